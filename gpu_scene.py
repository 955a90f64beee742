"""The scene on the GPU: uploads what ``Changes`` names, and keeps the list of draws."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Hashable
from dataclasses import dataclass, replace

import numpy as np

from .device.interface import Device, Texture, Vertices
from .gpu_shaders.frame.environment import Environment
from .gpu_shaders.frame.structs import IMAGE_CLOSEST, IMAGE_EXTEND, INSTANCE, MATERIAL
from .gpu_shaders.frame.tables import replace_table
from .scene.changes import Changes, world_boxes
from .scene.data import Image, Instance, Material, Mesh, Scene, Visibility
from .scene.data import Texture as ImageLookup

# Updates whose moved boxes are kept. A light map that was not looked at for longer is drawn again.
REMEMBERED_MOVES = 64

UvMaps = tuple[str, str]  # the maps that the base colour's and the emission's texture use


@dataclass(frozen=True, eq=False)
class Draw:
    """One draw call: a run of triangles of one mesh with one material, for a run of instances."""

    vertices: Vertices
    first_vertex: int
    vertex_count: int
    first_instance: int
    instance_count: int
    material: int
    visibility: Visibility
    bounds: np.ndarray  # (2, 3) float64: of all its instances, world space
    mesh: Mesh
    uv_maps: UvMaps


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
        self._meshes: dict[tuple[Hashable, UvMaps], Vertices] = {}
        self._images: dict[Hashable, Texture] = {}
        self.environment = Environment(device)
        self.white = device.texture((1, 1), "RGBA16F", np.ones((1, 1, 4), np.float32))
        self.instance_table: Texture | None = None
        self.material_table: Texture | None = None

    def update(self, scene: Scene, changes: Changes) -> None:
        """Make the GPU hold ``scene``; only what ``changes`` names is uploaded."""
        maps_before = _material_uv_maps(self.scene)
        self.scene = scene
        if changes.any:
            self.revision += 1
        for key in changes.images_removed:
            self.device.free(self._images.pop(key))
        for key in changes.images_added:
            self._images[key] = self._upload_image(scene.images[key])
        self.environment.update(scene.world, self._images)
        if self.environment.suns:
            self.scene = replace(scene, lights=(*scene.lights, *self.environment.suns))
        if changes.materials or self.material_table is None:
            self._upload_materials(scene.materials)
        same_draws = self.instance_table is not None and maps_before == _material_uv_maps(scene)
        only_instances = same_draws and not (changes.materials or changes.meshes_added or changes.meshes_removed)
        if (changes.geometry or not same_draws) and not (only_instances and self._move(scene)):
            self._place(scene)
        drawn = [scene.materials[index] for index in {draw.material for draw in self.draws}]
        self.is_glossy = any(material.is_glossy for material in drawn)
        self.emits = any(any(material.emission) for material in drawn)
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

    def textures_of(self, material: int) -> dict[str, Texture]:
        """The two samplers of a draw with this material."""
        m = self.scene.materials[material]
        return {"base_tx": self._image(m.base_color_texture), "emission_tx": self._image(m.emission_texture)}

    @property
    def triangle_count(self) -> int:
        return sum(draw.vertex_count // 3 * draw.instance_count for draw in self.draws)

    def free(self) -> None:
        for resource in (*self._meshes.values(), *self._images.values(), self.white):
            self.device.free(resource)
        for table in (self.instance_table, self.material_table):
            if table is not None:
                self.device.free(table)
        self.environment.free()
        self._meshes.clear()
        self._images.clear()
        self.instance_table = self.material_table = None
        self.draws = ()

    def _image(self, lookup: ImageLookup | None) -> Texture:
        return self.white if lookup is None else self._images.get(lookup.image, self.white)

    def _upload_image(self, image: Image) -> Texture:
        self.uploads["images"] += 1
        height, width = image.pixels.shape[:2]
        pixels = np.ascontiguousarray(image.pixels, np.float32)
        largest = pixels.max(initial=0.0)  # a panorama's sun may be brighter than half floats can be
        return self.device.texture((width, height), "RGBA16F" if largest < 6e4 else "RGBA32F", pixels)

    def _upload_materials(self, materials: tuple[Material, ...]) -> None:
        self.uploads["materials"] += 1
        rows = [
            {
                "base_color": m.base_color,
                "base_mode": _image_mode(m.base_color_texture),
                "emission": m.emission,
                "emission_mode": _image_mode(m.emission_texture),
                "specular": m.specular,
                "metallic": m.metallic,
                "roughness": m.roughness,
                "layered": m.layered,
            }
            for m in materials
        ]
        self.material_table = replace_table(self.device, MATERIAL.pack(rows), self.material_table)

    def _place(self, scene: Scene) -> None:
        """Upload new meshes and the table of instances, and list the draws."""
        groups: dict[tuple, list[Instance]] = defaultdict(list)
        for instance in scene.instances:
            groups[instance.mesh, instance.materials, instance.visibility].append(instance)
        placed = [instance for members in groups.values() for instance in members]
        boxes = world_boxes(placed, scene)
        draws, wanted, start = [], set(), 0
        for (mesh_key, materials, visibility), members in groups.items():
            mesh, end = scene.meshes[mesh_key], start + len(members)
            bounds = np.stack([boxes[start:end, 0].min(0), boxes[start:end, 1].max(0)])
            for slot, first, count in mesh.slots:
                material = materials[min(slot, len(materials) - 1)]
                maps = _uv_maps(scene.materials[material], mesh)
                wanted.add((mesh_key, maps))
                vertices = self._vertices(mesh, maps)
                place = (3 * first, 3 * count, start, len(members), material, visibility, bounds)
                draws.append(Draw(vertices, *place, mesh, maps))
            start = end
        for key in self._meshes.keys() - wanted:
            self.device.free(self._meshes.pop(key))
        self.matrices = np.array([i.world_from_object for i in placed], np.float64).reshape(-1, 4, 4)
        self._upload_instances()
        self.draws, self._placed = tuple(draws), placed
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
        self.draws = tuple(self._with_new_bounds(draw, moved) for draw in self.draws)
        return True

    def _with_new_bounds(self, draw: Draw, moved: list[int]) -> Draw:
        first, end = draw.first_instance, draw.first_instance + draw.instance_count
        if bisect_left(moved, first) == bisect_left(moved, end):
            return draw
        return replace(draw, bounds=np.stack([self.boxes[first:end, 0].min(0), self.boxes[first:end, 1].max(0)]))

    def _upload_instances(self) -> None:
        self.uploads["instances"] += 1
        packed = INSTANCE.pack_arrays(len(self.matrices), world_from_object=self.matrices)
        self.instance_table = replace_table(self.device, packed, self.instance_table)

    def _vertices(self, mesh: Mesh, maps: UvMaps) -> Vertices:
        key = (mesh.key, maps)
        if key not in self._meshes:
            self.uploads["meshes"] += 1
            none = np.zeros((len(mesh.positions), 2), np.float32)
            self._meshes[key] = self.device.vertices(
                {
                    "in_position": mesh.positions,
                    "in_normal": mesh.normals,
                    "in_base_uv": mesh.uvs.get(maps[0], none),
                    "in_emission_uv": mesh.uvs.get(maps[1], none),
                }
            )
        return self._meshes[key]


def _same_draw(a: Instance, b: Instance | None) -> bool:
    if b is None or a.transfer != b.transfer:
        return False
    return (a.mesh, a.materials, a.visibility) == (b.mesh, b.materials, b.visibility)


def _image_mode(lookup: ImageLookup | None) -> int:
    return -1 if lookup is None else IMAGE_CLOSEST * lookup.closest + IMAGE_EXTEND * (not lookup.repeat)


def _uv_maps(material: Material, mesh: Mesh) -> UvMaps:
    """The maps by name; "" where the material has no texture, so that its meshes are kept once."""
    lookups = (material.base_color_texture, material.emission_texture)
    return tuple("" if t is None else t.uv_map or mesh.active_uv for t in lookups)  # type: ignore[return-value]


def _material_uv_maps(scene: Scene) -> list[tuple[str | None, ...]]:
    """All of the materials that decides how meshes are laid out for the GPU."""
    lookups = ((m.base_color_texture, m.emission_texture) for m in scene.materials)
    return [tuple(None if t is None else t.uv_map for t in pair) for pair in lookups]
