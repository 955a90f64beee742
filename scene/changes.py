"""What differs between two scenes: the only thing that decides what is uploaded and which light map is redrawn."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field, fields

import numpy as np

from .data import Array, Instance, Light, Scene, Visibility

# What of an instance's visibility light maps and voxels depend on: its shape, and the look of what it reflects.
SHAPE_FLAGS = Visibility.SHADOW | Visibility.BOUNCE
LOOK_FLAGS = SHAPE_FLAGS | Visibility.NO_INDIRECT


def _no_boxes() -> Array:
    return np.zeros((0, 2, 3), np.float64)


@dataclass(frozen=True, eq=False)
class Changes:
    """The differences from an older scene to a newer one; ``Changes.between`` makes it.

    ``moved_bounds`` has one world-space box (lower, upper corner) for every place where the picture of some instance
    may have changed: where a moved, edited, reassigned or recoloured instance was and where it now is, where an
    added one is, where a removed one was. A light whose map sees none of these boxes keeps its map. ``shape_bounds``
    has those of them where more than materials changed: what a map of mere shapes depends on.
    """

    meshes_added: frozenset[Hashable] = frozenset()
    meshes_removed: frozenset[Hashable] = frozenset()
    images_added: frozenset[Hashable] = frozenset()
    images_removed: frozenset[Hashable] = frozenset()
    instances: bool = False  # an instance was added, removed, moved, hidden, given another mesh, material index or bake
    materials: bool = False  # the material table differs
    lights: frozenset[Hashable] = frozenset()  # lights whose own data changed, added and removed ones included
    world: bool = False
    film: bool = False  # transparency or pixel filter
    moved_bounds: Array = field(default_factory=_no_boxes)  # (n, 2, 3) float64, world space
    shape_bounds: Array = field(default_factory=_no_boxes)

    @property
    def geometry(self) -> bool:
        """True where shapes or their places differ: meshes or instances."""
        return self.instances or bool(self.meshes_added or self.meshes_removed)

    @property
    def images(self) -> bool:
        """True where the set of images differs."""
        return bool(self.images_added or self.images_removed)

    @property
    def any(self) -> bool:
        """True where anything differs: the picture must be started anew."""
        return self.geometry or self.images or self.materials or bool(self.lights) or self.world or self.film

    @classmethod
    def between(cls, old: Scene | None, new: Scene) -> Changes:
        """Compare two scenes; ``old`` None stands for "nothing was there", so everything is new."""
        first = old is None
        before = Scene(materials=()) if old is None else old
        pairs = tuple(_pair_instances(before, new))
        moved_bounds, shape_bounds = _moved_bounds(before, new, pairs)
        return cls(
            meshes_added=frozenset(new.meshes.keys() - before.meshes.keys()),
            meshes_removed=frozenset(before.meshes.keys() - new.meshes.keys()),
            images_added=frozenset(new.images.keys() - before.images.keys()),
            images_removed=frozenset(before.images.keys() - new.images.keys()),
            instances=any(not _same_instance(a, b) for a, b in pairs) or _order(before) != _order(new),
            materials=before.materials != new.materials,
            lights=_changed_lights(before, new),
            world=first or before.world != new.world,
            film=first or before.film_transparent != new.film_transparent or before.filter_width != new.filter_width,
            moved_bounds=moved_bounds,
            shape_bounds=shape_bounds,
        )


def _order(scene: Scene) -> list[Hashable]:
    return [instance.key for instance in scene.instances]


def _pair_instances(old: Scene, new: Scene) -> Iterator[tuple[Instance | None, Instance | None]]:
    """Pair the instances of two scenes by key; the missing partner is None."""
    if len(old.instances) == len(new.instances):  # as nearly always: the same ones in the same order
        pairs = tuple(zip(old.instances, new.instances, strict=True))
        if all(a is b or a.key == b.key for a, b in pairs):
            yield from pairs
            return
    remaining = {instance.key: instance for instance in old.instances}
    for instance in new.instances:
        yield remaining.pop(instance.key, None), instance
    for instance in remaining.values():
        yield instance, None


def _same_instance(a: Instance | None, b: Instance | None) -> bool:
    if a is b:
        return True
    if a is None or b is None:
        return False
    same_look = a.materials == b.materials and a.visibility == b.visibility and a.transfer == b.transfer
    return same_look and told(a) == told(b) and _same_place(a, b)


def _same_place(a: Instance, b: Instance) -> bool:
    if a is b:
        return True
    same_shape = a.mesh == b.mesh and not (a.visibility ^ b.visibility) & SHAPE_FLAGS
    return same_shape and np.array_equal(a.world_from_object, b.world_from_object)


def _changed_lights(old: Scene, new: Scene) -> frozenset[Hashable]:
    before = {light.key: light for light in old.lights}
    after = {light.key: light for light in new.lights}
    changed = {key for key in before.keys() & after.keys() if not _same_light(before[key], after[key])}
    return frozenset(changed | (before.keys() ^ after.keys()))


def _same_light(a: Light, b: Light) -> bool:
    return a is b or all(
        np.array_equal(getattr(a, entry.name), getattr(b, entry.name))
        if entry.name == "world_from_light"
        else getattr(a, entry.name) == getattr(b, entry.name)
        for entry in fields(Light)
    )


def _moved_bounds(
    old: Scene, new: Scene, pairs: tuple[tuple[Instance | None, Instance | None], ...]
) -> tuple[Array, Array]:
    places: tuple[list[Instance], list[Instance]] = [], []
    of_shape: tuple[list[bool], list[bool]] = [], []
    recoloured = _recoloured(old, new)
    for a, b in pairs:
        if a is b and a is not None and recoloured.isdisjoint(a.materials):
            continue
        same_shape = a is not None and b is not None and _same_place(a, b)
        if same_shape and _same_look(a, b, old, new):
            continue
        blocks_otherwise = not same_shape or _lets_pass(a, old) or _lets_pass(b, new)
        for side, instance, scene in ((0, a, old), (1, b, new)):
            if instance is not None and instance.mesh in scene.meshes:
                places[side].append(instance)
                of_shape[side].append(blocks_otherwise)
    moved = np.concatenate([world_boxes(places[0], old), world_boxes(places[1], new)])
    return moved, moved[np.array([*of_shape[0], *of_shape[1]], bool)]


def _recoloured(old: Scene, new: Scene) -> set[int]:
    """The places in both tables of materials whose material differs."""
    if old.materials is new.materials:
        return set()
    both = zip(old.materials, new.materials, strict=False)
    beyond = range(min(len(old.materials), len(new.materials)), max(len(old.materials), len(new.materials)))
    return {index for index, (a, b) in enumerate(both) if a is not b and a != b} | set(beyond)


def _lets_pass(instance: Instance | None, scene: Scene) -> bool:
    """Whether the materials decide what light an instance blocks."""
    worn = [scene.materials[index] for index in instance.materials] if instance is not None else []
    return any(material.passing or material.culled_by_lamps for material in worn)


def _same_look(a: Instance, b: Instance, old: Scene, new: Scene) -> bool:
    """True if both take part in the same light and wear equal materials, whatever their places in the two tables."""
    if (a.visibility ^ b.visibility) & LOOK_FLAGS or told(a) != told(b):
        return False
    if old.materials is new.materials:
        return a.materials == b.materials
    return [old.materials[i] for i in a.materials] == [new.materials[i] for i in b.materials]


def told(instance: Instance) -> tuple:
    """What materials can ask of an instance beside its place."""
    return instance.color, instance.index, instance.random


def world_bounds(instance: Instance, scene: Scene) -> Array:
    """The world-space box of an instance: (2, 3) float64, of its object-space box's eight corners."""
    return world_boxes([instance], scene)[0]


def world_boxes(instances: Sequence[Instance], scene: Scene) -> Array:
    """The same of n instances: (n, 2, 3)."""
    if not instances:
        return _no_boxes()
    bounds = np.array([scene.meshes[instance.mesh].bounds for instance in instances], np.float64)
    matrices = np.array([instance.world_from_object for instance in instances], np.float64)[:, :3]
    center = np.einsum("nij,nj->ni", matrices[..., :3], bounds.mean(axis=1)) + matrices[..., 3]
    half = np.einsum("nij,nj->ni", np.abs(matrices[..., :3]), bounds[:, 1] - bounds[:, 0]) * 0.5
    return np.stack((center - half, center + half), axis=1)
