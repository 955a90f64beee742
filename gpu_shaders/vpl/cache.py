"""The radiance cache: points of the scene's surfaces that gather from the pool and send what they reflect back to it.

A point's light is a mean over many samples, so the cache is calm where a path that goes on for many bounces is not.
Each update takes light one bounce further, with the surfaces' reflectance, below 1, as its gain.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ...device.interface import Device, Target, Texture
from ...scene.data import Scene
from ..frame.draws import ADD
from ..frame.light_maps import MapTile
from .shaders import CACHE_EMIT, CACHE_FADE, CACHE_GATHER
from .sources import POINTS_SIDE, Sources

if TYPE_CHECKING:
    from ...gpu_scene import GpuScene

# Rounds of gathering that a point does at once.
ROUNDS = 4
# Before a picture that follows none the cache is updated until so much of all light is left that goes on, and within
# these limits: each update takes light a bounce further.
LEFT, LEAST_WARM_UP, MOST_WARM_UP = 0.02, 4, 48
# After an edit so many times as often, within a limit: LEFT of a light that went out may be more than all that is lit.
AFTER_EDIT, MOST_AFTER_EDIT = 2, 24
# Where light goes on, a point forgets its updates until all bounces can be in them; then its mean is of this newer
# part of them.
NEWER = 0.5
# Updates after which no more points come to light that had none, so that the index of them stays as it is.
COME_TO_LIGHT = 4.0
# While one edit follows another the index is made anew only after so many updates.
SORTED_AFTER = 4.0


class Cache:
    """What the points of one atlas's cache tile have gathered."""

    def __init__(self, device: Device) -> None:
        self.device = device
        # The newest first: light, the sky's part of it, both as a target.
        self._sums: list[tuple[Texture, Texture, Target]] = []
        self._flux: tuple[Texture, Target] | None = None  # of the atlas
        self._next_row = 0
        self._revision = -1  # of the scene that was last gathered in
        self._updates = 0.0  # of every point, of those that count; below 0: before light has bounced enough
        self._counts = 1.0  # part of them that a mean is of
        self._gathered = 0.0  # updates since nothing was known
        self._sorted = 0.0  # of these, when the index was made last

    @property
    def sky(self) -> Texture:
        """Sum, and number, of the part of the points' light that came from the sky."""
        if not self._sums:
            self._allocate()
        return self._sums[0][1]

    def plan(self, gpu_scene: GpuScene, *, many: bool, rows: int) -> tuple[int, int]:
        """How often to gather for this picture, and in how many of the points' rows: in ``rows``, but in all of them
        after an edit, so that the light of before is soon gone.
        """
        rounds = 1
        if self._revision != gpu_scene.revision:
            bounces = _bounces(gpu_scene.scene) if many else 1
            if self._revision < 0:
                rounds = bounces
            else:
                bounces = min(AFTER_EDIT * bounces, MOST_AFTER_EDIT)
            self._revision, self._updates = gpu_scene.revision, float(1 - bounces)
        self._counts = NEWER if many else 1.0
        return rounds, POINTS_SIDE if self.settles else rows

    @property
    def settles(self) -> bool:
        """Whether light of before the newest edit is left, or some of the bounces after it are still to come."""
        return self._updates <= 0.0

    def emit(self, sources: Sources, tile: MapTile) -> None:
        """Write what every point reflects into the atlas."""
        if not self._sums:
            self._allocate()
        flux = sources.colors[2]
        if self._flux is None or self._flux[0] is not flux:
            self._free_flux()
            self._flux = (flux, self.device.target([flux]))
        place = sources.points_viewport(tile)
        self.device.fullscreen(
            CACHE_EMIT,
            self._flux[1],
            viewport=place,
            sum_tx=self._sums[0][0],
            position_area_tx=sources.colors[0],
            reflectance_tx=sources.colors[3],
            pc_origin=place[:2],
        )

    def gather(
        self, sources: Sources, tile: MapTile, candidates: Mapping[str, Any], rows: int, *, glossy: bool
    ) -> bool:
        """Gather at the points of the next ``rows`` rows; True if points that had no light may have some now."""
        place = sources.points_viewport(tile)
        if rows >= place[3] or self._next_row >= place[3]:
            self._next_row = 0
        rows = min(rows, place[3] - self._next_row)
        self._sums.reverse()
        (_, _, target), (old, old_sky, _) = self._sums
        most = ROUNDS * max(self._updates, 0.0) * self._counts
        span = (self._next_row, self._next_row + rows)
        self.device.fullscreen(CACHE_FADE, target, sum_tx=old, sky_tx=old_sky, pc_most=most, pc_rows=span)
        self.device.fullscreen(
            CACHE_GATHER[glossy],
            target,
            state=ADD,
            viewport=(0, self._next_row, place[2], rows),
            **{**candidates, "cache_sky_tx": old_sky},
            pc_rounds=ROUNDS,
            pc_origin=place[:2],
        )
        self._next_row += rows
        is_new = self._gathered < COME_TO_LIGHT
        before, self._updates = self._updates, self._updates + rows / place[3]
        self._gathered += rows / place[3]
        if before >= COME_TO_LIGHT or math.floor(self._updates) == math.floor(before):
            return False
        if not is_new and self._gathered - self._sorted < SORTED_AFTER:
            return False
        self._sorted = self._gathered
        return True

    def forget(self) -> None:
        """Begin anew: the points are others, or the picture follows none."""
        self._revision = -1
        self._clear()

    def free(self) -> None:
        self._free_flux()
        for texture, sky, target in self._sums:
            self.device.free(target)
            self.device.free(texture)
            self.device.free(sky)
        self._sums.clear()

    def _allocate(self) -> None:
        for _ in range(2):
            texture, sky = (self.device.texture((POINTS_SIDE, POINTS_SIDE), "RGBA32F") for _ in range(2))
            self._sums.append((texture, sky, self.device.target([texture, sky])))
        self._clear()

    def _clear(self) -> None:
        self._gathered = self._sorted = 0.0
        for *_, target in self._sums:
            self.device.clear(target)

    def _free_flux(self) -> None:
        if self._flux is not None:
            self.device.free(self._flux[1])
            self._flux = None


def _bounces(scene: Scene) -> int:
    """After how many bounces light is all but gone, by the mean reflectance of what there is."""
    used = Counter(m for instance in scene.instances for m in instance.materials)
    means = {m: np.mean(np.maximum(scene.materials[m].base_color, scene.materials[m].specular)) for m in used}
    total = sum(float(means[m]) * count for m, count in used.items())
    mean = min(max(total / max(used.total(), 1), 0.01), 0.99)
    return int(np.clip(np.ceil(np.log(LEFT) / np.log(mean)), LEAST_WARM_UP, MOST_WARM_UP))
