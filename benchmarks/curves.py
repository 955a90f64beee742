"""One scene, every engine: error over time, the first picture, the steady frame and its passes."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rebound.device import Device
from rebound.device.headless import HeadlessDevice
from rebound.scene.data import Scene, View
from rebound.scene.snapshot import load_snapshot
from rebound.settings import Settings

from .cases import BOUNCES, OWN_REFERENCE, OWN_REFERENCE_QUICK, Case, Goal
from .jobs import Done, Job, do
from .pictures import Passes, diffuse, quantity, read_passes, save_picture
from .results import CYCLES, EEVEE, F12, REBOUND, Curve, Pass, Point, SceneResult
from .score import scores
from .studio import VIEWPORT, Method, Studio, methods, seconds
from .timed_device import TimedDevice, median_passes

Say = Callable[[str], None]
LONG_SECONDS = 60.0  # a ladder that takes longer is climbed once


@dataclass(frozen=True)
class Plan:
    """How much is measured. The ladders are samples of one picture after another."""

    rebound: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64)
    eevee: tuple[int, ...] = (1, 4, 16, 64)
    cycles: tuple[int, ...] = (1, 4, 16, 64, 256)
    cycles_seconds: float = 120.0  # a further picture of Cycles that would take longer is left out
    runs: int = 3
    frames: int = 9  # of a steady frame's median
    own_reference: tuple[int, int] = OWN_REFERENCE
    size: tuple[int, int] | None = None  # instead of the reference's, for tests
    estimators: bool = False

    @classmethod
    def quick(cls) -> Plan:
        """Minutes where the whole takes hours on software OpenGL."""
        return cls((1, 2, 4, 8, 16), (1, 4, 16), (1, 4, 16, 64), 30.0, 1, 5, OWN_REFERENCE_QUICK)


@dataclass(frozen=True)
class Truth:
    """A scene ready to be measured: what every engine's picture is compared with."""

    case: Case
    size: tuple[int, int]
    references: dict[str, Passes]
    goals: tuple[Goal, ...]

    def scores(self, passes: Passes) -> dict[str, dict[str, float]]:
        """The figures of a picture by goal, for those goals that it has the passes for."""
        found = {}
        for goal in self.goals:
            reference = self.references[goal.reference]
            direct = diffuse(reference, "Direct") if {"Diffuse Color", "Diffuse Direct"} <= reference.keys() else None
            wanted, test = quantity(reference, goal.quantity), quantity(passes, goal.quantity, direct)
            if wanted is not None and test is not None:
                found[goal.key] = scores(wanted, test)
        return found


def measure_scene(case: Case, plan: Plan, folder: Path, say: Say = print) -> SceneResult:
    """Everything about one scene; what Cycles and EEVEE did is kept in ``folder`` and not done again."""
    kept = folder / "kept"
    truth = _truth(case, plan, kept, say)
    snapshot = do([Job(str(case.blend), size=truth.size)], kept, say)[0]
    scene, view = load_snapshot(snapshot.file)
    pictures = _Pictures(folder, case.name)
    many = "multi_bounce" in truth.references
    rebound = methods(estimators=plan.estimators, many_bounces=many)
    curves = [_rebound(m, scene, view, truth, plan, pictures, say) for m in rebound]
    curves += _final_renders(truth, plan, kept, pictures, say)
    curves += _blender(truth, plan, kept, pictures, say)
    return SceneResult(
        case.name,
        truth.size,
        [goal.key for goal in truth.goals],
        [goal.label for goal in truth.goals],
        snapshot.details["exposure"],
        curves,
        {kind: pictures.keep(f"reference-{kind}", passes) for kind, passes in truth.references.items()},
        sum(scene.meshes[instance.mesh].triangle_count for instance in scene.instances),
        len(scene.lights),
    )


class _Pictures:
    """Where a scene's pictures are kept for the report."""

    def __init__(self, folder: Path, scene: str) -> None:
        self.folder, self.scene = folder, scene

    def keep(self, name: str, passes: Passes) -> str:
        """Save a picture; its name within the folder."""
        file = f"pictures/{self.scene}-{name.lower().replace(' ', '-').replace(',', '')}.npz"
        save_picture(self.folder / file, passes)
        return file


def _truth(case: Case, plan: Plan, kept: Path, say: Say) -> Truth:
    references = {kind: read_passes(path) for kind, path in case.references.items()}
    if plan.size or not references:
        references = _own_references(case, plan, kept, say)
    height, width = next(iter(references.values()))["Combined"].shape[:2]
    goals = []
    for goal in case.goals:
        wanted = quantity(references[goal.reference], goal.quantity)
        if wanted is not None and wanted.any():
            goals.append(goal)
    return Truth(case, (width, height), references, tuple(goals))


def _own_references(case: Case, plan: Plan, kept: Path, say: Say) -> dict[str, Passes]:
    """Path-traced here, for a scene that has no reference or not of this size."""
    side, samples = plan.own_reference
    size = plan.size or (side, side)
    kinds = list(case.references) or ["multi_bounce"]
    say(f"{case.name}: path tracing a reference of {size[0]} x {size[1]}, {samples} samples")
    jobs = [Job(str(case.blend), CYCLES, samples, size, BOUNCES[kind]) for kind in kinds]
    return {kind: read_passes(done.file) for kind, done in zip(kinds, do(jobs, kept, say), strict=True)}


# --- Rebound ---------------------------------------------------------------------------------------------------------


def _rebound(
    method: Method, scene: Scene, view: View, truth: Truth, plan: Plan, pictures: _Pictures, say: Say
) -> Curve:
    """One method on a device of its own, so that its first picture compiles its shaders."""
    device = HeadlessDevice()
    try:
        settings = method.settings(viewport=False)
        studio = Studio(device, settings)
        first = seconds(device, lambda: _first_picture(studio, scene, view))
        studio.free()
        runs = [_ladder(device, settings, scene, view, plan.rebound)]
        while len(runs) < plan.runs and runs[0][0][-1] < LONG_SECONDS:
            runs.append(_ladder(device, settings, scene, view, plan.rebound))
        _, last = runs[-1]
        points = []
        for i, samples in enumerate(plan.rebound):
            times = [taken[i] for taken, _ in runs]
            points.append(Point(samples, statistics.median(times), len(times), truth.scores(last[i])))
        kept = pictures.keep(method.label, last[-1])
        points[-1] = replace(points[-1], picture=kept)
        first_frame, frame, passes = steady_frame(device, method, scene, view, plan.frames)
        name = device.name
    finally:
        device.close()
    say(f"{truth.case.name}: {REBOUND}, {method.label}: {points[-1].samples} samples {points[-1].seconds:.2f} s")
    return Curve(REBOUND, method.label, points, first, passes, frame, first_frame, name)


def _first_picture(studio: Studio, scene: Scene, view: View) -> None:
    studio.show(scene)
    studio.begin(view)
    studio.sample()
    studio.display()


def _ladder(
    device: HeadlessDevice, settings: Settings, scene: Scene, view: View, counts: Sequence[int]
) -> tuple[list[float], list[Passes]]:
    """One picture getting better, with nothing known from another: seconds and passes at each count.

    Uploading the scene and reading the picture are not in the time; light maps and whatever else a method prepares are.
    """
    studio = Studio(device, settings)
    studio.show(scene)
    studio.begin(view)
    spent, times, pictures = 0.0, [], []
    for samples in range(1, counts[-1] + 1):
        spent += seconds(device, studio.sample)
        if samples in counts:
            times.append(spent)
            pictures.append(studio.passes())
    studio.free()
    return times, pictures


def steady_frame(
    device: HeadlessDevice, method: Method, scene: Scene, view: View, frames: int
) -> tuple[float, float, list[Pass]]:
    """A viewport that stands still: seconds of the first frame, of the median one after it, and its passes.

    The passes are taken in frames of their own: waiting for the GPU around each makes a frame longer than it is.
    """
    settings = method.settings(viewport=True)
    studio = Studio(device, settings, VIEWPORT)
    first = seconds(device, lambda: _first_picture(studio, scene, view))
    times = []
    for _ in range(frames + 1):
        times.append(seconds(device, lambda: (studio.sample(), studio.display())))
    studio.free()
    return first, statistics.median(times[1:]), frame_passes(device, scene, view, settings, frames)


def frame_passes(device: Device, scene: Scene, view: View, settings: Settings, frames: int) -> list[Pass]:
    """The passes of a steady frame: each one's median."""
    timed = TimedDevice(device)
    studio = Studio(timed.as_device, settings)
    _first_picture(studio, scene, view)
    timed.passes()
    seen = []
    for _ in range(frames):
        studio.sample()
        studio.display()
        seen.append(timed.passes())
    studio.free()
    return median_passes(seen)


# --- Blender's engines -----------------------------------------------------------------------------------------------


def _final_renders(truth: Truth, plan: Plan, kept: Path, pictures: _Pictures, say: Say) -> list[Curve]:
    """Rebound as an artist's F12 has it, with reading the scene and filling the passes: the ladder's two ends."""
    curves = []
    for method in methods(many_bounces="multi_bounce" in truth.references):
        counts = (plan.rebound[0], plan.rebound[-1])
        job = Job(str(truth.case.blend), REBOUND, size=truth.size, settings=dict(method.changed))
        jobs = [replace(job, cold=True), *(replace(job, samples=n, runs=plan.runs) for n in counts)]
        cold, *warm = do(jobs, kept, say)
        curves.append(_curve(REBOUND, f"{method.label}{F12}", cold, counts, warm, truth, pictures))
    return curves


def _blender(truth: Truth, plan: Plan, kept: Path, pictures: _Pictures, say: Say) -> list[Curve]:
    """EEVEE, and Cycles with the bounces of each reference."""
    blend, size = str(truth.case.blend), truth.size
    say(f"{truth.case.name}: {EEVEE}")
    jobs = [Job(blend, EEVEE, 1, size, cold=True)]
    jobs += [Job(blend, EEVEE, samples, size, runs=plan.runs) for samples in plan.eevee]
    cold, *warm = do(jobs, kept, say)
    curves = [_curve(EEVEE, EEVEE, cold, plan.eevee, warm, truth, pictures)]
    for kind in truth.references:
        say(f"{truth.case.name}: {CYCLES}, {kind.replace('_', ' ')}")
        bounces = BOUNCES[kind]
        label = CYCLES if bounces > 1 else f"{CYCLES}, one bounce"
        cold = do([Job(blend, CYCLES, 1, size, bounces, cold=True)], kept, say)[0]
        done: list[Done] = []
        for samples in plan.cycles:
            if len(done) > 1:  # by the slope so far
                step = (done[-1].seconds - done[0].seconds) / (plan.cycles[len(done) - 1] - plan.cycles[0])
                if done[0].seconds + step * samples > plan.cycles_seconds:
                    break
            done += do([Job(blend, CYCLES, samples, size, bounces, runs=plan.runs)], kept, say)
        curves.append(_curve(CYCLES, label, cold, plan.cycles[: len(done)], done, truth, pictures))
    return curves


def _curve(
    engine: str, label: str, cold: Done, counts: Sequence[int], done: list[Done], truth: Truth, pictures: _Pictures
) -> Curve:
    points = []
    for samples, result in zip(counts, done, strict=True):
        passes = read_passes(result.file)
        points.append(Point(samples, result.seconds, result.runs, truth.scores(passes)))
        if samples == counts[-1]:
            points[-1] = replace(points[-1], picture=pictures.keep(label, passes))
    return Curve(engine, label, points, cold.seconds)
