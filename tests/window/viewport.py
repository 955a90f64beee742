"""The viewport in a real window: it shows the picture, converges and stops, follows edits, shows errors, recovers."""

from __future__ import annotations

import time

import bpy
import numpy as np
from steps import check, run, say, screenshot, viewport_picture, wait_for, window_context

from rebound import viewport as viewport_module
from rebound.session import SESSIONS

DRAWS: list[float] = []


def count_draws() -> None:
    """Note the seconds of every draw of a viewport."""
    draw = viewport_module.Viewport.draw

    def counted(self, context, depsgraph):
        start = time.perf_counter()
        draw(self, context, depsgraph)
        DRAWS.append(time.perf_counter() - start)

    viewport_module.Viewport.draw = counted


def session():
    return max(SESSIONS.alive, key=lambda s: s.status.samples)


def samples() -> int:
    return session().status.samples if SESSIONS.alive else 0


def build(scene) -> None:
    scene.render.engine = "REBOUND"
    scene.rebound.viewport_samples = 8
    light = bpy.data.objects["Light"].data
    light.type, light.energy = "SPOT", 3000
    bpy.data.objects["Light"].rotation_euler = (0.65, 0.05, 1.85)
    bpy.ops.mesh.primitive_plane_add(size=12, location=(0, 0, -1))
    floor = bpy.data.materials.new("Floor")
    if bpy.app.version < (5, 0):
        floor.use_nodes = True
    floor.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.1, 0.1, 1)
    bpy.context.object.data.materials.append(floor)


def scenario():
    scene = bpy.context.scene
    count_draws()
    with bpy.context.temp_override(**window_context()):
        build(scene)
    space = window_context()["space_data"]
    space.overlay.show_overlays = False
    space.shading.type = "RENDERED"
    yield from wait_for(lambda: samples() >= 8, 90)
    check("converged", samples() == 8, samples(), "samples on", session().status.device)
    say(f"{len(DRAWS)} draws, median {np.median(DRAWS) * 1000:.0f} ms, longest {max(DRAWS):.2f} s")
    yield 1.0
    red = viewport_picture("rendered")
    check("the red floor is in the picture", bool((red[..., 0] > 1.4 * red[..., 1] + 0.05).mean() > 0.05))
    count = len(DRAWS)
    yield 3.0
    check("an idle viewport does not redraw", len(DRAWS) - count <= 2, len(DRAWS) - count)

    bpy.data.objects["Light"].data.color = (0, 0, 1)
    yield from wait_for(lambda: samples() < 8, 5)
    yield from wait_for(lambda: samples() >= 8, 60)
    blue = viewport_picture("blue_light")
    check("the light's colour is followed", bool((blue[..., 2] > 2 * blue[..., 0] + 0.1).mean() > 0.05))

    scene.rebound.viewport_samples = 12
    yield from wait_for(lambda: samples() >= 12, 60)
    check("a setting is followed without another edit", samples() == 12)

    with bpy.context.temp_override(**window_context()):
        bpy.ops.view3d.view_orbit(angle=0.5, type="ORBITLEFT")
    yield from wait_for(lambda: samples() < 12, 5)
    yield from wait_for(lambda: samples() >= 12, 60)
    check("orbiting starts a new picture", samples() == 12)

    yield from local_view()
    yield from errors(scene, space)

    space.shading.type = "SOLID"
    yield 1.5
    check("a closed viewport's session is freed", all(s._gpu is None for s in SESSIONS.alive))
    space.shading.type = "MATERIAL"
    yield 60.0  # EEVEE compiles its shaders
    screenshot("material_preview")
    space.shading.type = "RENDERED"
    yield from wait_for(lambda: samples() >= 12, 60)
    check("rendered again after other modes", samples() == 12)


def local_view():
    """What local view hides is not drawn."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name == "Cube")
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    before = viewport_picture("before_local_view")
    with bpy.context.temp_override(**window_context()):
        bpy.ops.view3d.localview(frame_selected=False)
    yield 1.0
    yield from wait_for(lambda: samples() >= 12, 60)
    inside = viewport_picture("local_view")
    dark = [(picture.max(axis=-1) < 0.05).mean() for picture in (before, inside)]
    check("local view hides the rest", bool(dark[1] < dark[0] - 0.02), *np.round(dark, 3))
    with bpy.context.temp_override(**window_context()):
        bpy.ops.view3d.localview(frame_selected=False)
    yield 1.0
    yield from wait_for(lambda: samples() >= 12, 60)


def errors(scene, space):
    """A fault of ours and one of the user's are shown as text; the next edit tries again."""
    sample = viewport_module.Session.picture

    def broken(*_args):
        raise ZeroDivisionError("made by the scenario")

    viewport_module.Session.picture = broken
    say("a traceback is expected")
    bpy.data.objects["Cube"].location.x += 0.1
    yield 2.0
    lit = viewport_picture("own_fault")
    check("the error stands in the viewport", bool(((lit[..., 0] > 0.5) & (lit[..., 2] < 0.4)).sum() > 100))
    viewport_module.Session.picture = sample
    bpy.data.objects["Cube"].location.x -= 0.1
    yield from wait_for(lambda: samples() >= 12, 60)
    check("the next edit recovers", samples() == 12)


run(scenario)
