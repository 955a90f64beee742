"""What glossy surfaces reflect: a ray of every gathering pixel, the mean over samples, a filter, and the way up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...device.interface import Device
from ..frame.inputs import FrameInputs, LightTargets
from .filtering import Upsampling
from .memory import Memory
from .shaders import REFLECT, REFLECT_MEAN


class Reflections:
    """The passes of one grid, which is made when it is first drawn."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._memory = Memory(device)

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
        kept, scratch = ("surface", "history", "direct_history"), ("indirect", "direct")
        memory = self._memory
        if not memory.begin(size, kept, scratch, direct_apart=True, turn=True):
            most_history = 0.0  # the picture before showed nothing glossy
        new, old, rays = memory.new, memory.old, memory.scratch
        surface = new["surface"]
        self.device.fullscreen(
            REFLECT,
            memory.target(surface, *rays.values()),
            normal_tx=inputs.gbuffer.normal,
            specular_color_tx=inputs.gbuffer.specular,
            environment_tx=inputs.gpu_scene.environment.texture,
            **candidates,
            pc_stride=stride,
            pc_offset=offset,
        )
        up = Upsampling(self.device, inputs, surface, stride, offset, glossy=True)
        if not mean:
            up.cover(rays["indirect"], targets.glossy_indirect)
            up.add(rays["direct"], targets.glossy_direct)
            return
        self.device.fullscreen(
            REFLECT_MEAN,
            memory.target(new["history"], memory.filter.light[0], new["direct_history"]),
            surface_tx=surface,
            indirect_tx=rays["indirect"],
            direct_tx=rays["direct"],
            old_surface_tx=old["surface"],
            history_tx=old["history"],
            direct_history_tx=old["direct_history"],
            old_view=old_view,
            pc_most_history=most_history,
            pc_still=int(inputs.sample > 0),
        )
        light, direct = memory.filter.light[0], [new["direct_history"]]
        if denoise:
            light, direct = memory.filter.run(surface, direct)
        up.share_out(light, direct, targets.glossy_indirect, targets.glossy_direct)

    def free(self) -> None:
        self._memory.free()
