"""A bake as a multi-layer EXR file, which any program that reads EXR can show: a pixel a vertex, a channel a number.

Each array is one part of the file, named as it is; its rows fill a picture from the top, and its columns are the
channels "<name>.000" and so on. Arrays with more columns than are any use as channels lie in one channel, a row of
the array a row of the picture. What they are, their shapes and the checksum stand in the header as JSON.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .sphere import Array

# Grows when a file written before means something else.
VERSION = 1
_ATTRIBUTE = "reboundTransfer"
_DTYPES = {"float16": np.float16, "float32": np.float32, "uint32": np.uint32}
_MOST_CHANNELS = 128
_WIDEST = 2048


class BakeFileError(RuntimeError):
    """A file that cannot be written, or is refused; the message is one line for the user."""


@dataclass(frozen=True, eq=False)
class Bake:
    """What a file holds."""

    about: Mapping[str, Any]  # plain JSON: kind, object, fingerprint, surroundings, settings, errors
    arrays: Mapping[str, Array]  # float16, float32 or uint32, not empty


def write_bake(path: Path, bake: Bake) -> None:
    """Write in one step: a failure leaves no half a file, and what was there before. Raises BakeFileError."""
    openexr = _library()
    shapes = {name: [str(array.dtype), *array.shape] for name, array in bake.arrays.items()}
    wrong = [name for name, (dtype, *shape) in shapes.items() if dtype not in _DTYPES or not math.prod(shape)]
    if wrong or not shapes:
        raise BakeFileError(
            f"Cannot write '{path}': no numbers an EXR file can hold in {', '.join(wrong) or 'the bake'}"
        )
    header = {"version": VERSION, "about": bake.about, "shapes": shapes, "checksum": _checksum(bake)}
    pictures = {name: _channels(name, array) for name, array in bake.arrays.items()}
    sizes = [next(iter(channels.values())).shape for channels in pictures.values()]
    window = np.zeros(2, np.int32), np.max(sizes, axis=0)[::-1].astype(np.int32) - 1
    # In every part: of a damaged file the reader gives only the whole ones, and it is to be known as a bake still.
    head = {
        "compression": openexr.ZIP_COMPRESSION,
        "type": openexr.scanlineimage,
        "displayWindow": window,
        _ATTRIBUTE: json.dumps(header, sort_keys=True),
    }
    parts = [openexr.Part(dict(head), channels, name) for name, channels in pictures.items()]
    unfinished = path.with_name(path.name + ".part")
    try:
        openexr.File(parts).write(str(unfinished))
        os.replace(unfinished, path)
    except (OSError, RuntimeError) as error:
        raise BakeFileError(f"Cannot write '{path}': {error}") from error
    finally:
        unfinished.unlink(missing_ok=True)


def read_bake(path: Path) -> Bake:
    """What ``write_bake`` wrote. Raises BakeFileError with the reason for any other content."""
    openexr = _library()
    if not path.exists():
        raise BakeFileError(f"The bake '{path}' is missing: bake again")
    try:
        with openexr.File(str(path), separate_channels=True) as file:
            parts = {p.name(): {n: c.pixels.copy() for n, c in p.channels.items()} for p in file.parts}
            header = file.parts[0].header.get(_ATTRIBUTE) if file.parts else None
    except (OSError, RuntimeError, ValueError, TypeError) as error:
        raise BakeFileError(f"'{path}' is no EXR file, or a damaged one: bake again ({error})") from error
    if not parts:
        raise BakeFileError(f"'{path}' is damaged, its pictures cannot be read: bake again")
    if not isinstance(header, str):
        raise BakeFileError(f"'{path}' is an EXR file, but no bake of Rebound's")
    return _checked(path, header, parts)


def read_about(path: Path) -> Mapping[str, Any]:
    """``Bake.about`` alone, without looking at the arrays or the checksum. Raises BakeFileError, as ``read_bake``."""
    openexr = _library()
    if not path.exists():
        raise BakeFileError(f"The bake '{path}' is missing: bake again")
    try:
        with openexr.File(str(path), header_only=True) as file:
            return json.loads(file.parts[0].header[_ATTRIBUTE])["about"]
    except (OSError, RuntimeError, ValueError, TypeError, LookupError) as error:
        raise BakeFileError(f"'{path}' is no bake of Rebound's, or a damaged one: bake again ({error})") from error


def _checked(path: Path, text: str, parts: Mapping[str, Mapping[str, Array]]) -> Bake:
    try:
        header = json.loads(text)
        version = int(header["version"])
        if version > VERSION:
            raise BakeFileError(
                f"'{path}' was baked by a newer Rebound (format {version}): update Rebound or bake again"
            )
        arrays = {name: _array(name, shape, parts[name]) for name, shape in header["shapes"].items()}
        bake, checksum = Bake(header["about"], arrays), header["checksum"]
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise BakeFileError(f"'{path}' is damaged: bake again ({error})") from error
    if _checksum(bake) != checksum:
        raise BakeFileError(f"'{path}' is damaged, its checksum is wrong: bake again")
    return bake


def _library() -> Any:
    try:
        import OpenEXR  # noqa: PLC0415  everything else works without the wheel
    except ImportError as error:
        raise BakeFileError(
            "The Python package OpenEXR is missing: install Rebound from its zip file, which carries it"
        ) from error
    return OpenEXR


def _checksum(bake: Bake) -> str:
    digest = hashlib.sha256(json.dumps(bake.about, sort_keys=True).encode())
    for name in sorted(bake.arrays):
        array = np.ascontiguousarray(bake.arrays[name])
        digest.update(f"{name} {array.dtype} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _channels(name: str, array: Array) -> dict[str, Array]:
    table = array.reshape(len(array), -1)
    if table.shape[1] > _MOST_CHANNELS:
        return {f"{name}.rows": np.ascontiguousarray(table)}
    width = min(len(table), _WIDEST)
    height = -(-len(table) // width)
    filled = np.zeros((height * width, table.shape[1]), table.dtype)
    filled[: len(table)] = table
    return {f"{name}.{i:03d}": np.ascontiguousarray(c.reshape(height, width)) for i, c in enumerate(filled.T)}


def _array(name: str, shape: list[Any], channels: Mapping[str, Array]) -> Array:
    dtype, count, *rest = shape
    columns = math.prod(rest)
    if columns > _MOST_CHANNELS:
        table = channels[f"{name}.rows"]
    else:
        table = np.stack([channels[f"{name}.{i:03d}"].reshape(-1)[:count] for i in range(columns)], axis=-1)
    if table.dtype != _DTYPES[dtype]:
        raise ValueError(f"{name} is of {table.dtype} and not of {dtype}")
    return table.reshape(count, *rest)
