"""How large a scene may be in Blender: `.venv/bin/python benchmarks/bench_sync.py [--cases NAME ...]`, some minutes.

Scenes are made here, of bumpy sheets in rows. Each has a Blender of its own, so that memory is its alone. Python's time
is a redraw's less what is spent inside Blender's GPU calls, which on software OpenGL do the drawing.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import checkout  # noqa: F401  makes `rebound` importable
import gpu
import numpy as np

import rebound
from rebound.device.blender import BlenderDevice
from rebound.session import Picture
from rebound.tests.support.blender_build import link, material
from rebound.tests.support.viewport_build import View

SAID = "figures: "
REPEATED = 9  # of which the median is taken
SIZE = (960, 540)


@dataclass(frozen=True)
class Case:
    """``objects`` placed objects of ``meshes`` meshes with ``triangles`` each, under ``lights`` lamps."""

    objects: int
    meshes: int
    triangles: int
    lights: int = 8


CASES = {
    "10,000 objects of 100 meshes": Case(10_000, 100, 200),
    "1 million triangles in 100 meshes": Case(100, 100, 10_000),
    "1 million triangles in 1,000 meshes": Case(1000, 1000, 1000),
    "5 million triangles in 500 meshes": Case(500, 500, 10_000),
}


def build(case: Case) -> None:
    """Fill an empty file with the case; the camera sees all of it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "REBOUND"
    materials = [material(f"Material {i}", (0.2 + 0.06 * i, 0.5, 0.4)) for i in range(10)]
    meshes = [_sheet(i, case.triangles) for i in range(case.meshes)]
    for number, made in enumerate(meshes):
        made.materials.append(materials[number % len(materials)])
    side = int(case.objects**0.5 + 0.999)
    for k in range(case.objects):
        place = ((k % side - side / 2) * 2.2, (k // side - side / 2) * 2.2, 0)
        link(f"Object {k}", meshes[k % case.meshes], location=place)
    for k in range(case.lights):
        lamp: Any = bpy.data.lights.new(f"Lamp {k}", ("POINT", "SPOT", "AREA", "SPOT")[k % 4])
        lamp.energy = 500 * side
        link(lamp.name, lamp, location=((k % 3 - 1) * side * 0.6, (k // 3 - 1) * side * 0.6, 8))
    place = {"location": (0, -side * 1.5, side * 0.9), "rotation_euler": (1.05, 0, 0)}
    scene.camera = link("Camera", bpy.data.cameras.new("Camera"), **place)
    scene.world = bpy.data.worlds.new("World")
    bpy.context.view_layer.update()


def _sheet(number: int, triangles: int):
    """A mesh of a bumpy sheet, 2 m a side, smooth, with a UV map; no two are alike, or they would be one."""
    cells = max(int((triangles / 2) ** 0.5), 1)
    edge = np.linspace(-1.0, 1.0, cells + 1, dtype=np.float32)
    x, y = np.meshgrid(edge, edge, indexing="ij")
    made = bpy.data.meshes.new(f"Sheet {number}")
    made.vertices.add((cells + 1) ** 2)
    made.vertices.foreach_set("co", np.stack((x, y, 0.1 * np.sin(6 * x + number) * np.cos(5 * y)), -1).ravel())
    index = np.arange((cells + 1) ** 2, dtype=np.int32).reshape(cells + 1, cells + 1)
    corners = np.stack((index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]), -1).ravel()
    made.loops.add(len(corners))
    made.loops.foreach_set("vertex_index", corners)
    made.polygons.add(len(corners) // 4)
    made.polygons.foreach_set("loop_start", np.arange(0, len(corners), 4, dtype=np.int32))
    made.uv_layers.new(name="UVMap")
    made.shade_smooth()
    made.update(calc_edges=True)
    return made


# --- in Blender ------------------------------------------------------------------------------------------------------


class GpuTime:
    """Seconds of this thread inside Blender's GPU calls: all else of a redraw is Python's."""

    WATCHED = ("_draw", "_dispatch", "_read", "_clear", "_create_texture", "_create_vertices", "_end", "finish")

    def __init__(self) -> None:
        self.seconds = 0.0
        self._depth = 0

    @contextmanager
    def watching(self) -> Iterator[None]:
        """While the device's calls are timed."""
        originals = {name: getattr(BlenderDevice, name) for name in self.WATCHED}
        for name, original in originals.items():
            setattr(BlenderDevice, name, self._timed(original))
        try:
            yield
        finally:
            for name, original in originals.items():
                setattr(BlenderDevice, name, original)

    def _timed(self, call: Callable) -> Callable:
        def timed(*arguments, **options):
            self._depth += 1
            start = time.thread_time()
            try:
                return call(*arguments, **options)
            finally:
                self._depth -= 1
                if not self._depth:
                    self.seconds += time.thread_time() - start

        return timed


def memory() -> float:
    """Bytes of this process that are in memory now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def peak_memory() -> float:
    """The most that they were."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))


def measure(case: Case) -> dict[str, float]:
    """The figures of one case, in a Blender that has nothing else."""
    if bpy.app.version >= (5, 2):
        gpu.init()
    rebound.register()
    build(case)
    blenders = memory()
    viewport = _Followed()
    found = {"read, s": viewport.sync_seconds, "first picture, s": viewport.sync_seconds + viewport.first_picture()}
    found["memory above Blender's, GB"] = (memory() - blenders) / 1e9
    found["most at once, GB"] = (peak_memory() - blenders) / 1e9
    found["redraw, nothing changed: Python, ms"] = 1e3 * viewport.python_of_a_redraw()
    before = viewport.uploads()
    moved = [viewport.move(bpy.data.objects["Object 0"], 0.01 * k) for k in range(1, REPEATED + 1)]
    found["one object moved: read, ms"] = 1e3 * statistics.median(sync for sync, _ in moved)
    found["one object moved: compared and uploaded, ms"] = 1e3 * statistics.median(upload for _, upload in moved)
    found["meshes uploaded by that"] = viewport.uploads() - before
    found["all read again, ms"] = 1e3 * statistics.median(viewport.sync(None) for _ in range(REPEATED))
    return found


class _Followed:
    """A viewport that is told of every update, as in a window."""

    def __init__(self) -> None:

        self.view = View(bpy.context.scene, *SIZE)
        self.session = self.view.viewport.session
        self.depsgraph = bpy.context.evaluated_depsgraph_get()
        self.sync_seconds = self.sync(None)
        self.view.viewport._synced = True

    def sync(self, depsgraph) -> float:
        """Seconds of one update; without a depsgraph one that says nothing of what changed."""
        start = time.perf_counter()
        self.session.sync(depsgraph or self.depsgraph, for_viewport=True)
        return time.perf_counter() - start

    def first_picture(self) -> float:
        start = time.perf_counter()
        self.view.draw()
        return time.perf_counter() - start

    def uploads(self) -> int:
        return self.session._ready().scene.uploads["meshes"]

    def python_of_a_redraw(self) -> float:
        """Median over whole samples of a picture that goes on."""
        picture, gpu_time, found = self.view.picture, GpuTime(), []
        assert isinstance(picture, Picture)
        with gpu_time.watching():
            for _ in range(REPEATED):
                start, before = time.thread_time(), gpu_time.seconds
                while not picture.piece():
                    pass
                found.append(time.thread_time() - start - (gpu_time.seconds - before))
        return statistics.median(found)

    def move(self, obj, height: float) -> tuple[float, float]:
        """Seconds of reading after the object moved, and of comparing and uploading."""
        taken: list[float] = []
        handlers = bpy.app.handlers.depsgraph_update_post
        handlers.append(lambda _scene, depsgraph: taken.append(self.sync(depsgraph)))
        obj.location.z = height
        bpy.context.view_layer.update()
        handlers.pop()
        start = time.perf_counter()
        self.session._ready().upload(self.session.scene)
        return taken[0], time.perf_counter() - start


# --- the table -------------------------------------------------------------------------------------------------------


def _told(name: str) -> dict[str, float]:
    """The figures of a case, from a Blender of its own."""
    done = subprocess.run([sys.executable, __file__, "--measure", name], capture_output=True, text=True, check=False)
    lines = [line for line in done.stdout.splitlines() if line.startswith(SAID)]
    if not lines:
        raise SystemExit(f"{name}: no figures\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return json.loads(lines[-1].removeprefix(SAID))


def main() -> None:
    """Measure and print a table, a column a case."""
    parser = argparse.ArgumentParser(description="How large a scene may be in Blender.")
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES), metavar="NAME")
    parser.add_argument("--measure", choices=CASES, metavar="NAME", help="this case alone, in this process, as JSON")
    arguments = parser.parse_args()
    if arguments.measure:
        print(SAID + json.dumps(measure(CASES[arguments.measure])), flush=True)
        os._exit(0)  # Blender's own exit can take minutes
    found = {name: _told(name) for name in arguments.cases}
    print(f"| | {' | '.join(found)} |\n|---|{'---|' * len(found)}")
    for figure in next(iter(found.values())):
        cells = " | ".join(f"{figures[figure]:.3g}" for figures in found.values())
        print(f"| {figure} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
