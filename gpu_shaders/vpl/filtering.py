"""From the light of gathering pixels to that of all: the à-trous filter, and the way up."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...device.interface import Device, DrawState, Target, Texture
from ..frame.draws import ADD
from ..frame.inputs import FrameInputs
from .shaders import ATROUS, UPSAMPLE

# Distances between the texels that one pass of the filter compares.
FILTER_STEPS = (1, 2, 4)


class AtrousFilter:
    """The filter of one grid. ``light`` is a pair between which it goes to and fro; the first takes what is noisy.

    With ``direct_apart`` a part of the light is mixed alike and kept apart.
    """

    def __init__(self, device: Device, size: tuple[int, int], *, direct_apart: bool) -> None:
        self.device = device
        self.light = [device.texture(size, "RGBA32F") for _ in range(2)]
        self.direct = [device.texture(size, "RGBA32F") for _ in range(2 * direct_apart)]
        self._targets = [device.target([light, *self.direct[i : i + 1]]) for i, light in enumerate(self.light)]

    @property
    def resources(self) -> tuple[Texture | Target, ...]:
        return (*self._targets, *self.light, *self.direct)

    def run(self, surface: Texture, direct: list[Texture]) -> tuple[Texture, list[Texture]]:
        """Filter ``light[0]`` and its ``direct`` part, one texture if that is kept apart; both filtered."""
        newest = 0
        for step in FILTER_STEPS:
            apart: dict[str, Any] = {"direct_tx": direct[0]} if direct else {}
            self.device.fullscreen(
                ATROUS[bool(direct)],
                self._targets[1 - newest],
                surface_tx=surface,
                light_tx=self.light[newest],
                pc_step=step,
                **apart,
            )
            newest = 1 - newest
            direct = self.direct[newest : newest + 1]
        return self.light[newest], direct


class Upsampling:
    """The way from a grid of gathering pixels up to all, for one sample.

    ``stride`` and ``offset`` say which pixels gathered; ``surface`` is what they see. ``glossy``: light is over the
    albedo of their lobe.
    """

    def __init__(
        self,
        device: Device,
        inputs: FrameInputs,
        surface: Texture,
        stride: int,
        offset: tuple[int, int],
        glossy: bool = False,
    ) -> None:
        self.device, self._shader = device, UPSAMPLE[glossy]
        self._given = {
            "position_tx": inputs.gbuffer.position,
            "normal_tx": inputs.gbuffer.normal,
            "surface_tx": surface,
            "pc_stride": float(stride),
            "pc_offset": np.array(offset, np.float32),
        }
        if glossy:
            self._given |= {"specular_color_tx": inputs.gbuffer.specular, "pc_eye": inputs.eye}

    def cover(self, light: Texture, target: Target) -> None:
        """Make the light of the gathering pixels that of all."""
        self._draw(light, target, DrawState(), 1.0)

    def add(self, light: Texture, target: Target, gain: float = 1.0) -> None:
        """Add ``gain`` times the light of the gathering pixels to that of all."""
        self._draw(light, target, ADD, gain)

    def share_out(self, light: Texture, direct: list[Texture], indirect_target: Target, direct_target: Target) -> None:
        """Cover the first target with all light but its ``direct`` part, and add that to the second."""
        self.cover(light, indirect_target)
        for part in direct:
            self.add(part, indirect_target, gain=-1.0)
            self.add(part, direct_target)

    def _draw(self, light: Texture, target: Target, state: DrawState, gain: float) -> None:
        self.device.fullscreen(self._shader, target, state=state, light_tx=light, pc_gain=gain, **self._given)
