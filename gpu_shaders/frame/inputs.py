"""What a frame hands to an indirect-light technique."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...device.interface import Device, Target, Texture
from ...scene.data import View

if TYPE_CHECKING:
    from ...gpu_scene import GpuScene


# Bits of the G-buffer's position.w, of pixels whose baked light (prt) has what no technique is to add again: the
# light of the sky on the diffuse part; on the specular part as well; and the sky's light by way of surfaces.
HAS_DEFINES = (("HAS_SKY", "2"), ("HAS_SKY_MIRRORED", "4"), ("HAS_SKY_BOUNCES", "8"))
HAS_SKY, HAS_SKY_MIRRORED, HAS_SKY_BOUNCES = (int(number) for _, number in HAS_DEFINES)

# Seeds that one use of noise may count on from its own, as many as two for each of 2048 lights; and uses in a frame.
# With a frame's seed of up to 65535 all of them fit a shader's signed integer.
SEEDS_A_STREAM, STREAMS = 1 << 12, 5


@dataclass(frozen=True, eq=False)
class GBuffer:
    """What the camera sees, one texel a pixel.

    ``albedo`` RGBA16F: diffuse reflectance; a: 1 surface, 0 background, -1 holdout. ``emission`` RGBA32F radiance.
    ``position`` RGBA32F world position; w: 1 surface (plus bits of HAS_DEFINES), -1 one that takes no indirect light, 0
    background. ``normal`` RGBA32F: shading normal and geometric normal, both octahedral and on the camera's side.
    ``specular`` RGBA16F: specular reflectance at normal incidence (F0), black where the surface has no specular lobe;
    a: roughness, 0..1, the square root of GGX's alpha.
    ``passed`` RGBA16F, where the scene has anything that light passes: colour of what lies before that; a: the part of
    it that passed as if nothing was there, and not through glass.
    Where there is no surface only ``albedo`` and ``position`` hold something: zero.
    """

    albedo: Texture
    emission: Texture
    position: Texture
    normal: Texture
    specular: Texture
    depth: Texture
    passed: Texture

    @property
    def colors(self) -> Sequence[Texture]:
        return (self.albedo, self.emission, self.position, self.normal, self.specular)


@dataclass(frozen=True, eq=False)
class LightTargets:
    """Where a sample's light goes: four targets of one RGBA32F colour each, one texel a pixel.

    The diffuse ones hold irradiance / pi, which the albedo is not in; the glossy ones radiance toward the eye, which
    the specular reflectance is in, and stay zero where the scene has no specular lobe at all (``GpuScene.is_glossy``).
    """

    diffuse_direct: Target
    diffuse_indirect: Target
    glossy_direct: Target
    glossy_indirect: Target

    def clear_indirect(self, device: Device, *, glossy: bool) -> None:
        """Forget what an earlier sample left; in the ``glossy`` target, too."""
        for target in (self.diffuse_indirect, self.glossy_indirect)[: 1 + glossy]:
            device.clear(target)


def _unmarked(_name: str) -> None:
    """Nothing is timed."""


@dataclass(frozen=True, eq=False)
class FrameInputs:
    """One sample of one frame. ``seed`` is the frame's, the same for all of its samples.

    ``eye`` is the camera's position and 1, or for an orthographic view the unit direction to it and 0.
    ``follows``: the picture follows another of the same frame, as in a viewport that moves; what was found for that may
    be used again. ``clip_from_world``, (4, 4) float64, has this sample's offset inside the pixel in it: the G-buffer
    was drawn by it. ``mark``: to be called with a pass's name when it was done, for ``clock.Clock``.
    """

    gpu_scene: GpuScene
    gbuffer: GBuffer
    view: View
    sample: int
    seed: int
    eye: tuple[float, float, float, float]
    clip_from_world: np.ndarray
    follows: bool = False
    mark: Callable[[str], None] = _unmarked

    def noise_seed(self, stream: int) -> int:
        """A seed for sampling_hash(), the same for all samples: they walk along one sequence in every pixel, which
        converges faster than numbers that know nothing of each other. ``stream`` tells its uses apart.
        """
        return (self.seed * STREAMS + stream) * SEEDS_A_STREAM
