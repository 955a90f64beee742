"""Panels of baked light transfer: the bake in the render tab, an object's own in the object tab."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..bake.file import BakeFileError, read_about
from ..bake_settings import BAKE_SETTINGS
from ..baking import facts, has_bake, state_of, surfaces
from ..session import SESSIONS
from ..settings import named_settings
from .rebound_panel import ReboundPanel, draw_settings

# Rows that a basis has nothing to do with.
NOT_OF = {
    "DIFFUSE": {"bake_result_bands", "bake_error", "bake_texels", "bake_keep", "bake_lobe", "bake_lobe_terms"},
    "GLOSSY": {"bake_texels", "bake_keep", "bake_lobe", "bake_lobe_terms"},
    "WAVELET": {"bake_result_bands", "bake_error", "bake_lobe", "bake_lobe_terms"},
    "WAVELET_GLOSSY": {"bake_result_bands"},
}


class REBOUND_PT_transfer(ReboundPanel, bpy.types.Panel):
    """What is baked next, the button for it, and how far it is."""

    bl_label = "Light Transfer"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, group = self.layout, context.scene.rebound
        draw_settings(layout, group, [(name, s) for name, s in named_settings() if name.startswith("transfer_")])
        _draw_progress(layout, context.window_manager.rebound)
        row = layout.row(align=True)
        row.operator("rebound.bake_transfer", text="Bake Selected").objects = "SELECTED"
        row.operator("rebound.bake_transfer", text="Bake All").objects = "ALL"
        row.operator("rebound.remove_transfer", text="", icon="X").objects = "SELECTED"
        hidden = NOT_OF.get(group.bake_kind, set())
        draw_settings(layout, group, [(s.name, s) for s in BAKE_SETTINGS if s.name not in hidden])


class REBOUND_PT_object_transfer(ReboundPanel, bpy.types.Panel):
    """The object's bake: what it is, and whether it is in use."""

    bl_label = "Light Transfer"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return context.object is not None and bool(surfaces([context.object])) and super().poll(context)

    def draw(self, context):
        layout, obj = self.layout, context.object
        _draw_progress(layout, context.window_manager.rebound)
        layout.use_property_split = True
        layout.prop(obj.rebound, "transfer_file")
        if obj.rebound.transfer_image is not None:
            layout.prop(obj.rebound, "transfer_image")
        for text, icon in state_lines(obj):
            layout.label(text=text, icon=icon)
        row = layout.row(align=True)
        row.operator("rebound.bake_transfer", text="Bake Selected").objects = "SELECTED"
        row.operator("rebound.remove_transfer", text="", icon="X").objects = "SELECTED"


def state_lines(obj) -> list[tuple[str, str]]:
    """What the panel says of an object's bake, each line with its icon."""
    if not has_bake(obj):
        return [("No bake: the sky's light is live", "NONE")]
    state = state_of(obj, SESSIONS.newest.bakes)
    if state is not None:
        first = (state.unused, "ERROR") if state.unused else ("In use", "CHECKMARK")
        return [first, *((line, "NONE") for line in (facts(state.about, state.nbytes) if state.about else ()))]
    lines = [("Not looked at since it was baked: it is when a picture is drawn", "INFO")]
    if obj.rebound.transfer_image is not None:
        return lines
    try:
        path = Path(bpy.path.abspath(obj.rebound.transfer_file, library=obj.library))
        return [*lines, *((line, "NONE") for line in facts(read_about(path), 0))]
    except BakeFileError as error:
        return [(str(error), "ERROR")]


def _draw_progress(layout, progress) -> None:
    if progress.bake_line:
        row = layout.row(align=True)
        row.progress(factor=progress.bake_part, text=progress.bake_line)
        row.prop(progress, "bake_cancel", text="", icon="X")
