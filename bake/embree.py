"""Intel's Embree 4 as it comes with Blender, by its C interface: every Blender with Cycles brings the library along.

Nothing of Blender is imported: the file is looked for around the Python that runs, which is Blender's own in a worker
process, beside the module bpy, and where the system keeps its libraries.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import importlib.util
import os
import sys
from collections import deque
from collections.abc import Iterator
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from ..scene.data import Array

# Where Blender keeps its libraries, from its own folder or one around that of its Python: Linux and the module bpy,
# Windows, macOS. The folder with the Python is three deep at most.
_FOLDERS = ("lib", "blender.shared", "Resources/lib", ".")
_NAMES = ("libembree4.so*", "embree4.dll", "libembree4*.dylib")
_DEPTH = 4
# rtcore_device.h, rtcore_geometry.h, rtcore_buffer.h of Embree 4; the same in all its versions.
_VERSIONS = (1, 2, 3)  # properties of a device: major, minor, patch
_TRIANGLES, _INDICES, _VERTICES, _UINT3, _FLOAT3 = 0, 0, 1, 0x5003, 0x9003
_ROBUST = 4  # a ray through the edge of two triangles hits one of them
# Rays that are told in one call, and the numbers of one in it: origin, near, direction, time, far, mask, id and flags;
# then of the hit normal, u, v, primitive, geometry and instances, of which versions have one or two.
_WIDE = 16
_RAY, _RAY_AND_HIT = 12, 24
_FAR, _MASK, _U, _V, _PRIMITIVE = 8, 9, 15, 16, 17
_NOTHING = 0xFFFFFFFF
_PIECE = 32768  # rays laid out together: they stay in the processor's cache


class Embree:
    """The library, and a device of it. Raises ImportError where there is none that works."""

    def __init__(self) -> None:
        found = next(_files(), None)
        if found is None:
            raise ImportError("this Blender comes without the library of Embree 4")
        try:
            if hasattr(os, "add_dll_directory"):  # Windows: what it needs lies beside it
                with os.add_dll_directory(str(found.parent)):  # type: ignore[attr-defined]
                    self.call: Any = ctypes.CDLL(str(found))
            else:
                self.call = ctypes.CDLL(str(found))
        except OSError as error:
            raise ImportError(f"'{found}' does not load: {error}") from error
        pointer, whole, size = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
        self._declare("rtcNewDevice", pointer, ctypes.c_char_p)
        self._declare("rtcGetDeviceProperty", ctypes.c_ssize_t, pointer, whole)
        self._declare("rtcGetDeviceError", whole, pointer)
        self._declare("rtcNewScene", pointer, pointer)
        self._declare("rtcSetSceneFlags", None, pointer, whole)
        self._declare("rtcNewGeometry", pointer, pointer, whole)
        self._declare("rtcSetNewGeometryBuffer", pointer, pointer, whole, whole, whole, size, size)
        self._declare("rtcAttachGeometry", whole, pointer, pointer)
        self._declare("rtcCommitGeometry", None, pointer)
        self._declare("rtcCommitScene", None, pointer)
        for name in ("rtcReleaseGeometry", "rtcReleaseScene", "rtcReleaseDevice"):
            self._declare(name, None, pointer)
        for name in ("rtcOccluded16", "rtcIntersect16"):
            self._declare(name, None, *[pointer] * 4)
        self.device = self.call.rtcNewDevice(b"")
        if not self.device:
            raise ImportError(f"'{found}' makes no device: error {self.call.rtcGetDeviceError(None)}")
        self.version = ".".join(str(self.call.rtcGetDeviceProperty(self.device, part)) for part in _VERSIONS)

    def _declare(self, name: str, result: Any, *arguments: Any) -> None:
        try:
            function = getattr(self.call, name)
        except AttributeError as error:
            raise ImportError(f"the library of Embree lacks {name}") from error
        function.restype, function.argtypes = result, arguments

    def check(self) -> None:
        """Raises MemoryError for what went wrong since the last look."""
        error = self.call.rtcGetDeviceError(self.device)
        if error:
            raise MemoryError(f"Embree says error {error}; 4 is a lack of memory")


class EmbreeScene:
    """Triangles (t, 3, 3), in 32-bit floats around the middle of the scene. Raises ImportError without Embree."""

    def __init__(self, corners: Array) -> None:
        self._embree = Embree()
        call, device = self._embree.call, self._embree.device
        points = corners.reshape(-1, 3)
        self._middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        self.version = self._embree.version
        self._scene = call.rtcNewScene(device)
        call.rtcSetSceneFlags(self._scene, _ROBUST)
        geometry = call.rtcNewGeometry(device, _TRIANGLES)
        for kind, form, data in (
            (_VERTICES, _FLOAT3, (points - self._middle).astype(np.float32)),
            (_INDICES, _UINT3, np.arange(len(points), dtype=np.uint32)),
        ):
            rows = data.size // 3
            place = call.rtcSetNewGeometryBuffer(geometry, kind, 0, form, 12, rows)
            self._embree.check()
            ctypes.memmove(place, data.ctypes.data, data.nbytes)
        call.rtcCommitGeometry(geometry)
        call.rtcAttachGeometry(self._scene, geometry)
        call.rtcReleaseGeometry(geometry)
        call.rtcCommitScene(self._scene)
        self._embree.check()
        self._all = _aligned(_WIDE).view(np.int32)
        self._all[:] = -1

    def __del__(self) -> None:
        if hasattr(self, "_scene"):
            self._embree.call.rtcReleaseScene(self._scene)
            self._embree.call.rtcReleaseDevice(self._embree.device)

    def blocked(self, origins: Array, directions: Array) -> Array:
        """(n,) bool."""
        found = np.empty(len(origins), bool)
        for rows in _pieces(len(origins)):
            rays = self._run("rtcOccluded16", origins[rows], directions[rows], _RAY)
            found[rows] = (rays[:, _FAR] < 0.0).reshape(-1)[: len(found[rows])]
        return found

    def hits(self, origins: Array, directions: Array) -> tuple[Array, Array, Array]:
        """(n,) int64 of the nearest triangle or -1, and u and v there."""
        triangles = np.empty(len(origins), np.int64)
        u, v = np.empty((2, len(origins)), np.float32)
        for rows in _pieces(len(origins)):
            rays = self._run("rtcIntersect16", origins[rows], directions[rows], _RAY_AND_HIT)
            count = len(u[rows])
            triangles[rows] = rays.view(np.int32)[:, _PRIMITIVE].reshape(-1)[:count]
            u[rows], v[rows] = (rays[:, row].reshape(-1)[:count] for row in (_U, _V))
        return triangles, u, v

    def _run(self, name: str, origins: Array, directions: Array, numbers: int) -> Array:
        """(packets, numbers, 16) float32 as Embree leaves them."""
        count = len(origins)
        packets = -(-count // _WIDE)
        rays = _aligned(packets * numbers * _WIDE).reshape(packets, numbers, _WIDE)
        whole = rays.view(np.uint32)
        filled = np.zeros((packets * _WIDE, 3), np.float32)
        for first, values in ((0, origins - self._middle), (4, directions)):
            filled[:count] = values
            rays[:, first : first + 3] = filled.reshape(packets, _WIDE, 3).swapaxes(1, 2)
        rays[:, _FAR] = np.inf
        rays.swapaxes(1, 2)[-1, count - (packets - 1) * _WIDE :, _FAR] = -np.inf  # no rays
        whole[:, _MASK] = _NOTHING
        if numbers > _RAY:
            whole[:, _PRIMITIVE:] = _NOTHING
        step, first = numbers * _WIDE * 4, rays.ctypes.data
        places = range(first, first + packets * step, step)
        call = getattr(self._embree.call, name)
        deque(map(call, repeat(self._all.ctypes.data), repeat(self._scene), places, repeat(None)), maxlen=0)
        return rays


def _aligned(count: int) -> Array:
    """(count,) float32 that begins where a number of 64 bytes does."""
    room = np.zeros(4 * count + 64, np.uint8)
    start = -room.ctypes.data % 64
    return room[start : start + 4 * count].view(np.float32)


def _pieces(count: int) -> list[slice]:
    return [slice(first, first + _PIECE) for first in range(0, count, _PIECE)]


def _files() -> Iterator[Path]:
    """Where the library may be, the likeliest first."""
    starts = [Path(sys.prefix).resolve(), Path(sys.executable).resolve().parent]
    module = importlib.util.find_spec("bpy")  # is not imported by this
    if module is not None and module.origin:
        starts.insert(0, Path(module.origin).parent)
    for start in starts:
        for folder in (start, *list(start.parents)[: _DEPTH - 1]):
            for place in _FOLDERS:
                for name in _NAMES:
                    yield from sorted((folder / place).glob(name))
    system = ctypes.util.find_library("embree4")
    if system is not None:
        yield Path(system)
