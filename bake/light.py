"""The light of the surroundings as a bake takes it: spherical harmonics, or the texels of a cube map.

Axes are the world's; ``cube`` turns them into those of an object.
"""

from __future__ import annotations

import numpy as np

from ..gpu_shaders.frame.environment_map import texel_directions, texel_omegas
from . import lobes, sh
from .sphere import Array, texel_of

# Texels along a side of the map that harmonics are made of: 1.6 degrees, for functions no finer than 18.
_HARMONIC_SIDE = 128
# Texels along its side for each texel along a face of a cube map: even where those are smallest, two of them.
_CUBE_SIDES = 8


class Surroundings:
    """Radiance from far away: one colour (3,), or a map (n, n, 3) as of ``environment_map``, n a power of 2."""

    def __init__(self, radiance: Array) -> None:
        radiance = np.asarray(radiance, np.float64)
        self._color = radiance if radiance.ndim == 1 else None
        self._maps = {} if radiance.ndim == 1 else {len(radiance): radiance}
        self._terms: dict[int, Array] = {}

    def harmonics(self, bands: int, window: float = 0.0) -> Array:
        """(3, bands²) coefficients along the world's axes.

        ``window`` 0..1: the part of the squared Laplacian that is taken out, against ringing (Sloan 2008).
        """
        if bands not in self._terms:
            self._terms[bands] = self._project(bands)
        terms = self._terms[bands]
        strength = lobes.laplacian_strength(terms, 1.0 - window)
        return lobes.window(terms, lobes.laplacian(bands, strength))

    def cube(self, size: int, frame: Array) -> Array:
        """(6, size, size, 3) mean radiance over the texels of a cube map along the axes ``frame`` (3, 3)."""
        if self._color is not None:
            return np.broadcast_to(self._color, (6, size, size, 3))
        side = _CUBE_SIDES * size
        texels = texel_of(texel_directions(side).reshape(-1, 3) @ frame, size)
        weights = texel_omegas(side).reshape(-1)
        radiance = self._of_side(side).reshape(-1, 3)
        sums = [np.bincount(texels, weights * c, 6 * size * size) for c in radiance.T]
        areas = np.maximum(np.bincount(texels, weights, 6 * size * size), 1e-12)
        # Over the light that fell into them, not over their own size: a texel more or less makes no difference.
        return (np.stack(sums, axis=-1) / areas[:, None]).reshape(6, size, size, 3)

    def _project(self, bands: int) -> Array:
        if self._color is None:
            side = _HARMONIC_SIDE
            directions, weights = texel_directions(side).reshape(-1, 3), texel_omegas(side).reshape(-1)
            return sh.project(self._of_side(side).reshape(-1, 3), directions, weights, bands)
        terms = np.zeros((3, bands * bands))
        terms[:, 0] = self._color * np.sqrt(4.0 * np.pi)
        return terms

    def _of_side(self, side: int) -> Array:
        """The map with so many texels along a side, of the same light: means of four, or each four times."""
        if side not in self._maps:
            nearest = min(self._maps, key=lambda have: abs(np.log2(have / side)))
            found = self._maps[nearest]
            while len(found) < side:
                found = found.repeat(2, axis=0).repeat(2, axis=1)
            while len(found) > side:
                omegas = texel_omegas(len(found))[..., None]
                found = _sum_of_four(found * omegas) / _sum_of_four(omegas)
            self._maps[side] = found
        return self._maps[side]


def _sum_of_four(values: Array) -> Array:
    return values[0::2, 0::2] + values[1::2, 0::2] + values[0::2, 1::2] + values[1::2, 1::2]
