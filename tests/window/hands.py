"""A user at work, by mouse and keys alone: chooses the engine, looks, turns, drags a value, moves things, undoes."""

from __future__ import annotations

import bpy
import numpy as np
from steps import (
    areas,
    check,
    click,
    count_draws,
    difference,
    drag,
    finished,
    key,
    middle,
    picture,
    point,
    run,
    samples,
    screenshot,
    viewports,
    wait_for,
    window_context,
    xdotool,
)

SAME = 0.003  # mean difference of two pictures of the same: noise of a few samples


class WINDOW_PT_slider(bpy.types.Panel):  # noqa: N801  Blender's way
    """One of Rebound's settings where a test knows to find it: the upper end of the sidebar."""

    bl_label = "Slider"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Slider"

    def draw(self, context):
        column = self.layout.column()
        column.scale_y = 3
        column.prop(context.scene.world.node_tree.nodes["Background"].inputs["Strength"], "default_value")


def scenario():
    draws = count_draws()
    bpy.context.scene.rebound.viewport_samples = 4
    bpy.data.objects["Light"].data.energy = 3000
    bpy.ops.mesh.primitive_plane_add(size=12, location=(0, 0, -1))
    with bpy.context.temp_override(**window_context()):
        bpy.ops.object.select_all(action="DESELECT")
    yield from choose_engine()
    yield from choose_rendered()
    yield from orbit(draws)
    yield from slider()
    yield from move_and_undo()
    yield from hide()
    yield from edit_mode()
    yield from turn_all_the_time(draws)


def hover() -> None:
    point(middle(window_context()["region"]))


def choose_engine():
    """The menu at the top of the Render tab."""
    scene = bpy.context.scene
    check("Rebound is not the engine of a new file", scene.render.engine != "REBOUND")
    _window, area = areas("PROPERTIES")[0]
    area.spaces.active.context = "RENDER"
    yield 1.0
    region = next(r for r in area.regions if r.type == "WINDOW")
    x, y = region.x + int(region.width * 0.7), 800 - region.y - region.height + 52
    for _ in range(3):  # a machine that is busy with other things misses clicks
        yield from click((x, y))
        yield 1.0
        screenshot("engine_menu")
        key("r")  # the underlined letter of Rebound
        yield 1.0
        if scene.render.engine == "REBOUND":
            break
    check("the engine is chosen from the menu", scene.render.engine == "REBOUND", scene.render.engine)
    scene.render.engine = "REBOUND"


def choose_rendered():
    """The pie menu of the Z key: 8 is Rendered."""
    shading = window_context()["space_data"].shading
    hover()
    yield 0.3
    key("z")
    yield 0.7
    screenshot("shading_pie")
    key("8")
    yield from wait_for(lambda: shading.type == "RENDERED", 3)
    check("Rendered is chosen by key", shading.type == "RENDERED", shading.type)
    shading.type = "RENDERED"
    yield from finished(90)
    check("the first picture is there", samples() == 4)
    hover()
    key("shift+z")
    yield from wait_for(lambda: not viewports(), 5)
    check("Shift+Z leaves it and gives the memory back", not viewports())
    key("shift+z")
    yield from finished()


def orbit(draws):
    """A drag with the middle button turns the view, with pictures on the way."""
    view = window_context()["space_data"].region_3d
    turned, count, before = view.view_rotation.copy(), len(draws), picture("before_orbit")
    x, y = middle(window_context()["region"])
    yield from drag((x, y), (x + 160, y - 40), button=2, steps=10)
    check("the view turned", turned.rotation_difference(view.view_rotation).angle > 0.2)
    check("with pictures on the way", len(draws) - count >= 5, len(draws) - count)
    yield from finished()
    check("it is another picture", difference(picture("after_orbit"), before) > 0.01)


def slider():
    """Dragging a value is followed while the button is down; Esc takes it back."""
    strength = bpy.context.scene.world.node_tree.nodes["Background"].inputs["Strength"]
    bpy.utils.register_class(WINDOW_PT_slider)
    window_context()["space_data"].show_region_ui = True
    yield 1.0
    area = window_context()["area"]
    sidebar = next(r for r in area.regions if r.type == "UI")
    sidebar.active_panel_category = "Slider"
    yield 1.0
    place = sidebar.x + sidebar.width // 2 - 10, 800 - sidebar.y - sidebar.height + 60
    yield from finished()
    before, value = picture("before_slider"), strength.default_value
    yield from drag(place, (place[0] + 8, place[1]), steps=4)
    check("the value follows the mouse", strength.default_value > value + 0.2, strength.default_value)
    yield from finished()
    brighter = picture("after_slider")
    check("the picture follows the value", brighter.mean() > before.mean() + 0.01)

    value = strength.default_value
    point(place)
    yield 0.3
    xdotool("mousedown", 1)
    for step in range(1, 6):
        xdotool("mousemove", place[0] + 3 * step, place[1])
        yield 0.2
    dragged = strength.default_value
    key("Escape")
    yield 0.3
    xdotool("mouseup", 1)
    yield from finished()
    check("Esc takes a drag back", dragged > value + 0.1 and strength.default_value == value, dragged)
    check("in the picture too", difference(picture("slider_escaped"), brighter) < SAME)
    strength.default_value = 0.2
    space = window_context()["space_data"]
    space.show_region_ui = False
    # Of a sky hundreds of times as bright a few samples remember more than a few per cent.
    space.shading.type = "SOLID"
    yield 1.0
    space.shading.type = "RENDERED"
    bpy.utils.unregister_class(WINDOW_PT_slider)
    yield 1.0


def move_and_undo():
    """G Z 1 Return moves the cube, Ctrl+Z takes it back; a click selects it first."""
    view = window_context()["space_data"].region_3d
    view.view_location, view.view_distance = (0, 0, 0), 12
    yield from finished()
    yield from click(middle(window_context()["region"]))
    check("a click selects the cube", bpy.context.view_layer.objects.active == bpy.data.objects["Cube"])
    yield from finished()
    before = picture("before_move")
    xdotool("key", "--delay", 60, "g", "z", "1", "Return")
    yield from finished()
    check("G Z 1 moves it", abs(bpy.data.objects["Cube"].location.z - 1) < 1e-4)
    check("and the picture follows", difference(picture("moved"), before) > SAME)
    key("ctrl+z")
    yield from finished()
    check("Ctrl+Z takes it back", abs(bpy.data.objects["Cube"].location.z) < 1e-4)
    check("and the picture with it", difference(picture("undone"), before) < SAME)
    key("x")
    yield 0.5
    key("Return")
    yield from finished()
    check("X deletes it", "Cube" not in bpy.context.view_layer.objects)
    key("ctrl+z")
    yield from finished()
    check("undo brings it back", difference(picture("undeleted"), before) < SAME)


def hide():
    """H and Alt+H."""
    hover()
    before = picture("before_hide")
    key("h")
    yield from finished()
    check("H hides it", difference(picture("hidden"), before) > SAME)
    key("alt+h")
    yield from finished()
    check("Alt+H shows it", difference(picture("unhidden"), before) < SAME)


def edit_mode():
    """Tab, with the mesh's wires over the picture."""
    hover()
    before = picture("before_edit_mode")
    key("Tab")
    yield from finished()
    check("Tab enters Edit Mode", bpy.context.mode == "EDIT_MESH", bpy.context.mode)
    changed = np.abs(picture("edit_mode") - before).max(axis=-1) > 0.05
    check("wires stand over the picture", changed.mean() > 0.002, round(float(changed.mean()), 4))
    key("Tab")
    yield from finished()
    check("Tab leaves it", bpy.context.mode == "OBJECT" and difference(picture("object_mode"), before) < SAME)


def turn_all_the_time(draws):
    """Turning without a pause keeps pictures coming; a click into a menu meanwhile is answered."""
    x, y = middle(window_context()["region"])
    count = len(draws)
    for _ in range(3):
        yield from drag((x - 60, y), (x + 60, y), button=2, steps=6, pause=0.05)
    check("every drag has pictures", len(draws) - count >= 9, len(draws) - count)
    yield from finished()
    screenshot("turned")


run(scenario)
