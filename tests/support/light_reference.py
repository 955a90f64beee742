"""The irradiance of one unshadowed light in numpy: the truth that the shaders' lights are compared with.

Every emitter is integrated by a fixed grid, so the same input gives the same bits. The formulas are those of
docs/lights.md, which were compared with Cycles in tests/blender/test_scene_lights_cycles.py.
"""

from __future__ import annotations

import numpy as np

from rebound.scene.data import AreaShape, Light, LightKind

Array = np.ndarray


def irradiance(light: Light, points: Array, normals: Array, samples: int = 256) -> Array:
    """Irradiance in W/m² of surface points that see the whole light.

    points, normals: (n, 3), normals unit. samples: emitter samples for each point, rounded to a square grid.
    Returns (n, 3) RGB, light.diffuse_factor included.
    """
    points, normals = np.asarray(points, np.float64), np.asarray(normals, np.float64)
    emitters = {
        LightKind.POINT: _point,
        LightKind.SPOT: _point,
        LightKind.SUN: _sun,
        LightKind.AREA: _area,
    }
    geometry = emitters[light.kind](light, points, normals, max(int(round(samples**0.5)), 1))
    return geometry[:, None] * np.array(light.power) * light.diffuse_factor


# Each of these returns irradiance for a power of 1, (n,).


def _point(light: Light, points: Array, normals: Array, grid: int) -> Array:
    center = light.world_from_light[:3, 3]
    if light.radius == 0.0:
        to_light = center - points
        distance = np.linalg.norm(to_light, axis=1)
        direction = to_light / distance[:, None]
        cosine = np.maximum((direction * normals).sum(axis=1), 0.0)
        return cosine / (4.0 * np.pi * distance**2) * _spot_factor(light, -direction)
    radiance = 1.0 / (4.0 * np.pi**2 * light.radius**2)
    if light.soft_falloff:
        return radiance * _facing_disc(light, center, points, normals, grid)
    return radiance * _sphere(light, center, points, normals, grid)


def _facing_disc(light: Light, center: Array, points: Array, normals: Array, grid: int) -> Array:
    """A disc of the light's radius that turns to each receiver."""
    axis = points - center
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    u, v = _frame(axis)
    total = np.zeros(len(points))
    for x, y in _disc_grid(grid):
        to_light = center + light.radius * (x * u + y * v) - points
        distance = np.linalg.norm(to_light, axis=1)
        direction = to_light / distance[:, None]
        cosine = np.maximum((direction * normals).sum(axis=1), 0.0)
        emitted = np.maximum(-(direction * axis).sum(axis=1), 0.0)
        total += cosine * emitted / distance**2 * _spot_factor(light, -direction)
    return total * np.pi * light.radius**2 / grid**2


def _sphere(light: Light, center: Array, points: Array, normals: Array, grid: int) -> Array:
    axis = center - points
    distance = np.linalg.norm(axis, axis=1)
    axis /= distance[:, None]
    outside = distance > light.radius
    sine2 = np.where(outside, (light.radius / distance) ** 2, 0.0)
    total = _cone(axis, 1.0 - np.sqrt(1.0 - sine2), normals, grid, lambda d: _spot_factor(light, -d))
    return np.where(outside, total, np.pi)  # inside the sphere it shines from everywhere, cone or not


def _sun(light: Light, points: Array, normals: Array, grid: int) -> Array:
    axis = light.world_from_light[:3, 2] / np.linalg.norm(light.world_from_light[:3, 2])
    half = light.angle / 2.0
    if half == 0.0:
        return np.maximum(normals @ axis, 0.0)
    axes = np.broadcast_to(axis, points.shape)
    one_minus_cos = np.full(len(points), 2.0 * np.sin(half / 2.0) ** 2)
    return _cone(axes, one_minus_cos, normals, grid, lambda d: 1.0) / (np.pi * np.sin(half) ** 2)


def _cone(axis: Array, one_minus_cos: Array, normals: Array, grid: int, factor) -> Array:
    """The integral of cosine × factor over a cone of directions about axis, for a radiance of 1."""
    u, v = _frame(axis)
    total = np.zeros(len(axis))
    for i in range(grid):
        cosine = 1.0 - one_minus_cos * (i + 0.5) / grid
        sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
        for j in range(grid):
            phi = 2.0 * np.pi * (j + 0.5 * (i % 2)) / grid
            direction = cosine[:, None] * axis + sine[:, None] * (np.cos(phi) * u + np.sin(phi) * v)
            total += np.maximum((direction * normals).sum(axis=1), 0.0) * factor(direction)
    return total * 2.0 * np.pi * one_minus_cos / grid**2


def _area(light: Light, points: Array, normals: Array, grid: int) -> Array:
    matrix = light.world_from_light
    u, v = matrix[:3, 0] * light.area_size[0], matrix[:3, 1] * light.area_size[1]
    facing = -matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    round_shape = light.area_shape in {AreaShape.DISK, AreaShape.ELLIPSE}
    positions = 0.5 * _disc_grid(grid) if round_shape else _square_grid(grid)
    total = np.zeros(len(points))
    for x, y in positions:
        to_light = matrix[:3, 3] + x * u + y * v - points
        distance = np.linalg.norm(to_light, axis=1)
        direction = to_light / distance[:, None]
        cosine = np.maximum((direction * normals).sum(axis=1), 0.0)
        emitted = np.maximum(-(direction @ facing), 0.0)
        total += cosine * emitted / distance**2 * spread_factor(light.area_spread, emitted)
    return AREA_POWER_TO_RADIANCE * total / grid**2  # the emitter's area cancels


AREA_POWER_TO_RADIANCE = 1.0 / np.pi  # radiance × area of a light of 1 W


def spread_factor(spread: float, cosine: Array) -> Array:
    """How much an area light's grid of slats lets through at an angle to its axis; keeps the light's power."""
    half = spread / 2.0
    if spread >= np.pi - 1e-6:
        return np.ones_like(cosine)
    with np.errstate(divide="ignore", invalid="ignore"):
        tangent = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / cosine
        scale = 1.0 / (np.tan(half) - half) if half > 0.05 else 3.0 / half**3
        return np.where(cosine > 0.0, np.maximum((np.tan(half) - tangent) * scale, 0.0), 0.0)


def _spot_factor(light: Light, from_light: Array) -> Array | float:
    """The cone of a spot light for (n, 3) world directions from the light to the receiver."""
    if light.kind is not LightKind.SPOT:
        return 1.0
    local = from_light @ np.linalg.inv(light.world_from_light[:3, :3]).T
    cosine = -local[:, 2] / np.linalg.norm(local, axis=1)
    edge = np.cos(light.spot_angle / 2.0)
    if light.spot_blend == 0.0:
        return (cosine > edge).astype(np.float64)
    x = np.clip((cosine - edge) / ((1.0 - edge) * light.spot_blend), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def _frame(axis: Array) -> tuple[Array, Array]:
    """Two (n, 3) unit vectors perpendicular to each axis and each other."""
    helper = np.where(np.abs(axis[:, :1]) < 0.9, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    u = np.cross(axis, helper)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(axis, u)


def _square_grid(grid: int) -> Array:
    line = (np.arange(grid) + 0.5) / grid - 0.5
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)


def _disc_grid(grid: int) -> Array:
    """Equal-area points of the unit disc."""
    ring, turn = np.divmod(np.arange(grid * grid), grid)
    radius = np.sqrt((ring + 0.5) / grid)
    phi = 2.0 * np.pi * (turn + 0.5 * (ring % 2)) / grid
    return np.stack((radius * np.cos(phi), radius * np.sin(phi)), axis=-1)
