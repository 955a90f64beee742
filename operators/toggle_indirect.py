"""Toggle Indirect Light: bounced light of the viewports off and on again."""

from __future__ import annotations

import bpy

from .. import ENGINE_ID


class REBOUND_OT_toggle_indirect(bpy.types.Operator):
    """Turn bounced light off and on in the viewport. What was found of it is kept while it is off, at no cost in \
time; final renders always have it"""

    bl_idname = "rebound.toggle_indirect"
    bl_label = "Toggle Indirect Light"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        space = context.space_data
        is_other = space is not None and space.type == "VIEW_3D" and space.shading.type != "RENDERED"
        return context.scene is not None and context.engine == ENGINE_ID and not is_other

    def execute(self, context):
        group = context.scene.rebound
        group.viewport_indirect = not group.viewport_indirect
        return {"FINISHED"}
