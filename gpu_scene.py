"""The scene on the GPU: uploads what ``Changes`` names, and keeps the list of draws."""

from __future__ import annotations

import time
from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .device.interface import Device, Texture
from .device.shader import Shader
from .gpu_shaders.frame.batches import Batches
from .gpu_shaders.frame.environment import Environment
from .gpu_shaders.frame.material_pass import attribute_sampler, material_program
from .gpu_shaders.frame.mesh_pages import MeshKey, MeshPages, Page
from .gpu_shaders.frame.reflective_shaders import REFLECT
from .gpu_shaders.frame.shaders import GBUFFER, SHADOW_PASSING
from .gpu_shaders.frame.structs import INSTANCE, MATERIAL, MATERIAL_VIEW
from .gpu_shaders.frame.surface_points import SURFACE_POINT_DRAW
from .gpu_shaders.frame.tables import replace_table, replace_texels
from .gpu_shaders.materials import Attribute, MaterialShader, generate
from .scene.changes import Changes, told, world_boxes
from .scene.data import Image, Instance, Material, Mesh, Scene, View, Visibility

# Updates whose moved boxes are kept. A light map that was not looked at for longer is drawn again.
REMEMBERED_MOVES = 64


@dataclass(frozen=True, eq=False)
class Draw:
    """A run of triangles of one mesh with one material, for a run of instances; batches are drawn, of many of these."""

    number: int  # its place in GpuScene.draws
    page: Page
    first_on_page: int  # triangle
    first_triangle: int  # of the mesh
    triangle_count: int
    first_instance: int
    instance_count: int
    material: int
    visibility: Visibility
    bounds: np.ndarray  # (2, 3) float64: of all its instances, world space
    mesh: Mesh


class GpuScene:
    """GPU copies of one Scene. ``uploads`` counts what was sent since it was made, for the reactivity tests."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.scene = Scene()
        self.uploads: Counter[str] = Counter()
        self.draws: tuple[Draw, ...] = ()
        self.is_glossy = False  # whether anything drawn has a specular lobe
        self.emits = False  # whether anything drawn emits
        self.matrices = np.zeros((0, 4, 4))  # float64 world_from_object of every row of the table of instances
        self.boxes = np.zeros((1, 2, 3))  # world boxes of all instances, a point at the origin for an empty scene
        self.revision = 0  # grows with every update that changes something
        self._moved: list[tuple[int, np.ndarray, np.ndarray]] = []  # revision, boxes, those of them with other shapes
        self._placed: list[Instance] = []  # those of every row
        self._told = np.zeros((0, 13))  # what materials can ask of them beside their place: _instance_row()
        self.seen_through: tuple[Draw, ...] = ()  # what a camera may look through
        self.passing_boxes = np.zeros((0, 2, 3))  # world boxes of what blocks a part of lamps' light
        self._has_thin = False  # whether anything drawn does, or stops it on one side only
        self._visible: dict[int, tuple[tuple[Draw, ...], np.ndarray]] = {}
        self._meshes = MeshPages(device, self.uploads)
        self.batches = Batches(device)
        self._images: dict[Hashable, Texture] = {}
        self.environment = Environment(device)
        self._codes: tuple[MaterialShader | None, ...] = ()  # of each material
        self._compiled: set[MaterialShader] = set()
        self._unchecked = True  # whether the draws may have materials that were not asked for their programs
        self.waits = False  # whether some materials are shown by their constants until their programs are compiled
        self._first_values: tuple[int, ...] = ()  # each material's first texel among the values
        self._view = np.zeros(0, np.float32)  # MATERIAL_VIEW of the camera
        self.instance_table: Texture | None = None
        self.material_table: Texture | None = None
        self.value_table: Texture | None = None

    def update(self, scene: Scene, changes: Changes) -> None:
        """Make the GPU hold ``scene``; only what ``changes`` names is uploaded."""
        fields_before = self._mesh_fields
        self.scene = scene
        if changes.any:
            self.revision += 1
        if changes.materials or changes.images:
            self.batches.forget()
        for key in changes.images_removed:
            self.device.free(self._images.pop(key))
        for key in changes.images_added:
            self._images[key] = self._upload_image(scene.images[key])
        self.environment.update(scene.world, self._images)
        if self.environment.suns:
            self.scene = replace(scene, lights=(*scene.lights, *self.environment.suns))
        if changes.materials or self.material_table is None:
            self._upload_materials(scene.materials)
        same_draws = self.instance_table is not None and fields_before == self._mesh_fields
        only_instances = same_draws and not (changes.materials or changes.meshes_added or changes.meshes_removed)
        if (changes.geometry or not same_draws) and not (only_instances and self._move(scene)):
            self._place(scene)
        drawn = [scene.materials[index] for index in {draw.material for draw in self.draws}]
        self.is_glossy = any(material.is_glossy for material in drawn)
        self.emits = any(any(material.emission) for material in drawn)
        self._unchecked = self._unchecked or changes.any
        self._find_passing()
        if len(changes.moved_bounds):
            self._moved.append((self.revision, changes.moved_bounds, changes.shape_bounds))
            del self._moved[:-REMEMBERED_MOVES]

    def moved_since(self, revision: int, *, shapes_only: bool = False) -> np.ndarray | None:
        """World boxes (n, 2, 3) where something changed after ``revision``; None: too long ago to tell.

        ``shapes_only`` leaves out what only looks different.
        """
        if self._moved and len(self._moved) == REMEMBERED_MOVES and revision < self._moved[0][0]:
            return None
        boxes = [shapes if shapes_only else moved for when, moved, shapes in self._moved if when > revision]
        return np.concatenate(boxes) if boxes else np.zeros((0, 2, 3))

    @property
    def _mesh_fields(self) -> list[dict[str, Attribute] | None]:
        """What each material asks meshes for: it decides how they are laid out."""
        return [code and code.mesh_fields for code in self._codes]

    def look_from(self, view: View) -> None:
        """Tell materials where the camera is."""
        toward = np.diag((1.0, 1.0, -1.0, 1.0)) @ view.view_from_world  # Cycles' camera looks along its z
        window = view.clip_from_view @ view.view_from_world
        row = {"camera_from_world": toward, "window_from_world": window}
        self._view = MATERIAL_VIEW.pack([row], for_uniform=True)[0]

    def code_of(self, material: int) -> MaterialShader | None:
        """What a material is drawn by; None where it is the same all over, or has to wait for its program."""
        code = self._codes[material]
        return None if self.waits and code not in self._compiled else code

    def lets_pass(self, material: int) -> bool:
        """Whether light may go on through a material."""
        return self.scene.materials[material].passing > 0.0 and self.code_of(material) is not None

    def compile(self, seconds: float) -> bool:
        """Compile programs of materials for about so long, the first that is not ready in any case.

        What is not ready ``waits`` and is shown by its constants; True if something looks different now.
        """
        if not (self._unchecked or self.waits):
            return False
        missing: dict[MaterialShader, list[Draw]] = defaultdict(list)
        for draw in self.draws:
            code = self._codes[draw.material]
            if code is not None and code not in self._compiled:
                missing[code].append(draw)
        waited, end = self.waits, time.perf_counter() + seconds
        for code, draws in list(missing.items()):
            for program in {program for draw in draws for program in self._programs_of(draw, code)}:
                self.device.prepare(program)
            self._compiled.add(code)
            del missing[code]
            if waited:
                self._look_changed(draws)
            if time.perf_counter() > end:
                break
        self.waits, self._unchecked = bool(missing), False
        if waited or self.waits:
            self.batches.forget()
        self._find_passing()
        return waited

    def _programs_of(self, draw: Draw, code: MaterialShader) -> list[Shader]:
        material = self.scene.materials[draw.material]
        passes = material.passing > 0.0
        thin = passes or material.culled_by_lamps
        drawn = (GBUFFER, REFLECT, SHADOW_PASSING) if thin else (GBUFFER, REFLECT)
        return [
            *(material_program(shader, code, passes, self.culls(draw.material, shader)) for shader in drawn),
            material_program(SURFACE_POINT_DRAW, code),
        ]

    def _look_changed(self, draws: list[Draw]) -> None:
        """Have light maps that see them drawn anew."""
        self.revision += 1
        boxes = np.array([draw.bounds for draw in draws])
        self._moved.append((self.revision, boxes, boxes))
        del self._moved[:-REMEMBERED_MOVES]

    def _find_passing(self) -> None:
        thin = [draw for draw in self.draws if self.lets_pass(draw.material)]
        camera = Visibility.CAMERA | Visibility.HOLDOUT
        self.seen_through = tuple(draw for draw in thin if draw.visibility & camera == Visibility.CAMERA)
        passing = [
            draw.bounds for draw in thin if self.lets_lamps_pass(draw.material) and Visibility.SHADOW in draw.visibility
        ]
        self.passing_boxes = np.array(passing).reshape(-1, 2, 3)
        materials = self.scene.materials
        self._has_thin = bool(passing) or any(materials[draw.material].culled_by_lamps for draw in self.draws)

    def lets_lamps_pass(self, material: int) -> bool:
        """Whether lamps light what is behind a material: Blender's Transparent Shadows."""
        return self.lets_pass(material) and self.scene.materials[material].passes_lamps

    def culls(self, material: int, shader: Shader) -> bool:
        """Whether a pass draws nothing of the backs of a material's faces: as its camera or its lamp sees them."""
        of_camera = ("MATERIAL_CAMERA_RAY", "1") in shader.defines
        found = self.scene.materials[material]
        return found.culled if of_camera else found.culled_by_lamps

    def material_inputs(self, program: Shader) -> dict[str, Any]:
        """What a program of ``material_program`` wants to know of all materials."""
        given: dict[str, Any] = {"material_tx": self.material_table}
        if "value_tx" in program.samplers:
            given["value_tx"] = self.value_table
        if "material_view" in program.uniforms:
            given["material_view"] = self._view
        return given

    def image_inputs(self, material: int) -> dict[str, Texture]:
        """The images that such a program wants of a material."""
        graph = self.scene.materials[material].graph
        if graph is None or self.code_of(material) is None:
            return {}
        return {f"image_{k}_tx": self._images[key] for k, key in enumerate(graph.images)}

    def attribute_inputs(self, material: int, page: Page) -> dict[str, Texture]:
        """What it wants of a page of meshes."""
        code = self.code_of(material)
        fields = {} if code is None else code.mesh_fields
        return {attribute_sampler(name): page.attributes[attribute] for name, attribute in fields.items()}

    def own_inputs(self, material: int) -> dict[str, Any]:
        """What a program that draws no meshes wants to know of its one material."""
        given: dict[str, Any] = {"pc_material": material, **self.image_inputs(material)}
        if self.code_of(material) is not None:
            given["pc_values"] = self._first_values[material]
        return given

    def visible(self, visibility: Visibility) -> tuple[tuple[Draw, ...], np.ndarray]:
        """The draws that take part in any of ``visibility``, and their bounds (n, 2, 3)."""
        wanted = visibility.value  # plain numbers: flags are ten times as slow
        if wanted not in self._visible:
            found = tuple([draw for draw in self.draws if draw.visibility.value & wanted])
            self._visible[wanted] = found, np.array([draw.bounds for draw in found]).reshape(-1, 2, 3)
        return self._visible[wanted]

    def divided(self, draws: Sequence[Draw]) -> tuple[Sequence[Draw], Sequence[Draw]]:
        """Those of ``draws`` that stop all light of lamps, and those that let some of it pass or on one side all."""
        if not self._has_thin:
            return draws, ()
        materials = self.scene.materials
        worn = {draw.material for draw in draws}
        passes = {index: self.lets_lamps_pass(index) or materials[index].culled_by_lamps for index in worn}
        return [d for d in draws if not passes[d.material]], [d for d in draws if passes[d.material]]

    @property
    def triangle_count(self) -> int:
        return sum(draw.triangle_count * draw.instance_count for draw in self.draws)

    def free(self) -> None:
        tables = self.instance_table, self.material_table, self.value_table
        for resource in (*self._images.values(), *tables):
            self.device.free(resource)
        self.environment.free()
        self._meshes.free()
        self.batches.forget()
        self._images.clear()
        self.instance_table = self.material_table = self.value_table = None
        self._show(())

    def _show(self, draws: tuple[Draw, ...]) -> None:
        self.draws, self._visible = draws, {}

    def _upload_image(self, image: Image) -> Texture:
        self.uploads["images"] += 1
        height, width = image.pixels.shape[:2]
        if image.pixels.dtype == np.uint8:
            return self.device.texture((width, height), "RGBA8", image.pixels)
        pixels = np.ascontiguousarray(image.pixels, np.float32)
        largest = pixels.max(initial=0.0)  # a panorama's sun may be brighter than half floats can be
        return self.device.texture((width, height), "RGBA16F" if largest < 6e4 else "RGBA32F", pixels)

    def _upload_materials(self, materials: tuple[Material, ...]) -> None:
        self.uploads["materials"] += 1
        self._codes = tuple(None if m.graph is None else generate(m.graph.graph) for m in materials)
        tables = [np.zeros((1, 4), np.float32) if m.graph is None else m.graph.table for m in materials]
        self._first_values = tuple(np.cumsum([0, *map(len, tables)])[:-1].tolist())
        told = [field.name for field in MATERIAL.fields if field.name != "first_value"]
        rows = [
            {name: getattr(material, name) for name in told} | {"first_value": first}
            for material, first in zip(materials, self._first_values, strict=True)
        ]
        self.material_table = replace_table(self.device, MATERIAL.pack(rows), self.material_table)
        texels = np.concatenate([*tables, np.zeros((1, 4), np.float32)])
        self.value_table = replace_texels(self.device, texels, self.value_table)

    def _place(self, scene: Scene) -> None:
        """Upload new meshes and the table of instances, and list the draws."""
        groups: dict[tuple, list[Instance]] = defaultdict(list)
        for instance in scene.instances:
            groups[instance.mesh, instance.materials, instance.visibility].append(instance)
        placed = [instance for members in groups.values() for instance in members]
        boxes = world_boxes(placed, scene)
        held = self._mesh_keys(scene)
        self._meshes.hold({key: scene.meshes[mesh] for mesh, key in held.items()})
        draws: list[Draw] = []
        start = 0
        for (mesh_key, materials, visibility), members in groups.items():
            mesh, end = scene.meshes[mesh_key], start + len(members)
            bounds = np.stack([boxes[start:end, 0].min(0), boxes[start:end, 1].max(0)])
            page, on_page = self._meshes.place(held[mesh_key])
            for slot, first, count in mesh.slots:
                material = materials[min(slot, len(materials) - 1)]
                run = (on_page + first, first, count, start, len(members))
                draws.append(Draw(len(draws), page, *run, material, visibility, bounds, mesh))
            start = end
        self.matrices = np.array([i.world_from_object for i in placed], np.float64).reshape(-1, 4, 4)
        told = [_instance_row(instance, scene.meshes[instance.mesh]) for instance in placed]
        self._told = np.array(told, np.float64).reshape(-1, 13)
        self._upload_instances()
        self._show(tuple(draws))
        self.batches.place(self.draws)
        self._placed = placed
        self.boxes = boxes if placed else np.zeros((1, 2, 3))

    def _move(self, scene: Scene) -> bool:
        """Give what is drawn its new matrices; False, and nothing done, where more than that differs."""
        now = {instance.key: instance for instance in scene.instances}
        placed = [now.get(instance.key) for instance in self._placed]
        moved = [row for row, (old, new) in enumerate(zip(self._placed, placed, strict=True)) if old is not new]
        if len(now) != len(placed) or not moved or not all(_same_draw(self._placed[r], placed[r]) for r in moved):
            return False
        self._placed = [instance for instance in placed if instance is not None]
        of_moved = [self._placed[row] for row in moved]
        self.matrices, self.boxes = self.matrices.copy(), self.boxes.copy()
        self.matrices[moved] = [instance.world_from_object for instance in of_moved]
        self.boxes[moved] = world_boxes(of_moved, scene)
        self._upload_instances()
        self._show(tuple(self._with_new_bounds(draw, moved) for draw in self.draws))
        return True

    def _with_new_bounds(self, draw: Draw, moved: list[int]) -> Draw:
        first, end = draw.first_instance, draw.first_instance + draw.instance_count
        if bisect_left(moved, first) == bisect_left(moved, end):
            return draw
        return replace(draw, bounds=np.stack([self.boxes[first:end, 0].min(0), self.boxes[first:end, 1].max(0)]))

    def _upload_instances(self) -> None:
        self.uploads["instances"] += 1
        told = self._told
        packed = INSTANCE.pack_arrays(
            len(told),
            world_from_object=self.matrices,
            color=told[:, :4],
            texture_origin=told[:, 4:7],
            texture_scale=told[:, 7:10],
            random=told[:, 10],
            index=told[:, 11],
            visibility=told[:, 12].astype(np.int32),
        )
        self.instance_table = replace_table(self.device, packed, self.instance_table)

    def _mesh_keys(self, scene: Scene) -> dict[Hashable, MeshKey]:
        """What each mesh that is placed is held by."""
        asked: dict[Hashable, set[Attribute]] = defaultdict(set)
        for mesh, materials in {(instance.mesh, instance.materials) for instance in scene.instances}:
            codes = [self._codes[material] for material in materials]
            asked[mesh].update(a for code in codes if code is not None for a in code.mesh_fields.values())
        return {mesh: (mesh, frozenset(attributes)) for mesh, attributes in asked.items()}


def _same_draw(a: Instance, b: Instance | None) -> bool:
    if b is None or a.transfer != b.transfer or told(a) != told(b):
        return False
    return (a.mesh, a.materials, a.visibility) == (b.mesh, b.materials, b.visibility)


def _instance_row(instance: Instance, mesh: Mesh) -> tuple[float, ...]:
    """Colour, texture_origin, texture_scale, random, index, visibility."""
    lower, upper = mesh.bounds if mesh.texture_space is None else mesh.texture_space
    scale = 1.0 / np.maximum(upper - lower, 1e-20)
    return (
        *instance.color,
        *lower.tolist(),
        *scale.tolist(),
        instance.random,
        float(instance.index),
        instance.visibility.value,
    )
