"""Gathering at some of the pixels: candidates, reuse over space and time, a filter, and the way up to all pixels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...device.interface import Device, Target, Texture
from ..frame.coarse_grid import STRIDES, grid_offset, grid_size
from ..frame.inputs import FrameInputs, LightTargets
from ..frame.voxels import VOXEL_SAMPLERS
from ..technique import Value
from .filtering import AtrousFilter, Upsampling
from .reflections import Reflections
from .shaders import (
    ATLAS_SAMPLERS,
    GATHER,
    GATHER_TO_REUSE,
    REUSE,
    VIEW_BOUND,
    VIEW_HISTORY,
    VIEW_RESOLUTION,
)
from .structs import OLD_VIEW

# Samples that the mean of a surface's light may stand for: while it is only the view that moves, and after something in
# the scene did. A still view's mean grows without end.
LONG_HISTORY, SHORT_HISTORY, ENDLESS = 24.0, 1.0, 1e6
# Samples after an edit, that of the edit included, whose mean stays short and still holds light of before; longer
# while the cache does. They are provisional: once they are over, means and the picture begin anew, or a bright light
# that went out would stay to be seen for good.
SETTLING = 4
# Samples that an old reservoir may stand for.
MOST_REUSE = 2.0
# What the reuse reads of the candidates' samplers and blocks.
REUSE_READS = (*ATLAS_SAMPLERS, *VOXEL_SAMPLERS, "voxel_grid", "vpl_frame", "position_tx")
# How far the gathering is after its passes, for the progress bar.
GATHER_DONE, FILTER_DONE = 0.7, 0.8


@dataclass(frozen=True)
class PoolState:
    """``number`` of the sample in its sequence of noise; ``sources_revision`` of the atlas that the pool is from;
    ``first_hand``: it may have emitters or the sky, whose light is direct; ``settles``: the cache still holds light of
    before an edit.
    """

    number: int
    sources_revision: int
    first_hand: bool
    settles: bool


@dataclass(eq=False)
class _Grid:
    """Textures of one grid of gathering pixels. Those in pairs have the newest first.

    Direct light that the gathering found is a part of its light; ``emitted`` and ``direct_histories`` keep it apart,
    empty where there is none.
    """

    size: tuple[int, int]
    first_hand: bool
    surfaces: list[Texture]
    gathered: list[Texture]
    reservoirs: list[Texture]
    histories: list[Texture]
    emitted: list[Texture]
    direct_histories: list[Texture]
    gather_targets: list[Target]
    reuse_targets: list[Target]
    filter: AtrousFilter

    @property
    def resources(self) -> tuple[Texture | Target, ...]:
        return (
            *self.gather_targets,
            *self.reuse_targets,
            *self.filter.resources,
            *self.surfaces,
            *self.gathered,
            *self.reservoirs,
            *self.histories,
            *self.emitted,
            *self.direct_histories,
        )

    def turn(self) -> None:
        """Make what is newest the picture before."""
        for pair in (
            self.surfaces,
            self.gather_targets,
            self.reservoirs,
            self.histories,
            self.direct_histories,
            self.reuse_targets,
        ):
            pair.reverse()


@dataclass(frozen=True)
class _Before:
    """What the picture before was made of."""

    clip_from_world: np.ndarray
    size: tuple[int, int]
    offset: tuple[int, int]
    stride: int
    scene_revision: int
    sources_revision: int

    def block(self) -> np.ndarray:
        row = {
            "clip_from_world": self.clip_from_world,
            "size": self.size,
            "offset": self.offset,
            "stride": self.stride,
        }
        return OLD_VIEW.pack([row], for_uniform=True)


class Gathering:
    """The passes from the pool to the light of every pixel."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._grid: _Grid | None = None
        self._reflections = Reflections(device)
        self._before: _Before | None = None
        self._drawn: _Before | None = None  # the newest picture, reused or not
        self._whole = True  # whether the newest sample came to its end
        self._settling = 0  # samples to come whose mean stays short

    def draw(
        self,
        inputs: FrameInputs,
        settings: Mapping[str, Value],
        candidates: Mapping[str, Any],
        about: PoolState,
        targets: LightTargets,
    ) -> Iterator[float]:
        """Add this sample's light to ``targets``; yields progress.

        ``candidates``: what vpl_candidates_lib.glsl reads.
        """
        stride = STRIDES[str(settings["scale"])]
        offset = grid_offset(inputs.seed, about.number, stride)
        reuses, glossy = bool(settings["reuse"]), inputs.gpu_scene.is_glossy
        grid = self._fitting(inputs, stride, reuses and about.first_hand)
        self.device.fullscreen(
            GATHER_TO_REUSE[glossy, grid.first_hand] if reuses else GATHER[glossy],
            grid.gather_targets[0],
            normal_tx=inputs.gbuffer.normal,
            **candidates,
            pc_stride=stride,
            pc_offset=offset,
        )
        yield GATHER_DONE
        now = self._now(inputs, stride, offset, about.sources_revision)
        up = Upsampling(self.device, inputs, grid.surfaces[0], stride, offset)
        if reuses:
            history, reuse = self._most(inputs, now, about.settles)
            self._reuse(inputs, grid, candidates, now, history, reuse)
            light, direct = grid.filter.light[0], grid.direct_histories[:1]
            if settings["denoise"]:
                light, direct = grid.filter.run(grid.surfaces[0], direct)
            up.share_out(light, direct, targets.diffuse_indirect, targets.diffuse_direct)
        else:
            history = 0.0
            indirect, direct = grid.gathered
            up.cover(indirect, targets.diffuse_indirect)
            up.add(direct, targets.diffuse_direct)
        inputs.mark("gather")
        if glossy:
            yield FILTER_DONE
            self._reflections.draw(
                inputs,
                candidates,
                grid.size,
                stride,
                offset,
                (self._before or now).block(),
                most_history=history,
                mean=reuses,
                denoise=bool(settings["denoise"]),
                targets=targets,
            )
            inputs.mark("reflect")
        else:
            self._reflections.free()  # what they remember would be of an older picture than the one before
        self._before, self._drawn = now if reuses else None, now
        self._whole = True

    @property
    def settles(self) -> bool:
        """Whether the means still hold light of before an edit."""
        return self._settling > 0

    def view_bound(self, inputs: FrameInputs, candidates: Mapping[str, Any], target: Target) -> None:
        """Draw the light that the bound takes away, as this sample found it."""
        assert self._drawn is not None
        now, size = self._drawn, grid_size(inputs.view, self._drawn.stride)
        # Of its own: what the gathering keeps is the next picture's.
        surface, light, rest = (self.device.texture(size, "RGBA32F") for _ in range(3))
        own = self.device.target([surface, light, rest])
        self.device.fullscreen(
            VIEW_BOUND,
            own,
            normal_tx=inputs.gbuffer.normal,
            **candidates,
            pc_stride=now.stride,
            pc_offset=now.offset,
        )
        Upsampling(self.device, inputs, surface, now.stride, now.offset).add(light, target)
        for resource in (own, surface, light, rest):
            self.device.free(resource)

    def view_resolution(self, inputs: FrameInputs, target: Target) -> None:
        """Draw which pixels gathered, and how well they do for the others."""
        assert self._grid is not None and self._drawn is not None
        self.device.fullscreen(
            VIEW_RESOLUTION,
            target,
            position_tx=inputs.gbuffer.position,
            normal_tx=inputs.gbuffer.normal,
            surface_tx=self._grid.surfaces[0],
            pc_stride=self._drawn.stride,
            pc_offset=self._drawn.offset,
        )

    def view_history(self, settings: Mapping[str, Value], target: Target) -> None:
        """Draw how many samples each pixel's mean stands for."""
        assert self._grid is not None
        stride = STRIDES[str(settings["scale"])]
        history = self._grid.histories[0]
        self.device.fullscreen(VIEW_HISTORY, target, history_tx=history, pc_stride=stride, pc_many=LONG_HISTORY)

    def forget(self) -> None:
        """Know nothing of the picture before."""
        self._before, self._settling = None, 0

    def free(self) -> None:
        for resource in self._grid.resources if self._grid else ():
            self.device.free(resource)
        self._reflections.free()
        self._grid = self._before = self._drawn = None

    def _most(self, inputs: FrameInputs, now: _Before, pool_settles: bool) -> tuple[float, float]:
        """Samples that the mean of a surface's light may stand for, and a reservoir of the picture before."""
        before = self._before
        if before is None:
            return 0.0, 0.0
        still = inputs.sample > 0
        edited = before.scene_revision != now.scene_revision
        settled_before = self._settling == 0
        # Once begun, it lasts as long as the cache's.
        least = 1 if pool_settles and not settled_before else 0
        self._settling = SETTLING if edited else max(self._settling - 1, least)
        if self._settling == 0 and not settled_before:
            return 0.0, 0.0
        history = SHORT_HISTORY if self._settling else ENDLESS if still else LONG_HISTORY
        # Samples of a still view are to be independent, or their mean would converge more slowly.
        reuse = 0.0 if still or before.sources_revision != now.sources_revision else MOST_REUSE
        return history, reuse

    def _reuse(
        self,
        inputs: FrameInputs,
        grid: _Grid,
        candidates: Mapping[str, Any],
        now: _Before,
        history: float,
        reuse: float,
    ) -> None:
        direct: dict[str, Texture] = {}
        if grid.first_hand:
            direct = {"emitted_tx": grid.emitted[0], "direct_history_tx": grid.direct_histories[1]}
        self.device.fullscreen(
            REUSE[inputs.gpu_scene.is_glossy, grid.first_hand],
            grid.reuse_targets[0],
            **direct,
            **{name: candidates[name] for name in REUSE_READS},
            surface_tx=grid.surfaces[0],
            reservoir_tx=grid.gathered[0],
            rest_tx=grid.gathered[1],
            old_surface_tx=grid.surfaces[1],
            old_reservoir_tx=grid.reservoirs[1],
            history_tx=grid.histories[1],
            old_view=(self._before or now).block(),
            pc_most_reuse=reuse,
            pc_most_history=history,
        )

    def _now(self, inputs: FrameInputs, stride: int, offset: tuple[int, int], sources_revision: int) -> _Before:
        size = (inputs.view.width, inputs.view.height)
        return _Before(inputs.clip_from_world, size, offset, stride, inputs.gpu_scene.revision, sources_revision)

    def _fitting(self, inputs: FrameInputs, stride: int, first_hand: bool) -> _Grid:
        """The grid of this picture's size, turned so that the picture before is the older of each pair."""
        size = grid_size(inputs.view, stride)
        if self._grid is None or (self._grid.size, self._grid.first_hand) != (size, first_hand):
            self.free()
            self._grid = _new_grid(self.device, size, first_hand)
        if self._whole:  # what a cancelled sample left is written over: the picture before is still the older
            self._grid.turn()
        self._whole = False
        return self._grid


def _new_grid(device: Device, size: tuple[int, int], first_hand: bool) -> _Grid:
    def pair(wanted: bool = True) -> list[Texture]:
        return [device.texture(size, "RGBA32F") for _ in range(2 * wanted)]

    surfaces, gathered, reservoirs, histories, direct_histories = pair(), pair(), pair(), pair(), pair(first_hand)
    emitted = [device.texture(size, "RGBA32F")] if first_hand else []
    atrous = AtrousFilter(device, size, direct_apart=first_hand)
    return _Grid(
        size,
        first_hand,
        surfaces,
        gathered,
        reservoirs,
        histories,
        emitted,
        direct_histories,
        [device.target([surface, *gathered, *emitted]) for surface in surfaces],
        [
            device.target([reservoirs[i], histories[i], atrous.light[0], *direct_histories[i : i + 1]])
            for i in range(len(reservoirs))
        ],
        atrous,
    )
