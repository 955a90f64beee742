"""The radiance cache: points of the scene's surfaces that gather from the pool and send what they reflect back to it.

A point's light is a mean over many samples, so the cache is calm where a path that goes on for many bounces is not.
Each update takes light one bounce further, with the surfaces' reflectance, below 1, as its gain.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...device.interface import Device, Target, Texture
from ..frame.draws import ADD
from ..frame.light_maps import MapTile
from .shaders import CACHE_EMIT, CACHE_FADE, CACHE_GATHER
from .sources import POINTS_SIDE, Sources

# Rounds of gathering that a point does at once.
ROUNDS = 4


class Cache:
    """What the points of one atlas's cache tile have gathered."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._sums: list[tuple[Texture, Target]] = []  # the newest first
        self._flux: tuple[Texture, Target] | None = None  # of the atlas
        self._next_row = 0

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
        self, sources: Sources, tile: MapTile, candidates: Mapping[str, Any], rows: int, updates: float, glossy: bool
    ) -> None:
        """Gather at the points of the next ``rows`` rows. ``updates``: how many of each point's count, 0 for none."""
        place = sources.points_viewport(tile)
        rows = min(rows, place[3])
        if self._next_row + rows > place[3]:
            self._next_row = 0
        self._sums.reverse()
        (_, target), (old, _) = self._sums
        most = ROUNDS * updates
        span = (self._next_row, self._next_row + rows)
        self.device.fullscreen(CACHE_FADE, target, sum_tx=old, pc_most=most, pc_rows=span)
        self.device.fullscreen(
            CACHE_GATHER[glossy],
            target,
            state=ADD,
            viewport=(0, self._next_row, place[2], rows),
            **candidates,
            pc_rounds=ROUNDS,
            pc_origin=place[:2],
        )
        self._next_row += rows

    def forget(self) -> None:
        """Begin anew: the points are others."""
        for _, target in self._sums:
            self.device.clear(target)

    def free(self) -> None:
        self._free_flux()
        for texture, target in self._sums:
            self.device.free(target)
            self.device.free(texture)
        self._sums.clear()

    def _allocate(self) -> None:
        for _ in range(2):
            texture = self.device.texture((POINTS_SIDE, POINTS_SIDE), "RGBA32F")
            self._sums.append((texture, self.device.target([texture])))
        self.forget()

    def _free_flux(self) -> None:
        if self._flux is not None:
            self.device.free(self._flux[1])
            self._flux = None
