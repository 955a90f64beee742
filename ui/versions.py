"""Files of other Rebounds: a number kept with ``scene.rebound``, and what is done with settings of an older one.

Blender keeps what it does not know of a PropertyGroup, so a newer file loses nothing here: it is left as it is, and one
line says so. An older one is brought up to date as it is opened.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import bpy

from .. import ENGINE_ID

LOGGER = logging.getLogger("rebound")

# Grows with every change of a setting's name or meaning, together with a line in STEPS.
VERSION = 1


@dataclass(frozen=True)
class Step:
    """What a file older than ``version`` needs: what it holds as ``old`` becomes ``new``, each a property's name.

    ``new`` may name several, if one value came to be several; none, if the setting is no more. ``value`` turns the old
    raw value, as Blender stores it (a choice is a number), into the new one; None leaves the new default.
    """

    version: int
    old: str
    new: tuple[str, ...] = ()
    value: Callable[[Any], Any] = lambda value: value


STEPS = (
    # One choice served renders and viewports.
    Step(1, "vpl_bounces", ("vpl_bounces", "viewport_vpl_bounces")),
)


def stored(group):
    """What a file really holds of a group, by property name: raw values, unknown ones too."""
    return group.bl_system_properties_get() if hasattr(group, "bl_system_properties_get") else group


def migrate(held, steps: Iterable[Step], version: int) -> list[str]:
    """Bring raw values that were saved at ``version`` up to date, in place; what was done, one line each."""
    lines = []
    for step in sorted(steps, key=lambda step: step.version):
        if step.version <= version or step.old not in held:
            continue
        value = step.value(held[step.old])
        if step.old not in step.new:
            del held[step.old]
        for name in step.new if value is not None else ():
            held[name] = value
        kept = step.new if value is not None else ()
        lines.append(f"'{step.old}' became {' and '.join(repr(name) for name in kept) or 'a default'}")
    return lines


def file_notes(scene) -> list[str]:
    """What the panel says of the file that a scene comes from; empty where all is well."""
    group = scene.rebound
    if group.version <= VERSION:
        return []
    lines = [f"Saved by a newer Rebound (settings {group.version}, known {VERSION}): update to see it as it was"]
    for name, value in stored(group).items():
        entry = group.bl_rna.properties.get(name)
        if entry is not None and entry.type == "ENUM" and value not in {item.value for item in entry.enum_items}:
            lines.append(f"'{entry.name}' has a choice that is not known here: its default is used")
    return lines


@bpy.app.handlers.persistent
def update_file(*_arguments) -> None:
    """After a file is opened: every scene's settings as this Rebound knows them."""
    update_scenes(bpy.data.scenes)


@bpy.app.handlers.persistent
def update_imported(imported) -> None:
    """After an append or a link: the same for the scenes that came."""
    update_scenes(item.id for item in imported.import_items if isinstance(item.id, bpy.types.Scene))


def update_scenes(scenes: Iterable[bpy.types.Scene]) -> None:
    for scene in scenes:
        for line in file_notes(scene):
            LOGGER.warning("Scene '%s': %s; nothing of it is lost", scene.name, line)
        held = stored(scene.rebound)
        if held.keys() and scene.rebound.version < VERSION:
            for line in migrate(held, STEPS, scene.rebound.version):
                LOGGER.info("Scene '%s': setting %s", scene.name, line)
            held["version"] = VERSION


@bpy.app.handlers.persistent
def number_scenes(*_arguments) -> None:
    """Before a file is saved: say whose settings it holds. A newer Rebound's number stays."""
    for scene in bpy.data.scenes:
        used = scene.render.engine == ENGINE_ID or stored(scene.rebound).keys()
        if used and scene.rebound.version < VERSION:
            scene.rebound.version = VERSION


HANDLERS = (
    (bpy.app.handlers.load_post, update_file),
    (bpy.app.handlers.blend_import_post, update_imported),
    (bpy.app.handlers.save_pre, number_scenes),
)


def register() -> None:
    for handlers, call in HANDLERS:
        handlers.append(call)
    # A file may be open already; Blender shows it to nobody who is being enabled.
    bpy.app.timers.register(update_file)


def unregister() -> None:
    for handlers, call in HANDLERS:
        if call in handlers:
            handlers.remove(call)
    if bpy.app.timers.is_registered(update_file):
        bpy.app.timers.unregister(update_file)
