"""The tools of the viewport: bounced light off and on, the split view and its line, the views, statistics, presets."""

from __future__ import annotations

import bpy
import numpy as np
from steps import (
    SAME,
    check,
    count_draws,
    difference,
    drag,
    finished,
    key,
    middle,
    module,
    picture,
    point,
    principled,
    run,
    samples,
    screenshot,
    session,
    wait_for,
    window_context,
)


def red_room() -> None:
    """A grey cube between red walls: what bounces is red."""
    scene = bpy.context.scene
    scene.render.engine = "REBOUND"
    scene.rebound.viewport_samples = 8
    red, surface = principled("Red")
    surface.inputs["Base Color"].default_value = (0.8, 0.02, 0.02, 1)
    for location, rotation in (((0, 0, -1), (0, 0, 0)), ((-3, 0, 2), (0, 1.5708, 0)), ((0, 3, 2), (1.5708, 0, 0))):
        bpy.ops.mesh.primitive_plane_add(size=6, location=location, rotation=rotation)
        bpy.context.object.data.materials.append(red)
    bpy.data.objects["Light"].data.energy = 2000
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0
    for obj in bpy.context.view_layer.objects:
        obj.select_set(False)
    space = window_context()["space_data"]
    space.show_gizmo = True
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.shading.type = "RENDERED"
    space.region_3d.view_distance = 14


def hover() -> None:
    point(middle(window_context()["region"]))


def scenario():
    red_room()
    yield from finished(90)
    whole = picture("with_bounce")
    draws = count_draws()
    yield from toggle(draws, whole)
    yield from split(whole)
    yield from views(whole)
    yield from statistics(whole)
    yield from presets()


def toggle(draws, whole):
    """Shift+Alt+B, as the keymap has it."""
    group = bpy.context.scene.rebound
    hover()
    yield 0.3
    count = len(draws)
    key("shift+alt+b")
    yield from wait_for(lambda: not group.viewport_indirect, 3)
    check("the key turns bounced light off", not group.viewport_indirect)
    yield from wait_for(lambda: not session()._picture.settings["indirect"], 5)
    check("and is shown by the next redraw", len(draws) - count <= 1, len(draws) - count)
    yield from finished()
    without = picture("without_bounce")
    check("there is less light without it", without.mean() < whole.mean() - 0.01, without.mean(), whole.mean())
    hover()
    key("shift+alt+b")
    yield from wait_for(lambda: group.viewport_indirect, 3)
    yield from finished()
    check("and it is back at once", group.viewport_indirect and samples() == 8)
    check("as it was", difference(picture("bounce_again"), whole) < SAME)


def split(whole):
    """The line is dragged with the mouse; left of it there is no bounced light."""
    group, region = bpy.context.scene.rebound, window_context()["region"]
    group.viewport_split, group.viewport_split_place = True, 0.5
    yield from finished()
    half = picture("split")
    part = np.abs(half - whole).max(axis=-1)[80:]
    left, right = (float(side.mean()) for side in np.array_split(part, 2, axis=1))
    check("the left side lacks bounced light, the right is whole", left > 5 * right, round(left, 4), round(right, 4))
    bpy.ops.ed.undo_push(message="Split")
    x, y = middle(region)
    yield from drag((x, y), (x + region.width // 5, y), steps=8)
    place = group.viewport_split_place
    check("the line follows the mouse", 0.6 < place < 0.8, round(place, 3))
    yield from finished()
    screenshot("split_dragged")
    bpy.ops.ed.undo()
    yield from finished()
    group = bpy.context.scene.rebound
    check("undo puts the line back, and no more", group.viewport_split and abs(group.viewport_split_place - 0.5) < 0.01)
    group.viewport_split = False
    yield from finished()
    check("without split it is whole again", difference(picture("split_off"), whole) < SAME)


def views(whole):
    """Every view of both methods is another picture, and leaves none of itself behind."""
    group = bpy.context.scene.rebound
    keys = [item.identifier for item in group.bl_rna.properties["viewport_show"].enum_items]
    every = set()
    for method in ("RSM", "VPL"):
        group.method, shown = method, {"PICTURE": whole[60:]}
        names = [name for name in module("settings").views_of(method) if name != "PICTURE"]
        for name in names if method == "VPL" else [name for name in names if name.startswith(method)]:
            group.viewport_show = name
            yield from finished()
            shot = picture(f"view_{name.lower()}")[60:]
            error = session().status.error
            alike = [other for other, before in shown.items() if difference(shot, before) < SAME]
            check(f"the view {name} is neither the picture nor another view", not alike and not error, *alike, error)
            shown[name] = shot
        every |= set(shown)
    check("every choice was shown", every == set(keys), *sorted(set(keys) - every))
    group.viewport_show = "PICTURE"
    yield from finished()
    check("the picture is back", difference(picture("after_views"), whole) < SAME)


def statistics(whole):
    group = bpy.context.scene.rebound
    group.viewport_stats = True
    yield from finished()
    bpy.data.objects["Light"].data.energy += 1
    yield from finished()
    corner = np.abs(picture("statistics") - whole).max(axis=-1)[-200:, :400]
    check("text stands in the lower left corner", (corner > 0.2).sum() > 300, int((corner > 0.2).sum()))
    group.viewport_stats = False
    yield from finished()
    check("and goes", difference(picture("statistics_off"), whole) < SAME)


def presets():
    """Every preset is taken, sets what no other does, and gives a picture."""
    quality, group = module("ui.quality"), bpy.context.scene.rebound
    taken = {}
    for name in quality.SHIPPED:
        bpy.ops.script.execute_preset(filepath=str(quality.shipped_file(name)), menu_idname="REBOUND_PT_presets")
        values = tuple(getattr(group, kept) for kept in quality.kept_properties())
        check(f"the preset {name} is another one", values not in taken.values())
        taken[name] = values
        group.viewport_samples = 4
        yield from finished(180)
        shot, error = picture(f"preset_{name.lower()}"), session().status.error
        check(f"the preset {name} has a picture", shot.std() > 0.03 and not error, error)


run(scenario)
