"""What stands over and beside a viewport's picture: statistics, the legend of a view, buttons in the header."""

from __future__ import annotations

import logging
import textwrap
from collections.abc import Iterator, Mapping

import blf
import bpy

from ..engine import boundary
from ..gpu_shaders import TECHNIQUES
from ..gpu_shaders.frame.map_views import STRIP, THUMBNAIL_PART
from ..session import SESSIONS, Status, read_settings
from ..settings import Settings, shown_view
from .panels import shown_label
from .split import shows_rebound, shows_split

LOGGER = logging.getLogger("rebound")

SIZE, LINE, MARGIN = 11, 16, 14  # pixels at a user interface scale of 1
COLOR, SHADOW = (1.0, 1.0, 1.0, 0.9), (0.0, 0.0, 0.0, 0.8)
LEGEND_LETTERS = 90  # in a line
MIB = 1 << 20


def statistics_lines(status: Status) -> Iterator[str]:
    """The newest sample's times and counts."""
    if status.seconds:
        yield f"Sample  {1e3 * sum(status.seconds.values()):.1f} ms"
        yield from (f"    {name}  {1e3 * seconds:.1f} ms" for name, seconds in status.seconds.items())
    counts = status.statistics
    lights = counts.get("lights", 0)
    yield ", ".join([f"{lights:,.0f} light{'s' * (lights != 1)}", *_maps(counts, status.redrawn)])
    if counts.get("virtual_lights"):
        yield f"{counts['virtual_lights']:,.0f} virtual lights of {counts['light_texels']:,.0f}"
    yield f"{counts.get('triangles', 0):,.0f} triangles"
    yield f"{counts.get('gpu_bytes', 0) / MIB:,.0f} MiB of GPU memory"


def _maps(counts: Mapping[str, float], redrawn: Mapping[str, float]) -> Iterator[str]:
    for name, label in (("shadow_maps", "shadow maps"), ("light_maps", "light maps")):
        if name in counts:
            yield f"{counts[name]:,.0f} {label} ({redrawn.get(f'{name}_drawn', 0):,.0f} redrawn for this picture)"


def legend(settings: Settings) -> str:
    """What the colours of the view mean that is shown; "" for the picture."""
    view = shown_view(settings)
    if view is not None:
        return f"{view.label}: {view.description}"
    for technique in TECHNIQUES:
        for other in technique.views:
            if other.key == settings["show"]:
                return f"{other.label}: the picture is shown, for only the method {technique.label} has this view"
    return ""


def overlay_lines(scene, status: Status) -> list[str]:
    """All text of one viewport, from top to bottom."""
    settings = read_settings(scene, viewport=True)
    lines = [*statistics_lines(status)] if scene.rebound.viewport_stats else []
    if not settings["indirect"]:
        lines.append("Indirect light is off")
    return lines + textwrap.wrap(legend(settings), LEGEND_LETTERS)


def draw_overlay() -> None:
    """Draw the text into the viewport of the context, in its pixels."""
    context = bpy.context
    if not shows_rebound(context) or not context.space_data.overlay.show_overlays:
        return
    status = SESSIONS.status_of(context.region.as_pointer())
    lines = overlay_lines(context.scene, status) if status else []
    if status and not status.error and shows_split(context):
        _draw_split_labels(context)
    scale = context.preferences.system.ui_scale
    left, bottom = _left(context) + MARGIN * scale, _bottom(context) + MARGIN * scale
    for number, line in enumerate(reversed(lines)):
        _draw_text(line, left, bottom + number * LINE * scale, scale)


def _draw_split_labels(context) -> None:
    """What either side of the line shows, beside its upper end."""
    region, scale = context.region, context.preferences.system.ui_scale
    x, y = context.scene.rebound.viewport_split_place * region.width, 0.5 * region.height + 1.5 * LINE * scale
    blf.size(0, SIZE * scale)
    _draw_text("Direct", x - blf.dimensions(0, "Direct")[0] - MARGIN * scale, y, scale)
    _draw_text("With Bounce", x + MARGIN * scale, y, scale)


def _draw_text(text: str, left: float, bottom: float, scale: float) -> None:
    blf.size(0, SIZE * scale)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, *SHADOW)
    blf.color(0, *COLOR)
    blf.position(0, left, bottom, 0)
    blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


def _left(context) -> float:
    """How many pixels at the left of the region lie under the toolbar."""
    if not context.preferences.system.use_region_overlap:
        return 0.0
    widths = [r.width for r in context.area.regions if r.type == "TOOLS" and r.alignment == "LEFT" and r.width > 1]
    return float(max(widths, default=0))


def _bottom(context) -> float:
    """How many pixels at the bottom of the region a strip of thumbnails takes."""
    view = shown_view(read_settings(context.scene, viewport=True))
    is_strip = view is not None and view.key.endswith(STRIP)
    return THUMBNAIL_PART * context.region.height if is_strip else 0.0


class _Handler:
    """The draw handler: a fault in it takes it away and is logged once, as it would be met in every redraw."""

    def __init__(self) -> None:
        self._handle: object | None = None

    def add(self) -> None:
        self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_PIXEL")

    def remove(self) -> None:
        handle, self._handle = self._handle, None
        if handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")

    def _draw(self) -> None:
        if self._handle is not None:
            with boundary(self._fail):
                draw_overlay()

    def _fail(self, message: str) -> None:
        LOGGER.error("The viewport's overlay is off until Rebound is enabled again: %s", message)
        bpy.app.timers.register(self.remove)  # not while Blender walks along its handlers
        SESSIONS.newest.error = message


# Module-level, because Blender takes a draw handler back only for the handle it gave.
HANDLER = _Handler()


class REBOUND_PT_viewport(bpy.types.Panel):
    """What this viewport shows"""

    bl_label = "Rebound Viewport"
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_ui_units_x = 14

    def draw(self, context):
        layout, group = self.layout, context.scene.rebound
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.menu("REBOUND_MT_viewport_show", text=shown_label(group, "viewport_show"))
        for name in ("show_term", "show_result") if group.viewport_show == "TRANSFER" else ("show_light",):
            layout.prop(group, name)
        layout.prop(group, "viewport_indirect")
        column = layout.column(align=True)
        column.prop(group, "viewport_split")
        column.prop(group, "viewport_split_place")
        layout.prop(group, "viewport_stats")
        for line in textwrap.wrap(legend(read_settings(context.scene, viewport=True)), 50):
            layout.label(text=line)


def draw_header(self, context) -> None:
    """Append to the header of 3D viewports that show a picture of ours."""
    if not shows_rebound(context):
        return
    group = context.scene.rebound
    row = self.layout.row(align=True)
    row.operator("rebound.toggle_indirect", text="", icon="LIGHT", depress=group.viewport_indirect)
    row.prop(group, "viewport_split", text="", icon="ARROW_LEFTRIGHT")
    row.popover("REBOUND_PT_viewport", text="")


def draw_overlay_popover(self, context) -> None:
    """Append to Blender's popover of overlays."""
    if shows_rebound(context):
        self.layout.prop(context.scene.rebound, "viewport_stats")


def register() -> None:
    bpy.utils.register_class(REBOUND_PT_viewport)
    bpy.types.VIEW3D_HT_header.append(draw_header)
    bpy.types.VIEW3D_PT_overlay.append(draw_overlay_popover)
    HANDLER.add()


def unregister() -> None:
    HANDLER.remove()
    bpy.types.VIEW3D_PT_overlay.remove(draw_overlay_popover)
    bpy.types.VIEW3D_HT_header.remove(draw_header)
    if REBOUND_PT_viewport.is_registered:
        bpy.utils.unregister_class(REBOUND_PT_viewport)
