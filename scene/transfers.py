"""Objects' bakes -> Scene.transfers: reads the file that an object names, or what is packed, and judges if it fits."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Hashable
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy

from ..bake.file import Bake, BakeFileError, read_bake
from ..bake.job import unfit
from ..bake.surfaces import mesh_fingerprint
from .data import BakeState, Instance, Mesh, Scene, Transfer

Found = Transfer | BakeFileError


class TransferReader:
    """Reads the bakes of one scene; files that did not change, and judgements, are taken from the scene before."""

    def __init__(self, previous: Scene, warn: Callable[[str], None]) -> None:
        self._previous = previous
        self._warn = warn
        self._wanted: dict[Hashable, tuple[str, Found]] = {}  # by Instance.key: object's name
        self._shapes: dict[int, str] = {}

    def add(self, obj, key: Hashable) -> None:
        """Take in the object that is the instance ``key``, if it names a bake."""
        own = getattr(obj.original, "rebound", None)
        if own is None or not (own.transfer_image or own.transfer_file):
            return
        try:
            found: Found = self._read(obj.original)
        except BakeFileError as error:
            found = error
        self._wanted[key] = (obj.name, found)

    def finish(self, scene: Scene) -> Scene:
        """The scene with the bakes that fit it; the others are said, and their objects have live light."""
        if not self._wanted and not self._previous.bakes:
            return scene
        as_before = _same_set(self._previous, scene)
        bakes, transfers = {}, {}
        for key, (name, found) in self._wanted.items():
            if isinstance(found, BakeFileError):
                bakes[key] = BakeState(None, str(found))
            else:
                before = self._previous.bakes.get(key) if as_before else None
                if before is None or before.transfer != found.key:
                    before = _judged(found, unfit(found.about, scene, key, self._shape))
                bakes[key], transfers[found.key] = before, found
            if bakes[key].unused:
                self._warn(f"Object '{name}': its baked light transfer is not used: {bakes[key].unused}")
        instances = tuple(_lit(i, bakes.get(i.key)) for i in scene.instances)
        return replace(scene, instances=instances, transfers=transfers, bakes=bakes)

    def _read(self, obj) -> Transfer:
        own = obj.rebound
        if own.transfer_image is not None:
            return self._packed(own.transfer_image)
        path = Path(bpy.path.abspath(own.transfer_file, library=obj.library))
        try:
            facts = path.stat()
        except OSError as error:
            raise BakeFileError(f"the file '{path}' is missing: bake again") from error
        key = (str(path), facts.st_mtime_ns, facts.st_size)
        return self._previous.transfers.get(key) or _transfer(key, read_bake(path))

    def _packed(self, image) -> Transfer:
        if not image.packed_files:
            raise BakeFileError(f"'{image.name}' is not packed any more: bake again")
        packed = image.packed_files[0].packed_file
        key = (image.name, image.session_uid, packed.size)
        before = self._previous.transfers.get(key)
        if before is not None:
            return before
        with tempfile.TemporaryDirectory(prefix="rebound-bake-") as folder:
            path = Path(folder) / "packed.exr"  # the image may be called what no file can be
            path.write_bytes(packed.data)
            return _transfer(key, read_bake(path))

    def _shape(self, mesh: Mesh) -> str:
        """mesh_fingerprint, once for each mesh."""
        if id(mesh) not in self._shapes:
            self._shapes[id(mesh)] = mesh_fingerprint(mesh)
        return self._shapes[id(mesh)]


def _judged(found: Transfer, unused: str) -> BakeState:
    return BakeState(found.key, unused, found.about, sum(array.nbytes for array in found.arrays.values()))


def _transfer(key: Hashable, bake: Bake) -> Transfer:
    return Transfer(key, _plain(bake.about), bake.arrays)


def _plain(value: Any) -> Any:
    """JSON as snapshots take it: tuples for lists."""
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return tuple(_plain(item) for item in value) if isinstance(value, list) else value


def _lit(instance: Instance, bake: BakeState | None) -> Instance:
    transfer = None if bake is None or bake.unused else bake.transfer
    return instance if instance.transfer == transfer else replace(instance, transfer=transfer)


def _same_set(old: Scene, new: Scene) -> bool:
    """True if the same objects stand in the same places with the same looks, so that what fitted still does."""
    if len(old.instances) != len(new.instances) or old.materials != new.materials:
        return False
    return all(_same_one(a, b) for a, b in zip(old.instances, new.instances, strict=True))


def _same_one(a: Instance, b: Instance) -> bool:
    if a is b:
        return True
    same = a.key == b.key and a.mesh == b.mesh and a.materials == b.materials and a.visibility == b.visibility
    return same and a.world_from_object.tobytes() == b.world_from_object.tobytes()
