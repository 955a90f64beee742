"""What a viewport shows while something moves: an orbiting camera, a moved light, a moved object.

Frames are what a viewport draws: the picture is begun anew, one sample is taken and shown. A technique that reuses what
it found in earlier frames does so here as it does there.
"""

from __future__ import annotations

import statistics
from dataclasses import dataclass, replace

import numpy as np

from rebound.device.headless import HeadlessDevice
from rebound.scene.changes import world_bounds
from rebound.scene.data import Instance, Light, LightKind, Scene, View

from .results import Figure
from .score import cells, relative_squared_error
from .studio import VIEWPORT, Method, Studio, picture, seconds

STEP = 1.0  # degrees that the camera goes around between two frames
SHOWN = 8  # frames after which a moving picture is judged
SHIFT = 0.1  # how far something is moved, in parts of the scene's size
WARM_UP = 2  # frames left out of the median: the first ones draw light maps and fill histories


@dataclass(frozen=True)
class Effort:
    """How much work goes into what is compared with: frames timed, samples of a converged picture."""

    frames: int = 24
    converged: int = 256


def orbit_view(view: View, pivot: np.ndarray, degrees: float) -> View:
    """The view from around a vertical axis through ``pivot``."""
    angle = np.radians(degrees)
    turn, shift = np.eye(4), np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    shift[:3, 3] = pivot
    around = shift @ turn @ np.linalg.inv(shift)
    return replace(view, view_from_world=view.view_from_world @ np.linalg.inv(around))


def orbit(frame: int) -> float:
    """Degrees at a frame: steadily one way for SHOWN frames, then back, and so on."""
    there = frame % (2 * SHOWN)
    return STEP * (there if there <= SHOWN else 2 * SHOWN - there)


def last_view(scene: Scene, view: View) -> View:
    """Where the orbit is when it is judged."""
    return orbit_view(view, _middle(scene), orbit(SHOWN))


def measure_orbit(
    device: HeadlessDevice, method: Method, scene: Scene, view: View, effort: Effort, truth: np.ndarray | None = None
) -> tuple[list[Figure], np.ndarray]:
    """Times and error of frames under a camera that goes around; and the picture that is judged, (h, w, 3).

    ``truth`` is a path-traced picture of ``last_view``; without one the error is against our own converged one only.
    """
    pivot = _middle(scene)
    studio = Studio(device, method.settings(viewport=True), VIEWPORT)

    def frame(number: int) -> None:
        studio.begin(orbit_view(view, pivot, orbit(number)))
        studio.sample()
        studio.display()

    first = seconds(device, lambda: (studio.show(scene), frame(0)))
    times, judged = [], np.zeros((view.height, view.width, 3), np.float32)
    for number in range(1, max(effort.frames, SHOWN + 1)):
        times.append(seconds(device, lambda number=number: frame(number)))
        if number == SHOWN:
            judged = studio.shown()
    studio.free()
    own = picture(device, scene, last_view(scene, view), method.settings(viewport=False), effort.converged)
    still = picture(device, scene, last_view(scene, view), method.settings(viewport=True), 1)
    figures = [
        Figure("first picture after the scene is loaded", first, "s"),
        Figure("a frame of the orbit, median", statistics.median(times[WARM_UP:]), "s"),
        Figure(
            f"relmse after {SHOWN} frames of the orbit",
            relative_squared_error(own, judged),
            "relmse",
            relative_squared_error(own, still),
            "the first frame of a still camera",
            "against our own converged picture of the same view",
        ),
    ]
    if truth is not None:
        error, best = relative_squared_error(truth, judged), relative_squared_error(truth, own)
        name = f"relmse after {SHOWN} frames of the orbit, path traced"
        figures.append(Figure(name, error, "relmse", best, "our own converged picture"))
    return figures, judged


# --- ghosts ----------------------------------------------------------------------------------------------------------


def measure_drag(device: HeadlessDevice, method: Method, scene: Scene, view: View, frames: int) -> list[Figure]:
    """Times of frames while a light or an object is dragged: it moves before each of them."""
    figures = []
    for what, moved in (("a light", moved_light), ("an object", moved_object)):
        states = [moved(scene, SHIFT * n / frames) for n in range(frames + WARM_UP)]
        studio = Studio(device, method.settings(viewport=True), VIEWPORT)

        def frame(state: Scene, studio: Studio = studio) -> None:
            studio.show(state)
            studio.begin(view)
            studio.sample()
            studio.display()

        times = [seconds(device, lambda state=state: frame(state)) for state in states if state is not None]
        studio.free()
        if times:
            figures.append(Figure(f"a frame while {what} is dragged, median", statistics.median(times[WARM_UP:]), "s"))
    return figures


def moved_light(scene: Scene, part: float = SHIFT) -> Scene:
    """The first light ``part`` of the scene's size aside; a sun is turned by as much of a radian."""
    light = scene.lights[0]
    return replace(scene, lights=(_moved_light(light, part, _size(scene)), *scene.lights[1:]))


def _moved_light(light: Light, part: float, size: float) -> Light:
    matrix = np.array(light.world_from_light)
    if light.kind is LightKind.SUN:
        turn = np.eye(4)
        turn[:2, :2] = [[np.cos(part), -np.sin(part)], [np.sin(part), np.cos(part)]]
        matrix = turn @ matrix
    else:
        matrix[0, 3] += part * size
    return replace(light, world_from_light=matrix)


def moved_object(scene: Scene, part: float = SHIFT) -> Scene | None:
    """The largest object that is neither flat nor half as large as the scene, ``part`` of its size aside."""
    chosen = _movable(scene)
    if chosen is None:
        return None
    matrix = np.array(chosen.world_from_object)
    matrix[0, 3] += part * _size(scene)
    moved = replace(chosen, world_from_object=matrix)
    return replace(scene, instances=tuple(moved if i is chosen else i for i in scene.instances))


def _movable(scene: Scene) -> Instance | None:
    size = _size(scene)
    found: list[tuple[float, int]] = []
    for number, instance in enumerate(scene.instances):
        low, high = world_bounds(instance, scene)
        extent = high - low
        if extent.min() > 0.01 * size and extent.max() < 0.7 * size:
            found.append((float(extent.prod()), -number))
    return scene.instances[-max(found)[1]] if found else None


def measure_ghost(
    device: HeadlessDevice, method: Method, before: Scene, after: Scene, view: View, what: str, converged: int
) -> list[Figure]:
    """What is left of the state before, SHOWN frames after something jumped, and of noise beside it.

    The ghost is the part of the old picture in the new one: what differs from a fresh picture of as many frames,
    projected onto the change, which noise does not bias. 1 would be the old picture still standing there.
    """
    settings = method.settings(viewport=True)
    studio = Studio(device, settings)
    for scene in (before, after):
        studio.show(scene)
        studio.begin(view)
        for _ in range(SHOWN):
            studio.sample()
            studio.display()
    judged = studio.shown()
    studio.free()
    fresh = picture(device, after, view, settings, SHOWN)
    truth = picture(device, after, view, settings, converged)
    old = picture(device, before, view, settings, converged)
    judged, fresh, truth, old = cells(judged), cells(fresh), cells(truth), cells(old)
    change = old - truth
    mean = float(np.abs(change).mean()) or 1.0
    left = float((change * (judged - fresh)).sum() / max((change**2).sum(), 1e-12))
    difference, noise = float(np.abs(judged - fresh).mean()) / mean, float(np.abs(fresh - truth).mean()) / mean
    return [
        Figure(f"{what}: left of the picture before, {SHOWN} frames after", left, "of the change"),
        Figure(
            f"{what}: difference to a fresh picture of {SHOWN} frames",
            difference,
            "of the mean change",
            noise,
            "what noise alone is in the fresh one",
        ),
    ]


def _middle(scene: Scene) -> np.ndarray:
    return _bounds(scene).mean(axis=0)


def _size(scene: Scene) -> float:
    """The longest side of the box around the scene, metres."""
    low, high = _bounds(scene)
    return float((high - low).max())


def _bounds(scene: Scene) -> np.ndarray:
    boxes = np.array([world_bounds(instance, scene) for instance in scene.instances]) if scene.instances else None
    return np.zeros((2, 3)) if boxes is None else np.stack((boxes[:, 0].min(0), boxes[:, 1].max(0)))
