"""What glossy surfaces reflect: a ray of every gathering pixel, the mean over samples, a filter, and the way up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...device.interface import Device, Target, Texture
from ..frame.inputs import FrameInputs, LightTargets
from .filtering import AtrousFilter, Upsampling
from .shaders import REFLECT, REFLECT_MEAN


class Reflections:
    """The passes of one grid, which is made when it is first drawn."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._size = (0, 0)
        self._resources: tuple[Texture | Target, ...] = ()

    def draw(
        self,
        inputs: FrameInputs,
        candidates: Mapping[str, Any],
        size: tuple[int, int],
        stride: int,
        offset: tuple[int, int],
        old_view: np.ndarray,
        *,
        most_history: float,
        mean: bool,
        denoise: bool,
        targets: LightTargets,
    ) -> None:
        """Add what this sample finds. ``old_view``: OLD_VIEW of the picture before; ``mean``: whether that counts, for
        at most ``most_history`` samples; ``denoise``: whether the filter runs over it.
        """
        if self._fit(size):
            most_history = 0.0  # the picture before showed nothing glossy
        self._turn()
        surface, old_surface = self._surfaces
        self.device.fullscreen(
            REFLECT,
            self._ray_targets[0],
            normal_tx=inputs.gbuffer.normal,
            specular_color_tx=inputs.gbuffer.specular,
            environment_tx=inputs.gpu_scene.environment.texture,
            **candidates,
            pc_stride=stride,
            pc_offset=offset,
        )
        up = Upsampling(self.device, inputs, surface, stride, offset, glossy=True)
        if not mean:
            up.cover(self._rays[0], targets.glossy_indirect)
            up.add(self._rays[1], targets.glossy_direct)
            return
        self.device.fullscreen(
            REFLECT_MEAN,
            self._mean_targets[0],
            surface_tx=surface,
            indirect_tx=self._rays[0],
            direct_tx=self._rays[1],
            old_surface_tx=old_surface,
            history_tx=self._histories[1],
            direct_history_tx=self._direct_histories[1],
            old_view=old_view,
            pc_most_history=most_history,
            pc_still=int(inputs.sample > 0),
        )
        light, direct = self._filter.light[0], self._direct_histories[:1]
        if denoise:
            light, direct = self._filter.run(surface, direct)
        up.share_out(light, direct, targets.glossy_indirect, targets.glossy_direct)

    def free(self) -> None:
        for resource in self._resources:
            self.device.free(resource)
        self._size, self._resources = (0, 0), ()

    def _fit(self, size: tuple[int, int]) -> bool:
        """Have textures of this size; whether they are new, and hold nothing yet."""
        if size == self._size:
            return False
        self.free()

        def pair() -> list[Texture]:
            return [self.device.texture(size, "RGBA32F") for _ in range(2)]

        # Those in pairs have the newest first; the rays are indirect and direct light.
        self._surfaces, self._rays, self._histories, self._direct_histories = pair(), pair(), pair(), pair()
        self._filter = AtrousFilter(self.device, size, direct_apart=True)
        self._ray_targets = [self.device.target([surface, *self._rays]) for surface in self._surfaces]
        both = zip(self._histories, self._direct_histories, strict=True)
        self._mean_targets = [self.device.target([mean, self._filter.light[0], direct]) for mean, direct in both]
        textures = (*self._surfaces, *self._rays, *self._histories, *self._direct_histories)
        self._resources = (*self._ray_targets, *self._mean_targets, *self._filter.resources, *textures)
        self._size = size
        return True

    def _turn(self) -> None:
        """Make what is newest the picture before."""
        for pair in (self._surfaces, self._ray_targets, self._histories, self._direct_histories, self._mean_targets):
            pair.reverse()
