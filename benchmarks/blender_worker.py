"""Does jobs in a process with Blender: `python benchmarks/blender_worker.py JOBS.json`, started by jobs.py.

Every picture is a real F12 render in background, so all engines are timed by the same call. Loading the file and
writing the EXR are left out of the time; reading the scene into the engine is in it, as an artist waits for it.
"""

from __future__ import annotations

import json
import os
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import checkout  # noqa: F401  makes `rebound` importable
from mathutils import Matrix

import rebound
from rebound.benchmarks.jobs import SAID, Job
from rebound.benchmarks.results import CYCLES, EEVEE, REBOUND
from rebound.benchmarks.staging import stage
from rebound.scene.cameras import active_camera, camera_view
from rebound.scene.convert import convert_scene
from rebound.scene.snapshot import save_snapshot
from rebound.session import SESSIONS

PASSES = ("use_pass_combined", "use_pass_diffuse_direct", "use_pass_diffuse_indirect", "use_pass_diffuse_color")
# One render takes at most this long where several are made for a median.
QUICK_SECONDS = 5.0


class Worker:
    """One Blender with one file open, and whether its engine has rendered that file: each has shaders of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.opened: Job | None = None
        self.warm = False

    def do(self, name: str, job: Job) -> None:
        """Do a job and write its answer beside its file."""
        self._open(job)
        answer = self._render(name, job) if job.engine else self._snapshot(name, job)
        unfinished = self.folder / f"{name}.part"
        unfinished.write_text(json.dumps(answer))
        os.replace(unfinished, self.folder / f"{name}.json")

    def _open(self, job: Job) -> None:
        """Load the file anew, unless this job differs from the last one in the number of samples only."""
        same = self.opened and replace(self.opened, samples=job.samples, runs=job.runs, cold=False) == job
        if same and not job.cold:
            return
        self.opened, self.warm = job, False
        bpy.ops.wm.open_mainfile(filepath=job.blend)
        scene = bpy.context.scene
        if job.size:
            width, height = job.size
            by_aspect = round(width * scene.render.resolution_y / scene.render.resolution_x)
            scene.render.resolution_x, scene.render.resolution_y = width, max(height or by_aspect, 4)
        scene.render.resolution_percentage = 100
        scene.render.use_border = False
        if job.camera:
            scene.camera.parent = None
            scene.camera.constraints.clear()
            scene.camera.animation_data_clear()
            scene.camera.matrix_world = Matrix(job.camera)
        if job.staged:
            stage(scene)

    def _snapshot(self, name: str, job: Job) -> dict[str, Any]:
        depsgraph = bpy.context.evaluated_depsgraph_get()
        start = time.perf_counter()
        scene = convert_scene(depsgraph, for_viewport=False)
        seconds = time.perf_counter() - start
        render = bpy.context.scene.render
        width, height = render.resolution_x, render.resolution_y
        view = camera_view(active_camera(depsgraph), depsgraph, width=width, height=height)
        file = f"{name}.npz"
        save_snapshot(self.folder / file, scene, view)
        exposure = bpy.context.scene.view_settings.exposure
        return {"file": file, "seconds": seconds, "runs": 1, "details": {"exposure": exposure}}

    def _render(self, name: str, job: Job) -> dict[str, Any]:
        scene = bpy.context.scene
        _configure(scene, job)
        if not job.cold and not self.warm:
            _set_samples(scene, job.engine, 1)
            _render_once()
            _set_samples(scene, job.engine, job.samples)
        times = [_render_once()]
        self.warm = True
        while len(times) < job.runs and times[0] < QUICK_SECONDS and not job.cold:
            times.append(_render_once())
        file = f"{name}.exr"
        _save(scene, self.folder / file)
        seconds = statistics.median(times)
        print(f"{SAID}{job.engine}, {job.samples} samples{', first' if job.cold else ''}: {seconds:.2f} s", flush=True)
        return {"file": file, "seconds": seconds, "runs": len(times), "details": _details(job)}


def _details(job: Job) -> dict[str, Any]:
    return {"warnings": list(SESSIONS.newest.warnings)} if job.engine == REBOUND else {}


def _configure(scene, job: Job) -> None:
    engine: Any = bpy.types.RenderSettings.bl_rna.properties["engine"]
    engines = engine.enum_items.keys()
    eevee = "BLENDER_EEVEE_NEXT" if "BLENDER_EEVEE_NEXT" in engines else "BLENDER_EEVEE"
    if job.engine == REBOUND:
        rebound.register()
    scene.render.engine = {CYCLES: "CYCLES", EEVEE: eevee, REBOUND: rebound.ENGINE_ID}[job.engine]
    scene.render.use_compositing = scene.render.use_sequencer = False
    for layer in scene.view_layers:
        layer.use = layer.use or len(scene.view_layers) == 1
        for name in PASSES:
            setattr(layer, name, True)
    if job.engine == CYCLES:
        _configure_cycles(scene.cycles, job.bounces)
    elif job.engine == EEVEE:
        scene.eevee.use_raytracing = scene.eevee.use_shadows = True
        scene.eevee.ray_tracing_options.resolution_scale = "1"
    _set_samples(scene, job.engine, job.samples)
    for key, value in job.settings.items():
        setattr(scene.rebound, key, value)


def _configure_cycles(cycles, bounces: int) -> None:
    """Plain path tracing: nothing that trades truth for speed, so that it converges to the reference."""
    cycles.device = "CPU"
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.sample_clamp_indirect = cycles.sample_clamp_direct = cycles.blur_glossy = 0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = bounces
    cycles.caustics_reflective = cycles.caustics_refractive = True


def _set_samples(scene, engine: str, samples: int) -> None:
    if engine == CYCLES:
        scene.cycles.samples = samples
    elif engine == EEVEE:
        scene.eevee.taa_render_samples = samples
    else:
        scene.rebound.samples = samples


def _render_once() -> float:
    start = time.perf_counter()
    bpy.ops.render.render()
    return time.perf_counter() - start


def _save(scene, path: Path) -> None:
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # since 5.0, and to be set first
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth, settings.exr_codec = "32", "ZIP"
    bpy.data.images["Render Result"].save_render(str(path), scene=scene)


def main(order: Path) -> None:
    """Do all jobs of the file, in order."""
    worker = Worker(order.parent)
    for name, values in json.loads(order.read_text()).items():
        worker.do(name, Job(**values))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
    sys.stdout.flush()
    os._exit(0)  # Blender's own exit can take minutes
