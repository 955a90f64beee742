"""The line of the split view: a gizmo that is dragged, drawn over the picture."""

from __future__ import annotations

from typing import Any

import bpy
from mathutils import Matrix

from .. import ENGINE_ID
from ..session import read_settings
from ..settings import shown_view

# Pixels at a user interface scale of 1: how near the mouse takes hold, half the line's width, the handle's half size.
REACH, HALF_LINE, HANDLE = 8.0, 1.0, 16.0
COLOR, HIGHLIGHT = (0.9, 0.9, 0.9), (1.0, 0.6, 0.1)
SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1))
# Two arrowheads that point away from the line.
ARROWS = ((-0.4, -0.5), (-0.4, 0.5), (-1, 0), (0.4, -0.5), (1, 0), (0.4, 0.5))


def shows_rebound(context) -> bool:
    """Whether the context's 3D viewport shows a picture of ours."""
    space = context.space_data
    is_view = space is not None and space.type == "VIEW_3D"
    return is_view and context.engine == ENGINE_ID and space.shading.type == "RENDERED"


def shows_split(context) -> bool:
    """Whether there is a line to drag: not without bounced light, nor over a view."""
    if not shows_rebound(context) or not context.scene.rebound.viewport_split:
        return False
    settings = read_settings(context.scene, viewport=True)
    return bool(settings["indirect"]) and shown_view(settings) is None


def line_is_near(place: float, width: int, x: float, scale: float) -> bool:
    """Whether a mouse at pixel ``x`` of a region ``width`` pixels wide takes hold of the line."""
    return abs(x - place * width) <= REACH * scale


def place_of(x: float, width: int) -> float:
    """Where a line at pixel ``x`` stands, 0..1."""
    return min(max(x / max(width, 1), 0.0), 1.0)


class REBOUND_GT_split_line(bpy.types.Gizmo):
    """A vertical line over the whole region, with a handle."""

    bl_idname = "REBOUND_GT_split_line"
    __slots__ = ("square", "arrows", "before")

    def setup(self):
        if not hasattr(self, "square"):
            self.square = self.new_custom_shape("TRIS", SQUARE)
            self.arrows = self.new_custom_shape("TRIS", ARROWS)

    def draw(self, context):
        region, scale = context.region, context.preferences.system.ui_scale
        x = context.scene.rebound.viewport_split_place * region.width
        center = Matrix.Translation((x, 0.5 * region.height, 0.0))
        self.draw_custom_shape(
            self.square, matrix=center @ Matrix.Diagonal((HALF_LINE * scale, 0.5 * region.height, 1.0, 1.0))
        )
        self.draw_custom_shape(self.arrows, matrix=center @ Matrix.Diagonal((HANDLE * scale, HANDLE * scale, 1.0, 1.0)))

    def test_select(self, context, location: Any):
        place, scale = context.scene.rebound.viewport_split_place, context.preferences.system.ui_scale
        x, _y = location
        return 0 if line_is_near(place, context.region.width, x, scale) else -1

    def invoke(self, context, _event):
        self.before = context.scene.rebound.viewport_split_place
        return {"RUNNING_MODAL"}

    def modal(self, context, event, _tweak):
        place = place_of(event.mouse_x - context.region.x, context.region.width)
        context.scene.rebound.viewport_split_place = place
        context.area.header_text_set(f"Split: without bounced light {place:.0%}, with it {1.0 - place:.0%}")
        return {"RUNNING_MODAL"}

    def exit(self, context, cancel):
        context.area.header_text_set(None)
        if cancel:
            context.scene.rebound.viewport_split_place = self.before
        else:  # Blender makes no undo step of what a gizmo of Python's did
            bpy.ops.ed.undo_push(message="Move Split")


class REBOUND_GGT_split(bpy.types.GizmoGroup):
    """The line, in every viewport that shows the split view."""

    bl_idname = "REBOUND_GGT_split"
    bl_label = "Rebound Split View"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context):
        return shows_split(context)

    def setup(self, _context):
        gizmo = self.gizmos.new(REBOUND_GT_split_line.bl_idname)
        gizmo.color, gizmo.color_highlight = COLOR, HIGHLIGHT
        gizmo.alpha = gizmo.alpha_highlight = 0.9
        gizmo.use_draw_modal = True


CLASSES = (REBOUND_GT_split_line, REBOUND_GGT_split)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        if "bl_rna" in vars(cls):  # gizmo groups have no is_registered
            bpy.utils.unregister_class(cls)
