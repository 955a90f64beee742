"""The light of the surroundings as a bake takes it: spherical harmonics, or the texels of a cube map.

Axes are the world's; ``Surroundings`` turns them into those of an object.
"""

from __future__ import annotations

import numpy as np

from . import lobes, sh
from .sphere import Array, equirect_directions, equirect_solid_angles, texel_of

# Pixels of a picture of the surroundings that harmonics are made of, across.
_WIDEST = 512
# Pixels across for each texel along a face of a cube map: even where texels are smallest, two of them.
_PIXELS = 16


class Surroundings:
    """Radiance from far away: one colour, or a picture (h, w, 3) laid out as in ``sphere.equirect_directions``."""

    def __init__(self, radiance: Array) -> None:
        radiance = np.asarray(radiance, np.float64)
        self._color = radiance if radiance.ndim == 1 else None
        self._image = np.zeros((1, 1, 3)) if radiance.ndim == 1 else radiance
        self._sized: dict[int, Array] = {}
        self._terms: dict[int, Array] = {}

    @property
    def is_black(self) -> bool:
        return not (self._image.any() if self._color is None else self._color.any())

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
        image = self._of_width(_PIXELS * size)
        height, width = image.shape[:2]
        towards = equirect_directions(height, width).reshape(-1, 3) @ frame
        weights = equirect_solid_angles(height, width).reshape(-1)
        texels = texel_of(towards, size)
        sums = [np.bincount(texels, weights * c, 6 * size * size) for c in image.reshape(-1, 3).T]
        areas = np.maximum(np.bincount(texels, weights, 6 * size * size), 1e-12)
        # Over the light that fell into them, not over their own size: a pixel more or less makes no difference.
        return (np.stack(sums, axis=-1) / areas[:, None]).reshape(6, size, size, 3)

    def _project(self, bands: int) -> Array:
        if self._color is None:
            return sh.project_equirect(self._of_width(_WIDEST), bands)
        terms = np.zeros((3, bands * bands))
        terms[:, 0] = self._color * np.sqrt(4.0 * np.pi)
        return terms

    def _of_width(self, wanted: int) -> Array:
        """The picture with about so many pixels across: means over squares of them, or each several times."""
        if wanted not in self._sized:
            height, width = self._image.shape[:2]
            more = -(-wanted // width)
            if more > 1:
                self._sized[wanted] = self._image.repeat(more, axis=0).repeat(more, axis=1)
            else:
                self._sized[wanted] = _reduced(self._image, max(width // wanted, 1))
        return self._sized[wanted]


def _reduced(image: Array, step: int) -> Array:
    """Means over ``step`` x ``step`` pixels, by their solid angles; a few more where they do not come out even."""
    if step == 1:
        return image
    height, width = (max(n // step, 1) for n in image.shape[:2])
    rows, columns = (np.arange(n) * m // n for n, m in zip(image.shape[:2], (height, width), strict=True))
    places = (rows[:, None] * width + columns[None, :]).reshape(-1)
    weights = equirect_solid_angles(*image.shape[:2]).reshape(-1)
    areas = np.bincount(places, weights, height * width)
    sums = [np.bincount(places, weights * c, height * width) for c in image.reshape(-1, image.shape[2]).T]
    return (np.stack(sums, axis=-1) / areas[:, None]).reshape(height, width, -1)
