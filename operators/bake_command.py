"""`blender --background --command rebound bake FILE.blend`: bakes light transfer from a shell, on a farm."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
from pathlib import Path

import bpy

from ..bake_settings import BAKE_SETTINGS
from ..baking import TransferBake, bake, settings_of, surfaces
from ..scene.errors import SceneError

LOGGER = logging.getLogger("rebound")
DONE, FAILED, CANCELLED = 0, 1, 2
# Parts of the whole between two lines of progress.
STEP = 0.1


def run(words: Sequence[str]) -> int:
    """What stands behind `--command rebound`; the exit status."""
    try:
        arguments = _parser().parse_args(words)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else FAILED
    try:
        _bake(arguments)
    except KeyboardInterrupt:
        LOGGER.error("cancelled: bakes of before are as they were")
        return CANCELLED
    except (SceneError, OSError, RuntimeError) as error:  # RuntimeError: Blender's, of a file that it cannot open
        LOGGER.error("%s", " ".join(str(error).split()))
        return FAILED
    return DONE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="blender --background --command rebound")
    bake_parser = parser.add_subparsers(dest="command", required=True).add_parser(
        "bake", help="bake light transfer of a file's objects, and save the file"
    )
    bake_parser.add_argument("file", type=Path, metavar="FILE.blend")
    bake_parser.add_argument("--objects", nargs="+", metavar="NAME", help="default: all that are shown")
    bake_parser.add_argument("--save-as", type=Path, metavar="OTHER.blend", help="leave FILE.blend as it is")
    for setting in BAKE_SETTINGS:
        name = "--" + setting.name.removeprefix("bake_").replace("_", "-")
        how: dict = {"dest": setting.name, "help": setting.description.replace("%", "%%")}
        if setting.kind == "BOOL":
            bake_parser.add_argument(name, action=argparse.BooleanOptionalAction, **how)
        elif setting.kind == "ENUM":
            bake_parser.add_argument(name, choices=[item.key for item in setting.items], **how)
        else:
            bake_parser.add_argument(name, type=int if setting.kind == "INT" else float, **how)
    return parser


def _bake(arguments: argparse.Namespace) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(arguments.file.resolve()))
    scene = bpy.context.scene
    for setting in BAKE_SETTINGS:
        value = getattr(arguments, setting.name)
        if value is not None:
            setattr(scene.rebound, setting.name, value)
    blend = (arguments.save_as or arguments.file).resolve()
    objects = _objects(scene, arguments.objects)
    for line in bake(objects, settings_of(scene.rebound), blend=blend, each=_Lines()):
        LOGGER.warning("%s", line)
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))


def _objects(scene, names: Sequence[str] | None) -> list:
    if names is None:
        return surfaces(obj for obj in scene.objects if obj.visible_get())
    missing = [name for name in names if name not in scene.objects]
    if missing:
        raise SceneError(f"The scene has no object '{missing[0]}'")
    return [scene.objects[name] for name in names]


class _Lines:
    """A line for each tenth of the way."""

    def __init__(self) -> None:
        self._next = 0.0

    def __call__(self, work: TransferBake) -> None:
        if work.process.part >= self._next:
            LOGGER.info("%s%s", work.line, f" ({work.process.device})" if work.process.device else "")
            self._next = work.process.part + STEP
