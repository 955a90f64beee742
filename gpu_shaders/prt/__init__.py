"""What baked objects pass on of the light of their surroundings, drawn over the G-buffer.

P.-P. Sloan, J. Kautz, J. Snyder, "Precomputed Radiance Transfer", SIGGRAPH 2002; R. Ng, R. Ramamoorthi, P. Hanrahan,
"All-Frequency Shadows Using Non-linear Wavelet Lighting Approximation", SIGGRAPH 2003.

1. The light of the vertices comes from ``bake.live``, by products of matrices, whenever the surroundings or their
   rotation change: irradiance / pi, and harmonics of the arriving radiance or the numbers of a lobe's factors.
2. The objects are drawn again where the G-buffer has them. A pixel mixes its vertices' light; harmonics are convolved
   with the cosine there, and multiplied with the weights that the material's lobe has from this view; numbers are
   multiplied with the factors of the view.
3. What was drawn is added to the direct light. The G-buffer's position is marked, so that no technique adds the sky.

Limits: docs/prt.md. Between the vertices, and the points inside triangles that a bake may have, light is mixed.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...device.interface import Device, DrawState, Target, Texture, Vertices
from ..frame.draws import ADD
from ..frame.inputs import HAS_SKY, HAS_SKY_BOUNCES, HAS_SKY_MIRRORED, FrameInputs, LightTargets
from ..frame.shaders import RESOLVE
from .shaders import DRAW, PRT_DRAW, ROW_TEXELS, SHADERS, Look

__all__ = ["SHADERS", "BakedObject", "BakedObjects", "Look"]

# What a view of bakes shows where there is none.
NOT_BAKED = (0.05, 0.05, 0.05)
# Nothing else: what is seen through an object that lets light pass has its own light.
OVER_GBUFFER = DrawState(depth_test="EQUAL")


@dataclass(eq=False)
class _Light:
    """What one object's vertices have."""

    texture: Texture
    look: Look
    coefficients: int  # of a vertex
    texels: int  # of a vertex
    views: Texture | None  # Look.LOBE: the factors of the view


@dataclass(eq=False)
class BakedObject:
    """One object's mesh by corners and the light of its vertices."""

    world_from_object: np.ndarray  # (4, 4)
    frame: np.ndarray  # (3, 3): the axes of the bake in the world
    vertices: Vertices
    light: _Light
    tree: Texture | None  # where light has points inside triangles
    has: int  # HAS_... bits of frame.inputs
    least_roughness: float  # Look.HARMONICS: smoother surfaces are seen by the lobe of this


class BakedObjects:
    """The passes and what they keep on the GPU. Meshes, lights, trees are told by name; given back when not told."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._meshes: dict[Hashable, Vertices] = {}
        self._lights: dict[Hashable, _Light] = {}
        self._trees: dict[Hashable, Texture] = {}
        self._lobes: Texture | None = None
        self._pictures: Target | None = None  # diffuse, glossy
        self._target: Target | None = None  # the G-buffer's position, and those
        self._over: Texture | None = None  # that position

    def has_mesh(self, key: Hashable) -> bool:
        return key in self._meshes

    def add_mesh(self, key: Hashable, positions: np.ndarray, vertices: np.ndarray) -> None:
        """(3T, 3) corners, and the vertex of each (3T,)."""
        triangles = np.repeat(vertices.reshape(-1, 3).astype(np.int32), 3, axis=0)
        self._meshes[key] = self.device.vertices({"in_position": positions, "in_triangle": triangles})

    def set_light(
        self, key: Hashable, light: np.ndarray, look: Look = Look.MATT, views: np.ndarray | None = None
    ) -> None:
        """(vertices, coefficients, 3) float32 of one object; of a lobe also the (VIEWS, K, 4) factors of the view."""
        count, coefficients, _ = light.shape
        texels = -(-3 * coefficients // 4) if look is Look.HARMONICS else coefficients
        row = ROW_TEXELS // texels
        height = -(-count // row)
        filled = np.zeros((height * row, texels, 4), np.float32)
        if look is Look.HARMONICS:  # in a row, as there are most of them
            filled.reshape(height * row, -1)[:count, : 3 * coefficients] = light.reshape(count, -1)
        else:
            filled[:count, :, :3] = light
        if key in self._lights:
            self._free_light(key)
        texture = self.device.texture((row * texels, height), "RGBA32F", filled.reshape(height, row * texels, 4))
        table = None if views is None else self.device.texture(views.shape[1::-1], "RGBA32F", views)
        self._lights[key] = _Light(texture, look, coefficients, texels, table)

    def has_tree(self, key: Hashable) -> bool:
        return key in self._trees

    def add_tree(self, key: Hashable, nodes: np.ndarray) -> None:
        """(nodes, 4) float32: the cuts of a mesh's triangles, as of bake.refine.tree."""
        height = -(-len(nodes) // ROW_TEXELS)
        filled = np.zeros((height * ROW_TEXELS, 4), np.float32)
        filled[: len(nodes)] = nodes
        self._trees[key] = self.device.texture((ROW_TEXELS, height), "RGBA32F", filled.reshape(height, ROW_TEXELS, 4))

    def set_lobes(self, table: np.ndarray) -> None:
        """(views, LOBE_TEXELS roughnesses, 4) of LOBES_SIDE a side: see prt_weights() in prt_harmonics_frag.glsl."""
        self.device.free(self._lobes)
        self._lobes = self.device.texture((table.shape[1], table.shape[0]), "RGBA32F", table.astype(np.float32))

    def object(
        self,
        mesh: Hashable,
        light: Hashable,
        tree: Hashable,
        world_from_object: np.ndarray,
        frame: np.ndarray,
        *,
        bounces: bool,
        least_roughness: float = 0.0,
    ) -> BakedObject:
        """Of a mesh and a light that were told before, and a tree if it was. ``bounces``: whether the bake has light
        that bounced.
        """
        of_vertices = self._lights[light]
        has = HAS_SKY | HAS_SKY_MIRRORED * (of_vertices.look is not Look.MATT) | HAS_SKY_BOUNCES * bounces
        vertices, cuts = self._meshes[mesh], self._trees.get(tree)
        return BakedObject(world_from_object, frame, vertices, of_vertices, cuts, has, least_roughness)

    def keep(self, meshes: set[Hashable], lights: set[Hashable], trees: set[Hashable]) -> None:
        """Give everything else back."""
        for key in self._meshes.keys() - meshes:
            self.device.free(self._meshes.pop(key))
        for key in self._lights.keys() - lights:
            self._free_light(key)
        for key in self._trees.keys() - trees:
            self.device.free(self._trees.pop(key))

    def draw(
        self, inputs: FrameInputs, objects: list[BakedObject], targets: LightTargets, *, glossy: bool, seen=(True, True)
    ) -> None:
        """Add the objects' light to the direct targets, and mark their pixels in the G-buffer's position.

        ``seen``: whether the world lights diffusely, and whether it is mirrored.
        """
        diffuse, mirrored = self._draw(inputs, objects)
        if seen[0]:
            self.device.fullscreen(RESOLVE, targets.diffuse_direct, state=ADD, sum_tx=diffuse, pc_weight=1.0)
        if glossy and seen[1]:
            self.device.fullscreen(RESOLVE, targets.glossy_direct, state=ADD, sum_tx=mirrored, pc_weight=1.0)

    def show(self, inputs: FrameInputs, objects: list[BakedObject], target: Target) -> None:
        """Draw the objects' light as it is into a picture, over grey."""
        self.device.clear(target, (*NOT_BAKED, 1.0))
        shown, _ = self._draw(inputs, objects)
        state = DrawState(blend="ALPHA_PREMULT")
        self.device.fullscreen(RESOLVE, target, state=state, sum_tx=shown, pc_weight=1.0)

    def _draw(self, inputs: FrameInputs, objects: list[BakedObject]) -> tuple[Texture, Texture]:
        """What the objects send by their matt and by their glossy side."""
        pictures, over = self._targets(inputs)
        self.device.clear(pictures)
        for one in objects:
            light = one.light
            rotation = np.eye(4)
            rotation[:3, :3] = one.frame.T
            block = {
                "clip_from_world": inputs.clip_from_world,
                "world_from_object": one.world_from_object,
                "local_from_world": rotation,
                "eye": inputs.eye,
                "has": one.has,
                "row": ROW_TEXELS // light.texels,
                "texels": light.texels,
                "coefficients": light.coefficients,
                "least_roughness": one.least_roughness,
            }
            given: dict[str, Any] = {} if one.tree is None else {"tree_tx": one.tree}
            if light.look is not Look.MATT:
                given |= {"normal_tx": inputs.gbuffer.normal, "specular_tx": inputs.gbuffer.specular}
                given["lobe_tx"] = light.views or self._lobes
            self.device.draw(
                DRAW[light.look, one.tree is not None],
                one.vertices,
                over,
                state=OVER_GBUFFER,
                light_tx=light.texture,
                prt_draw=PRT_DRAW.pack([block], for_uniform=True),
                **given,
            )
        diffuse, mirrored = pictures.colors
        return diffuse, mirrored

    def _free_light(self, key: Hashable) -> None:
        light = self._lights.pop(key)
        self.device.free(light.texture)
        self.device.free(light.views)

    def free(self) -> None:
        self.keep(set(), set(), set())
        self._free_targets()
        self.device.free(self._lobes)
        self._lobes = None

    def _targets(self, inputs: FrameInputs) -> tuple[Target, Target]:
        position = inputs.gbuffer.position
        if self._pictures is None or self._target is None or self._over is not position:
            self._free_targets()
            size = position.size
            self._pictures = self.device.target([self.device.texture(size, "RGBA32F") for _ in range(2)])
            self._target = self.device.target([position, *self._pictures.colors], inputs.gbuffer.depth)
            self._over = position
        return self._pictures, self._target

    def _free_targets(self) -> None:
        self.device.free(self._target)
        if self._pictures is not None:
            self.device.free(self._pictures)
            for texture in self._pictures.colors:
                self.device.free(texture)
        self._pictures = self._target = self._over = None
