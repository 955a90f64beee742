"""Single figures that answer a question about one scene: a moving view, a leaking wall, many lights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from rebound.device.headless import HeadlessDevice
from rebound.gpu_shaders import TECHNIQUES
from rebound.scene.data import Scene, View
from rebound.scene.snapshot import load_snapshot

from .cases import BOUNCES, EXAMPLE, Case
from .curves import Plan, frame_passes
from .jobs import Job, do
from .moving import Effort, last_view, measure_drag, measure_ghost, measure_orbit, moved_light, moved_object
from .pictures import INDIRECT, quantity, read_passes
from .results import CYCLES, EEVEE, Figure, FigureSet, Pass
from .score import cells
from .studio import Method, Studio, methods

Say = Callable[[str], None]

ORBIT_SIZE, ORBIT_SIZE_QUICK = (960, 540), (240, 136)
ORBIT_TRUTH_SAMPLES, ORBIT_TRUTH_SAMPLES_QUICK = 256, 32
# Small, with one light that a change of is seen everywhere; EEVEE takes minutes for each.
MOVING_SCENES = (EXAMPLE, "cornell_spot")
# Voxels along the longest side of a scene: what a leak is measured in, whether a method has voxels or not.
VOXELS = 64
# divider.blend: the wall stands in x = -0.05 .. 0.05 m from y = -0.6 m to the back; light comes from the right.
WALL_FACE, WALL_BEGINS = -0.05, -0.6
DARK_PLACES = {"the dark chamber": 2.0, "within two voxels of the wall": 2 * 4.0 / VOXELS}  # metres from its face


def measure_figures(case: Case, plan: Plan, folder: Path, quick: bool, say: Say = print) -> list[FigureSet]:
    """All figures of a scene, each for every method."""
    found: list[FigureSet] = []
    for measure in (measure_moving, measure_divider, measure_many_lights):
        found += measure(case, plan, folder / "kept", quick, say)
    return found


# --- a moving view, a moving light -----------------------------------------------------------------------------------


def measure_moving(case: Case, plan: Plan, kept: Path, quick: bool, say: Say) -> list[FigureSet]:
    """The orbit with EEVEE beside it, then a light and an object that are dragged, and that jump."""
    if case.name not in MOVING_SCENES:
        return []
    size = ORBIT_SIZE_QUICK if quick else ORBIT_SIZE
    effort = Effort(12, 32) if quick else Effort()
    scene, view = load_snapshot(do([Job(str(case.blend), size=size)], kept, say)[0].file)
    camera = np.linalg.inv(last_view(scene, view).view_from_world).tolist()
    samples = ORBIT_TRUTH_SAMPLES_QUICK if quick else ORBIT_TRUTH_SAMPLES
    kinds = ("one_bounce", "multi_bounce")
    traced = do([Job(str(case.blend), CYCLES, samples, size, BOUNCES[k], camera=camera) for k in kinds], kept, say)
    eevee = _eevee_times(case, size, kept, say)
    sets = []
    for method in methods(many_bounces=True):
        truth = traced["MANY" in method.changed.values()]
        say(f"{case.name}: {method.label}, orbit at {size[0]} x {size[1]}")
        device = HeadlessDevice()
        try:
            path_traced = read_passes(truth.file)["Combined"]
            figures, _ = measure_orbit(device, method, scene, view, effort, path_traced)
            for i, (name, against) in enumerate(eevee.items()):
                figures[i] = replace(figures[i], against=against, against_name=name)
            figures += measure_drag(device, method, scene, view, effort.frames)
            figures += _ghosts(device, method, scene, view, effort)
            title = f"{case.name}, {size[0]} × {size[1]}, {method.label}: a viewport in motion"
            sets.append(FigureSet(title, figures, device.name))
        finally:
            device.close()
    return sets


def _eevee_times(case: Case, size: tuple[int, int], kept: Path, say: Say) -> dict[str, float | None]:
    """Seconds of EEVEE's first picture and of one more sample; None where noise of the clock hides the latter."""
    counts = (1, 4)
    jobs = [Job(str(case.blend), EEVEE, 1, size, cold=True)]
    first, few, more = do([*jobs, *(Job(str(case.blend), EEVEE, n, size) for n in counts)], kept, say)
    sample = (more.seconds - few.seconds) / (counts[1] - counts[0])
    return {"EEVEE's": first.seconds, "one sample of EEVEE": sample if sample > 0 else None}


def _ghosts(device: HeadlessDevice, method: Method, scene: Scene, view: View, effort: Effort) -> list[Figure]:
    figures = measure_ghost(device, method, scene, moved_light(scene), view, "moved light", effort.converged // 2)
    moved = moved_object(scene)
    if moved is not None:
        figures += measure_ghost(device, method, scene, moved, view, "moved object", effort.converged // 2)
    return figures


# --- leaks -----------------------------------------------------------------------------------------------------------


def measure_divider(case: Case, plan: Plan, kept: Path, quick: bool, say: Say) -> list[FigureSet]:
    """How bright the chamber behind the wall is, all of it and close to the wall, against path tracing."""
    if case.name != "divider" or "one_bounce" not in case.references:
        return []
    reference = read_passes(case.references["one_bounce"])
    wanted = quantity(reference, INDIRECT)
    assert wanted is not None
    height, width = wanted.shape[:2]
    scene, view = load_snapshot(do([Job(str(case.blend), size=(width, height))], kept, say)[0].file)
    sets = []
    for method in methods():
        say(f"{case.name}: {method.label}, the dark chamber")
        device = HeadlessDevice()
        try:
            test, position = _final_indirect(device, method, scene, view, plan.rebound[-1])
            sets.append(FigureSet(f"{case.name}, {method.label}: leaks", _leaks(wanted, test, position), device.name))
        finally:
            device.close()
    return sets


def _final_indirect(
    device: HeadlessDevice, method: Method, scene: Scene, view: View, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    """Indirect diffuse radiance and world position of a final render, rows from the top."""
    studio = Studio(device, method.settings(viewport=False))
    studio.show(scene)
    studio.begin(view)
    for _ in range(samples):
        studio.sample()
    test, position = quantity(studio.passes(), INDIRECT), studio.read("position")
    studio.free()
    assert test is not None
    return test, position


def _leaks(wanted: np.ndarray, test: np.ndarray, position: np.ndarray) -> list[Figure]:
    figures = []
    for place, distance in DARK_PLACES.items():
        where = dark_pixels(position, distance)
        mean, truth = float(test[where].mean()), float(wanted[where].mean())
        figures.append(Figure(f"mean bounce, {place}", mean, "radiance", truth, "path traced"))
        whole = cells(where[..., None].astype(np.float32))[..., 0] == 1.0  # in cells, or noise would count as a leak
        excess = float(np.maximum(cells(test)[whole] - cells(wanted)[whole], 0.0).mean())
        figures.append(Figure(f"too much of it, {place}", excess, "radiance", truth, "the path-traced mean there"))
    return figures


def dark_pixels(position: np.ndarray, distance: float) -> np.ndarray:
    """(h, w) bool: pixels behind the wall of divider.blend, within ``distance`` metres of its dark face."""
    x, y = position[..., 0], position[..., 1]
    return (x < WALL_FACE - 1e-4) & (x > WALL_FACE - distance) & (y > WALL_BEGINS)


# --- many lights -----------------------------------------------------------------------------------------------------


def measure_many_lights(case: Case, plan: Plan, kept: Path, quick: bool, say: Say) -> list[FigureSet]:
    """What all lights cost against one of them, and which maps are drawn again after one of them moved."""
    if case.name != "many_lights":
        return []
    scene, view = load_snapshot(do([Job(str(case.blend))], kept, say)[0].file)
    sets = []
    for method in methods():
        say(f"{case.name}: {method.label}, {len(scene.lights)} lights against one")
        device = HeadlessDevice()
        try:
            figures = _light_costs(device, method, scene, view, plan.frames) + _redrawn(device, method, scene, view)
            sets.append(FigureSet(f"{case.name}, {method.label}", figures, device.name))
        finally:
            device.close()
    return sets


def _light_costs(device: HeadlessDevice, method: Method, scene: Scene, view: View, frames: int) -> list[Figure]:
    settings = method.settings(viewport=True)
    one, all_of_them = (
        frame_passes(device, replace(scene, lights=lights), view, settings, frames)
        for lights in (scene.lights[:1], scene.lights)
    )
    own = {shader.name for t in TECHNIQUES if t.id.upper() == method.changed["method"] for shader in t.shaders}
    count = len(scene.lights)
    return [
        Figure(f"the method's own passes, {count} lights", _sum(all_of_them, own), "ms", _sum(one, own), "one light"),
        Figure(f"all passes of a frame, {count} lights", _sum(all_of_them), "ms", _sum(one), "one light"),
    ]


def _sum(passes: list[Pass], names: set[str] | None = None) -> float:
    return sum(p.milliseconds for p in passes if names is None or p.name in names)


def _redrawn(device: HeadlessDevice, method: Method, scene: Scene, view: View) -> list[Figure]:
    """Light maps drawn in the frame after one light moved, by the renderer's own count."""
    studio = Studio(device, method.settings(viewport=True))
    counts = []
    for state in (scene, moved_light(scene)):
        studio.show(state)
        studio.begin(view)
        studio.sample()
        counts.append(studio.renderer.statistics())
    studio.free()
    names = [name for name in counts[0] if name.endswith("_drawn")]
    return [
        Figure(f"{name.replace('_', ' ')} again after one light moved", counts[1][name] - counts[0][name], "maps",
               counts[0][name], "the first frame")
        for name in names
    ]  # fmt: skip
