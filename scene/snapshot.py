"""A scene and a view in one file, to be rendered where there is no Blender: on another machine, in a test.

The file is a .npz: one long array for each type of number, and a JSON text that says what lies where in them. It is
made from the fields of the dataclasses and enums in ``data`` and ``node_graph``, whatever they are: a new field needs
nothing here.
Nothing is pickled, so that a file from somebody else can do no more than be refused.
"""

from __future__ import annotations

import base64
import json
import math
import os
import struct
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from . import data, node_graph
from .data import Scene, View

# Grows when the way of writing changes, not when a field is added to a class of ``data``.
VERSION = 1
HEADER = "header"
# What Python's zip reader, numpy and json raise for bytes that they did not write.
DAMAGES = (
    *(zipfile.BadZipFile, zlib.error, struct.error, OSError, EOFError, SyntaxError),
    *(ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError, MemoryError),
)

KINDS: dict[str, type] = {
    name: kind
    for module in (data, node_graph)
    for name, kind in vars(module).items()
    if isinstance(kind, type) and kind.__module__ == module.__name__ and (is_dataclass(kind) or issubclass(kind, Enum))
}


class SnapshotError(ValueError):
    """A file that is no snapshot, is damaged, or is of another Rebound; the message is one line for the user."""


def save_snapshot(path: str | os.PathLike, scene: Scene, view: View) -> None:
    """Write both to ``path``, in one step: a failure leaves no half a file. Raises TypeError for what has no place."""
    writer = _Writer()
    header = {"version": VERSION, "scene": writer.plain(scene), "view": writer.plain(view)}
    text = np.frombuffer(json.dumps(header, separators=(",", ":")).encode(), np.uint8)
    path = Path(path)
    unfinished = path.with_name(path.name + ".part")
    try:
        with open(unfinished, "wb") as file:
            np.savez_compressed(file, **{HEADER: text, **writer.pools()})
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def load_snapshot(path: str | os.PathLike) -> tuple[Scene, View]:
    """What ``save_snapshot`` wrote. Raises SnapshotError for any other content, OSError where there is no file."""
    with open(path, "rb") as opened:
        try:
            file = np.load(opened, allow_pickle=False)
            header = json.loads(bytes(file[HEADER]).decode())
            _check_version(header["version"])
            reader = _Reader(file)
            scene, view = reader.value(header["scene"]), reader.value(header["view"])
        except SnapshotError as error:
            raise SnapshotError(f"{path}: {error}") from None
        except DAMAGES as error:
            raise SnapshotError(f"{path}: not a snapshot of Rebound's, or a damaged one ({error})") from error
    if not isinstance(scene, Scene) or not isinstance(view, View):
        raise SnapshotError(f"{path}: holds no scene and view")
    return scene, view


def _check_version(version: object) -> None:
    if not isinstance(version, int) or version < 1:
        raise SnapshotError("not a snapshot of Rebound's")
    if version > VERSION:
        raise SnapshotError(f"written by a newer Rebound (format {version}, this one reads {VERSION}): update Rebound")


class _Writer:
    """Turns values into JSON ones; arrays go to ``pools``, each once. A scene may have 50,000 matrices."""

    def __init__(self) -> None:
        self._pools: dict[str, list[np.ndarray]] = {}
        self._sizes: dict[str, int] = {}
        self._places: dict[int, tuple[np.ndarray, dict]] = {}  # by identity; the array is kept so that it stays unique

    def pools(self) -> dict[str, np.ndarray]:
        """The numbers by their dtype."""
        return {name: np.concatenate(arrays) for name, arrays in self._pools.items()}

    def plain(self, value: Any) -> Any:
        if isinstance(value, Enum):  # before int: a flag is one
            return {"enum": self._kind(value), "value": value.value}
        if isinstance(value, np.ndarray):
            return self._place(value)
        if isinstance(value, np.generic):  # before float: a float64 is one
            return {"scalar": True, **self._place(np.asarray(value))}
        if value is None or isinstance(value, bool | int | float | str):
            return value
        if isinstance(value, bytes):
            return {"bytes": base64.b64encode(value).decode()}
        if isinstance(value, tuple):
            return [self.plain(item) for item in value]
        if isinstance(value, Mapping):
            return {"map": [[self.plain(key), self.plain(item)] for key, item in value.items()]}
        if is_dataclass(value) and not isinstance(value, type):
            return {
                "kind": self._kind(value),
                "fields": {f.name: self.plain(getattr(value, f.name)) for f in fields(value)},
            }
        raise TypeError(f"a snapshot has no place for {type(value).__name__}: {value!r:.60}")

    def _kind(self, value: object) -> str:
        name = type(value).__name__
        if KINDS.get(name) is not type(value):
            raise TypeError(f"a snapshot has no place for {name}, which is not of the scene's data")
        return name

    def _place(self, array: np.ndarray) -> dict[str, Any]:
        if array.dtype.hasobject:
            raise TypeError("a snapshot has no place for arrays of Python objects")
        if id(array) not in self._places:
            pool = array.dtype.str
            place = {"array": pool, "at": self._sizes.get(pool, 0), "shape": list(array.shape)}
            self._pools.setdefault(pool, []).append(array.ravel())
            self._sizes[pool] = place["at"] + array.size
            self._places[id(array)] = array, place
        return self._places[id(array)][1]


class _Reader:
    """The way back."""

    def __init__(self, file: Mapping[str, np.ndarray]) -> None:
        self._file = file
        self._pools: dict[str, np.ndarray] = {}

    def value(self, plain: Any) -> Any:
        if isinstance(plain, list):
            return tuple(self.value(item) for item in plain)
        if not isinstance(plain, dict):
            return plain
        if "kind" in plain:
            return self._instance(_kind(plain["kind"]), plain["fields"])
        if "enum" in plain:
            return _kind(plain["enum"])(plain["value"])
        if "array" in plain:
            array = self._array(plain["array"], plain["at"], plain["shape"])
            return array[()] if "scalar" in plain else array
        if "bytes" in plain:
            return base64.b64decode(plain["bytes"])
        return {self.value(key): self.value(item) for key, item in plain["map"]}

    def _instance(self, kind: type, plain: Mapping[str, Any]) -> Any:
        unknown = plain.keys() - {entry.name for entry in fields(kind)}
        if unknown:
            raise SnapshotError(f"of another Rebound: its {kind.__name__} has {', '.join(sorted(unknown))}")
        required = {f.name for f in fields(kind) if f.default is MISSING and f.default_factory is MISSING}
        if required - plain.keys():
            missing = ", ".join(sorted(required - plain.keys()))
            raise SnapshotError(f"of another Rebound: its {kind.__name__} has no {missing}")
        return kind(**{name: self.value(item) for name, item in plain.items()})

    def _array(self, pool: str, first: int, shape: list[int]) -> np.ndarray:
        if pool not in self._pools:  # unpacked once, not for every array in it
            self._pools[pool] = self._file[pool]
        return self._pools[pool][first : first + math.prod(shape)].reshape(shape)


def _kind(name: str) -> Any:
    if name not in KINDS:
        raise SnapshotError(f"of another Rebound: it has a {name}")
    return KINDS[name]
