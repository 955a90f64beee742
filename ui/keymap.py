"""Default shortcuts, in Blender's keymap of add-ons: the keymap editor shows them, and a user may change them."""

from __future__ import annotations

import bpy

from ..operators.toggle_indirect import REBOUND_OT_toggle_indirect

KEYMAP, SPACE = "3D View", "VIEW_3D"
# "B" for bounce. Free in Blender's own keymaps; a test looks.
TOGGLE_KEY = {"type": "B", "value": "PRESS", "shift": True, "alt": True}


def register() -> None:
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is not None:  # as it is where Blender has no user interface
        keymap = configuration.keymaps.new(name=KEYMAP, space_type=SPACE)
        keymap.keymap_items.new(REBOUND_OT_toggle_indirect.bl_idname, **TOGGLE_KEY)


def unregister() -> None:
    configuration = bpy.context.window_manager.keyconfigs.addon
    keymap = configuration.keymaps.get(KEYMAP) if configuration is not None else None
    for item in list(keymap.keymap_items) if keymap else ():
        if item.idname == REBOUND_OT_toggle_indirect.bl_idname:
            keymap.keymap_items.remove(item)
