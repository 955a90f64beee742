"""Real spherical harmonics up to order 10: evaluation, projection, rotation, products.

``bands`` n means the orders l = 0 .. n - 1, so n² coefficients; that of (l, m) is number l (l + 1) + m. The functions
are orthonormal over the sphere and carry no Condon-Shortley sign: those of l = 1 are sqrt(3 / 4 pi) times y, z, x.
Coefficients are the last axis of an array; a colour's channels come before it.
"""

from __future__ import annotations

import numpy as np

from .sphere import Array, quadrature

MAX_BANDS = 11
# Directions evaluated at a time: 16,384 with 121 coefficients are 16 MB.
_CHUNK = 16384


def band_count(coefficients: Array) -> int:
    """How many bands the last axis has. Raises ValueError where it is no square, or over MAX_BANDS²."""
    bands = round(coefficients.shape[-1] ** 0.5)
    if bands * bands != coefficients.shape[-1] or not 1 <= bands <= MAX_BANDS:
        raise ValueError(f"{coefficients.shape[-1]} coefficients are not those of 1 to {MAX_BANDS} bands")
    return bands


def band_of(bands: int) -> Array:
    """(bands²,) the order l of each coefficient."""
    return np.repeat(np.arange(bands), 2 * np.arange(bands) + 1)


def evaluate(directions: Array, bands: int) -> Array:
    """(..., bands²) float64: every basis function in each of ``directions``, unit vectors (..., 3).

    By recurrence on Cartesian coordinates, without angles: Y_lm is a polynomial in z times the real or imaginary part
    of (x + i y)^|m|, so nothing is singular at the poles.
    """
    if not 1 <= bands <= MAX_BANDS:
        raise ValueError(f"{bands} bands: between 1 and {MAX_BANDS} are possible")
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    values = np.empty((*x.shape, bands * bands))
    real, imaginary = np.ones_like(x), np.zeros_like(x)
    sectoral = np.sqrt(0.25 / np.pi)  # the polynomial in z of l = m: a constant
    for m in range(bands):
        if m:
            real, imaginary = x * real - y * imaginary, x * imaginary + y * real
            sectoral *= np.sqrt((2 * m + 1) / (2 * m))
        older, newer = np.zeros_like(z), np.full_like(z, sectoral)
        for order in range(m, bands):
            if order > m:
                older, newer = newer, _next_in_z(order, m, z, newer, older)
            middle = order * (order + 1)
            if m == 0:
                values[..., middle] = newer
            else:
                values[..., middle + m] = np.sqrt(2.0) * newer * real
                values[..., middle - m] = np.sqrt(2.0) * newer * imaginary
    return values


def _next_in_z(order: int, m: int, z: Array, newer: Array, older: Array) -> Array:
    """The polynomial of (l, m) from those of (l - 1, m) and (l - 2, m), all normalised."""
    scale = np.sqrt((4.0 * order**2 - 1.0) / (order**2 - m**2))
    last = order - 1.0
    return scale * (z * newer - np.sqrt((last**2 - m**2) / (4.0 * last**2 - 1.0)) * older)


def project(values: Array, directions: Array, weights: Array, bands: int) -> Array:
    """(..., bands²) coefficients of a function known in n directions: (n, ...) values, (n, 3), (n,) steradians."""
    values = np.asarray(values, np.float64)
    total = np.zeros((*values.shape[1:], bands * bands))
    for first in range(0, len(directions), _CHUNK):
        chunk = slice(first, first + _CHUNK)
        basis = evaluate(directions[chunk], bands) * weights[chunk, None]
        total += np.tensordot(values[chunk], basis, axes=(0, 0))
    return total


def rotation_blocks(rotation: Array, bands: int) -> list[Array]:
    """One (2 l + 1, 2 l + 1) matrix a band: what turning a function by ``rotation`` (3, 3) does to its coefficients.

    Each is the integral of a turned basis function times an unturned one, by a quadrature that is exact for it.
    """
    directions, weights = quadrature(2 * (bands - 1))
    turned = evaluate(directions @ np.asarray(rotation, np.float64), bands) * weights[:, None]
    still = evaluate(directions, bands)
    return [still[:, run].T @ turned[:, run] for run in _runs(bands)]


def rotate(coefficients: Array, rotation: Array) -> Array:
    """Coefficients of the function turned by ``rotation``: g(s) = f(rotation⁻¹ s)."""
    blocks = rotation_blocks(rotation, band_count(coefficients))
    turned = np.empty(coefficients.shape, np.result_type(coefficients, np.float32))
    for run, block in zip(_runs(len(blocks)), blocks, strict=True):
        turned[..., run] = coefficients[..., run] @ block.T
    return turned


def _runs(bands: int) -> list[slice]:
    """Where the coefficients of each band lie."""
    return [slice(order**2, (order + 1) ** 2) for order in range(bands)]


def triple_product(bands: int, other: int, result: int) -> Array:
    """(bands², other², result²): the integrals of three basis functions, the tensor of products. Exact."""
    directions, weights = quadrature(bands + other + result - 3)
    pairs = np.einsum("di,dj->dij", evaluate(directions, bands), evaluate(directions, other))
    pairs = pairs.reshape(len(directions), -1).T @ (evaluate(directions, result) * weights[:, None])
    return pairs.reshape(bands * bands, other * other, result * result)


def product(a: Array, b: Array, result: int) -> Array:
    """Coefficients (..., result²) of the product of two functions, cut off after ``result`` bands. Exact.

    For one product: to many, ``triple_product`` is applied faster than this.
    """
    bands, other = band_count(a), band_count(b)
    directions, weights = quadrature(bands + other + result - 3)
    values = (a @ evaluate(directions, bands).T) * (b @ evaluate(directions, other).T)
    return (values * weights) @ evaluate(directions, result)
