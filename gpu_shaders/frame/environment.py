"""The world on the GPU: its light as an octahedral map with a pyramid, as harmonics and as suns; and as a background.

A world's graph is evaluated once, when it or its numbers change: drawn into a map, which is read back, freed of its
suns (``environment_map``) and sent again with its pyramid. A world of one colour draws nothing.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ...device.interface import Device, Target, Texture
from ...device.structs import Struct
from ...scene.data import Light, LightKind, World
from .environment_map import Sun, harmonics, pyramid, without_suns
from .environment_shaders import WORLD_VIEW, background_shader, map_shader
from .tables import replace_texels

if TYPE_CHECKING:
    from .inputs import FrameInputs

# Texels along a side of the map: of one colour, without an image, with a Sky Texture, and the most.
PLAIN_SIDE, GRAPH_SIDE, SKY_SIDE, MOST_SIDE = 16, 256, 512, 1024
# Directions along a side of a texel: without an image, and the most; with one, as many as miss none of its texels.
GRAPH_STEPS, MOST_STEPS = 3, 8

HARMONICS = Struct("Harmonics", **{f"factor_{k}": "vec4" for k in range(9)})


class Environment:
    """One scene's world. ``revision`` grows with its light; ``drawn`` counts the maps, for the reactivity tests."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.world = World()
        self.revision = 0
        self.drawn = 0
        self.suns: tuple[Light, ...] = ()
        self.harmonics = np.zeros((9, 3))
        self.pixels = np.zeros((PLAIN_SIDE, PLAIN_SIDE, 3), np.float32)  # the map without its suns
        self.texture = device.texture((PLAIN_SIDE * 3 // 2, PLAIN_SIDE), "RGBA32F")
        self._values: Texture | None = None
        self._images: tuple[Texture, ...] = ()

    def update(self, world: World, images: Mapping[Hashable, Texture]) -> None:
        """Make it that of ``world``, whose images are on the GPU already. Does nothing where it is so."""
        if world == self.world:
            return
        before, self.world = self.world, world
        self._images = tuple(images[key] for key in world.images)
        if _light_of(world) == _light_of(before):
            return
        self.revision += 1
        pixels, suns = without_suns(self._radiance(), world.sun_threshold, world.sun_angle)
        self.suns = tuple(_lamp(world, sun, number) for number, sun in enumerate(suns))
        self.pixels, self.harmonics = pixels, harmonics(pixels)
        self.device.free(self.texture)
        picture = pyramid(pixels)
        self.texture = self.device.texture(picture.shape[1::-1], "RGBA32F", picture)

    @property
    def lights(self) -> bool:
        """Whether surfaces take light from it: diffusely, at least."""
        return self.world.shines and self.world.diffuse

    @property
    def mirrored(self) -> bool:
        """Whether glossy surfaces show it."""
        return self.world.shines and self.world.glossy

    @property
    def has_background(self) -> bool:
        """Whether a camera sees more than one colour of it."""
        return self.world.graph is not None and self.world.seen

    def draw_background(self, inputs: FrameInputs, emission: Target) -> None:
        """Write radiance into the G-buffer's emission where there is no surface."""
        assert self.world.graph is not None
        turned = inputs.view.view_from_world.copy()
        turned[:3, 3] = 0.0
        jitter = inputs.clip_from_world @ np.linalg.inv(inputs.view.clip_from_view @ inputs.view.view_from_world)
        view = {
            "world_from_clip": np.linalg.inv(jitter @ inputs.view.clip_from_view @ turned),
            "camera_from_world": np.diag([1.0, 1.0, -1.0, 1.0]) @ turned,
            "eye": inputs.eye,
            "size": (inputs.view.width, inputs.view.height),
        }
        self.device.fullscreen(
            background_shader(self.world.graph),
            emission,
            albedo_tx=inputs.gbuffer.albedo,
            world_view=WORLD_VIEW.pack([view], for_uniform=True),
            **self._graph_inputs(),
        )

    def harmonics_block(self) -> np.ndarray:
        """HARMONICS as a uniform block."""
        row = {f"factor_{k}": (*factor, 0.0) for k, factor in enumerate(self.harmonics)}
        return HARMONICS.pack([row], for_uniform=True)

    def free(self) -> None:
        for texture in (self.texture, self._values):
            if texture is not None:
                self.device.free(texture)
        self._values, self._images = None, ()

    def _radiance(self) -> np.ndarray:
        """The world's map with its suns, (n, n, 3) float32."""
        world = self.world
        if world.graph is None:
            return np.broadcast_to(np.array(world.color, np.float32), (PLAIN_SIDE, PLAIN_SIDE, 3)).copy()
        self._upload_values()
        side, steps = _resolution(self._images, any(node.kind == "Sky" for node in world.graph.nodes))
        texture = self.device.texture((side, side), "RGBA32F")
        target = self.device.target([texture])
        self.device.fullscreen(
            map_shader(world.graph), target, pc_side=float(side), pc_steps=steps, **self._graph_inputs()
        )
        self.drawn += 1
        pixels = self.device.read(texture)[..., :3].copy()
        self.device.free(target)
        self.device.free(texture)
        return np.nan_to_num(pixels, copy=False, posinf=1e30)

    def _upload_values(self) -> None:
        texels = np.asarray(self.world.values, np.float32).reshape(-1, 4)
        self._values = replace_texels(self.device, texels, self._values)

    def _graph_inputs(self) -> dict[str, Any]:
        images = {f"image_{number}_tx": texture for number, texture in enumerate(self._images)}
        return {"value_tx": self._values, "pc_values": 0, **images}


def _light_of(world: World) -> tuple:
    """All of a world that its map and its suns depend on."""
    suns = world.sun_threshold, world.sun_angle, world.diffuse, world.glossy
    return world.color, world.graph, world.values, world.images, *suns


def _resolution(images: tuple[Texture, ...], has_sky: bool) -> tuple[int, int]:
    """Texels along a side of the map, and directions along a side of a texel, for a world of these images."""
    if not images:
        return GRAPH_SIDE, GRAPH_STEPS
    # A panorama's texel is pi / height wide, the map's widest 4.6 / side.
    height = max(texture.size[1] for texture in images)
    least = SKY_SIDE if has_sky else GRAPH_SIDE
    side = int(np.clip(1 << (height - 1).bit_length(), least, MOST_SIDE))
    return side, int(np.clip(np.ceil(1.5 * height * 4.6 / (np.pi * side)), GRAPH_STEPS, MOST_STEPS))


def _lamp(world: World, sun: Sun, number: int) -> Light:
    """A sun of the world as any other light."""
    z = np.asarray(sun.direction)
    x = np.cross(np.eye(3)[np.argmin(abs(z))], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack((x, np.cross(z, x), z), 1)
    name = "Sun of the World" if number == 0 else f"Sun {number + 1} of the World"
    return Light(
        ("world", number),
        name,
        LightKind.SUN,
        sun.irradiance,
        matrix,
        angle=sun.angle,
        diffuse_factor=float(world.diffuse),
        specular_factor=float(world.glossy),
        bounce=float(world.diffuse),
    )
