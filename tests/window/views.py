"""Every way to look: perspective, orthographic, through the camera, in quad view, in two viewports and two windows, and
only a part of it by a render region. The picture must stand exactly where Blender's own drawing does."""

from __future__ import annotations

import bpy
import numpy as np
from steps import (
    areas,
    check,
    difference,
    drag,
    finished,
    key,
    middle,
    picture,
    point,
    principled,
    run,
    screenshot,
    viewports,
    wait_for,
    window_context,
)

# Of the pixels in either of two silhouettes, the part that is in both; edges are smooth in one and hard in the other.
SAME = 0.94
HALF = 0.735  # what a pixel shows that a white object covers half


def build() -> None:
    """Objects that shine before black: what is bright in the picture is their silhouette."""
    scene = bpy.context.scene
    scene.render.engine = "REBOUND"
    scene.rebound.viewport_samples = 16  # fewer stand up to half a pixel off
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (0, 0, 0, 1)
    bpy.ops.mesh.primitive_monkey_add(size=2, location=(2.5, 0.5, 0))
    material, surface = principled("Shine")
    surface.inputs["Emission Color"].default_value = (1, 1, 1, 1)
    surface.inputs["Emission Strength"].default_value = 1
    surface.inputs["Base Color"].default_value = (0, 0, 0, 1)
    surface.inputs["Specular IOR Level"].default_value = 0
    scene.view_settings.view_transform = "Standard"
    for name in ("Cube", "Suzanne"):
        bpy.data.objects[name].data.materials.clear()
        bpy.data.objects[name].data.materials.append(material)
    bpy.data.objects["Cube"].rotation_euler = (0.3, 0.2, 0.1)
    for _window, area in areas("VIEW_3D"):
        plain(area.spaces.active)


def plain(space) -> None:
    """Nothing but the objects: white before black in Solid mode too."""
    space.overlay.show_overlays = space.show_gizmo = space.show_region_toolbar = False
    shading = space.shading
    shading.light, shading.color_type, shading.single_color = "FLAT", "SINGLE", (1, 1, 1)
    shading.show_object_outline = False  # which darkens edges, and not all alike
    shading.background_type, shading.background_color = "VIEWPORT", (0, 0, 0)


def bright(shot: np.ndarray) -> np.ndarray:
    """The silhouette, without the header on top."""
    return shot[60:].max(axis=-1) > HALF


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / max((a | b).sum(), 1))


def in_place(what: str, number: int = 0):
    """Check that the picture stands where Solid mode draws; leaves the viewport in Rendered and returns its picture."""
    context = window_context(number)
    shading, name = context["space_data"].shading, what.replace(" ", "_")
    shading.type = "SOLID"
    yield 0.8
    solid = picture(f"{name}_solid", context["area"])
    shading.type = "RENDERED"
    yield from finished(90)
    rendered = picture(name, context["area"])
    masks = bright(rendered), bright(solid)
    same = overlap(*masks)
    # Half a pixel off, and a shift by a whole one would not be worse.
    shifted = [overlap(np.roll(masks[0], step, axis), masks[1]) for axis in (0, 1) for step in (-1, 1)]
    good = same > SAME and same > max(shifted) and masks[1].mean() > 0.005
    check(f"{what}: in its place", good, round(same, 4), "shifted by a pixel:", *np.round(shifted, 4))
    return rendered


def scenario():
    build()
    space = window_context()["space_data"]
    view = space.region_3d
    yield from in_place("perspective")
    view.view_perspective = "ORTHO"
    yield from in_place("orthographic")
    view.view_perspective = "PERSP"
    yield from render_region(space)
    yield from through_camera(space)
    yield from clipped()
    yield from quad(space)
    yield from two_viewports()
    yield from two_windows()


def render_region(space):
    """Ctrl+B and a drag: only that part is drawn, and it is what the whole was."""
    whole = yield from in_place("whole")
    x, y = middle(window_context()["region"])
    point((x, y))
    yield 0.3
    key("ctrl+b")
    yield from drag((x - 120, y - 80), (x + 150, y + 60))
    check("Ctrl+B sets a render region", space.use_render_border)
    yield from finished()
    part = picture("render_region")
    yield from same_inside("render region", whole, part, (x - 120, y - 80, x + 150, y + 60))
    key("ctrl+alt+b")
    yield from finished()
    check("Ctrl+Alt+B draws the whole again", difference(picture("whole_again"), whole) < 0.004)


def same_inside(what: str, whole: np.ndarray, part: np.ndarray, box: tuple[int, int, int, int]):
    """``part`` is ``whole`` inside of ``box`` (pixels of the screen) and nothing outside of it."""
    area = window_context()["area"]
    left, top = area.x, 800 - area.y - area.height
    inside = np.zeros(whole.shape[:2], bool)
    inside[box[1] - top : box[3] - top, box[0] - left : box[2] - left] = True
    rim = np.zeros_like(inside)
    rim[box[1] - top - 2 : box[3] - top + 2, box[0] - left - 2 : box[2] - left + 2] = True
    off = np.abs(whole - part).max(axis=-1)
    lit = part[60:].max(axis=-1)[~rim[60:]]
    check(f"{what}: the same inside", off[inside].mean() < 0.01, round(float(off[inside].mean()), 4))
    check(f"{what}: nothing outside", (lit > 0.5).mean() < 0.002, round(float((lit > 0.5).mean()), 5))
    yield 0.0


def through_camera(space):
    """The camera's frame with lens shift, the passepartout, and the scene's border."""
    scene, camera = bpy.context.scene, bpy.context.scene.camera
    camera.data.shift_x, camera.data.shift_y, camera.data.lens = 0.1, -0.05, 35
    with bpy.context.temp_override(**window_context()):
        bpy.ops.view3d.view_camera()
    yield 1.0
    space.region_3d.view_camera_zoom = 10
    camera.data.show_passepartout = False
    whole = yield from in_place("camera")
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.4, 0.7, 0.3, 0.8
    yield from finished()
    part = picture("camera_border")
    yield from same_inside("camera border", whole, part, frame_box((0.4, 0.3, 0.7, 0.8)))
    render.use_border = False
    space.overlay.show_overlays = True
    for name in ("show_floor", "show_axis_x", "show_axis_y", "show_cursor", "show_extras", "show_text"):
        setattr(space.overlay, name, False)
    camera.data.show_passepartout, camera.data.passepartout_alpha = True, 1.0
    yield from finished()
    shot = picture("passepartout")
    x0, _y0, x1, _y1 = frame_box((0, 0, 1, 1))
    outside = shot[60:, : x0 - window_context()["area"].x - 6], shot[60:, x1 - window_context()["area"].x + 6 :]
    dark = [float(part[..., :].max(axis=-1).mean()) for part in outside]
    check("passepartout hides what the camera does not see", max(dark) < 0.05, *np.round(dark, 3))
    space.overlay.show_overlays = False
    with bpy.context.temp_override(**window_context()):
        bpy.ops.view3d.view_camera()
    yield 1.0


def frame_box(part: tuple[float, float, float, float]) -> tuple[int, int, int, int]:
    """Screen pixels of a part (left, bottom, right, top in 0..1) of the camera's frame, by Blender's own projection."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d  # noqa: PLC0415

    context, scene = window_context(), bpy.context.scene
    camera, region = scene.camera, context["region"]
    corners = [camera.matrix_world.normalized() @ corner for corner in camera.data.view_frame(scene=scene)]
    places = [location_3d_to_region_2d(region, context["space_data"].region_3d, corner) for corner in corners]
    left, right = min(p.x for p in places), max(p.x for p in places)
    low, high = min(p.y for p in places), max(p.y for p in places)
    x0, x1 = (region.x + left + side * (right - left) for side in part[0::2])
    y1, y0 = (800 - region.y - low - side * (high - low) for side in part[1::2])
    return round(x0), round(y0), round(x1), round(y1)


def clipped():
    """A clipping region, which is made in Solid mode only: it shows in no engine's picture and breaks nothing."""
    context = window_context()
    shading = context["space_data"].shading
    shading.type = "SOLID"
    yield 0.5
    x, y = middle(context["region"])
    point((x, y))
    yield 0.3
    key("alt+b")
    yield from drag((x - 100, y - 60), (x + 100, y + 60))
    view = context["space_data"].region_3d
    check("Alt+B clips", view.use_clip_planes)
    shading.type = "RENDERED"
    yield from finished()
    check("a clipped view has a picture", bright(picture("clipped")).mean() > 0.005)
    view.use_clip_planes = False
    yield 0.5


def quad(space):
    """Ctrl+Alt+Q: four views, each with a picture of its own, and one again."""
    point(middle(window_context()["region"]))
    yield 0.3
    key("ctrl+alt+q")
    yield 1.5
    yield from in_place("quad view")
    check("four views have a session each", len(viewports()) == 4, len(viewports()))
    point(middle(window_context()["area"]))
    key("ctrl+alt+q")
    yield 1.5
    check("one view again", not space.region_quadviews)
    yield from finished()
    yield from wait_for(lambda: len(viewports()) == 1, 5)
    check("the other sessions gave their memory back", len(viewports()) == 1, len(viewports()))


def two_viewports():
    """One viewport split in two, looking from different sides, and one of them closed."""
    context = window_context()
    with bpy.context.temp_override(**context):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
    yield 1.0
    second = window_context(1)
    with bpy.context.temp_override(**second):
        bpy.ops.view3d.view_axis(type="TOP")
    yield 1.0
    yield from in_place("first of two")
    yield from in_place("second of two", 1)
    check("both have a session", len(viewports()) == 2, len(viewports()))
    second["area"].type = "CONSOLE"
    yield from wait_for(lambda: len(viewports()) == 1, 5)
    check("a closed viewport gave its memory back", len(viewports()) == 1, len(viewports()))
    yield from finished()


def two_windows():
    """A second window shows the same scene, and closing it leaves the first alone."""
    context = window_context()
    with bpy.context.temp_override(**context):
        bpy.ops.wm.window_new()
    windows = bpy.context.window_manager.windows
    space = windows[1].screen.areas[0].spaces
    windows[1].screen.areas[0].type = "VIEW_3D"
    yield 1.0
    plain(space.active)
    space.active.shading.type = "RENDERED"
    yield 2.0
    yield from finished(90)
    screenshot("second_window")
    check("two windows, two sessions", len(windows) == 2 and len(viewports()) == 2, len(windows), len(viewports()))
    bpy.data.objects["Cube"].location.z += 1
    yield from finished()
    screenshot("second_window_edited")
    with bpy.context.temp_override(window=windows[1]):
        bpy.ops.wm.window_close()
    yield 2.0
    yield from wait_for(lambda: len(viewports()) == 1, 5)
    check("a closed window gave its memory back", len(viewports()) == 1, len(viewports()))
    yield from in_place("first window")


run(scenario)
