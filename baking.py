"""Baking light transfer of Blender's objects: what the operator, the command line and scripts have in common.

``bake(objects)`` is the Python function. What is baked is worked out in a process of its own (bake/process.py); the
objects get the path of their file, or an image that packs it, when all of it is done.
"""

from __future__ import annotations

import logging
import shutil
import tempfile
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .bake.job import BakeSettings, Kind
from .bake.process import BakeProcess, Outcome
from .bake.surfaces import is_mirror, mesh_vertices
from .bake.view_table import ggx, least_roughness
from .bake_settings import BAKE_SETTINGS
from .scene.changes import world_bounds
from .scene.convert import convert_scene, is_own_surface
from .scene.data import BakeState, Instance, Scene
from .scene.errors import SceneError

LOGGER = logging.getLogger("rebound")

SUFFIX = ".transfer.exr"
# A triangle of more than two parts in so many of the scene's size is large.
COARSE = 8.0


@dataclass(frozen=True)
class _Target:
    """One object of a bake."""

    uid: int  # the object's: it may be renamed, or be gone, until the bake is done
    name: str
    file: Path


class TransferBake:
    """A bake under way. ``step`` it until it says how it ended, then ``close`` it; to close it earlier cancels."""

    def __init__(
        self, depsgraph, objects: Iterable, settings: BakeSettings, *, pack: bool, blend: Path | None = None
    ) -> None:
        """``blend``: what the file is to be saved as, by default as it is called.

        Raises SceneError where an object cannot be baked, or files have no place; OSError.
        """
        self._blend = blend or (Path(bpy.data.filepath) if bpy.data.filepath else None)
        self.pack = pack
        self.warnings: list[str] = []
        self._folder = Path(tempfile.mkdtemp(prefix="rebound-packed-")) if pack else _folder_beside(self._blend)
        try:
            scene = convert_scene(depsgraph, for_viewport=True)
            files = self._assign(scene, list(objects), settings)
            self.process = BakeProcess(scene, files, settings)
        except BaseException:
            self._clean()
            raise

    @property
    def names(self) -> list[str]:
        """Of the objects, as they were called at the start."""
        return [target.name for target in self._targets]

    @property
    def line(self) -> str:
        """How far it is, for people."""
        left = self.process.seconds_left
        time_left = f", {_duration(left)} left" if left is not None else ""
        return f"{self.process.part:.0%}, {self.process.doing}{time_left}"

    def step(self) -> Outcome | None:
        """Look after it; once it is done the objects have their bakes. Raises SceneError where it failed."""
        outcome = self.process.poll()
        if outcome is Outcome.FAILED:
            raise SceneError(f"The bake failed, bakes of before are as they were: {self.process.error}")
        if outcome is Outcome.DONE:
            self._hand_over()
        return outcome

    def close(self) -> None:
        """End it, and clean up. Harmless when repeated."""
        self.process.close()
        self._clean()

    def _assign(self, scene, objects: Sequence, settings: BakeSettings) -> dict[Hashable, Path]:
        """Which file each object's instance goes to. Warns of what the bake will not show."""
        if not objects:
            raise SceneError("No object to bake: select some that have a surface")
        self._targets: list[_Target] = []
        files: dict[Hashable, Path] = {}
        for obj in objects:
            uid = obj.session_uid
            instance = next((i for i in scene.instances if is_own_surface(i.key, uid)), None)
            if instance is None:
                raise SceneError(f"Object '{obj.name}' has no surface that is shown: leave it out of the bake")
            if obj.library is not None and obj.override_library is None:
                raise SceneError(f"Object '{obj.name}' is linked from another file: bake it there, or override it")
            target = _Target(uid, obj.name, self._folder / _file_name(obj.name, {t.file.name for t in self._targets}))
            self._targets.append(target)
            files[instance.key] = target.file
            self.warnings += _not_shown(obj.name, scene, instance, settings)
        if not self.pack:
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise SceneError(
                    f"No folder for bakes can be made at '{self._folder}' ({error.strerror}): save the .blend where "
                    "there can be one, or turn on Pack"
                ) from None
        return files

    def _hand_over(self) -> None:
        by_uid: dict[int, Any] = {obj.session_uid: obj for obj in bpy.data.objects}
        for target in self._targets:
            obj = by_uid.get(target.uid)
            if obj is None:
                LOGGER.warning("Object '%s' is gone: its bake is in '%s'", target.name, target.file)
                continue
            _take_off(obj)
            if self.pack:
                obj.rebound.transfer_image = _packed(target.file)
            else:
                obj.rebound.transfer_file = bpy.path.relpath(str(target.file), start=str(self._folder.parent))
            obj.update_tag()

    def _clean(self) -> None:
        if self.pack:
            shutil.rmtree(self._folder, ignore_errors=True)


def bake(
    objects: Iterable,
    settings: BakeSettings | None = None,
    *,
    pack: bool | None = None,
    depsgraph: Any = None,
    blend: Path | None = None,
    each: Callable[[TransferBake], None] = lambda bake: None,
) -> list[str]:
    """Bake Blender objects and wait for it; lines that warn of something. By default as the scene's settings say.

    ``blend`` is what the file will be saved as, where that is another name. ``each`` is called with the TransferBake
    now and then. Raises SceneError, or OSError for files, and leaves all as it was.
    """
    depsgraph = depsgraph or bpy.context.evaluated_depsgraph_get()
    group: Any = depsgraph.scene.rebound
    work = TransferBake(
        depsgraph, objects, settings or settings_of(group), pack=group.bake_pack if pack is None else pack, blend=blend
    )
    try:
        work.process.wait(lambda _process: each(work))
        if work.step() is Outcome.CANCELLED:
            raise SceneError("The bake was cancelled, bakes of before are as they were")
        LOGGER.info("baked %s in %s, %s", ", ".join(work.names), _duration(work.process.seconds), work.process.device)
        return [*work.warnings, *work.process.warnings]
    finally:
        work.close()


def settings_of(group) -> BakeSettings:
    """What ``scene.rebound`` says of bakes. Raises SceneError for values that do not go together."""
    values = {setting.name.removeprefix("bake_"): getattr(group, setting.name) for setting in BAKE_SETTINGS}
    values |= {"kind": Kind(values["kind"]), "texels": int(values["texels"])}
    known = {field.name for field in fields(BakeSettings)}
    try:
        return BakeSettings(**{name: value for name, value in values.items() if name in known})
    except ValueError as error:
        raise SceneError(str(error)) from error


def remove(objects: Iterable) -> int:
    """Take objects' bakes from them; how many had one. Files stay where they are."""
    baked = [obj for obj in objects if has_bake(obj)]
    for obj in baked:
        _take_off(obj)
        obj.update_tag()
    return len(baked)


def has_bake(obj) -> bool:
    """Whether an object names a bake, of use or not."""
    return bool(obj.rebound.transfer_image or obj.rebound.transfer_file)


def state_of(obj, bakes: Mapping[Hashable, BakeState]) -> BakeState | None:
    """That of an object's bake among those of a session; None where none has looked at it."""
    return next((state for key, state in bakes.items() if is_own_surface(key, obj.session_uid)), None)


def facts(about: Mapping, nbytes: int) -> list[str]:
    """What a bake is, a line each, for the panel. ``nbytes`` 0: not known."""
    settings = about["settings"]
    kind = next(item for s in BAKE_SETTINGS if s.name == "bake_kind" for item in s.items if item.key == about["kind"])
    detail = {
        "DIFFUSE": f"{settings['bands']} bands",
        "GLOSSY": f"{settings['bands']} bands to {settings['result_bands']}",
        "WAVELET": f"6 x {settings['texels']}² texels, {settings['keep']:.2%} of the energy",
        "WAVELET_GLOSSY": f"6 x {settings['texels']}² texels, {settings['keep']:.2%} of the energy",
    }[about["kind"]]
    lines = [f"{kind.label}: {detail}", f"{settings['directions']:,} directions, {settings['bounces']} bounces"]
    if about["kind"] == "GLOSSY":
        least = least_roughness(ggx, min(settings["bands"], settings["result_bands"]))
        lines.append(f"Holds reflections of roughness {least:.2f} and more")
    if "points" in about:
        lines.append(f"{about['points']:,} points inside triangles, errors up to {about['detail_error']:.0%} are left")
    if "device" in about:
        lines.append(f"Baked on {about['device']}")
    if "roughness" in about:
        lobe = f"{settings['lobe_terms']} terms of {settings['lobe']}"
        lines.append(f"For roughness {about['roughness']:.2f}: {lobe}, {about['lobe_error']:.0%} of it left out")
    if "rms" in about:
        lines.append(f"Error of compression {about['rms']:.2%}, worst vertex {about['worst']:.1%}")
    return [*lines, f"{nbytes / 1e6:.1f} MB"] if nbytes else lines


def surfaces(objects: Iterable) -> list:
    """Those of the objects that may have a surface."""
    return [obj for obj in objects if obj.type in {"MESH", "CURVE", "SURFACE", "META", "FONT"}]


def _not_shown(name: str, scene: Scene, instance: Instance, settings: BakeSettings) -> Iterator[str]:
    """What a bake of the object ``name`` will lack, a line each with the remedy."""
    if not settings.points and _is_coarse(scene, instance):
        count = len(mesh_vertices(scene.meshes[instance.mesh])[0])
        yield (
            f"Object '{name}' has {count} vertices: baked light is as fine as the mesh. Raise Detail Points, or "
            "subdivide it, to see shadows on it"
        )
    if settings.kind is Kind.GLOSSY:
        bands = min(settings.bands, settings.result_bands)
        metals = [scene.materials[m].roughness for m in instance.materials if is_mirror(scene.materials[m])]
        least = least_roughness(ggx, bands)
        if metals and min(metals) < least:
            yield (
                f"Object '{name}' has a roughness of {min(metals):.2f}, smoother than {bands} bands hold: with Widen "
                f"Lobes its reflections are as of roughness {least:.2f}. Take Sharp, Glossy or more bands"
            )


def _is_coarse(scene: Scene, instance: Instance) -> bool:
    """Whether a triangle is so large beside the scene that light changes over it."""
    boxes = np.array([world_bounds(i, scene) for i in scene.instances])
    across = np.linalg.norm(boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0))
    points = scene.meshes[instance.mesh].positions.astype(np.float64) @ instance.world_from_object[:3, :3].T
    a, b, c = points.reshape(-1, 3, 3).transpose(1, 0, 2)
    return bool(np.linalg.norm(np.cross(b - a, c - a), axis=1).max() > (across / COARSE) ** 2)


def _take_off(obj) -> None:
    image = obj.rebound.transfer_image
    obj.rebound.transfer_image, obj.rebound.transfer_file = None, ""
    if image is not None and not image.users:
        bpy.data.images.remove(image)


def _packed(path: Path):
    image = bpy.data.images.load(str(path))
    image.pack()
    image.filepath = f"//{path.name}"  # where it was is gone; unpacking asks for a place
    return image


def _folder_beside(blend: Path | None) -> Path:
    """Where the bakes of this .blend lie."""
    if blend is None:
        raise SceneError("Save the .blend first: bakes are written beside it. Or switch Pack on")
    return blend.with_name(f"{blend.stem}.bakes")


def _file_name(name: str, taken: set[str]) -> str:
    plain = bpy.path.clean_name(name)
    number, found = 1, plain + SUFFIX
    while found in taken:
        number, found = number + 1, f"{plain}.{number}{SUFFIX}"
    return found


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"
