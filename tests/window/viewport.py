"""The viewport in a real window: it shows the picture, converges and stops, follows edits, shows errors, recovers."""

from __future__ import annotations

import bpy
import gpu
import numpy as np
from steps import (
    check,
    count_draws,
    difference,
    finished,
    module,
    note_log,
    picture,
    principled,
    run,
    samples,
    say,
    select,
    session,
    sessions,
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
    yield from missing(space)

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
    """A fault of ours is shown as text and logged once, however often it is redrawn; the next edit tries again."""
    told, tries = note_log(), []
    session_class = module("session").Session
    working = session_class.picture

    def broken(*_args):
        tries.append(1)
        raise ZeroDivisionError("made by the scenario")

    session_class.picture = broken
    say("a traceback is expected")
    bpy.data.objects["Cube"].location.x += 0.1
    yield from wait_for(lambda: bool(tries), 10)
    yield 1.0
    lit = text_pixels(picture("own_fault"))
    check("the error stands in the viewport", lit > 100, lit)
    for _ in range(5):
        window_context()["area"].tag_redraw()
        yield 0.2
    check("an error is logged once, and not tried again", len(told) == len(tries) == 1, len(tries), *told)
    say("a traceback is expected")
    bpy.data.objects["Cube"].location.x += 0.1
    yield from wait_for(lambda: len(tries) > 1, 5)
    check("the next edit tries again", len(tries) == 2, len(tries))
    session_class.picture = working
    bpy.data.objects["Cube"].location.x -= 0.2
    yield from finished()
    check("and with the fault gone it recovers", samples() == 12)


def text_pixels(shot: np.ndarray) -> int:
    """Pixels in the orange of errors, as the view transform shows it; nothing else in the viewport has it."""
    red, green, blue = shot[60:, :, 0], shot[60:, :, 1], shot[60:, :, 2]
    return int(((red > 0.7) & (green > 0.4) & (green < 0.75) & (blue < 0.55)).sum())


def missing(space):
    """What a GPU lacks is named in the viewport, without a traceback."""
    texture = gpu.types.GPUTexture

    def refused(size, **options):
        if options.get("format") == "RG16F":
            raise RuntimeError("unknown format")
        return texture(size, **options)

    space.shading.type = "SOLID"
    yield from wait_for(lambda: not viewports(), 5)
    gpu.types.GPUTexture = refused
    space.shading.type = "RENDERED"
    yield from wait_for(lambda: any(s.status.error for s in sessions()), 20)
    yield 1.0
    errors = [s.status.error for s in sessions() if s.status.error]
    lit = text_pixels(picture("missing_format"))
    gpu.types.GPUTexture = texture
    check("a missing format of textures is named", len(errors) == 1 and "RG16F" in errors[0], *errors)
    check("as text in the viewport", lit > 100, lit)
    bpy.data.objects["Cube"].location.x += 0.01
    yield from finished(90)
    check("where it is there, the next edit renders", samples() == 12)


run(scenario)
