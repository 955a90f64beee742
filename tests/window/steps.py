"""What every window scenario uses: a generator of waiting times that Blender's timers drive, checks, screenshots."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator

import bpy

import rebound

OUT = os.environ["WINDOW_OUT"]
FAILURES: list[str] = []


def say(*words) -> None:
    sys.stdout.write(f">> {' '.join(map(str, words))}\n")
    sys.stdout.flush()


def check(what: str, passed: bool, *details) -> None:
    say("ok  " if passed else "FAIL", what, *details)
    if not passed:
        FAILURES.append(what)


def screenshot(name: str) -> None:
    """The whole virtual screen as a PNG in the output folder."""
    subprocess.run(["import", "-window", "root", f"{OUT}/{name}.png"], check=True)


def key(name: str) -> None:
    """A key press, as a user's."""
    subprocess.run(["xdotool", "key", name], check=True)


def window_context() -> dict:
    """Window, area, region and space of the first 3D viewport, for ``bpy.context.temp_override``."""
    window = bpy.context.window_manager.windows[0]
    area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
    region = next(r for r in area.regions if r.type == "WINDOW")
    return {"window": window, "area": area, "region": region, "space_data": area.spaces.active}


def viewport_picture(name: str):
    """Screenshot of the 3D viewport's own pixels: (h, w, 3) floats, row 0 at the top."""
    import numpy as np  # noqa: PLC0415

    screenshot(name)
    area = window_context()["area"]
    data = subprocess.run(
        ["convert", f"{OUT}/{name}.png", "-crop", f"{area.width}x{area.height}+{area.x}+{800 - area.y - area.height}",
         "+repage", "-depth", "8", "rgb:-"], check=True, capture_output=True).stdout  # fmt: skip
    pixels = np.frombuffer(data, np.uint8)
    return pixels.reshape(-1, area.width, 3) / 255


def wait_for(condition: Callable[[], bool], seconds: float) -> Iterator[float]:
    """Wait until ``condition()`` or the time is over."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        yield 0.1


def run(scenario: Callable[[], Iterator[float]]) -> None:
    """Enable Rebound and drive the scenario; quits Blender at its end."""
    bpy.context.preferences.view.show_splash = False
    rebound.register()
    steps = scenario()

    def step():
        try:
            return next(steps)
        except StopIteration:
            say("PASSED" if not FAILURES else f"FAILED: {FAILURES}")
        except Exception:  # noqa: BLE001  the end of the scenario, told in the log
            traceback.print_exc(file=sys.stdout)
        sys.stdout.flush()
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(step, first_interval=2.0)
