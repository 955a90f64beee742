"""Hours of work in minutes: redraws with edits, file loads, engine switches, disabling. Memory must not grow.

REBOUND_SOAK multiplies the counts: 1 is a few minutes, 10 an hour on software OpenGL.
"""

from __future__ import annotations

import gc
import os

import addon_utils
import bpy
from steps import (
    OUT,
    PACKAGE,
    check,
    count_draws,
    finished,
    module,
    run,
    say,
    session,
    sessions,
    viewports,
    wait_for,
    window_context,
)

TIMES = float(os.environ.get("REBOUND_SOAK", "1"))
REDRAWS, LOADS, SWITCHES, REGISTERS = (max(round(n * TIMES), 2) for n in (60, 5, 4, 2))
# The first few times Blender and the driver make what they keep: measured, until the fourth file.
WARM_UP = 4
GROWTH = 0.02  # of what it was after the warm-up


def resident() -> float:
    """MiB of memory that this process has."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def gpu_mib() -> float:
    """MiB that all live devices of Rebound's say they hold."""
    return sum(s._gpu.device.allocated_bytes for s in viewports()) / 2**20


def live_textures() -> int:
    """Textures of Rebound's that Python still knows."""
    gc.collect()
    name = module("device.resources").Texture.__name__  # by name: another copy of the class would count too
    textures = (thing for thing in gc.get_objects() if type(thing).__name__ == name)
    return sum(getattr(texture, "handle", None) is not None for texture in textures)


def measure() -> tuple[float, float, int]:
    return resident(), gpu_mib(), live_textures()


def flat(what: str, before: tuple[float, float, int], after: tuple[float, float, int], repeats: int) -> None:
    """Check that nothing grew; for the process's memory 20 MiB more are forgiven, which Blender itself moves about."""
    say(f"{what}, {repeats} times: resident {before[0]:.0f} -> {after[0]:.0f} MiB, GPU {before[1]:.1f} -> "
        f"{after[1]:.1f} MiB, textures {before[2]} -> {after[2]}")  # fmt: skip
    check(f"{what}: the process does not grow", after[0] < before[0] * (1 + GROWTH) + 20)
    check(f"{what}: the GPU memory does not grow", after[1] <= before[1] * (1 + GROWTH))
    check(f"{what}: no texture is left over", after[2] <= before[2])


def scenario():
    scene = bpy.context.scene
    scene.render.engine = "REBOUND"
    scene.rebound.viewport_samples = 2
    bpy.ops.mesh.primitive_plane_add(size=12, location=(0, 0, -1))
    window_context()["space_data"].overlay.show_overlays = False
    window_context()["space_data"].shading.type = "RENDERED"
    yield from finished(90)
    bpy.ops.wm.save_as_mainfile(filepath=f"{OUT}/soak.blend")
    yield from redraws()
    yield from file_loads()
    yield from engine_switches()
    yield from registers()


def edit(number: int) -> None:
    """One edit of the kind that number says: transform, light, material, mesh, setting, resolution of a map."""
    cube, scene = bpy.data.objects["Cube"], bpy.context.scene
    kind = number % 6
    if kind == 0:
        cube.location.x = 0.1 * (number % 5)
    elif kind == 1:
        bpy.data.objects["Light"].data.energy = 1000 + number % 50
    elif kind == 2:
        nodes = cube.data.materials[0].node_tree.nodes
        nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.2 + 0.1 * (number % 5)
    elif kind == 3:
        cube.data.vertices[0].co.x = -1 - 0.1 * (number % 3)
        cube.data.update()
    elif kind == 4:
        bpy.data.objects["Light"].location.z = 5 + 0.1 * (number % 4)
    else:
        scene.rebound.viewport_soft_shadows = ("SAMPLED", "FILTERED")[number % 2]


def redraws():
    draws = count_draws()
    before = None
    for number in range(REDRAWS + REDRAWS // 5):
        if number == REDRAWS // 5:  # the warm-up: every kind of edit a few times
            yield from finished()
            before = measure()
        count = len(draws)
        edit(number)
        yield 0.01
        yield from wait_for(lambda count=count: len(draws) > count, 5)
    yield from finished()
    flat("redraws with edits", before, measure(), REDRAWS)


def file_loads():
    before = None
    for number in range(LOADS + WARM_UP):
        if number == WARM_UP:
            before = measure()
        bpy.ops.wm.open_mainfile(filepath=f"{OUT}/soak.blend")
        yield 0.5
        window_context()["space_data"].shading.type = "RENDERED"
        yield from finished(90)
        yield from wait_for(lambda: len(viewports()) == 1, 5)
    flat("file loads", before, measure(), LOADS)
    check("file loads: one session is left on the GPU", len(viewports()) == 1, len(viewports()), len(sessions()))


def engine_switches():
    before = None
    for number in range(SWITCHES + 2):
        if number == 2:
            before = measure()
        bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
        yield from wait_for(lambda: not viewports(), 5)
        bpy.context.scene.render.engine = "REBOUND"
        yield from finished()
    flat("engine switches", before, measure(), SWITCHES)


def registers():
    """Disable and enable the extension as the preferences do."""
    before = None
    for number in range(REGISTERS + 2):
        if number == 2:
            before = measure()
        addon_utils.disable(PACKAGE)
        yield 0.5
        addon_utils.enable(PACKAGE)
        bpy.context.scene.render.engine = "REBOUND"
        window_context()["space_data"].shading.type = "RENDERED"
        yield from finished(90)
    flat("disabling and enabling", before, measure(), REGISTERS)
    say("samples at the end:", session().status.samples)


run(scenario)
