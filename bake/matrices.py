"""Matrices that turn the coefficients of light from far away into those of the radiance that arrives at a vertex.

Sloan, Kautz, Snyder 2002: the light of the directions above the horizon that nothing blocks, and what the surfaces that
do block pass on. As in ``transfer``, what is not blocked is exact (a hemisphere's product matrix) and only the rest is
sampled.
"""

from __future__ import annotations

import numpy as np

from . import lobes, sh
from .sphere import Array, quadrature


def hemisphere(bands: int) -> Array:
    """The lobe that is 1 above the horizon and 0 below: exact integrals of the Legendre polynomials over 0..1."""
    nodes, weights = np.polynomial.legendre.leggauss(bands)
    z = 0.5 * (nodes + 1.0)
    axis = np.stack([np.sqrt(1.0 - z * z), np.zeros_like(z), z], axis=-1)
    orders = np.arange(bands)
    return np.pi * weights @ sh.evaluate(axis, bands)[:, orders * (orders + 1)]


def open_matrices(normals: Array, light: int, result: int) -> Array:
    """(V, result², light²): the transfer of a vertex that sees all of its hemisphere. Exact."""
    bands = light + result - 1  # the highest order that a product of two can have
    above = lobes.turn(hemisphere(bands), normals)
    directions, weights = quadrature(2 * (bands - 1))
    # The tensor of products, without the limit of MAX_BANDS on one of its axes' reach.
    pairs = np.einsum("di,dj->dij", sh.evaluate(directions, result), sh.evaluate(directions, light))
    tensor = (sh.evaluate(directions, bands) * weights[:, None]).T @ pairs.reshape(len(directions), -1)
    return (above @ tensor).reshape(len(normals), result**2, light**2)


class Arriving:
    """Sums over ``directions`` (N, 3) into matrices of ``result`` bands for a light of ``light``."""

    def __init__(self, directions: Array, light: int, result: int) -> None:
        self._weight = 4.0 * np.pi / len(directions)
        self._out = sh.evaluate(directions, result)
        self._pairs = np.einsum("di,dj->dij", self._out, sh.evaluate(directions, light)).reshape(len(directions), -1)
        self._bands = light, result

    def from_the_sky(self, normals: Array, at: Array, numbers: Array) -> Array:
        """(V, result², light²) float64: ray ``numbers[i]`` of vertex ``at[i]`` is blocked."""
        lost = np.zeros((len(normals), len(self._out)))
        lost[at, numbers] = self._weight
        found = open_matrices(normals, *self._bands)
        found -= (lost @ self._pairs).reshape(found.shape)
        return found

    def by_surfaces(self, count: int, at: Array, numbers: Array, light: Array) -> Array:
        """(count, result², channels, light²) float32: along ray ``numbers[i]`` of vertex ``at[i]`` comes ``light[i]``.

        ``at`` ascends.
        """
        total = np.zeros((count, self._out.shape[1], *light.shape[1:]), np.float32)
        ends = np.searchsorted(at, np.arange(count + 1))
        for row in range(count):  # one product a vertex
            rays = slice(ends[row], ends[row + 1])
            total[row] = np.tensordot(self._out[numbers[rays]], light[rays], axes=(0, 0))
        return self._weight * total


def turn_matrices(matrices: Array, frame: Array) -> Array:
    """The matrices (..., result², light²) for light and result along the axes ``frame`` (3, 3), not the world's."""
    turned = np.swapaxes(sh.rotate(matrices, frame.T), -1, -2)
    return np.swapaxes(sh.rotate(turned, frame.T), -1, -2)
