"""Points of the scene's surfaces drawn into a tile of textures: one texel a point."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from ...device.interface import Device, Target, Texture, Viewport
from ...device.shader import Shader
from ...device.structs import Struct
from ...scene.data import Material, Visibility
from ...scene.surface_points import Part, Points, SurfaceSampler, emission_density, gram_matrices
from ..materials import VALUE_WIDTH
from .draws import visible_draws
from .material_pass import material_program
from .reflective_shaders import SOURCE_DEFINES
from .structs import INSTANCE, MATERIAL
from .tables import replace_table, replace_texels
from .voxel_grids import grid_bounds

if TYPE_CHECKING:
    from ...gpu_scene import Draw, GpuScene

SIDES = 2  # of every surface; a point is on one of them and stands for the other's area too
# Change of a squared length, as a part of the largest, that the rounding of a rotation may cause.
SAME_SHAPE = 1e-5
# Of the points of kind AREA, for objects that have nearly all of the area: a ground to the horizon around a room.
HUGE_SHARE = 0.5

SURFACE_POINT = Struct(
    "SurfacePoint",
    position="vec3",  # object space, as all of it
    instance="int",
    normal="vec3",
    area="float",  # m², world
    geometric_normal="vec3",
    texel="int",
    backfacing="float",
)

SURFACE_POINT_DRAW = Shader(
    name="surface_point_draw",
    vertex="frame/surface_point_draw_vert.glsl",
    fragment="frame/surface_point_draw_frag.glsl",
    varyings={"v_point": "flat INT"},
    outputs={"out_position_area": "VEC4", "out_normal": "VEC4", "out_flux": "VEC4", "out_reflectance": "VEC4"},
    samplers={
        "instance_tx": "FLOAT_2D",
        "material_tx": "FLOAT_2D",
        "point_tx": "FLOAT_2D",
        "attribute_tx": "FLOAT_2D",
    },
    structs=(INSTANCE, MATERIAL, SURFACE_POINT),
    constants={
        "pc_first_point": "INT",
        "pc_side": "INT",
        "pc_material": "INT",
        "pc_emits": "INT",
        "pc_attributes": "INT",  # texels a point has in attribute_tx
    },
    defines=(
        *SOURCE_DEFINES,
        ("MATERIAL_CAMERA_RAY", "0"),
        ("MATERIAL_INDEX", "pc_material"),
        ("MATERIAL_SCATTERED", "1"),
        ("ATTRIBUTE_WIDTH", str(VALUE_WIDTH)),
    ),
)


class SurfacePoints:
    """A square of points on what bounces light: of kind AREA spread evenly, of EMISSION by what is emitted.

    Colour textures: world position and area (RGBA32F), unit normal and SourceKind, flux in watts
    (RGBA32F; AREA: 0), diffuse reflectance (EMISSION: 0). A point is on one side of its surface and its area is of
    sides: all areas add up to SIDES times ``total_area``, and flux is pi times radiance times area. Points of AREA have
    the shading normal, those of EMISSION the geometric one.
    """

    def __init__(self, device: Device, kind: Literal["AREA", "EMISSION"]) -> None:
        self.device = device
        self.kind = kind
        self.count = self._attribute_count = 0
        self.total_area = 0.0  # m², of the surfaces that the points are on
        self._sampler = SurfaceSampler()
        self._table: Texture | None = None
        self._attributes: Texture | None = None
        self._runs: tuple[tuple[int, int, int], ...] = ()  # material, first row of the table, rows
        self._seen: tuple = ()  # what of the scene the last update looked at
        self._sampled: tuple = ()  # what the points depend on, but the instances' shapes
        self._shapes = np.zeros((0, 3, 3))
        self._rows = np.zeros(0, np.int64)  # instances that have points

    def update(self, gpu_scene: GpuScene, side: int, seed: int = 0) -> bool:
        """Have ``side`` x ``side`` points, none where nothing has an area; True: they must be drawn anew.

        New points are made only when shapes, their scales, what there is or the shares of emission differ.
        """
        scene = gpu_scene.scene
        seen = gpu_scene.draws, gpu_scene.matrices, scene.materials, side, seed
        before, self._seen = self._seen, seen
        if before and all(a is b or (i > 1 and a == b) for i, (a, b) in enumerate(zip(before, seen, strict=True))):
            return False
        parts = self._parts(gpu_scene)
        shapes = gram_matrices(gpu_scene.matrices)
        sampled = tuple(part.layout for part in parts), side, seed
        if sampled != self._sampled or not self._same_shapes(shapes):
            self._make(parts, gpu_scene, side * side, seed)
            self._sampled, self._shapes = sampled, shapes
            return True
        return self._looks_different(before, gpu_scene)

    def draw(self, gpu_scene: GpuScene, target: Target, viewport: Viewport) -> None:
        """Fill the tile ``viewport``, of the updated side; texels without a point are zero."""
        self.device.clear(target, viewport=viewport)
        if not self.count:
            return
        shared = {
            "instance_tx": gpu_scene.instance_table,
            "point_tx": self._table,
            "attribute_tx": self._attributes,
            "pc_side": viewport[2],
            "pc_emits": int(self.kind == "EMISSION"),
            "pc_attributes": self._attribute_count,
        }
        for material, first, count in self._runs:
            program = material_program(SURFACE_POINT_DRAW, gpu_scene.code_of(material))
            given = shared | gpu_scene.material_inputs(program) | gpu_scene.own_inputs(material)
            self.device.draw(program, None, target, viewport=viewport, count=3 * count, pc_first_point=first, **given)

    def free(self) -> None:
        self.device.free(self._table)
        self.device.free(self._attributes)
        self._table = self._attributes = None
        self._seen = self._sampled = self._runs = ()
        self.count = 0

    def _parts(self, gpu_scene: GpuScene) -> list[Part]:
        scene = gpu_scene.scene
        draws = visible_draws(gpu_scene, Visibility.BOUNCE)
        if self.kind == "AREA":  # what takes no indirect light has none to pass on
            return [_part(draw, gpu_scene, 1.0) for draw in draws if Visibility.NO_INDIRECT not in draw.visibility]
        densities = [emission_density(material) for material in scene.materials]
        # Against the brightest, in a single's precision: dimming all emitters alike moves no point.
        shares = (np.array(densities) / max(*densities, 1e-30)).astype(np.float32).tolist()
        return [_part(draw, gpu_scene, shares[draw.material]) for draw in draws if shares[draw.material] > 0.0]

    def _same_shapes(self, shapes: np.ndarray) -> bool:
        """Compared with the shapes that the points were made for, so that small changes add up."""
        old = self._shapes[self._rows]
        tolerance = SAME_SHAPE * np.abs(old).max((1, 2), initial=0.0)[:, None, None]
        return bool((np.abs(shapes[self._rows] - old) <= tolerance).all())

    def _looks_different(self, before: tuple, gpu_scene: GpuScene) -> bool:
        """Whether anything moved or another look came to anything that has points."""
        moved = before[1] is not gpu_scene.matrices and not np.array_equal(
            before[1][self._rows], gpu_scene.matrices[self._rows]
        )
        old: tuple[Material, ...] = before[2]
        return moved or any(old[m] != gpu_scene.scene.materials[m] for m, _, _ in self._runs)

    def _make(self, parts: list[Part], gpu_scene: GpuScene, count: int, seed: int) -> None:
        huge_share, focus = (HUGE_SHARE, grid_bounds(gpu_scene.boxes)) if self.kind == "AREA" else (1.0, None)
        points = self._sampler.sample(parts, gpu_scene.matrices, count, seed, huge_share, focus)
        self.count = len(points)
        self.total_area = float(points.weights.sum())
        rows = [np.arange(p.first_instance, p.first_instance + p.instance_count) for p in parts]
        self._rows = np.unique(np.concatenate([np.zeros(0, np.int64), *rows]))
        order = np.argsort(points.materials, kind="stable")
        used, first, counts = np.unique(points.materials[order], return_index=True, return_counts=True)
        self._runs = tuple(zip(used.tolist(), first.tolist(), counts.tolist(), strict=True))
        self._table = replace_table(self.device, _packed(points, order), self._table)
        self._attribute_count = points.attributes.shape[1]
        texels = points.attributes[order].reshape(-1, 4)
        self._attributes = replace_texels(self.device, texels, self._attributes)


def _part(draw: Draw, gpu_scene: GpuScene, density: float) -> Part:
    triangles = draw.first_triangle, draw.triangle_count
    instances = draw.first_instance, draw.instance_count
    code = gpu_scene.code_of(draw.material)
    asked = () if code is None else tuple((a.field, a.name) for a in code.mesh_fields.values())
    return Part(draw.mesh, *triangles, *instances, draw.material, asked, density)


def _packed(points: Points, order: np.ndarray) -> np.ndarray:
    """Rows of SURFACE_POINT, those of one material together."""
    return SURFACE_POINT.pack_arrays(
        len(points),
        position=points.positions[order],
        instance=points.instances[order],
        normal=points.normals[order],
        area=SIDES * points.weights[order],
        geometric_normal=points.geometric_normals[order],
        texel=order,
        backfacing=points.backfacing[order],
    )
