"""The world's light for methods that have no light of their own from it: harmonics and mirrors, hidden by voxels.

1. Diffuse: the irradiance of the map's harmonics of order 3, times the share of rays with the surface's cosine that
   leave the scene: one ray a sample.
2. Glossy: the map in the direction of one ray of the lobe, where that leaves the scene, blurred over what it is for.

Limits: what hides one side of the sky dims all of it; surfaces do not send this light on.
"""

from __future__ import annotations

from collections.abc import Iterator

from ...device.interface import Device
from ...device.shader import Shader
from .draws import ADD
from .environment import HARMONICS
from .inputs import HAS_DEFINES, FrameInputs, LightTargets
from .voxels import VOXEL_GRID, VOXEL_SAMPLERS, Voxels

# Voxels along the longest side of the scene, and the stream of noise.
VOXELS, NOISE = 128, 3

_SHARED = {"position_tx": "FLOAT_2D", "normal_tx": "FLOAT_2D", **VOXEL_SAMPLERS}
_CONSTANTS = {"pc_eye": "VEC4", "pc_sample": "INT", "pc_seed": "INT"}
DIFFUSE = Shader(
    name="environment_diffuse",
    fragment="frame/environment_diffuse_frag.glsl",
    outputs={"out_light": "VEC4"},
    samplers=_SHARED,
    uniforms={"voxel_grid": VOXEL_GRID, "harmonics": HARMONICS},
    constants=_CONSTANTS,
    defines=HAS_DEFINES,
)
GLOSSY = Shader(
    name="environment_glossy",
    fragment="frame/environment_glossy_frag.glsl",
    outputs={"out_light": "VEC4"},
    samplers={**_SHARED, "specular_tx": "FLOAT_2D", "environment_tx": "FLOAT_2D"},
    uniforms={"voxel_grid": VOXEL_GRID},
    constants=_CONSTANTS,
    defines=HAS_DEFINES,
)
SHADERS = (DIFFUSE, GLOSSY)


class EnvironmentLight:
    """The voxels of one renderer, made where a world shines."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._voxels = Voxels(device)

    def draw(self, inputs: FrameInputs, targets: LightTargets) -> Iterator[float]:
        """Add the world's light to the direct ones of ``targets``; yields progress 0..1."""
        environment = inputs.gpu_scene.environment
        if not (environment.lights or environment.mirrored):
            return
        yield from self._voxels.update(inputs.gpu_scene, VOXELS)
        shared = {
            "position_tx": inputs.gbuffer.position,
            "normal_tx": inputs.gbuffer.normal,
            "pc_eye": inputs.eye,
            "pc_sample": inputs.sample,
            "pc_seed": inputs.noise_seed(NOISE),
            **self._voxels.bindings(),
        }
        if environment.lights:
            block = environment.harmonics_block()
            self.device.fullscreen(DIFFUSE, targets.diffuse_direct, state=ADD, harmonics=block, **shared)
        if environment.mirrored and inputs.gpu_scene.is_glossy:
            self.device.fullscreen(
                GLOSSY,
                targets.glossy_direct,
                state=ADD,
                specular_tx=inputs.gbuffer.specular,
                environment_tx=environment.texture,
                **shared,
            )

    def free(self) -> None:
        self._voxels.free()
