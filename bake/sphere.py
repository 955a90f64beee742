"""Directions over the sphere with the solid angle of each: quadrature, sample sets, cube maps, equirectangular images.

Axes are Blender's: right-handed, Z up. Directions are (..., 3) unit vectors of float64; solid angles add up to 4 pi.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray

# The six faces of a cube map in the order and orientation of OpenGL: major axis, direction of s, direction of t.
FACES = np.array(
    [
        [[1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[-1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[0, 1, 0], [1, 0, 0], [0, 0, 1]],
        [[0, -1, 0], [1, 0, 0], [0, 0, -1]],
        [[0, 0, 1], [1, 0, 0], [0, -1, 0]],
        [[0, 0, -1], [-1, 0, 0], [0, -1, 0]],
    ],
    np.float64,
)
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


def quadrature(degree: int) -> tuple[Array, Array]:
    """Directions (n, 3) and weights (n,) that integrate every polynomial up to ``degree`` exactly.

    Gauss-Legendre in z times the trapezium rule in azimuth: (degree + 1) (degree // 2 + 1) directions.
    """
    z, z_weights = np.polynomial.legendre.leggauss(degree // 2 + 1)
    turns = degree + 1
    azimuth = (np.arange(turns) + 0.5) * (2.0 * np.pi / turns)
    radius = np.sqrt(1.0 - z * z)
    directions = np.empty((len(z), turns, 3))
    directions[..., 0] = radius[:, None] * np.cos(azimuth)
    directions[..., 1] = radius[:, None] * np.sin(azimuth)
    directions[..., 2] = z[:, None]
    return directions.reshape(-1, 3), np.repeat(z_weights * (2.0 * np.pi / turns), turns)


def spread(count: int) -> Array:
    """(count, 3) directions spread evenly along a spiral of golden angles, each standing for 4 pi / count."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    radius, azimuth = np.sqrt(1.0 - z * z), _GOLDEN_ANGLE * np.arange(count)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=-1)


def cube_directions(size: int) -> Array:
    """(6, size, size, 3): where the middle of each texel of a cube map looks, indexed by face, t, s."""
    at = (np.arange(size) + 0.5) * (2.0 / size) - 1.0
    s, t = at[None, None, :, None], at[None, :, None, None]
    axis, along_s, along_t = (FACES[:, i][:, None, None, :] for i in range(3))
    directions = axis + s * along_s + t * along_t
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def cube_solid_angles(size: int) -> Array:
    """(6, size, size) steradians of each texel, exact: differences of the integral from the middle to a corner."""
    edge = np.linspace(-1.0, 1.0, size + 1)
    s, t = edge[None, :], edge[:, None]
    corner = np.arctan2(s * t, np.sqrt(s * s + t * t + 1.0))
    face = np.diff(np.diff(corner, axis=0), axis=1)
    return np.broadcast_to(face, (6, size, size))


def texel_of(directions: Array, size: int) -> Array:
    """(n,) the texel of a cube map that each of ``directions`` (n, 3) passes, numbered over faces, t, s."""
    major = np.abs(directions).argmax(axis=1)
    rows = np.arange(len(directions))
    face = 2 * major + (directions[rows, major] < 0)
    length = np.abs(directions[rows, major])
    st = [(FACES[face, axis] * directions).sum(axis=1) / length for axis in (1, 2)]
    s, t = (((place + 1.0) * (0.5 * size)).astype(np.int64).clip(0, size - 1) for place in st)
    return (face * size + t) * size + s
