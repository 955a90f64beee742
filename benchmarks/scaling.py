"""How the time of a frame grows with lights, pixels, triangles and instances: on scenes made here, without Blender.

One thing grows at a time over the same hall: a bumpy floor, blocks on it, spots above. Settings are the viewport's.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rebound.device import Device
from rebound.device.headless import HeadlessDevice
from rebound.scene.data import Instance, Light, LightKind, Material, Mesh, Scene, View, Visibility

from .curves import frame_passes
from .results import ScalePoint, Scaling
from .studio import VIEWPORT, Method, Studio, methods, seconds

Say = Callable[[str], None]
EVERYTHING = Visibility.CAMERA | Visibility.SHADOW | Visibility.BOUNCE
HALL = 16.0  # metres, a side
LIGHT_HEIGHT = 4.0
TOTAL_POWER = 4000.0  # watts, however many lights share it
BASE_TRIANGLES, BASE_INSTANCES, BASE_LIGHTS = 2048, 24, 4
BASE_SIZE = (320, 180)


@dataclass(frozen=True)
class Axis:
    """What grows; ``make`` gives the scene and view for a number of it."""

    title: str
    unit: str
    values: tuple[int, ...]
    quick: tuple[int, ...]
    make: Callable[[int], tuple[Scene, View]]


def axes() -> list[Axis]:
    """The four curves."""
    return [
        Axis("Lights", "lights", (1, 4, 16, 64, 256), (1, 4, 16), lambda n: (hall(lights=n), hall_view(BASE_SIZE))),
        Axis("Pixels", "pixels", _areas((160, 320, 640, 1280, 1920)), _areas((160, 320)), lambda n: (hall(), _view(n))),
        Axis(
            "Triangles",
            "triangles",
            (10_000, 100_000, 1_000_000, 5_000_000),
            (10_000, 100_000),
            lambda n: (hall(triangles=n), hall_view(BASE_SIZE)),
        ),
        Axis(
            "Instances",
            "instances",
            (100, 1000, 10_000, 50_000),
            (100, 1000),
            lambda n: (hall(instances=n), hall_view(BASE_SIZE)),
        ),
    ]


def _areas(widths: Sequence[int]) -> tuple[int, ...]:
    return tuple(width * (width * 9 // 16) for width in widths)


def _view(pixels: int) -> View:
    width = round(math.sqrt(pixels * 16 / 9))
    return hall_view((width, pixels // width))


def measure_scaling(quick: bool, frames: int, say: Say = print, only: Sequence[str] = ()) -> list[Scaling]:
    """Every curve for every method."""
    found = []
    for axis in axes():
        if only and axis.title.lower() not in only:
            continue
        for method in methods():
            device = HeadlessDevice()
            try:
                points = [_point(device, method, n, axis, frames) for n in (axis.quick if quick else axis.values)]
                found.append(Scaling(axis.title, axis.unit, method.label, points, device.name))
            finally:
                device.close()
            times = ", ".join(f"{p.x}: {1000 * p.seconds:.0f} ms" for p in points)
            say(f"{axis.title}, {method.label}: {times}")
    return found


def _point(device: Device, method: Method, number: int, axis: Axis, frames: int) -> ScalePoint:
    scene, view = axis.make(number)
    settings = method.settings(viewport=True)
    studio = Studio(device, settings, VIEWPORT)

    def frame() -> None:
        studio.sample()
        studio.display()

    first = seconds(device, lambda: (studio.show(scene), studio.begin(view), frame()))
    frame()
    steady = statistics.median(seconds(device, frame) for _ in range(frames))
    studio.free()
    return ScalePoint(number, steady, first, frame_passes(device, scene, view, settings, min(frames, 3)))


# --- the hall --------------------------------------------------------------------------------------------------------


def hall(lights=BASE_LIGHTS, triangles=BASE_TRIANGLES, instances=BASE_INSTANCES) -> Scene:
    """A bumpy floor of ``triangles`` with ``instances`` blocks on it, under ``lights`` spots of one total power."""
    rng = np.random.default_rng(5)
    floor, block = bumpy_floor(triangles), _block()
    placed = [Instance("floor", floor.key, (0,), np.eye(4), EVERYTHING)]
    side = math.ceil(math.sqrt(instances))
    cell = HALL / side
    for i in range(instances):
        matrix = np.diag((0.3 * cell, 0.3 * cell, min(0.6 * cell, 1.0), 1.0))
        matrix[:3, 3] = (i % side + 0.5) * cell - HALL / 2, (i // side + 0.5) * cell - HALL / 2, 0.1
        placed.append(Instance(("block", i), block.key, (1 + i % 3,), matrix, EVERYTHING))
    colors = rng.uniform(0.2, 0.8, (3, 3))
    materials = [Material("Floor", (0.7, 0.7, 0.7))]
    materials += [Material(f"Block {i}", (float(c[0]), float(c[1]), float(c[2]))) for i, c in enumerate(colors)]
    return Scene({floor.key: floor, block.key: block}, tuple(placed), tuple(materials), lights=tuple(_spots(lights)))


def bumpy_floor(triangles: int) -> Mesh:
    """A grid of about so many triangles over the hall, a little wavy."""
    side = max(round(math.sqrt(triangles / 2)), 1)
    line = np.linspace(-HALL / 2, HALL / 2, side + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    z = 0.05 * np.sin(2.0 * x) * np.cos(1.7 * y)
    slope_x, slope_y = 0.1 * np.cos(2.0 * x) * np.cos(1.7 * y), -0.085 * np.sin(2.0 * x) * np.sin(1.7 * y)
    normals = np.stack((-slope_x, -slope_y, np.ones_like(x)), -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)

    def corners(grid: np.ndarray) -> np.ndarray:
        a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
        return np.stack((a, b, c, a, c, d), 2).reshape(-1, 3).astype(np.float32)

    return _mesh("floor", corners(np.stack((x, y, z), -1)), corners(normals))


def _block() -> Mesh:
    """A unit cube that stands on the ground."""
    corners, normals = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            n, u, v = (np.eye(3)[(axis + k) % 3] for k in range(3))
            u = u * sign  # counter-clockwise seen from outside
            a, b, c, d = (sign * n + s * u + t * v for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
            corners += [a, b, c, a, c, d]
            normals += [sign * n] * 6
    points = 0.5 * np.array(corners, np.float32) + np.array((0.0, 0.0, 0.5), np.float32)
    return _mesh("block", points, np.array(normals, np.float32))


def _mesh(key: str, positions: np.ndarray, normals: np.ndarray) -> Mesh:
    count = len(positions) // 3
    bounds = np.stack((positions.min(0), positions.max(0)))
    return Mesh((key, count), positions, normals, {}, "", ((0, 0, count),), bounds)


def _spots(count: int) -> list[Light]:
    """Spots in a grid above the hall that look down and light it all together."""
    side = math.ceil(math.sqrt(count))
    cell = HALL / side
    angle = 2 * math.atan2(cell, LIGHT_HEIGHT)
    power = TOTAL_POWER / count
    found = []
    for i in range(count):
        matrix = np.eye(4)
        matrix[:3, 3] = (i % side + 0.5) * cell - HALL / 2, (i // side + 0.5) * cell - HALL / 2, LIGHT_HEIGHT
        found.append(
            Light(
                i,
                f"Spot {i}",
                LightKind.SPOT,
                (power, power, power),
                matrix,
                spot_angle=max(angle, 0.9),
                spot_blend=0.2,
            )
        )
    return found


def hall_view(size: tuple[int, int]) -> View:
    """From above one end over the hall."""
    width, height = size
    position, target = np.array((0.0, -11.0, 6.0)), np.array((0.0, 0.0, 0.0))
    z = (position - target) / np.linalg.norm(position - target)
    x = np.cross((0.0, 0.0, 1.0), z)
    x /= np.linalg.norm(x)
    world = np.eye(4)
    world[:3, 0], world[:3, 1], world[:3, 2], world[:3, 3] = x, np.cross(z, x), z, position
    near, far, f = 0.1, 100.0, 1.2
    clip = np.zeros((4, 4))
    clip[0, 0], clip[1, 1] = f, f * width / height
    clip[2, 2], clip[2, 3], clip[3, 2] = -(far + near) / (far - near), -2 * far * near / (far - near), -1.0
    return View(np.linalg.inv(world), clip, width, height)
