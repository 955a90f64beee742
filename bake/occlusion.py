"""What rays hit: by Blender's Embree, or plain numpy where that is missing, which says so."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..scene.data import Array
from .embree import EmbreeScene

_logger = logging.getLogger("rebound")  # by name: as an extension the package is bl_ext.….rebound

# Triangles in a leaf of the tree, and rays that walk it together: 4096 rays meet a few hundred thousand boxes.
_LEAF = 4
_RAYS = 4096


@dataclass(frozen=True, eq=False)
class Hits:
    """What n rays hit first. A point is (1 - u - v) a + u b + v c of its triangle's corners."""

    triangles: Array  # (n,) int64, -1 where nothing was hit
    u: Array  # (n,) float32
    v: Array  # (n,) float32


class Caster(Protocol):
    """Answers for a fixed set of triangles. Origins and directions are (n, 3); rays have no end."""

    name: str

    def blocked(self, origins: Array, directions: Array) -> Array:
        """(n,) bool."""
        ...

    def hits(self, origins: Array, directions: Array) -> Hits:
        """The nearest triangle of each ray."""
        ...


def make_caster(corners: Array, kind: str = "") -> Caster:
    """The best one there is for triangles (t, 3, 3), or the one that ``kind`` names: "embree" or "numpy".

    Raises ImportError where Embree is asked for by name and is missing.
    """
    if kind == "numpy" or not len(corners):
        return NumpyCaster(corners)
    try:
        return EmbreeCaster(corners)
    except ImportError as error:
        if kind == "embree":
            raise
        _logger.warning(
            "Rays are traced by numpy on the CPU, many times slower: %s. Bake with a Blender that has Cycles", error
        )
        return NumpyCaster(corners)


class EmbreeCaster:
    """Embree as it comes with Blender (embree.py)."""

    def __init__(self, corners: Array) -> None:
        self._scene = EmbreeScene(corners)
        self.name = f"Embree {self._scene.version}"

    def blocked(self, origins: Array, directions: Array) -> Array:
        return self._scene.blocked(origins, directions)

    def hits(self, origins: Array, directions: Array) -> Hits:
        return Hits(*self._scene.hits(origins, directions))


class NumpyCaster:
    """A complete binary tree of boxes over the triangles in Morton order, walked level by level by many rays."""

    name = "numpy"

    def __init__(self, corners: Array) -> None:
        self._levels = max(0, int(np.ceil(np.log2(max(1, len(corners)) / _LEAF))))
        slots = _LEAF << self._levels
        order = np.argsort(_morton(corners.mean(axis=1)), kind="stable") if len(corners) else np.zeros(0, np.int64)
        self._triangles = np.full(slots, -1)
        self._triangles[: len(order)] = order
        self._corners = np.full((slots, 3, 3), np.nan)
        self._corners[: len(order)] = corners[order]
        low, high = np.full((slots, 3), np.inf), np.full((slots, 3), -np.inf)
        low[: len(order)], high[: len(order)] = corners[order].min(axis=1), corners[order].max(axis=1)
        self._boxes = [(low.reshape(-1, _LEAF, 3).min(axis=1), high.reshape(-1, _LEAF, 3).max(axis=1))]
        while len(self._boxes[0][0]) > 1:
            low, high = self._boxes[0]
            self._boxes.insert(0, (np.minimum(low[::2], low[1::2]), np.maximum(high[::2], high[1::2])))

    def blocked(self, origins: Array, directions: Array) -> Array:
        return self.hits(origins, directions).triangles >= 0

    def hits(self, origins: Array, directions: Array) -> Hits:
        found = Hits(np.full(len(origins), -1), *np.zeros((2, len(origins)), np.float32))
        for first in range(0, len(origins), _RAYS):
            chunk = slice(first, first + _RAYS)
            rays, slots, u, v = self._walk(origins[chunk].astype(np.float64), directions[chunk].astype(np.float64))
            found.triangles[first + rays], found.u[first + rays], found.v[first + rays] = self._triangles[slots], u, v
        return found

    def _walk(self, origins: Array, directions: Array) -> tuple[Array, Array, Array, Array]:
        """Rays that hit something, the slot of what they hit first, and where."""
        with np.errstate(divide="ignore"):
            slopes = 1.0 / directions
        rays = np.arange(len(origins))
        nodes = np.zeros_like(rays)
        for level, (low, high) in enumerate(self._boxes):
            if level:
                rays, nodes = np.repeat(rays, 2), np.stack([2 * nodes, 2 * nodes + 1], axis=-1).reshape(-1)
            met = _meets(low[nodes], high[nodes], origins[rays], slopes[rays])
            rays, nodes = rays[met], nodes[met]
        rays, slots = np.repeat(rays, _LEAF), (nodes[:, None] * _LEAF + np.arange(_LEAF)).reshape(-1)
        distance, u, v = _triangle_hits(self._corners[slots], origins[rays], directions[rays])
        good = np.isfinite(distance)
        rays, slots, distance, u, v = rays[good], slots[good], distance[good], u[good], v[good]
        nearest = np.lexsort((slots, distance, rays))
        rays = rays[nearest]
        nearest = nearest[np.diff(rays, prepend=-1) > 0]
        return np.unique(rays), slots[nearest], u[nearest], v[nearest]


def _meets(low: Array, high: Array, origins: Array, slopes: Array) -> Array:
    """Which rays pass through which boxes, (n,) bool. A ray in the plane of a side (0 times infinity) is let through.

    An empty box, as the tree is filled up with, has its lower corner above the upper one.
    """
    with np.errstate(invalid="ignore"):
        one, other = (low - origins) * slopes, (high - origins) * slopes
    sided = ~(np.isnan(one) | np.isnan(other))
    enters = np.fmin(one, other).max(axis=1, initial=0.0, where=sided)
    leaves = np.fmax(one, other).min(axis=1, initial=np.inf, where=sided)
    return (enters <= leaves * (1.0 + 1e-12)) & (low[:, 0] <= high[:, 0])


def _triangle_hits(corners: Array, origins: Array, directions: Array) -> tuple[Array, Array, Array]:
    """Distance along the ray, infinite for a miss, and barycentric u, v (Möller and Trumbore 1997)."""
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(directions, ac)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        scale = 1.0 / (ab * across).sum(axis=1)
        away = origins - a
        u = (away * across).sum(axis=1) * scale
        turned = np.cross(away, ab)
        v = (directions * turned).sum(axis=1) * scale
        distance = (ac * turned).sum(axis=1) * scale
        inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
    return np.where(inside, distance, np.inf), u, v


def _morton(points: Array) -> Array:
    """Places along a curve that keeps neighbours together: the bits of the three coordinates interleaved."""
    low, high = points.min(axis=0), points.max(axis=0)
    cells = ((points - low) / np.maximum(high - low, 1e-300).max() * 1023).astype(np.int64)
    bits = (cells[:, :, None] >> np.arange(10)) & 1
    return (bits << (3 * np.arange(10)[None, None, :] + np.arange(3)[None, :, None])).sum(axis=(1, 2))
