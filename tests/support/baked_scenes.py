"""Scenes whose objects are baked as they are rendered: without files and worker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rebound.bake.job import BakeSettings, bake_objects
from rebound.bake.transfer import finish
from rebound.scene.data import Scene, Transfer


def baked(scene: Scene, settings: BakeSettings, keys: Sequence | None = None) -> Scene:
    """The scene with bakes of the objects ``keys``, of all by default."""
    keys = [instance.key for instance in scene.instances] if keys is None else list(keys)
    bakes = finish(bake_objects(scene, keys, settings))
    states = {key: (key, hash(b"".join(a.tobytes() for a in bake.arrays.values()))) for key, bake in bakes.items()}
    transfers = {states[key]: Transfer(states[key], bake.about, bake.arrays) for key, bake in bakes.items()}
    instances = tuple(replace(i, transfer=states.get(i.key)) for i in scene.instances)
    return replace(scene, instances=instances, transfers=transfers)
