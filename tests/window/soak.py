"""Hours of work in half an hour: 1,000 redraws with edits, 50 file loads, 50 engine switches, 20 times disabled and
enabled. Memory of the process and of the GPU must stay flat.

Blender may come with an allocator of its own that keeps what was freed by the hundred MiB, more or less of it at every
look. tools/test_window.py puts the C library's in its place here: resident memory is then what is in use.

REBOUND_SOAK multiplies the counts; REBOUND_SOAK_PARTS names those of PARTS that are wanted, with commas between.
"""

from __future__ import annotations

import ctypes
import gc
import os
from collections.abc import Callable
from typing import NamedTuple

import addon_utils
import bpy
import gpu
from steps import (
    OUT,
    PACKAGE,
    Steps,
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
REDRAWS, LOADS, SWITCHES, REGISTERS = (max(round(n * TIMES), 2) for n in (1000, 50, 50, 20))
# The first few times Blender and the driver make what they keep: as often as this before the first look.
WARM_UP = {"redraws": 60, "file_loads": 8, "engine_switches": 4, "registers": 4}
LOOKS = 10  # at memory in a part, beside the one before it
LISTS = 64  # of what is to be drawn, that llvmpipe has at most
GROWTH = 0.02  # of what it was after the warm-up


class Mallinfo(ctypes.Structure):
    """The C library's struct mallinfo2."""

    _fields_ = [(name, ctypes.c_size_t) for name in (
        "arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost",
    )]  # fmt: skip


class Memory(NamedTuple):
    """What there is at one look."""

    resident: float  # MiB of the process
    in_use: float  # MiB that the C library's allocator gave out and did not get back
    gpu: float  # MiB that all live devices of Rebound's say they hold
    textures: int  # of Rebound's that Python still knows


def process_mib() -> tuple[float, float]:
    """Resident and in use, without what Python and the C library keep for later."""
    gc.collect()
    library = ctypes.CDLL(None)
    library.malloc_trim(0)
    library.mallinfo2.restype = Mallinfo
    found = library.mallinfo2()
    with open("/proc/self/statm") as file:
        resident = int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return resident / 2**20, (found.uordblks + found.hblkhd) / 2**20


def gpu_mib() -> float:
    return sum(s._gpu.device.allocated_bytes for s in viewports()) / 2**20


def live_textures() -> int:
    name = module("device.resources").Texture.__name__  # by name: another copy of the class would count too
    textures = (thing for thing in gc.get_objects() if type(thing).__name__ == name)
    return sum(getattr(texture, "handle", None) is not None for texture in textures)


def overwrite_lists() -> None:
    """In a viewport's own context: let the driver go of the textures of what it drew long ago.

    llvmpipe has up to LISTS lists of what is to be drawn. A list that was done keeps its textures alive until it is
    filled again, and all of them are only where the driver is far behind: as here, after a sample of a picture.
    """
    for _ in range(LISTS):
        small = gpu.types.GPUFrameBuffer(color_slots=gpu.types.GPUTexture((1, 1), format="RGBA8"))
        with small.bind():
            small.clear(color=(0, 0, 0, 0))


def look(found: list[Memory]) -> Steps:
    """Note the memory, once what was freed is gone from the driver too."""
    handlers = [bpy.types.SpaceView3D.draw_handler_add(overwrite_lists, (), "WINDOW", when)
                for when in ("POST_VIEW", "POST_PIXEL")]  # fmt: skip
    bpy.data.objects["Light"].data.energy += 1  # a new picture
    yield from finished(90)
    for handler in handlers:
        bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    found.append(Memory(*process_mib(), gpu_mib(), live_textures()))


def soak(part: str, times: int, once: Callable[[int], Steps]) -> Steps:
    """Do ``once`` for the warm-up and then ``times`` times; check that nothing grew."""
    found: list[Memory] = []
    for number in range(WARM_UP[part] + times):
        done = number - WARM_UP[part]
        if done >= 0 and done % max(times // LOOKS, 1) == 0:
            yield from look(found)
            say(part, done, "resident {:.0f} MiB, in use {:.0f}, GPU {:.1f}, {} textures".format(*found[-1]))
        yield from once(number)
    yield from look(found)
    flat(part.replace("_", " "), found, times)


def flat(what: str, found: list[Memory], times: int) -> None:
    """Check that the last look saw no more than the first."""
    before, after = found[0], found[-1]
    for name in Memory._fields:
        say(f"{what}, {times} times, {name}:", ", ".join(f"{getattr(memory, name):.0f}" for memory in found))
    check(f"{what}: Blender uses the C library's allocator", before.in_use > 0.1 * before.resident)
    grown = after.resident / before.resident - 1
    check(f"{what}: the process does not grow", grown < GROWTH, f"{100 * grown:+.1f} %")
    check(f"{what}: the GPU memory does not grow", after.gpu <= before.gpu * (1 + GROWTH))
    # How many there are hangs on which edit was the last: later looks must not see more than earlier ones.
    textures = [memory.textures for memory in found]
    half = len(textures) // 2
    check(f"{what}: no texture is left over", max(textures[half:]) <= max(textures[:half]))


def scenario():
    wanted = os.environ.get("REBOUND_SOAK_PARTS", ",".join(PARTS)).split(",")
    scene = bpy.context.scene
    scene.render.engine = "REBOUND"
    scene.rebound.viewport_samples = 2
    scene.rebound.viewport_vpl_scale = "EIGHTH"  # quicker, and as many textures
    bpy.ops.mesh.primitive_plane_add(size=12, location=(0, 0, -1))
    window_context()["space_data"].overlay.show_overlays = False
    window_context()["space_data"].shading.type = "RENDERED"
    yield from finished(90)
    bpy.ops.wm.save_as_mainfile(filepath=f"{OUT}/soak.blend")
    for part in wanted:
        yield from PARTS[part]()
    say("samples at the end:", session().status.samples)


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
        scene.rebound.viewport_soft_shadows = ("SAMPLED", "FILTERED")[number // 6 % 2]


def redraws() -> Steps:
    draws = count_draws()

    def once(number: int) -> Steps:
        count = len(draws)
        edit(number)
        yield 0.01
        yield from wait_for(lambda: len(draws) > count, 5)

    yield from soak("redraws", REDRAWS, once)


def file_loads() -> Steps:
    def once(_number: int) -> Steps:
        bpy.ops.wm.open_mainfile(filepath=f"{OUT}/soak.blend")
        yield 0.5
        window_context()["space_data"].shading.type = "RENDERED"
        yield from finished(90)
        yield from wait_for(lambda: len(viewports()) == 1, 5)

    yield from soak("file_loads", LOADS, once)
    check("file loads: one session is left on the GPU", len(viewports()) == 1, len(viewports()), len(sessions()))


def engine_switches() -> Steps:
    def once(_number: int) -> Steps:
        bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
        yield from wait_for(lambda: not viewports(), 5)
        bpy.context.scene.render.engine = "REBOUND"
        yield from finished()

    yield from soak("engine_switches", SWITCHES, once)


def registers() -> Steps:
    """Disable and enable the extension as the preferences do.

    Not with its engine in the viewport: Blender would draw by EEVEE meanwhile, whose first picture takes 570 MiB.
    """

    def once(_number: int) -> Steps:
        bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
        addon_utils.disable(PACKAGE)
        yield 0.5
        addon_utils.enable(PACKAGE)
        bpy.context.scene.render.engine = "REBOUND"
        window_context()["space_data"].shading.type = "RENDERED"
        yield from finished(90)

    yield from soak("registers", REGISTERS, once)


PARTS = {"redraws": redraws, "file_loads": file_loads, "engine_switches": engine_switches, "registers": registers}

run(scenario)
