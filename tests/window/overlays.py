"""What Blender draws over Rebound's picture: wires, empties, outlines, the 3D cursor; hidden by what is before them."""

from __future__ import annotations

import bpy
import numpy as np
from steps import SAME, check, difference, finished, key, middle, picture, point, run, select, wait_for, window_context

# Colours that nothing else in the window has.
WIRE = (0.0, 1.0, 0.0)
ACTIVE = (1.0, 0.0, 1.0)


def build() -> None:
    scene = bpy.context.scene
    scene.render.engine = "REBOUND"
    scene.rebound.viewport_samples = 4
    scene.world.color = (0.05, 0.05, 0.05)
    theme = bpy.context.preferences.themes[0].view_3d
    theme.wire = theme.empty = WIRE
    theme.object_active = theme.object_selected = ACTIVE
    cube = bpy.data.objects["Cube"]
    cube.scale = (1, 3, 3)
    cube.location = (0, 0, 0)
    for name in ("Light", "Camera"):
        bpy.data.objects[name].location = (40, 0, 40)


def look() -> None:
    """From the front of the cube's large side, along -X, without perspective."""
    space = window_context()["space_data"]
    space.shading.type = "RENDERED"
    space.show_gizmo = False
    overlay = space.overlay
    overlay.show_floor = overlay.show_axis_x = overlay.show_axis_y = False
    overlay.show_cursor = overlay.show_relationship_lines = False
    overlay.show_text = overlay.show_stats = False
    with bpy.context.temp_override(**window_context()):
        bpy.ops.view3d.view_axis(type="RIGHT")
    space.region_3d.view_perspective = "ORTHO"
    space.region_3d.view_location, space.region_3d.view_distance = (0, 0, 0), 20


def coloured(shot: np.ndarray, color) -> int:
    """Pixels of about that hue, however blended with what is below."""
    wanted = np.array(color, bool)
    return int((shot[..., wanted].min(axis=-1) > shot[..., ~wanted].max(axis=-1) + 0.2).sum())


def shown(name: str, color):
    """Wait for the picture and count that colour's pixels."""
    yield from finished()
    return coloured(picture(name), color)


def scenario():
    build()
    look()
    none = yield from shown("nothing", WIRE)
    check("the colours are the overlays' own", none < 20, none)

    empty = bpy.data.objects.new("Empty", None)
    empty.empty_display_type, empty.empty_display_size = "CUBE", 1
    bpy.context.scene.collection.objects.link(empty)
    before = empty.location = (4, 0, 0)
    before = yield from shown("empty_before", WIRE)
    empty.location = (-4, 0, 0)
    behind = yield from shown("empty_behind", WIRE)
    check("an empty is hidden behind the picture's cube", before > 200 and behind < 0.05 * before, before, behind)

    empty.location = (-0.5, 3, 0)
    half = yield from shown("empty_beside", WIRE)
    check("and half of it where it only reaches into it", 0.2 * before < half < 0.95 * before, half)
    bpy.data.objects.remove(empty)

    bpy.ops.mesh.primitive_ico_sphere_add(radius=1, location=(4, 0, 0))
    ball = bpy.context.object
    ball.show_wire = True
    ball.select_set(False)
    before = yield from shown("wire_before", WIRE)
    ball.location.x = -4
    behind = yield from shown("wire_behind", WIRE)
    check("a wire is hidden behind the cube", before > 200 and behind < 0.05 * before, before, behind)

    select("Cube")
    outline = yield from shown("cube_selected", ACTIVE)
    check("the selected cube has its outline", outline > 200, outline)
    yield from cursor()
    yield from edit_mode()


def cursor():
    """The 3D cursor is drawn through everything, as in every engine; what is under it stays."""
    space = window_context()["space_data"]
    without = picture("cursor_off")
    space.overlay.show_cursor = True
    bpy.context.scene.cursor.location = (-4, 1, 1)
    yield 1.0
    changed = np.abs(picture("cursor_on") - without).max(axis=-1) > 0.1
    check("the 3D cursor covers little of the picture", 20 < changed.sum() < 3000, int(changed.sum()))
    space.overlay.show_cursor = False


def edit_mode():
    """Edit mode shows vertices and edges of the near side over the picture, and follows a moved vertex."""
    with bpy.context.temp_override(**window_context()):
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
    yield from finished()
    yield from x_ray()
    before = picture("edit_mode")
    with bpy.context.temp_override(**window_context()):
        bpy.ops.transform.resize(value=(0.5, 0.5, 0.5))
    yield from finished()
    after = picture("edit_mode_resized")
    check("an edit in Edit Mode is followed", np.abs(after - before).max(axis=-1).astype(bool).sum() > 5000)
    with bpy.context.temp_override(**window_context()):
        bpy.ops.object.mode_set(mode="OBJECT")
    yield from finished()


def x_ray():
    """Alt+Z in Edit Mode: Solid mode sees through the cube; a rendered picture is what it was, as in every engine."""
    shading, region = window_context()["space_data"].shading, window_context()["region"]
    before = picture("x_ray_off")
    point(middle(region))
    yield 0.3
    for on in (True, False):
        key("alt+z")
        yield from wait_for(lambda on=on: shading.show_xray == on, 3)
        yield from finished()
        check(f"X-ray {'on' if on else 'off'}", shading.show_xray == on)
        check("the rendered picture stays", difference(picture(f"x_ray_{on}"), before) < SAME)
    shading.type = "SOLID"
    yield 1.0
    solid = picture("x_ray_solid_off")
    shading.show_xray = True
    yield 1.0
    check("Solid mode sees through", difference(picture("x_ray_solid"), solid) > SAME)
    shading.show_xray, shading.type = False, "RENDERED"
    yield from finished(90)
    check("and the rendered picture is back", difference(picture("x_ray_after"), before) < SAME)


run(scenario)
