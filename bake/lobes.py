"""Lobes around an axis (zonal harmonics): cosine, Phong; turned anywhere; a window against ringing.

A lobe is its n coefficients z_l of the functions with m = 0, its axis being +Z. Convolving a function with it
multiplies band l by sqrt(4 pi / (2 l + 1)) z_l (Funk and Hecke).
"""

from __future__ import annotations

import numpy as np

from .sh import band_count, band_of, evaluate
from .sphere import Array


def band_scales(bands: int) -> Array:
    """(bands,) sqrt(4 pi / (2 l + 1))."""
    return np.sqrt(4.0 * np.pi / (2.0 * np.arange(bands) + 1.0))


def turn(lobe: Array, axes: Array) -> Array:
    """(..., n²) coefficients of ``lobe`` around each of ``axes`` (..., 3)."""
    bands = len(lobe)
    return evaluate(axes, bands) * (band_scales(bands) * lobe)[band_of(bands)]


def phong(bands: int, exponent: float) -> Array:
    """max(0, z)^exponent, scaled to integrate to 1. ``exponent`` > 0.

    The moments of the Legendre polynomials follow from one another: I_l = I_(l-2) (p - l + 2) / (p + l + 1).
    """
    moments = np.zeros(bands)
    moments[0] = 1.0 / (exponent + 1.0)
    if bands > 1:
        moments[1] = 1.0 / (exponent + 2.0)
    for order in range(2, bands):
        moments[order] = moments[order - 2] * (exponent - order + 2.0) / (exponent + order + 1.0)
    return (exponent + 1.0) * moments / band_scales(bands)


def cosine(bands: int) -> Array:
    """max(0, z): the lobe that turns radiance into irradiance (Ramamoorthi and Hanrahan 2001)."""
    return np.pi * phong(bands, 1.0)


def narrowest(bands: int) -> float:
    """The mean cosine to its axis of the narrowest lobe of so many bands that is nowhere negative.

    Such a lobe is the square of a polynomial of the cosine, for even ``bands`` times 1 + cosine (Lukács), and its mean
    cosine at most the largest node of Gauss' quadrature, or of Radau's with a node at -1 (Szegő 1939, chapter 7.7).
    """
    half = (bands + 1) // 2
    series = [0.0] * half + ([1.0] if bands % 2 else [1.0, 1.0])  # P_half, or P_half + P_(half + 1)
    return float(np.polynomial.legendre.legroots(series).real.max())


def window(coefficients: Array, factors: Array) -> Array:
    """Multiply each band by its factor."""
    return coefficients * factors[band_of(band_count(coefficients))]


def laplacian(bands: int, strength: float) -> Array:
    """1 / (1 + strength l² (l + 1)²): the best fit that is charged for its squared Laplacian (Sloan 2008)."""
    curvature = np.arange(bands) * (np.arange(bands) + 1.0)
    return 1.0 / (1.0 + strength * curvature**2)


def laplacian_strength(coefficients: Array, keep: float) -> float:
    """The strength that leaves the fraction ``keep`` (0..1) of the squared Laplacian, summed over all leading axes.

    0 where there is none to begin with: a constant function needs no window.
    """
    bands = band_count(coefficients)
    power = np.bincount(band_of(bands), (coefficients.reshape(-1, bands * bands) ** 2).sum(axis=0))
    energy = power * (np.arange(bands) * (np.arange(bands) + 1.0)) ** 2
    if not energy.any() or keep >= 1.0:
        return 0.0
    low, high = 0.0, 1.0
    while (energy * laplacian(bands, high) ** 2).sum() > keep * energy.sum():
        low, high = high, 2.0 * high
    for _ in range(60):
        middle = 0.5 * (low + high)
        if (energy * laplacian(bands, middle) ** 2).sum() > keep * energy.sum():
            low = middle
        else:
            high = middle
    return high
