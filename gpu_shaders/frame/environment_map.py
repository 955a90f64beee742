"""The light of the world as numbers: an octahedral map of radiance, its suns, its spherical harmonics, its pyramid.

A map is (n, n, 3) float32, n a power of 2: the octahedron of lib/octahedron_lib.glsl, row 0 at the bottom. What is
here needs no GPU, and is done once for a world, not for a picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

Array = np.ndarray

# The most suns of one world.
MOST_SUNS = 4
# A spot is a sun if it has at least this share of all light that reaches a sphere: less is no harder to sample as sky,
SUN_SHARE = 0.02
# and if so far around its brightest texel,
SUN_REACH = math.radians(4.0)
# there is nearly all that is above the threshold within twice as far: lamps and windows are no suns.
SUN_COMPACT = 1.25


@dataclass(frozen=True)
class Sun:
    """A spot of a map that became a light of its own."""

    direction: tuple[float, float, float]  # to it, unit
    irradiance: tuple[float, float, float]  # W/m² on a surface that faces it
    angle: float  # angular diameter, radians


@lru_cache(maxsize=4)
def texel_directions(side: int) -> Array:
    """(n, n, 3) float64 unit directions of the texels' centres."""
    line = (2 * np.arange(side) + 1) / side - 1
    x, y = np.meshgrid(line, line)
    z = 1 - abs(x) - abs(y)
    below = z < 0
    folded = (1 - abs(y)) * np.where(x >= 0, 1, -1), (1 - abs(x)) * np.where(y >= 0, 1, -1)
    d = np.stack((np.where(below, folded[0], x), np.where(below, folded[1], y), z), -1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    d.flags.writeable = False
    return d


@lru_cache(maxsize=4)
def texel_omegas(side: int) -> Array:
    """(n, n) float64 solid angles, sr, which add up to 4 pi."""
    omega = abs(texel_directions(side)).sum(-1) ** 3.0
    omega *= 4 * math.pi / omega.sum()
    omega.flags.writeable = False
    return omega


def without_suns(pixels: Array, threshold: float, least_angle: float) -> tuple[Array, tuple[Sun, ...]]:
    """The map with its suns cut down to what is around them, and the suns. A sun and what is left give the same light.

    ``threshold``: radiance above which a spot can be one; 0: never. ``least_angle``: their least angular diameter.
    """
    level = pixels.mean(-1, dtype=np.float64)
    if threshold <= 0.0 or level.max() <= threshold:
        return pixels, ()
    side = len(pixels)
    directions, omegas = texel_directions(side), texel_omegas(side)
    least = SUN_SHARE * (level * omegas).sum()
    left, suns = pixels.copy(), []
    for _ in range(MOST_SUNS):
        peak = np.unravel_index(np.argmax(level), level.shape)
        if level[peak] <= threshold:
            break
        found = _sun_at(left, level, directions, omegas, peak, (threshold, least, least_angle))
        if found is None:
            break
        region, kept, sun = found
        left[region] *= kept[:, None].astype(np.float32)
        level[region] *= kept
        suns.append(sun)
    return left, tuple(suns)


def _sun_at(pixels, level, directions, omegas, peak, limits) -> tuple[Array, Array, Sun] | None:
    """The sun around a texel: its texels, what they keep, and the light. None where it is none."""
    threshold, least, least_angle = limits
    cosine = directions @ directions[peak]
    near, far = cosine > math.cos(SUN_REACH), cosine > math.cos(2 * SUN_REACH)
    around = far & ~near
    base = max(threshold, float((level * omegas)[around].sum() / max(omegas[around].sum(), 1e-30)))
    above = np.maximum(level - base, 0.0) * omegas
    taken = float(above[near].sum())
    if taken < least or above[far].sum() > SUN_COMPACT * taken:
        return None
    region = near & (above > 0.0)
    kept = base / level[region]
    weights = above[region]
    middle = weights @ directions[region]
    middle /= np.linalg.norm(middle)
    light = (pixels[region] * ((1.0 - kept) * omegas[region])[:, None]).sum(0, dtype=np.float64)
    # A disc of radius r has the mean square distance r² / 2; a square texel of area w has w / 6 of its own.
    squared = np.maximum(2.0 - 2.0 * (directions[region] @ middle), 0.0)
    spread = weights @ (squared - omegas[region] / 6.0) / weights.sum()
    angle = max(2.0 * math.sqrt(max(2.0 * spread, 0.0)), least_angle)
    return region, kept, Sun(tuple(middle.tolist()), tuple(light.tolist()), angle)


def harmonics(pixels: Array) -> Array:
    """(9, 3) float64: the map's irradiance / pi as factors of 1, y, z, x, xy, yz, 3z² - 1, xz, x² - y² of a normal.

    R. Ramamoorthi, P. Hanrahan: "An Efficient Representation for Irradiance Environment Maps", SIGGRAPH 2001.
    """
    side = len(pixels)
    basis = _basis(side)
    light = np.tensordot(basis, pixels.reshape(-1, 3) * texel_omegas(side).reshape(-1, 1), 1)
    # Each polynomial over its norm on the sphere, times the share of a band that the cosine over pi lets through.
    norms = np.array([1, 3, 3, 3, 15, 15, 5 / 4, 15, 15 / 4]) / (4 * math.pi)
    shares = np.array([1, *[2 / 3] * 3, *[1 / 4] * 5])
    return light * (norms * shares)[:, None]


@lru_cache(maxsize=2)
def _basis(side: int) -> Array:
    x, y, z = np.moveaxis(texel_directions(side).reshape(-1, 3), -1, 0)
    return np.stack((np.ones_like(x), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y))


def pyramid(pixels: Array) -> Array:
    """All levels in one picture, (n, 3/2 n, 4) float32: the map, and beside it the next ones, each above the last.

    A texel is the mean over the solid angle of the four below it, so that every level sends the same light.
    """
    side = len(pixels)
    picture = np.zeros((side, side + side // 2, 4), np.float32)
    picture[:side, :side, :3] = pixels
    level, omegas, row = pixels.astype(np.float64), texel_omegas(side), 0
    while len(level) > 1:
        weighted = _sum_of_four(level * omegas[..., None])
        omegas = _sum_of_four(omegas[..., None])[..., 0]
        level = weighted / omegas[..., None]
        picture[row : row + len(level), side : side + len(level), :3] = level
        row += len(level)
    return picture


def _sum_of_four(values: Array) -> Array:
    return values[0::2, 0::2] + values[1::2, 0::2] + values[0::2, 1::2] + values[1::2, 1::2]
