"""The viewport in a real window: it shows the picture, converges and stops, follows edits, shows errors, recovers."""

from __future__ import annotations

import bpy
import numpy as np
from steps import (
    check,
    count_draws,
    difference,
    finished,
    module,
    picture,
    principled,
    run,
    samples,
    say,
    select,
    session,
    viewports,
    wait_for,
    window_context,
)


def build(scene) -> None:
    scene.render.engine = "REBOUND"
    scene.rebound.viewport_samples = 8
    light = bpy.data.objects["Light"].data
    light.type, light.energy = "SPOT", 3000
    bpy.data.objects["Light"].rotation_euler = (0.65, 0.05, 1.85)
    # So wide that grids of voxels lie around one another: lavapipe is easily crashed by them.
    bpy.ops.mesh.primitive_plane_add(size=20, location=(0, 0, -1))
    floor, surface = principled("Floor")
    surface.inputs["Base Color"].default_value = (0.8, 0.1, 0.1, 1)
    bpy.context.object.data.materials.append(floor)


def scenario():
    scene = bpy.context.scene
    draws = count_draws()
    with bpy.context.temp_override(**window_context()):
        build(scene)
    space = window_context()["space_data"]
    space.overlay.show_overlays = False
    space.shading.type = "RENDERED"
    yield from finished(90)
    check("converged", samples() == 8, samples(), "samples on", session().status.device)
    say(f"{len(draws)} draws, median {np.median(draws) * 1000:.0f} ms, longest {max(draws):.2f} s")
    red = picture("rendered")
    check("the red floor is in the picture", (red[..., 0] > 1.4 * red[..., 1] + 0.05).mean() > 0.05)
    count = len(draws)
    yield 3.0
    check("an idle viewport does not redraw", len(draws) - count <= 2, len(draws) - count)

    bpy.data.objects["Light"].data.color = (0, 0, 1)
    yield from finished()
    blue = picture("blue_light")
    check("the light's colour is followed", (blue[..., 2] > 1.5 * blue[..., 0] + 0.1).mean() > 0.03)

    scene.rebound.viewport_samples = 12
    yield from finished()
    check("a setting is followed without another edit", samples() == 12)

    with bpy.context.temp_override(**window_context()):
        bpy.ops.view3d.view_orbit(angle=0.5, type="ORBITLEFT")
    yield from wait_for(lambda: samples() < 12, 5)
    check("orbiting starts a new picture", samples() < 12)
    yield from finished()

    yield from local_view()
    yield from errors()

    space.shading.type = "SOLID"
    yield from wait_for(lambda: not viewports(), 3)
    check("a closed viewport's session is freed", not viewports())
    space.shading.type = "MATERIAL"
    yield 3.0
    space.shading.type = "RENDERED"
    yield from finished(90)
    check("rendered again after other modes", samples() == 12)


def local_view():
    """What local view hides is not drawn."""
    select("Cube")
    before = picture("before_local_view")
    with bpy.context.temp_override(**window_context()):
        bpy.ops.view3d.localview(frame_selected=False)
    yield from finished()
    inside = picture("local_view")
    floor = [(shot[..., 2] > 1.5 * shot[..., 1] + 0.05).mean() for shot in (before, inside)]
    check("local view hides the rest", floor[0] > 0.05 and floor[1] < 0.01, *np.round(floor, 3))
    with bpy.context.temp_override(**window_context()):
        bpy.ops.view3d.localview(frame_selected=False)
    yield from finished()
    check("leaving local view brings it back", difference(picture("after_local_view"), before) < 0.005)


def errors():
    """A fault of ours is shown as text; the next edit tries again."""
    session_class = module("session").Session
    working = session_class.picture

    def broken(*_args):
        raise ZeroDivisionError("made by the scenario")

    session_class.picture = broken
    say("a traceback is expected")
    bpy.data.objects["Cube"].location.x += 0.1
    yield 2.0
    lit = picture("own_fault")
    check("the error stands in the viewport", ((lit[..., 0] > 0.5) & (lit[..., 2] < 0.4)).sum() > 100)
    session_class.picture = working
    bpy.data.objects["Cube"].location.x -= 0.1
    yield from finished()
    check("the next edit recovers", samples() == 12)


run(scenario)
