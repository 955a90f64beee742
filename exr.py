"""Pictures as multi-layer OpenEXR files, through the OpenEXR wheel that travels with the extension."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True, eq=False)
class Layer:
    """One layer of a file: its channels' letters, one each, and (h, w, channels) floats, row 0 at the bottom."""

    channels: str
    pixels: np.ndarray


class ExrError(RuntimeError):
    """A file that cannot be written; the message is one line for the user."""


def layer_name(name: str) -> str:
    """``name`` fit for one step of a channel name, whose steps are separated by dots."""
    return name.replace(".", "_")


def write_layers(path: Path, layers: Mapping[str, Layer]) -> None:
    """Write layers by name as 32-bit channels "<name>.X" and so on.

    Layers of one size share a part of the file, so that most files have one part, as every program expects. Raises
    ExrError where the OpenEXR wheel is missing or the file cannot be written.
    """
    try:
        import OpenEXR  # noqa: PLC0415  everything else works without the wheel
    except ImportError as error:
        raise ExrError(
            "The Python package OpenEXR is missing: install Rebound from its zip file, which carries it"
        ) from error
    by_size: dict[tuple[int, int], dict[str, np.ndarray]] = {}
    for name, layer in layers.items():
        by_size.setdefault(layer.pixels.shape[:2], {}).update(_channels(name, layer))
    # The parts of a file have one display window.
    corner = np.max(list(by_size), axis=0)[::-1].astype(np.int32) - 1
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "displayWindow": (np.zeros(2, np.int32), corner),
    }
    parts = [OpenEXR.Part(dict(header), channels, f"{w} x {h}") for (h, w), channels in by_size.items()]
    try:
        OpenEXR.File(parts).write(str(path))
    except (OSError, RuntimeError) as error:
        raise ExrError(f"Cannot write '{path}': {error}") from error


def _channels(name: str, layer: Layer) -> dict[str, np.ndarray]:
    """EXR counts its rows from the top."""
    planes = np.moveaxis(layer.pixels[::-1].astype(np.float32), 2, 0)
    return {f"{name}.{c}": np.ascontiguousarray(plane) for c, plane in zip(layer.channels, planes, strict=True)}
