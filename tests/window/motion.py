"""What moves by itself or under a brush: an animation that plays, and a stroke of the sculptor's."""

from __future__ import annotations

import bpy
from steps import (
    SAME,
    check,
    count_draws,
    cube_on_floor,
    difference,
    drag,
    finished,
    key,
    middle,
    picture,
    point,
    run,
    samples,
    select,
    session,
    wait_for,
    window_context,
)


def scenario():
    space = cube_on_floor(samples=4)
    space.show_gizmo = False
    space.region_3d.view_location, space.region_3d.view_distance = (0, 0, 0), 12
    yield from finished(90)
    yield from play(count_draws())
    yield from properties_that_move()
    yield from sculpt(count_draws())


def play(draws):
    """Space plays: every frame that Blender shows is drawn, none is refined; Esc goes back to where it began."""
    scene, cube = bpy.context.scene, bpy.data.objects["Cube"]
    scene.frame_start, scene.frame_end, scene.sync_mode = 1, 48, "NONE"
    for frame, place in ((1, 0.0), (25, 3.0), (48, 0.0)):
        cube.location.y = place
        cube.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    yield from finished()
    first = picture("frame_1")
    point(middle(window_context()["region"]))
    yield 0.3
    count, frames = len(draws), set()
    key("space")
    yield from wait_for(lambda: bpy.context.screen.is_animation_playing, 5)
    for _ in range(60):
        yield 0.1
        frames.add(scene.frame_current)
    shown = len(draws) - count
    check("an animation plays, with a picture for its frames", shown >= 0.5 * len(frames) > 2, shown, len(frames))
    key("Escape")
    yield from wait_for(lambda: not bpy.context.screen.is_animation_playing, 5)
    yield from finished()
    check("Esc ends it where it began", scene.frame_current == 1 and samples() == 4, scene.frame_current)
    check("with the picture of before", difference(picture("frame_1_again"), first) < SAME)


def properties_that_move():
    """Rebound's own properties: a light's bounce with keys, a viewport's samples with a driver."""
    scene, light = bpy.context.scene, bpy.data.objects["Light"].data
    for frame, strength in ((1, 0.0), (11, 8.0)):
        light.rebound.bounce_strength = strength
        light.keyframe_insert("rebound.bounce_strength", frame=frame)
    scene.driver_add("rebound.viewport_samples").driver.expression = "frame + 2"
    bright = []
    for frame in (1, 6, 11):
        scene.frame_set(frame)
        yield from finished(90)
        bright.append(float(picture(f"animated_bounce_{frame}").mean()))
        check(f"frame {frame}: the driver's samples", samples() == frame + 2, samples())
    rises = bright[1] > bright[0] + 0.002 and bright[2] > bright[1] + 0.002
    check("an animated bounce is followed", rises, *(round(value, 4) for value in bright))
    scene.driver_remove("rebound.viewport_samples")
    scene.rebound.viewport_samples = 4
    light.animation_data_clear()
    light.rebound.bounce_strength = 1.0
    scene.frame_set(1)
    yield from finished()


def sculpt(draws):
    """A stroke with the first brush in Sculpt Mode."""
    select("Cube")
    with bpy.context.temp_override(**window_context()):
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.subdivide(number_cuts=20)
        bpy.ops.object.mode_set(mode="SCULPT")
        bpy.ops.ed.undo_push(message="Sculpt Mode")  # as keys do: Blender aborts at an undo of a stroke without it
    yield from finished()
    before, count = picture("before_stroke"), len(draws)
    x, y = middle(window_context()["region"])
    yield from drag((x - 30, y), (x + 30, y + 15), steps=10, pause=0.2)
    during = len(draws) - count
    yield from finished()
    after = picture("after_stroke")
    check("a stroke has pictures on the way", during >= 3, during)
    check("and shows what it made", difference(after, before) > 1e-3, round(difference(after, before), 5))
    key("ctrl+z")
    yield from finished()
    check("undo takes it back", difference(picture("stroke_undone"), before) < SAME)
    check("without an error", not session().status.error, session().status.error)


run(scenario)
