"""How long a viewport of 1280 x 800 pixels takes: a table for docs/performance.md.

The scene is examples/cornell_box.blend, or the file that REBOUND_SCENE names. Times are medians. The GPU is waited for
by reading one texel, because Blender's gpu module has no other way.
"""

from __future__ import annotations

import time
from pathlib import Path

import bpy
import gpu
import numpy as np
from mathutils import Quaternion
from steps import check, finished, module, run, say, session, viewports, wait_for, window_context

STEPS = 24  # of an orbit, each a tenth of a radian
Draws = list[tuple[float, float, object]]  # seconds of Python, seconds with the GPU, the picture that was shown


def note_draws() -> Draws:
    """Time every draw. The call that brings the picture to the screen is no Python: software OpenGL draws within it."""
    draws: Draws = []
    viewport, device = module("viewport").Viewport, module("device.blender").BlenderDevice
    draw, show = viewport.draw, device.draw_to_current
    shown = []

    def timed(self, *arguments, **resources):
        start = time.perf_counter()
        show(self, *arguments, **resources)
        shown.append(time.perf_counter() - start)

    def noted(self, context, depsgraph):
        shown.clear()
        start = time.perf_counter()
        draw(self, context, depsgraph)
        python = time.perf_counter() - start - sum(shown)
        if self.session._gpu is not None:
            self.session._gpu.device.finish()
        draws.append((python, time.perf_counter() - start, self.session._picture))

    viewport.draw, device.draw_to_current = noted, timed
    return draws


def view():
    return window_context()["space_data"].region_3d


def turn() -> None:
    view().view_rotation = Quaternion((0, 0, 1), 0.1) @ view().view_rotation


def redrawn() -> float:
    """Seconds of one redraw of the whole region, Blender's part included."""
    texel = gpu.types.GPUTexture((1, 1), format="RGBA8")
    start = time.perf_counter()
    with bpy.context.temp_override(**window_context()):
        bpy.ops.wm.redraw_timer(type="DRAW", iterations=1)
    texel.read()
    return time.perf_counter() - start


def milliseconds(seconds) -> str:
    return f"{np.median(seconds) * 1000:.0f} ms ({min(seconds) * 1000:.0f} to {max(seconds) * 1000:.0f})"


def row(what: str, value: object) -> None:
    say(f"| {what} | {value} |")


def scenario():
    bpy.ops.wm.open_mainfile(filepath=str(Path(__file__).with_name("scene.blend")))
    yield 1.0
    with bpy.context.temp_override(**window_context()):
        bpy.ops.screen.screen_full_area(use_hide_panels=True)
    yield 1.0
    space = window_context()["space_data"]
    space.overlay.show_overlays = space.show_gizmo = False
    scene = bpy.context.scene
    region = window_context()["region"]
    say(f"{scene.name} of {bpy.data.filepath and 'the file'}, {region.width} x {region.height} pixels")
    scene.render.engine = "REBOUND"
    draws = note_draws()
    if scene.camera:
        view().view_perspective = "CAMERA"
        yield 0.5
        view().view_perspective = "PERSP"
    space.shading.type = "RENDERED"
    yield from finished(120)
    row("device", session().status.device)
    yield from orbit(draws)
    yield from unchanged(draws)
    yield from edited(draws)
    yield from whole_redraws(space)


def orbit(draws: Draws):
    for _ in range(4):  # a moving picture compiles and allocates what a still one does not
        turn()
        yield 0.5
    times = []
    for _ in range(STEPS):
        count = len(draws)
        turn()
        window_context()["area"].tag_redraw()
        yield 0.01
        yield from wait_for(lambda count=count: len(draws) > count, 10)
        times.append(draws[count][1])
    row("in view_draw while orbiting, GPU waited for", milliseconds(times))
    check("orbiting: at most 150 ms", np.median(times) <= 0.15, milliseconds(times))


def unchanged(draws: Draws):
    yield from finished(120)
    count = len(draws)
    for _ in range(20):
        window_context()["area"].tag_redraw()
        before = len(draws)
        yield 0.01
        yield from wait_for(lambda before=before: len(draws) > before, 10)
    times = [python for python, _all, _picture in draws[count:]]
    row("Python in view_draw where nothing changed", f"{np.median(times) * 1000:.2f} ms")
    check("an unchanged redraw: at most 2 ms of Python", np.median(times) <= 0.002)


def edited(draws: Draws):
    """How many redraws until what is shown has an edit in it."""
    worst = 0
    for value in (0.9, 0.8, 0.7):
        yield from finished(120)
        old, count = session()._picture, len(draws)
        bpy.data.materials[0].diffuse_color[0] = value
        light = next(obj for obj in bpy.data.objects if obj.type == "LIGHT")
        light.data.energy *= value
        yield 0.01
        yield from wait_for(lambda old=old, count=count: any(p is not old for *_, p in draws[count:]), 10)
        worst = max(worst, next(n for n, (*_, p) in enumerate(draws[count:], 1) if p is not old))
    row("redraws until an edited light is in the picture", worst)
    check("an edit is shown after at most 2 redraws", worst <= 2)


def whole_redraws(space):
    """The same orbit as whole redraws of the region, for every way to draw it."""
    ways = {"Rebound": ("REBOUND", "RENDERED"), "EEVEE": ("BLENDER_EEVEE", "RENDERED"), "Solid": ("REBOUND", "SOLID")}
    if bpy.app.version < (5, 0):
        ways["EEVEE"] = ("BLENDER_EEVEE_NEXT", "RENDERED")
    for name, (engine, shading) in ways.items():
        bpy.context.scene.render.engine = engine
        space.shading.type = shading
        yield 3.0
        # EEVEE compiles its shaders beside the redraws, which take the last ones meanwhile.
        slow = time.monotonic() + 120
        for _ in range(6):
            turn()
            redrawn()
            yield 2.0 if name == "EEVEE" and time.monotonic() < slow else 0.1
        times = []
        for _ in range(STEPS):
            turn()
            times.append(redrawn())
            yield 0.01
        row(f"a whole redraw of the region while orbiting: {name}", milliseconds(times))
    yield from wait_for(lambda: not viewports(), 5)


run(scenario)
