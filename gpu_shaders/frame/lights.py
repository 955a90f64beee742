"""Lights for the shaders: the table of lights, and the point of each emitter that a sample of the frame uses."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...scene.data import AreaShape, Light, LightKind
from .maps import light_axes
from .structs import LIGHT_KINDS

ROUND = (AreaShape.DISK, AreaShape.ELLIPSE)
# 1/g, 1/g^2, 1/g^3 with g the root of g^4 = g + 1: the R3 sequence (Roberts 2018).
_R3 = np.array([0.8191725133961645, 0.6710436067037893, 0.5497004779019703])


def has_size(light: Light) -> bool:
    """Whether the emitter is more than a point (a direction, for a sun)."""
    if light.kind is LightKind.SUN:
        return light.angle > 0
    return light.kind is LightKind.AREA or light.radius > 0


def half_size(light: Light) -> tuple[float, float]:
    """Half the extent of an area light along its X and Y, metres, with the object's scale."""
    lengths = np.linalg.norm(np.asarray(light.world_from_light)[:3, :2], axis=0)
    x, y = light.area_size
    if light.area_shape in (AreaShape.SQUARE, AreaShape.DISK):
        y = x
    return 0.5 * x * float(lengths[0]), 0.5 * y * float(lengths[1])


def intensity(light: Light) -> np.ndarray:
    """(3,) W/sr of a point or spot, W/sr along the axis of an area light, W/m² of a sun: for diffuse reflection."""
    return _plain_intensity(light) * light.diffuse_factor


def _plain_intensity(light: Light) -> np.ndarray:
    scale = {LightKind.SUN: 1.0, LightKind.AREA: 1.0 / math.pi}.get(light.kind, 1.0 / (4.0 * math.pi))
    return np.asarray(light.power, np.float64) * scale


def emitter_sample(light: Light, index: int, count_offset: np.ndarray) -> np.ndarray:
    """The point (sun: unit direction to the light, even over its cone) that sample ``index`` of the frame uses.

    A point or spot light of radius R is a disc that turns to every receiver. One point must serve all receivers, so it
    is drawn from the isotropic density whose projection onto any plane is the uniform disc: its inverse
    Abel transform, proportional to 1 / sqrt(R² - r²).
    """
    flat = light.kind in (LightKind.SUN, LightKind.AREA)
    u = np.array(_net_point(index, count_offset)) if flat else (count_offset + _R3 * index) % 1.0
    center = np.asarray(light.world_from_light, np.float64)[:3, 3]
    axes = light_axes(light)
    if light.kind is LightKind.SUN:
        cosine, angle = 1 - u[0] * (1 - math.cos(0.5 * light.angle)), 2 * math.pi * u[1]
        sine = math.sqrt(max(1 - cosine * cosine, 0))
        direction = axes @ np.array([sine * math.cos(angle), sine * math.sin(angle), cosine])
        return direction / np.linalg.norm(direction)
    if light.kind is LightKind.AREA:
        x, y = 2 * u[0] - 1, 2 * u[1] - 1
        if light.area_shape in ROUND:
            x, y = _concentric(x, y)
        half = half_size(light)
        return center + axes[:, 0] * x * half[0] + axes[:, 1] * y * half[1]
    if light.radius <= 0:
        return center
    z, angle = 2 * u[0] - 1, 2 * math.pi * u[1]
    side = math.sqrt(max(1 - z * z, 0))
    direction = np.array([side * math.cos(angle), side * math.sin(angle), z])
    return center + light.radius * math.sin(_sine_squared_quantile(u[2])) * direction


def emitter_points(light: Light, across: float, most: int) -> list[np.ndarray | None]:
    """Points (3,) evenly over an area light, one for each ``across`` metres of both sides but at most ``most``.

    One is its centre, and None; so it is where ``across`` is nothing, in a scene of lights alone.
    """
    half = half_size(light)
    if across <= 0.0:
        return [None]
    x, y = (max(min(math.ceil(2.0 * side / across), most), 1) for side in half)
    while x * y > max(most, 1):
        x, y = (x - 1, y) if x >= y else (x, y - 1)
    if x * y == 1:
        return [None]
    center, axes = np.asarray(light.world_from_light, np.float64)[:3, 3], light_axes(light)
    places = [((2 * i + 1) / x - 1, (2 * j + 1) / y - 1) for i in range(x) for j in range(y)]
    if light.area_shape in ROUND:
        places = [_concentric(*place) for place in places]
    return [center + axes[:, 0] * (u * half[0]) + axes[:, 1] * (v * half[1]) for u, v in places]


def _net_point(index: int, scramble: np.ndarray) -> tuple[float, float]:
    """Point ``index`` of a (0, 2)-sequence, Sobol's first two dimensions, with digits flipped by ``scramble`` (0..1).

    Every 2^k points in order lie one in each box of a grid of 2^k boxes, whatever the grid's shape.
    """
    x, y = (int(s * 2**32) for s in scramble[:2])
    column_x = column_y = 1 << 31
    while index:
        if index & 1:
            x, y = x ^ column_x, y ^ column_y
        column_x, column_y, index = column_x >> 1, column_y ^ column_y >> 1, index >> 1
    return x / 2**32, y / 2**32


def _concentric(x: float, y: float) -> tuple[float, float]:
    """The square [-1, 1]² onto the unit disc, areas kept and neighbours too (Shirley & Chiu 1997)."""
    if abs(x) < abs(y):
        angle = 0.5 * math.pi - 0.25 * math.pi * x / y
        return y * math.cos(angle), y * math.sin(angle)
    angle = 0.25 * math.pi * y / x if x else 0.0
    return x * math.cos(angle), x * math.sin(angle)


def _sine_squared_quantile(u: float) -> float:
    """phi in [0, pi/2] whose density is sin²: solves (2 phi - sin 2 phi) / pi = u by bisection."""
    low, high = 0.0, 0.5 * math.pi
    for _ in range(40):
        middle = 0.5 * (low + high)
        if (2 * middle - math.sin(2 * middle)) / math.pi < u:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def light_row(light: Light, source: np.ndarray | None, first_face: int, face_count: int) -> dict:
    """The LIGHT table row; ``source`` is this sample's ``emitter_sample``, None the whole emitter, filtered."""
    axes = light_axes(light)
    center = np.asarray(light.world_from_light, np.float64)[:3, 3]
    rows = _object_from_world(light) if light.kind is LightKind.SPOT else axes.T
    half = half_size(light) if light.kind is LightKind.AREA else (0.0, 0.0)
    spot_cosine = math.cos(0.5 * (light.angle if light.kind is LightKind.SUN else light.spot_angle))
    is_disc = light.soft_falloff and light.kind in (LightKind.POINT, LightKind.SPOT)
    tangent, normalize = _spread(light)
    filtered = source is None and has_size(light)
    if source is None:
        source = axes[:, 2] if light.kind is LightKind.SUN else center
    return {
        "position": center,
        "kind": LIGHT_KINDS[light.kind],
        "axis_x": rows[0],
        "axis_y": rows[1],
        "axis_z": rows[2],
        "spot_cosine": spot_cosine,
        "spot_smooth": 1.0 / max((1.0 - spot_cosine) * light.spot_blend, 1e-7),
        "soft_radius_squared": light.radius**2 if is_disc else 0.0,
        "intensity": intensity(light),
        "specular_intensity": _plain_intensity(light) * light.specular_factor,
        "face_count": face_count,
        "source": source,
        "first_face": first_face,
        "filtered": int(filtered),
        "half_size": half,
        "spread_tangent": tangent,
        "spread_normalize": normalize,
        "emitter_radius": _emitter_radius(light, half),
        "round_shape": int(light.area_shape in ROUND),
    }


def _object_from_world(light: Light) -> np.ndarray:
    """(3, 3) to the directions of the light's object space, in which a spot's cone is round; only directions count."""
    matrix = np.asarray(light.world_from_light, np.float64)[:3, :3]
    if abs(np.linalg.det(matrix)) < 1e-12 * np.abs(matrix).max() ** 3:
        return light_axes(light).T
    inverse = np.linalg.inv(matrix)
    return inverse / np.abs(inverse).max()


def _emitter_radius(light: Light, half: Sequence[float]) -> float:
    if light.kind is LightKind.SUN:
        return math.tan(0.5 * min(light.angle, 3.0))
    if light.kind is LightKind.AREA:
        return math.sqrt(half[0] * half[1])
    return light.radius


def _spread(light: Light) -> tuple[float, float]:
    """Tangent of half the spread and Cycles' factor that keeps the light's power; (-1, 0): no limit."""
    if light.kind is not LightKind.AREA or light.area_spread >= math.pi - 1e-4:
        return -1.0, 0.0
    half = 0.5 * max(light.area_spread, 1e-3)
    return math.tan(half), 1.0 / (math.tan(half) - half)
