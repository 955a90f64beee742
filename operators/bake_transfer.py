"""Bake Light Transfer: how objects pass on the light of their surroundings, found once; and taking that off again."""

from __future__ import annotations

import logging

import bpy

from ..bake.process import Outcome
from ..baking import TransferBake, bake, has_bake, remove, settings_of, surfaces
from ..scene.errors import SceneError

LOGGER = logging.getLogger("rebound")
USER_FAULTS = (SceneError, OSError)

TICK = 0.1  # seconds between two looks at the worker
OBJECTS = (
    ("SELECTED", "Selected", "Bake the selected objects"),
    ("ALL", "All", "Bake all objects of the scene that are shown"),
)


def chosen(context, which: str) -> list:
    """The objects that an operator of this choice works on."""
    return surfaces(context.selected_objects if which == "SELECTED" else context.visible_objects)


class REBOUND_OT_bake_transfer(bpy.types.Operator):
    """Find out how objects pass on the light of their surroundings, with shadows and bounces, and keep it. Turning or \
changing the world then costs nothing. Works beside Blender; Esc cancels and leaves the bakes of before"""

    bl_idname = "rebound.bake_transfer"
    bl_label = "Bake Light Transfer"

    objects: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Objects", description="Which objects are baked", items=OBJECTS, default="SELECTED"
    )

    @classmethod
    def poll(cls, context):
        if context.window_manager.rebound.bake_line:
            cls.poll_message_set("A bake is under way")
            return False
        return context.scene is not None and context.mode == "OBJECT"

    def execute(self, context):
        """From a script: wait for it."""
        try:
            lines = bake(chosen(context, self.objects))
        except USER_FAULTS as error:
            return self._fail(error)
        for line in lines:
            self.report({"WARNING"}, line)
        return {"FINISHED"}

    def invoke(self, context, _event):
        group = context.scene.rebound
        try:
            objects = chosen(context, self.objects)
            depsgraph = context.evaluated_depsgraph_get()
            self._bake = TransferBake(depsgraph, objects, settings_of(group), pack=group.bake_pack)
        except USER_FAULTS as error:
            return self._fail(error)
        manager = context.window_manager
        manager.rebound.bake_cancel = False
        self._timer = manager.event_timer_add(TICK, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)
        self._tell(context)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            context.window_manager.rebound.bake_cancel = True
        if event.type != "TIMER":
            return {"PASS_THROUGH", "RUNNING_MODAL"}
        if context.window_manager.rebound.bake_cancel:
            self._bake.process.cancel()
        try:
            outcome = self._bake.step()
        except USER_FAULTS as error:
            self._end(context)
            return self._fail(error)
        if outcome is None:
            self._tell(context)
            return {"PASS_THROUGH", "RUNNING_MODAL"}
        process, names = self._bake.process, ", ".join(self._bake.names)
        self._end(context)
        if outcome is Outcome.CANCELLED:
            self.report({"WARNING"}, "The bake was cancelled: bakes of before are as they were")
            return {"CANCELLED"}
        for line in (*self._bake.warnings, *process.warnings):
            self.report({"WARNING"}, line)
        self.report({"INFO"}, f"Baked {names} in {process.seconds:.0f} s ({process.device})")
        return {"FINISHED"}

    def cancel(self, context):
        """Blender ends it: another file is opened, or Blender quits."""
        self._end(context)

    def _tell(self, context) -> None:
        """Show how far it is: beside the cursor, in the status bar, and in the panel."""
        group, line = context.window_manager.rebound, self._bake.line
        context.window_manager.progress_update(round(100 * self._bake.process.part))
        group.bake_part, group.bake_line = self._bake.process.part, line
        context.workspace.status_text_set(f"Baking light transfer: {line}. Esc cancels")
        _redraw_panels(context)

    def _end(self, context) -> None:
        self._bake.close()
        manager = context.window_manager
        manager.event_timer_remove(self._timer)
        manager.progress_end()
        manager.rebound.bake_line = ""
        context.workspace.status_text_set(None)
        _redraw_panels(context)

    def _fail(self, error: Exception) -> set[str]:
        self.report({"ERROR"}, f"Rebound: {error}")
        return {"CANCELLED"}


class REBOUND_OT_remove_transfer(bpy.types.Operator):
    """Take the baked light transfer from objects: they have live light again. Files stay where they are"""

    bl_idname = "rebound.remove_transfer"
    bl_label = "Remove Bake"
    bl_options = {"REGISTER", "UNDO"}

    objects: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Objects", description="Whose bakes are removed", items=OBJECTS, default="SELECTED"
    )

    @classmethod
    def poll(cls, context):
        return context.scene is not None and any(map(has_bake, context.scene.objects))

    def execute(self, context):
        count = remove(chosen(context, self.objects))
        self.report({"INFO"}, f"{count} bakes removed")
        return {"FINISHED"} if count else {"CANCELLED"}


def _redraw_panels(context) -> None:
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()
