"""Meshes on the GPU: pages that hold the corners of many, so that one draw takes them all.

Vertex shaders fetch corners from a page by number (mesh_lib.glsl). Part of a texture cannot be filled anew: what is new
in an update gets pages of its own, what goes leaves a gap, and pages with much of it are put together again.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ...device.interface import Device, DeviceError, Texture
from ...scene.data import Mesh
from ..materials import Attribute

PAGE_WIDTH = 4096  # texels a row
# 64 MiB of corners. A larger mesh has a larger page to itself.
PAGE_TRIANGLES = 1 << 20
# Numbers of triangles go to shaders as floats, and are exact up to here.
MOST_TRIANGLES = 1 << 24
# Pages less full than this are put together, and so are small ones where there are more of them.
LEAST_USED = 0.25
MOST_SMALL = 8
_PACKED_AT_ONCE = 1 << 14  # normals: all that their packing needs stays in a cache

Attributes = frozenset[Attribute]
MeshKey = tuple[Hashable, Attributes]  # Mesh.key and what its materials ask of it


@dataclass(eq=False)
class Page:
    """``corners``: RGBA32F, object position and packed normal; ``attributes``: the same order, (u, v) or a colour."""

    corners: Texture
    attributes: Mapping[Attribute, Texture]
    triangles: int
    first: dict[MeshKey, int]  # first triangle of each of its meshes
    single: np.ndarray  # (triangles + 2,) int32: of every second one up to here, how many begin no pair

    @property
    def textures(self) -> tuple[Texture, ...]:
        return (self.corners, *self.attributes.values())

    def is_paired(self, starts: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """(n,) whether runs of ``counts`` triangles from ``starts`` are pairs, but for the last of an odd number."""
        last = starts + counts // 2 * 2
        return self.single[last] == self.single[starts]


class MeshPages:
    """The meshes of one scene. ``uploads`` counts meshes: new ones, and those that changed pages."""

    def __init__(self, device: Device, uploads: Counter[str]) -> None:
        self.device = device
        self.uploads = uploads
        self._page_of: dict[MeshKey, Page] = {}
        self._meshes: dict[MeshKey, Mesh] = {}

    def hold(self, wanted: Mapping[MeshKey, Mesh]) -> None:
        """Hold these meshes and no others."""
        gone = self._page_of.keys() - wanted.keys()
        touched = {self._page_of.pop(key) for key in gone}
        for page in touched:
            for key in gone & page.first.keys():
                del page.first[key]
        self._meshes = dict(wanted)
        new = [key for key in wanted if key not in self._page_of]
        self.uploads["meshes"] += len(new)
        moved = [key for page in self._scattered(touched) for key in page.first]
        self.uploads["meshes put together"] += len(moved)
        left = {self._page_of[key] for key in moved} | {page for page in touched if not page.first}
        self._add([*moved, *new])
        for page in left:
            self._free(page)

    def place(self, key: MeshKey) -> tuple[Page, int]:
        """The page of a mesh that is held, and its first triangle there."""
        page = self._page_of[key]
        return page, page.first[key]

    def free(self) -> None:
        for page in set(self._page_of.values()):
            self._free(page)
        self._page_of.clear()
        self._meshes.clear()

    def _scattered(self, touched: Iterable[Page]) -> list[Page]:
        """Pages to be put together: nearly empty ones, and small ones that have become many."""
        found = {page for page in touched if page.first and self._used(page) < LEAST_USED * page.triangles}
        small: dict[Attributes, list[Page]] = defaultdict(list)
        for page in dict.fromkeys(self._page_of.values()):
            if self._used(page) < PAGE_TRIANGLES / 2:
                small[frozenset(page.attributes)].append(page)
        found.update(page for pages in small.values() if len(pages) > MOST_SMALL for page in pages)
        return list(found)

    def _used(self, page: Page) -> int:
        return sum(self._meshes[key].triangle_count for key in page.first)

    def _add(self, keys: Iterable[MeshKey]) -> None:
        by_attributes: dict[Attributes, list[MeshKey]] = defaultdict(list)
        for key in keys:
            by_attributes[key[1]].append(key)
        for attributes, members in by_attributes.items():
            on_page: list[MeshKey] = []
            triangles = 0
            for key in members:
                count = self._meshes[key].triangle_count
                if on_page and triangles + count > PAGE_TRIANGLES:
                    self._fill(attributes, on_page)
                    on_page, triangles = [], 0
                on_page.append(key)
                triangles += count
            self._fill(attributes, on_page)

    def _fill(self, attributes: Attributes, keys: list[MeshKey]) -> None:
        """Make a page of these meshes."""
        meshes = [self._meshes[key] for key in keys]
        counts = [mesh.triangle_count for mesh in meshes]
        starts = np.cumsum([0, *counts]).tolist()
        height = -(-3 * starts[-1] // PAGE_WIDTH)
        if starts[-1] > MOST_TRIANGLES or height > self.device.max_texture_size:
            most = min(MOST_TRIANGLES, PAGE_WIDTH * self.device.max_texture_size // 3)
            raise DeviceError(
                f"A mesh of {starts[-1]:,} triangles is too large for one draw: split it into objects of up to {most:,}"
            )
        corners = _rows(height, 4)
        flat, end = corners.reshape(-1, 4), 3 * starts[-1]
        _concatenate([mesh.positions for mesh in meshes], flat[:end, :3])
        for mesh, start in zip(meshes, starts, strict=False):
            pack_normals(mesh.normals, flat[3 * start : 3 * start + len(mesh.normals), 3])
        textures, kept = {}, []
        for attribute in attributes:
            channels, format = (2, "RG32F") if attribute.field == "uv" else (4, "RGBA32F")
            values = _rows(height, channels)
            arrays = [mesh.corner_attribute(attribute.field, attribute.name) for mesh in meshes]
            _concatenate(arrays, values.reshape(-1, channels)[:end])
            textures[attribute] = self.device.texture((PAGE_WIDTH, height), format, values)
            kept.append(values)
        texture = self.device.texture((PAGE_WIDTH, height), "RGBA32F", corners)
        single = _single(flat[:end], *(values.reshape(-1, values.shape[2])[:end] for values in kept))
        page = Page(texture, textures, starts[-1], dict(zip(keys, starts, strict=False)), single)
        self._page_of |= dict.fromkeys(keys, page)

    def _free(self, page: Page) -> None:
        for texture in page.textures:
            self.device.free(texture)


def _single(*layers: np.ndarray) -> np.ndarray:
    """``Page.single`` of corners' layers, each (3n, 2 or 4) float32.

    A pair is what Blender makes of a quadrilateral: corners a b c, a c d. They are the same if their bits are.
    """
    count = len(layers[0]) // 3
    paired = np.ones(max(count - 1, 0), bool)
    for layer in layers:
        for column in layer.view(np.int64).reshape(count, 3, -1).transpose(2, 1, 0):
            paired &= (column[0, 1:] == column[0, :-1]) & (column[1, 1:] == column[2, :-1])
    single = np.zeros(count + 2, np.int32)
    begins_none = np.ones(count, np.int32)
    begins_none[:-1] = ~paired
    for parity in (0, 1):
        single[2 + parity :: 2] = np.cumsum(begins_none[parity::2])
    return single


def pack_normals(normals: np.ndarray, out: np.ndarray) -> None:
    """Unit normals (n, 3) as float32 bits (n,): two octahedral numbers (octahedron_lib.glsl) of 15 bits each.

    Exact along the axes, elsewhere within 0.008 degrees; 0 for what is no direction. The exponent's bits are such that
    it is neither a denormal nor NaN, which a GPU need not keep.
    """
    for start in range(0, len(normals), _PACKED_AT_ONCE):
        part = slice(start, start + _PACKED_AT_ONCE)
        x, y, z = (np.ascontiguousarray(column) for column in normals[part].T)
        size = np.abs(x) + np.abs(y) + np.abs(z)
        none = np.flatnonzero(~(size > 0.0))
        size[none] = 1.0
        x /= size
        y /= size
        below = z < 0.0
        folded = np.copysign(1.0 - np.abs(y), x), np.copysign(1.0 - np.abs(x), y)
        for column, other in zip((x, y), folded, strict=True):
            np.copyto(column, other, where=below)
            column[none] = 0.0
            column *= 16383.0
            column += 16383.5  # rounds
        low, high = x.astype(np.uint32), y.astype(np.uint32)
        bits = low | (high & 0x3FFF) << 15 | 1 << 29 | (high >> 14) << 31
        bits[none] = 0
        out[part] = bits.view(np.float32)


def _rows(height: int, channels: int) -> np.ndarray:
    return np.zeros((height, PAGE_WIDTH, channels), np.float32)


def _concatenate(arrays: list[np.ndarray], out: np.ndarray) -> None:
    start = 0
    for array in arrays:
        out[start : start + len(array)] = array
        start += len(array)
