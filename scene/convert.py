"""Depsgraph -> Scene: the only door from Blender's data into Rebound's."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from .cameras import FARTHEST, camera_warnings
from .data import Array, Instance, Light, Mesh, Scene, Visibility
from .hair import HairReader, has_strands
from .images import ImageReader, OnMainThread
from .lights import read_light
from .materials import MaterialTable
from .meshes import content_key, mesh_key, read_mesh
from .random_ids import object_random
from .transfers import TransferReader
from .world import read_world

# Not among them: grease pencil, which Blender itself draws over any engine's picture.
UNSHOWN_TYPES = {"VOLUME": "volumes"}
SHOWN_TYPES = {"MESH", "LIGHT", "CURVES", "POINTCLOUD"}


def _receives_bounce(obj) -> bool:
    """Rebound's own setting of an object; all receive where there is none, as it is not enabled."""
    own = getattr(obj, "rebound", None)
    return own is None or bool(own.receive_bounce)


def _says(layer_collection, name: str) -> bool:
    """Whether a collection of a view layer, or one in it, has this switch on."""
    return getattr(layer_collection, name) or any(_says(child, name) for child in layer_collection.children)


@cache
def _visibility(camera: bool, shadow: bool, bounce: bool, holdout: bool, receives: bool) -> Visibility:
    flags = Visibility(0)
    for wanted, flag in ((camera, Visibility.CAMERA), (shadow, Visibility.SHADOW), (bounce, Visibility.BOUNCE)):
        flags |= flag if wanted else Visibility(0)
    if holdout and camera:
        flags |= Visibility.HOLDOUT
    if flags and not receives:
        flags |= Visibility.NO_INDIRECT
    return flags


NO_NUMBER = 0x7FFFFFFF  # in an instance's persistent_id, behind those it has


def is_own_surface(key: Hashable, uid: int) -> bool:
    """Whether Instance.key is that of the object with this session uid itself, and not of another's instance of it.

    A curve, text, surface or metaball comes as the first instance of its evaluated mesh.
    """
    return key == (uid,) or key == (uid, uid, 0, *(NO_NUMBER,) * 7)


def here(call: Callable[[], object]) -> object:
    """For ``on_main_thread``, on the main thread."""
    return call()


def convert_scene(
    depsgraph,
    *,
    for_viewport: bool,
    previous: Scene | None = None,
    visible: Callable[[object], bool] | None = None,
    on_main_thread: OnMainThread = here,
) -> Scene:
    """Read everything that a frame needs from an evaluated depsgraph.

    ``previous`` is an older scene of the same session: meshes and images whose key did not change are taken from it,
    as the same objects. ``visible`` is asked about each original object (the instancer, for an instance) and hides
    what it declines; a viewport passes its local view there. ``on_main_thread`` runs a call on Blender's main thread
    and returns its result: needed where this runs on another one, since a sequence's frames are read through
    data-blocks. What cannot be read stands in Scene.warnings; nothing is raised for it.
    """
    reader = SceneReader(depsgraph, for_viewport, previous or Scene(), visible, on_main_thread)
    reader.add_all()
    return reader.scene()


def instance_matrices(depsgraph, count: int) -> Array:
    """World matrices of all ``count`` of depsgraph.object_instances, (n, 4, 4) float32, quicker than one by one."""
    columns = np.empty(16 * count, np.float32)
    depsgraph.object_instances.foreach_get("matrix_world", columns)
    return columns.reshape(-1, 4, 4).transpose(0, 2, 1)


class SceneReader:
    """Collects one scene while the depsgraph's instances go by; nothing of Blender's is kept past one of them.

    ``rows`` tells of each item of depsgraph.object_instances what became of it: numbers of its Instances (itself, its
    hair), ~number of its Light, or nothing.
    """

    def __init__(
        self,
        depsgraph,
        for_viewport: bool,
        previous: Scene,
        visible: Callable[[object], bool] | None = None,
        on_main_thread: OnMainThread = here,
        known: Mapping[Hashable, Mesh] | None = None,
    ) -> None:
        self.depsgraph = depsgraph
        self.for_viewport = for_viewport
        self.view_layer = depsgraph.view_layer_eval
        self.previous = previous
        self.visible = visible
        self.warnings: dict[str, None] = {}  # an ordered set: each line once
        self.images = ImageReader(previous.images, self.warn, on_main_thread)
        self.materials = MaterialTable(self.images, self.warn)
        self.hair = HairReader(previous.meshes)
        self.transfers = TransferReader(previous, self.warn)
        self.read: dict[Hashable, Mesh] = {}  # some have no triangles
        self.known = known or {}  # what meshes were when they were read last, by mesh_key
        self.states: dict[tuple, Mesh] = {}  # the same for the next time
        self.read_by_uid: dict[tuple, Mesh] = {}  # those of evaluated data-blocks, which many instances share
        self.instances: list[Instance] = []
        self.lights: list[Light] = []
        self.keys: set[Hashable] = set()
        self.rows: list[tuple[int, ...]] = []
        self.instancers: set[int] = set()  # session uids of the original objects that place others
        self.is_whole = True  # False if something was left out because of its transform
        self.before = {instance.key: instance for instance in previous.instances}
        # Asked of every object only where some collection says so: a third of the time of reading an object.
        self.layers_hold_out = _says(self.view_layer.layer_collection, "holdout")
        self.layers_hide = _says(self.view_layer.layer_collection, "indirect_only")

    def warn(self, line: str) -> None:
        self.warnings[line] = None

    def add_all(self) -> None:
        """Take in all of depsgraph.object_instances."""
        matrices = instance_matrices(self.depsgraph, len(self.depsgraph.object_instances)).astype(np.float64)
        fine = np.abs(matrices).max((1, 2), initial=0.0) < FARTHEST  # false for NaN
        for row, instance in enumerate(self.depsgraph.object_instances):
            self.rows.append(())
            if instance.show_self or instance.show_particles:
                self.add(instance, row, matrices[row], bool(fine[row]))

    def add(self, instance, row: int, matrix: Array, is_finite: bool) -> None:
        """Take in one item of depsgraph.object_instances."""
        obj = instance.object
        kind = obj.type
        # A curve, text, surface or metaball comes a second time, as an instance of its evaluated mesh.
        if kind not in SHOWN_TYPES:
            if kind in UNSHOWN_TYPES:
                self.warn(f"Object '{obj.name}': {UNSHOWN_TYPES[kind]} are not supported; it is left out")
            return
        parent = instance.parent if instance.is_instance else obj
        if self.visible is not None and not self.visible(parent.original):
            return
        if not is_finite:
            self.is_whole = False
            self.warn(f"Object '{obj.name}': its transform is not finite or too large; it is left out")
            return
        key = self._unique_key(instance, obj, parent)
        if kind == "LIGHT":
            light = self.light(obj, parent, matrix, key)
            if light is None:
                self.is_whole = False
            else:
                self.rows[row] = (~len(self.lights),)
                self.lights.append(light)
            return
        visibility = self.visibility(obj, parent)
        worn = self._worn(obj) if visibility else ()
        for number, mesh in self._meshes(instance, obj, worn) if visibility else ():
            own_key = (*key, "hair", number) if number else key
            made = self._placed(instance, matrix, own_key, mesh, worn, visibility)
            if made is None:
                continue
            self.rows[row] += (len(self.instances),)
            self.instances.append(made)
            if obj.is_shadow_catcher or parent.is_shadow_catcher:
                line = "shadow catchers are not supported yet; it is shown as any other object"
                self.warn(f"Object '{obj.name}': {line}")

    def light(self, obj, parent, matrix: Array, key: Hashable) -> Light | None:
        """A light object read, None where it gives no light."""
        lights = {
            "diffuse": obj.visible_diffuse and parent.visible_diffuse,
            "glossy": obj.visible_glossy and parent.visible_glossy,
        }
        return read_light(obj, matrix, key, lights, self.warn)

    def _meshes(self, instance, obj, worn: tuple[int, ...]) -> Iterator[tuple[int, Mesh]]:
        """The meshes of an object: its own as number 0, from 1 on the hair that its particle systems grow."""
        if instance.show_self:
            yield 0, self._mesh(obj, self.materials.asked(worn)[0])
        if obj.type != "MESH" or not obj.particle_systems or not instance.show_particles:
            return
        for number, system in enumerate(obj.particle_systems, 1):
            if has_strands(system):
                state = (mesh_key(obj.data), number)
                mesh = self.known.get(state) or self.hair.particles(obj, system, for_viewport=self.for_viewport)
                self.states[state] = self._used(mesh)
                yield number, mesh

    def _placed(
        self, instance, matrix: Array, key: Hashable, mesh: Mesh, worn: tuple[int, ...], visibility: Visibility
    ) -> Instance | None:
        """A mesh's instance: the previous scene's where nothing of it changed, so that it is known to be so."""
        if mesh.triangle_count == 0:
            return None
        obj = instance.object
        slots = worn + worn[-1:] * max(mesh.slots[-1][0] + 1 - len(worn), 0)
        if is_own_surface(key, obj.original.session_uid):
            self.transfers.add(obj, key)
        told: dict = {}
        if self.materials.asked(worn)[1]:
            told = {"color": tuple(obj.color), "index": obj.pass_index, "random": object_random(instance)}
        old = self.before.get(key)
        same = old is not None and old.mesh == mesh.key and old.materials == slots and old.visibility is visibility
        same = same and all(getattr(old, name) == value for name, value in told.items())
        if old is not None and same and old.world_from_object.tobytes() == matrix.tobytes():
            return old
        return Instance(key, mesh.key, slots, matrix.copy(), visibility, **told)

    def _mesh(self, obj, wanted: tuple[str, ...]) -> Mesh:
        """The mesh of an object: one met before, one of the previous scene, or read now."""
        if obj.type != "MESH":
            return self._used(self.hair.read(obj, self.warn))
        data = obj.data
        uid = data.session_uid
        if (uid, wanted) in self.read_by_uid:
            return self.read_by_uid[uid, wanted]
        if not data.is_editmode:
            state = mesh_key(data, wanted)
            mesh = self._used(self.known[state]) if state in self.known else self._of_content(obj, data, wanted)
            self.read_by_uid[uid, wanted] = self.states[state] = mesh
            return mesh
        # In edit mode the arrays are BMesh's: a temporary mesh holds them for us, and only its content names it.
        mesh = obj.to_mesh()
        try:
            return self._of_content(obj, mesh, wanted)
        finally:
            obj.to_mesh_clear()

    def _of_content(self, obj, data, wanted: tuple[str, ...]) -> Mesh:
        """A mesh that looks so: Blender evaluates many anew that come out as they were, after undo all of them."""
        key = content_key(data, wanted)
        known = self.read.get(key) or self.previous.meshes.get(key)
        return self._used(known or read_mesh(data, key, obj.name, wanted))

    def _used(self, mesh: Mesh) -> Mesh:
        if mesh.key not in self.read:
            self.read[mesh.key] = mesh
            for line in mesh.warnings:
                self.warn(line)
        return mesh

    def _worn(self, obj) -> tuple[int, ...]:
        """Material indices by slot, at least one; what lies beyond the slots wears the last."""
        override = self.view_layer.material_override
        if override is not None:
            return (self.materials.index(override),)
        return tuple(self.materials.index(slot.material) for slot in obj.material_slots) or (0,)

    def visibility(self, obj, parent) -> Visibility:
        """What an object takes part in; an instance needs its instancer's leave as well, as in Cycles."""
        camera, shadow, bounce = obj.visible_camera, obj.visible_shadow, obj.visible_diffuse
        holdout, receives = obj.is_holdout, _receives_bounce(obj)
        if parent is not obj:
            camera, shadow = camera and parent.visible_camera, shadow and parent.visible_shadow
            bounce, receives = bounce and parent.visible_diffuse, receives and _receives_bounce(parent)
        if self.layers_hold_out and not holdout:
            holdout = parent.holdout_get(view_layer=self.view_layer)
        if self.layers_hide and not holdout and parent.indirect_only_get(view_layer=self.view_layer):
            camera = False
        return _visibility(camera, shadow, bounce, holdout, receives)

    def _unique_key(self, instance, obj, parent) -> tuple:
        """A key that stays while objects are moved and edited: who places whom, and the place's number."""
        key: tuple = (parent.original.session_uid,)
        if instance.is_instance:
            self.instancers.add(key[0])
            key = (*key, obj.original.session_uid, *instance.persistent_id)
        while key in self.keys:
            key = (*key, -1)
        self.keys.add(key)
        return key

    def _warn_of_unread_settings(self, scene) -> None:
        """Lines for what a final render would show and this one does not."""
        if scene.camera is not None and scene.camera.type == "CAMERA":
            for line in camera_warnings(scene.camera):
                self.warn(line)
        if scene.render.use_motion_blur:
            self.warn("Motion blur is not shown yet; everything stands still")

    def scene(self) -> Scene:
        """The finished scene."""
        scene = self.depsgraph.scene_eval
        if not self.for_viewport:
            self._warn_of_unread_settings(scene)
        world = read_world(getattr(self.view_layer, "world_override", None) or scene.world, self.images, self.warn)
        found = Scene(
            meshes={key: mesh for key, mesh in self.read.items() if mesh.triangle_count},
            instances=tuple(self.instances),
            materials=self.materials.finish(),
            images=self.images.images,
            lights=tuple(self.lights),
            world=world,
            film_transparent=bool(scene.render.film_transparent),
            filter_width=float(scene.render.filter_size),
        )
        found = self.transfers.finish(found)
        return replace(found, warnings=tuple(self.warnings))
