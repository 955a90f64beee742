"""A depsgraph read again after every edit; where nothing but transforms changed, only matrices are read.

Not where objects are baked: whether a bake still fits is for a whole reading to say.

A scene of 10,000 objects takes a tenth of a second to read, which is too long for each step of dragging one of them.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .cameras import FARTHEST
from .convert import SceneReader, here, instance_matrices
from .data import Array, Instance, Light, Mesh, Scene
from .images import OnMainThread
from .meshes import mesh_key


@dataclass(frozen=True, eq=False)
class _Read:
    """What is remembered of the depsgraph's items when they were read."""

    place: tuple  # which scene, view layer and frame
    rows: tuple[tuple[int, ...], ...]  # SceneReader.rows
    matrices: Array  # (n, 4, 4) float32
    ids: Array  # (n,) int32: hashes of what each item is
    instancers: frozenset[int]  # session uids of the objects that place others
    shows: Hashable  # what else decides what is seen


class SceneFollower:
    """The scene of one depsgraph as of its last update."""

    def __init__(self) -> None:
        self.scene = Scene()
        self._read: _Read | None = None
        self._known: dict[tuple, Mesh] = {}  # by meshes.mesh_key
        self._states: set[tuple[tuple, Hashable]] = set()  # the same without what materials ask for, and Mesh.key

    def read(
        self,
        depsgraph,
        *,
        for_viewport: bool,
        visible: Callable[[object], bool] | None = None,
        shows: Hashable = (),
        on_main_thread: OnMainThread = here,
    ) -> Scene:
        """As ``convert_scene``, whose ``previous`` is the scene read last. To be called for every update there is.

        ``shows`` is all that ``visible`` goes by beside what updates tell of; None where that cannot be said.
        """
        before, self._read = self._read, None
        if before and (shows is None or shows != before.shows):
            before = None
        moved = _moved_objects(depsgraph, before) if before and for_viewport and not self.scene.bakes else None
        found = self._with_new_places(before, moved, depsgraph) if before and moved else None
        if found is not None:
            self.scene, self._read = found
            return self.scene
        reader = SceneReader(depsgraph, for_viewport, self.scene, visible, on_main_thread, self._known)
        reader.add_all()
        self.scene, self._known = reader.scene(), reader.states
        self._states = {(state[:3], mesh.key) for state, mesh in reader.states.items()}
        if for_viewport and reader.is_whole and shows is not None:
            ids, matrices = _item_ids(depsgraph, len(reader.rows)), instance_matrices(depsgraph, len(reader.rows))
            rows, instancers = tuple(reader.rows), frozenset(reader.instancers)
            self._read = _Read(_place(depsgraph), rows, matrices, ids, instancers, shows)
        return self.scene

    def _with_new_places(self, before: _Read, moved: Mapping[int, Any], depsgraph) -> tuple[Scene, _Read] | None:
        """The scene with the matrices that the depsgraph has now; None where it must be read as a whole."""
        scene, count = self.scene, len(depsgraph.object_instances)
        if count != len(before.rows) or not np.array_equal(_item_ids(depsgraph, count), before.ids):
            return None
        matrices = instance_matrices(depsgraph, count)
        changed = np.flatnonzero((matrices != before.matrices).any((1, 2)))
        if not np.abs(matrices[changed]).max(initial=0.0) < FARTHEST:
            return None
        reader = SceneReader(depsgraph, True, Scene())
        instances, lights = list(scene.instances), list(scene.lights)
        for row in changed:
            matrix = matrices[row].astype(np.float64)
            for number in before.rows[row]:
                if number >= 0:
                    instances[number] = replace(instances[number], world_from_object=matrix)
                    continue
                light = _moved_light(reader, lights[~number], matrix, moved)
                if light is None:
                    return None
                lights[~number] = light
        for instance in scene.instances:
            obj = moved.get(instance.key[0]) if len(instance.key) == 1 else None  # type: ignore[index, arg-type]
            if obj is not None and not self._is_as_before(reader, obj, instance):
                return None
        if reader.warnings:
            return None
        now = replace(scene, instances=tuple(instances), lights=tuple(lights)) if len(changed) else scene
        return now, replace(before, matrices=matrices)

    def _is_as_before(self, reader: SceneReader, obj, instance: Instance) -> bool:
        """Whether an object is all that it was but for its place: a script can change more in one go."""
        known = obj.type == "MESH" and (mesh_key(obj.data), instance.mesh) in self._states
        return known and reader.visibility(obj, obj) is instance.visibility


def _place(depsgraph) -> tuple:
    scene = depsgraph.scene
    return scene.session_uid, depsgraph.view_layer.name, scene.frame_current, scene.frame_subframe


def _item_ids(depsgraph, count: int) -> Array:
    ids = np.empty(count, np.int32)
    depsgraph.object_instances.foreach_get("random_id", ids)
    return ids


def _moved_objects(depsgraph, before: _Read) -> Mapping[int, Any] | None:
    """The evaluated objects that moved, by session uid, if an update says that nothing else happened.

    After undo, and wherever Blender does not know, it lists more, or nothing at all.
    """
    if _place(depsgraph) != before.place:
        return None
    moved = {}
    for update in depsgraph.updates:
        only_moved = update.is_updated_transform and not (update.is_updated_geometry or update.is_updated_shading)
        if update.id.id_type != "OBJECT" or not only_moved:
            return None
        uid = update.id.original.session_uid
        if uid in before.instancers or update.id.is_instancer:
            return None
        moved[uid] = update.id
    return moved or None


def _moved_light(reader: SceneReader, light: Light, matrix: Array, moved: Mapping[int, Any]) -> Light | None:
    obj = moved.get(light.key[0]) if len(light.key) == 1 else None  # type: ignore[index, arg-type]
    return reader.light(obj, obj, matrix, light.key) if obj is not None else None
