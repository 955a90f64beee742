"""What every window scenario uses: a generator of waiting times that Blender's timers drive, checks, eyes and hands.

Rebound is the installed extension: ``module("viewport")`` is its viewport.py. Places on the screen are pixels from its
upper left corner, as the mouse has them; Blender counts from the lower left.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from importlib import import_module
from types import ModuleType
from typing import Any

import bpy
import numpy as np

PACKAGE = "bl_ext.user_default.rebound"
OUT = os.environ["WINDOW_OUT"]
SCREEN = (1280, 800)
FAILURES: list[str] = []
STARTED = time.monotonic()
SAME = 0.004  # mean difference of two pictures of the same: noise of a few samples

Place = tuple[int, int]
Steps = Iterator[float]


def module(name: str) -> ModuleType:
    """A module of the installed extension."""
    return import_module(f"{PACKAGE}.{name}")


def say(*words) -> None:
    sys.stdout.write(f">> {' '.join(map(str, words))}\n")
    sys.stdout.flush()


def check(what: str, passed, *details) -> None:
    say("ok  " if passed else "FAIL", what, *details, f"[{time.monotonic() - STARTED:.0f} s]")
    if not passed:
        FAILURES.append(what)


# --- what there is in the window -------------------------------------------------------------------------------------


def areas(kind: str) -> list[tuple[Any, Any]]:
    """(window, area) of every editor of a kind, in Blender's order."""
    windows = bpy.context.window_manager.windows
    return [(window, area) for window in windows for area in window.screen.areas if area.type == kind]


def window_context(number: int = 0) -> dict:
    """Window, area, region and space of a 3D viewport, for ``bpy.context.temp_override``."""
    window, area = areas("VIEW_3D")[number]
    region = next(r for r in area.regions if r.type == "WINDOW")
    return {"window": window, "area": area, "region": region, "space_data": area.spaces.active}


def select(name: str) -> None:
    """Make one object the only selected one, and the active one."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name == name)
    bpy.context.view_layer.objects.active = bpy.data.objects[name]


def cube_on_floor(samples: int) -> Any:
    """Blender's own scene, brighter and with a floor, in the first 3D viewport without overlays; its space."""
    scene = bpy.context.scene
    scene.render.engine = "REBOUND"
    scene.rebound.viewport_samples = samples
    bpy.data.objects["Light"].data.energy = 2000
    bpy.ops.mesh.primitive_plane_add(size=12, location=(0, 0, -1))
    space = window_context()["space_data"]
    space.overlay.show_overlays = False
    space.shading.type = "RENDERED"
    return space


def principled(name: str) -> tuple[Any, Any]:
    """A new material and its Principled BSDF."""
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    return material, material.node_tree.nodes["Principled BSDF"]


def sessions() -> list:
    return list(module("session").SESSIONS.alive)


def session():
    """The session that has the most samples."""
    return max(sessions(), key=lambda s: s.status.samples)


def samples() -> int:
    return session().status.samples if sessions() else 0


def viewports() -> list:
    """Every viewport of Rebound's that holds something on the GPU, by its session."""
    return [s for s in sessions() if s._gpu is not None]


def count_draws() -> list[float]:
    """A list that from now on gets the seconds of every draw of a viewport of Rebound's."""
    draws: list[float] = []
    viewport = module("viewport").Viewport
    draw = viewport.draw

    def counted(self, context, depsgraph):
        start = time.perf_counter()
        draw(self, context, depsgraph)
        draws.append(time.perf_counter() - start)

    viewport.draw = counted
    return draws


def note_log() -> list[str]:
    """A list that from now on gets every warning and error of Rebound's log: as text, for a record holds its frames."""
    lines: list[str] = []

    class Note(logging.Handler):
        def emit(self, record):
            lines.append(f"{record.levelname} {record.getMessage()}")
            logging.lastResort.handle(record)  # as where nobody listens

    logging.getLogger("rebound").addHandler(Note(logging.WARNING))
    return lines


# --- eyes ------------------------------------------------------------------------------------------------------------


def screenshot(name: str) -> None:
    """The whole virtual screen as a PNG in the output folder."""
    subprocess.run(["import", "-window", "root", f"{OUT}/{name}.png"], check=True)


def picture(name: str, area=None) -> np.ndarray:
    """Screenshot of an editor's own pixels, of the first 3D viewport's where none is given: (h, w, 3), row 0 on top."""
    area = area or window_context()["area"]
    screenshot(name)
    size = f"{area.width}x{area.height}+{area.x}+{SCREEN[1] - area.y - area.height}"
    command = ["convert", f"{OUT}/{name}.png", "-crop", size, "+repage", "-depth", "8", "rgb:-"]
    data = subprocess.run(command, check=True, capture_output=True).stdout
    return np.frombuffer(data, np.uint8).reshape(-1, area.width, 3) / 255


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Mean difference of two pictures, as a part of white."""
    return float(np.abs(a - b).mean())


# --- hands -----------------------------------------------------------------------------------------------------------


def xdotool(*words) -> None:
    subprocess.run(["xdotool", *map(str, words)], check=True)


def key(name: str) -> None:
    """A key press, as a user's, for what is under the mouse."""
    xdotool("key", name)


def press_f12(samples: int) -> Steps:
    """Begin a final render by its key, in whatever window is on top; fails where none begins."""
    bpy.context.scene.rebound.samples = samples
    point(middle(window_context()["area"]))
    yield 0.5
    xdotool("key", 96)  # its key code: by its name xdotool holds Alt down with it
    yield from wait_for(rendering, 10)
    if not rendering():
        screenshot("f12_not_begun")
        check("F12 begins a render", False)


def point(place: Place) -> None:
    """Move the mouse; a second, tiny move makes Blender notice the editor that it is in."""
    x, y = place
    xdotool("mousemove", x - 1, y, "mousemove", x, y)


def click(place: Place, button: int = 1) -> Steps:
    """Press and release a button of the mouse: 1 left, 2 middle, 3 right."""
    point(place)
    yield 0.3
    xdotool("click", button)
    yield 0.5


def drag(start: Place, end: Place, button: int = 1, steps: int = 6, pause: float = 0.1) -> Steps:
    """Move the mouse with a button held down, in steps that Blender sees one by one."""
    point(start)
    yield 0.3
    xdotool("mousedown", button)
    for step in range(1, steps + 1):
        yield pause
        xdotool("mousemove", *(round(a + (b - a) * step / steps) for a, b in zip(start, end, strict=True)))
    yield pause
    xdotool("mouseup", button)
    yield 0.3


def middle(area_or_region) -> Place:
    """The middle of an area or a region on the screen."""
    at = area_or_region
    return at.x + at.width // 2, SCREEN[1] - at.y - at.height // 2


# --- time ------------------------------------------------------------------------------------------------------------


def wait_for(condition: Callable[[], bool], seconds: float) -> Steps:
    """Wait until ``condition()`` or the time is over."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        yield 0.1


def finished(seconds: float = 60) -> Steps:
    """Wait until every viewport has the samples that it wants and keeps them; fails where that takes too long.

    Between two looks Blender goes once through its main loop: notices edits, redraws, shows. A few looks are enough for
    an edit to arrive and for the last redraw to reach the screen.
    """
    end, since = time.monotonic() + seconds, time.monotonic()
    while time.monotonic() < since + 0.5:
        yield 0.1
        counts = [s.status.samples for s in viewports()]
        if not counts or min(counts) < bpy.context.scene.rebound.viewport_samples:
            since = time.monotonic()
        if time.monotonic() > end:
            check(f"a picture is finished within {seconds:.0f} s", False, counts)
            return


def rendering() -> bool:
    return bpy.app.is_job_running("RENDER")


def run(scenario: Callable[[], Steps]) -> None:
    """Drive the scenario once Blender's window is there; quits Blender at its end."""
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.use_save_prompt = False
    steps = scenario()

    def step():
        try:
            return next(steps)
        except StopIteration:
            say(f"FAILED: {FAILURES}" if FAILURES else "PASSED")
            say("DONE")
        except Exception:  # noqa: BLE001  the end of the scenario, told in the log
            traceback.print_exc(file=sys.stdout)
        sys.stdout.flush()
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(step, first_interval=2.0, persistent=True)
