"""The two-dimensional Haar basis on the faces of a cube map, and functions kept as their few strongest terms.

The non-standard decomposition (Ng, Ramamoorthi, Hanrahan 2003): a square of four texels becomes their sum / 2 and three
differences / 2, and the sums are treated again. The basis is orthonormal over texels, so products of functions are sums
of products of coefficients; light is stored as radiance, and transport has the solid angles of the texels in it.

In a face's array of coefficients the mean stands at [0, 0], and the block of level k, 2^k texels wide, holds the
differences along s at [:2^k, 2^k:], along t at [2^k:, :2^k], and the diagonal ones at [2^k:, 2^k:].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .sphere import Array

# What a quantised value may be: 16 bits with a sign, and the same steps on both sides of 0. With 8 bits, the means of
# the six faces alone put a white sky wrong by 0.8 %, and the numbers of the terms take as much room anyway.
STEPS = 32767


def forward(faces: Array) -> Array:
    """Coefficients of (..., size, size) texels, in an array of the same shape. ``size`` is a power of two."""
    size = _size(faces)
    out = np.array(faces, np.result_type(faces, np.float32))
    while size > 1:
        half = size // 2
        block = out[..., :size, :size]
        a, b = block[..., 0::2, 0::2], block[..., 0::2, 1::2]
        c, d = block[..., 1::2, 0::2], block[..., 1::2, 1::2]
        quarters = 0.5 * (a + b + c + d), 0.5 * (a - b + c - d), 0.5 * (a + b - c - d), 0.5 * (a - b - c + d)
        block[..., :half, :half], block[..., :half, half:] = quarters[:2]
        block[..., half:, :half], block[..., half:, half:] = quarters[2:]
        size = half
    return out


def inverse(coefficients: Array) -> Array:
    """The texels that ``forward`` was given."""
    size = _size(coefficients)
    out = np.array(coefficients, np.result_type(coefficients, np.float32))
    half = 1
    while half < size:
        block = out[..., : 2 * half, : 2 * half]
        mean, along_s = block[..., :half, :half].copy(), block[..., :half, half:].copy()
        along_t, diagonal = block[..., half:, :half].copy(), block[..., half:, half:].copy()
        block[..., 0::2, 0::2] = 0.5 * (mean + along_s + along_t + diagonal)
        block[..., 0::2, 1::2] = 0.5 * (mean - along_s + along_t - diagonal)
        block[..., 1::2, 0::2] = 0.5 * (mean + along_s - along_t - diagonal)
        block[..., 1::2, 1::2] = 0.5 * (mean - along_s - along_t + diagonal)
        half *= 2
    return out


def _size(faces: Array) -> int:
    height, width = faces.shape[-2:]
    if height != width or height & (height - 1) or not height:
        raise ValueError(f"faces of {width} x {height} texels: the Haar basis wants a square of a power of two")
    return height


def strongest(coefficients: Array, count: int, weights: Array | None = None) -> Array:
    """Which ``count`` terms of the light to keep, strongest first: (..., terms) -> (count,) their numbers.

    Strength is the absolute value, summed over the channels before the last axis, times ``weights`` (terms,): the
    energy of the transport that each term meets. Terms that no vertex sees are then not kept, however bright.
    """
    strength = np.abs(coefficients).reshape(-1, coefficients.shape[-1]).sum(axis=0)
    if weights is not None:
        strength = strength * weights
    count = min(count, len(strength))
    kept = np.argpartition(-strength, count - 1)[:count]
    return kept[np.lexsort((kept, -strength[kept]))]


@dataclass(frozen=True, eq=False)
class SparseRows:
    """The transport of n vertices: for each the strongest terms, as whole steps of the row's own scale.

    Row i is at [starts[i], starts[i + 1]) of ``terms`` and ``steps``; a value is its step times scales[i].
    """

    starts: Array  # (n + 1,) int64
    terms: Array  # (kept,) uint16: number of the coefficient over all six faces, ascending in a row
    steps: Array  # (kept,) int16
    scales: Array  # (n,) float32
    width: int  # how many terms a whole row has

    @property
    def nbytes(self) -> int:
        return self.terms.nbytes + self.steps.nbytes + self.scales.nbytes + self.starts.nbytes

    @property
    def rows(self) -> Array:
        """(kept,) which row each value belongs to."""
        return np.repeat(np.arange(len(self.scales)), np.diff(self.starts))

    def dense(self) -> Array:
        """(n, width) float32."""
        full = np.zeros((len(self.scales), self.width), np.float32)
        full[self.rows, self.terms] = self.steps * self.scales[self.rows]
        return full

    def dot(self, light: Array) -> Array:
        """(n, ...) the light (width, ...) that each vertex passes on."""
        values = (self.steps * self.scales[self.rows]).reshape(-1, *[1] * (light.ndim - 1)) * light[self.terms]
        total = np.zeros((len(self.scales), *light.shape[1:]), values.dtype)
        np.add.at(total, self.rows, values)
        return total

    def energy(self) -> Array:
        """(width,) the norm of each term over all vertices: the weights for ``strongest``."""
        values = (self.steps * self.scales[self.rows]).astype(np.float64)
        return np.sqrt(np.bincount(self.terms, values * values, self.width))


def sparse_rows(rows: Array, keep: float, together: int = 1) -> SparseRows:
    """Quantise (n, width) coefficients, keeping the fraction ``keep`` (0..1) of each row's squared sum.

    The largest terms that together have it are kept, of so many rows ``together``. Besides what is left out, a value
    errs by at most half a step, 1 / 65,534 of the row's largest; terms that come out as 0 are left out too.
    """
    if rows.shape[1] > 65536:
        raise ValueError(f"{rows.shape[1]} terms: a number of 16 bits counts 65,536")
    power = (rows.astype(np.float64) ** 2).reshape(-1, together * rows.shape[1])
    rising = np.sort(power, axis=1)
    summed = np.cumsum(rising, axis=1)
    dropped = (summed <= (1.0 - keep) * summed[:, -1:]).sum(axis=1).clip(max=power.shape[1] - 1)
    kept = (power >= rising[np.arange(len(power)), dropped][:, None]).reshape(rows.shape)
    scales = (np.abs(rows).max(axis=1) / STEPS).astype(np.float32)
    steps = np.rint(rows / np.where(scales > 0, scales, 1)[:, None])
    row, term = np.nonzero(kept & (steps != 0))
    starts = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=len(rows)))])
    return SparseRows(starts, term.astype(np.uint16), steps[row, term].astype(np.int16), scales, rows.shape[1])


def join_rows(pieces: list[SparseRows]) -> SparseRows:
    """One after the other."""
    counts = np.concatenate([np.diff(piece.starts) for piece in pieces])
    starts = np.concatenate([[0], np.cumsum(counts)])
    terms, steps, scales = (np.concatenate([getattr(p, name) for p in pieces]) for name in ("terms", "steps", "scales"))
    return SparseRows(starts, terms, steps, scales, pieces[0].width)
