"""Gathering at some of the pixels: candidates, reuse over space and time, a filter, and the way up to all pixels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...device.interface import Device, Target, Texture
from ..frame.coarse_grid import COARSEST, STRIDES, grid_offset, grid_size
from ..frame.inputs import FrameInputs, LightTargets
from ..frame.voxels import VOXEL_SAMPLERS
from ..technique import Value
from .filtering import Upsampling
from .memory import Memory
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
# and where it is from a coarser picture, of a view that came to rest: detail is to come soon.
COARSE_HISTORY = 4.0
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


@dataclass(frozen=True)
class _Before:
    """What the picture before was made of."""

    clip_from_world: np.ndarray
    projection: np.ndarray
    size: tuple[int, int]
    offset: tuple[int, int]
    stride: int
    scene_revision: int
    sources_revision: int

    def sees_other(self, inputs: FrameInputs) -> bool:
        """Whether view or scene have changed since."""
        same_view = np.array_equal(self.projection, _projection(inputs))
        return not same_view or self.scene_revision != inputs.gpu_scene.revision

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
        self._memory = Memory(device)
        self._reflections = Reflections(device)
        self._before: _Before | None = None
        self._drawn: _Before | None = None  # the newest picture, reused or not
        self.is_coarse = False  # whether the newest sample was made in haste
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
        stride = self._stride(inputs, settings)
        offset = grid_offset(inputs.seed, about.number, stride)
        reuses, glossy = bool(settings["reuse"]), inputs.gpu_scene.is_glossy
        first_hand = reuses and about.first_hand
        memory = self._begin(inputs, stride, first_hand)
        self.device.fullscreen(
            GATHER_TO_REUSE[glossy, first_hand] if reuses else GATHER[glossy],
            memory.target(memory.new["surface"], *memory.scratch.values()),
            normal_tx=inputs.gbuffer.normal,
            **candidates,
            pc_stride=stride,
            pc_offset=offset,
        )
        yield GATHER_DONE
        now = self._now(inputs, stride, offset, about.sources_revision)
        surface = memory.new["surface"]
        up = Upsampling(self.device, inputs, surface, stride, offset)
        if reuses:
            history, reuse = self._most(inputs, now, about.settles)
            self._reuse(inputs, candidates, now, history, reuse)
            light, direct = memory.filter.light[0], [memory.new["direct_history"]] if first_hand else []
            if settings["denoise"]:
                light, direct = memory.filter.run(surface, direct)
            up.share_out(light, direct, targets.diffuse_indirect, targets.diffuse_direct)
        else:
            history = 0.0
            up.cover(memory.scratch["light"], targets.diffuse_indirect)
            up.add(memory.scratch["rest"], targets.diffuse_direct)
        inputs.mark("gather")
        if glossy:
            yield FILTER_DONE
            self._reflections.draw(
                inputs,
                candidates,
                memory.size,
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
    def provisional(self) -> bool:
        """Whether the means still hold light of before an edit, or few pixels gathered in haste."""
        return self._settling > 0 or self.is_coarse

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
        assert self._drawn is not None
        self.device.fullscreen(
            VIEW_RESOLUTION,
            target,
            position_tx=inputs.gbuffer.position,
            normal_tx=inputs.gbuffer.normal,
            surface_tx=self._memory.new["surface"],
            pc_stride=self._drawn.stride,
            pc_offset=self._drawn.offset,
        )

    def view_history(self, target: Target) -> None:
        """Draw how many samples each pixel's mean stands for."""
        assert self._drawn is not None
        history = self._memory.new["history"]
        stride = self._drawn.stride
        self.device.fullscreen(VIEW_HISTORY, target, history_tx=history, pc_stride=stride, pc_many=LONG_HISTORY)

    def forget(self) -> None:
        """Know nothing of the picture before."""
        self._before, self._settling, self.is_coarse = None, 0, False

    def free(self) -> None:
        self._memory.free()
        self._reflections.free()
        self._before = self._drawn = None

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
        if before.stride > now.stride:
            history = min(history, COARSE_HISTORY)
        # Samples of a still view are to be independent, or their mean would converge more slowly.
        reuse = 0.0 if still or before.sources_revision != now.sources_revision else MOST_REUSE
        return history, reuse

    def _reuse(
        self,
        inputs: FrameInputs,
        candidates: Mapping[str, Any],
        now: _Before,
        history: float,
        reuse: float,
    ) -> None:
        new, old, scratch = self._memory.new, self._memory.old, self._memory.scratch
        light = self._memory.filter.light[0]
        first_hand = "direct_history" in new
        target = self._memory.target(new["reservoir"], new["history"], light)
        direct: dict[str, Texture] = {}
        if first_hand:
            target = self._memory.target(new["reservoir"], new["history"], light, new["direct_history"])
            direct = {"emitted_tx": scratch["emitted"], "direct_history_tx": old["direct_history"]}
        self.device.fullscreen(
            REUSE[inputs.gpu_scene.is_glossy, first_hand],
            target,
            **direct,
            **{name: candidates[name] for name in REUSE_READS},
            surface_tx=new["surface"],
            reservoir_tx=scratch["light"],
            rest_tx=scratch["rest"],
            old_surface_tx=old["surface"],
            old_reservoir_tx=old["reservoir"],
            history_tx=old["history"],
            old_view=(self._before or now).block(),
            pc_most_reuse=reuse,
            pc_most_history=history,
        )

    def _stride(self, inputs: FrameInputs, settings: Mapping[str, Value]) -> int:
        """Pixels from one that gathers to the next: more where another picture will show the same better."""
        stride, before = STRIDES[str(settings["scale"])], self._drawn
        self.is_coarse = (
            bool(settings["coarser_in_motion"])
            and inputs.follows
            and inputs.sample == 0
            and before is not None
            and stride < COARSEST
            and before.sees_other(inputs)
        )
        return 2 * stride if self.is_coarse else stride

    def _now(self, inputs: FrameInputs, stride: int, offset: tuple[int, int], sources_revision: int) -> _Before:
        size = (inputs.view.width, inputs.view.height)
        revision = inputs.gpu_scene.revision
        return _Before(inputs.clip_from_world, _projection(inputs), size, offset, stride, revision, sources_revision)

    def _begin(self, inputs: FrameInputs, stride: int, first_hand: bool) -> Memory:
        """Textures of this picture's size. What a cancelled sample left is written over."""
        apart = ("direct_history",) if first_hand else ()
        knows_before = self._memory.begin(
            grid_size(inputs.view, stride),
            ("surface", "reservoir", "history", *apart),
            ("light", "rest", *(("emitted",) if first_hand else ())),
            direct_apart=first_hand,
            turn=self._whole,
        )
        if not knows_before:
            self._before = None
        self._whole = False
        return self._memory


def _projection(inputs: FrameInputs) -> np.ndarray:
    """(4, 4) of the view, without the sample's offset inside the pixel."""
    return inputs.view.clip_from_view @ inputs.view.view_from_world
