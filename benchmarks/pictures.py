"""Pictures of any engine: reading the passes that Blender writes, and the quantities that are compared."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

Array = np.ndarray
Passes = dict[str, Array]  # by Blender's long name: (h, w, 3) float32, row 0 at the top

# Blender below 5.0 writes short names, and the references were written with long ones.
LONG_NAMES = {
    old + short: f"{new} {long}"
    for old, new in (("Diff", "Diffuse"), ("Gloss", "Glossy"))
    for short, long in (("Dir", "Direct"), ("Ind", "Indirect"), ("Col", "Color"))
} | {"Env": "Environment", "Emit": "Emission"}

COMBINED = "Combined"
INDIRECT = "DiffInd*"  # radiance of indirect diffuse light: the pass times the colour
KEPT_PASSES = (COMBINED, "Diffuse Direct", "Diffuse Indirect", "Diffuse Color")


def read_passes(path: Path) -> Passes:
    """Every pass of a multi-layer EXR by its long name: (h, w, 3) float32, row 0 at the top."""
    import OpenEXR  # noqa: PLC0415  the rest of the benchmarks runs where there is none

    channels: dict[str, dict[str, np.ndarray]] = {}
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                full = name if "." in name else f"{part.name()}.{name}"
                *layer, axis = full.split(".")
                short = layer[-1]
                channels.setdefault(LONG_NAMES.get(short, short), {})[axis] = np.asarray(channel.pixels, np.float32)
    return {
        name: np.nan_to_num(np.stack([axes[a] for a in axes_in_order], -1))
        for name, axes in channels.items()
        if len(axes_in_order := [a for a in "RGBXYZ" if a in axes]) == 3
    }


def diffuse(passes: Mapping[str, Array], which: str) -> Array:
    """Radiance of "Direct" or "Indirect" diffuse light: the pass times the colour."""
    return passes[f"Diffuse {which}"] * passes["Diffuse Color"]


def quantity(passes: Mapping[str, Array], name: str, direct: Array | None = None) -> Array | None:
    """The picture that a figure is about, or None where these passes do not have it.

    EEVEE has one pass for all diffuse light: its indirect light is what is left of that without ``direct``, the
    reference's direct radiance.
    """
    if name != INDIRECT:
        return passes.get(name)
    if "Diffuse Color" not in passes or "Diffuse Direct" not in passes:
        return None
    if "Diffuse Indirect" in passes:
        return diffuse(passes, "Indirect")
    return None if direct is None else diffuse(passes, "Direct") - direct


def save_picture(path: Path, passes: Mapping[str, Array]) -> None:
    """Keep the passes that are compared and shown, in half precision."""
    path.parent.mkdir(parents=True, exist_ok=True)
    kept: dict[str, Any] = {
        name: np.clip(passes[name], -65000, 65000).astype(np.float16) for name in KEPT_PASSES if name in passes
    }
    with open(path, "wb") as file:
        np.savez_compressed(file, **{name.replace(" ", "_"): array for name, array in kept.items()})


def load_picture(path: Path) -> Passes:
    """What ``save_picture`` kept."""
    with np.load(path, allow_pickle=False) as file:
        return {name.replace("_", " "): file[name].astype(np.float32) for name in file.files}
