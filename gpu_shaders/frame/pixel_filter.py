"""Where inside (and around) a pixel a sample lies: Blender's pixel filter, sampled by its own density."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

# 1/g and 1/g^2 of the plastic number: the R2 sequence (Roberts 2018).
_R2 = np.array([0.7548776662466927, 0.5698402909980532])


def blackman_harris(x: np.ndarray) -> np.ndarray:
    """The filter's weight at x in [-1/2, 1/2] filter widths (Harris 1978, four terms)."""
    t = 2 * np.pi * (x + 0.5)
    return 0.35875 - 0.48829 * np.cos(t) + 0.14128 * np.cos(2 * t) - 0.01168 * np.cos(3 * t)


@lru_cache(maxsize=1)
def _quantiles() -> tuple[np.ndarray, np.ndarray]:
    x = np.linspace(-0.5, 0.5, 1025)
    cumulative = np.concatenate([[0.0], np.cumsum(0.5 * (blackman_harris(x[1:]) + blackman_harris(x[:-1])))])
    return cumulative / cumulative[-1], x


def pixel_offset(sample: int, width: float) -> np.ndarray:
    """(2,) offset from the pixel's centre in pixels; sample 0 is the centre itself.

    ``width`` is Blender's filter width: the window reaches that far to either side, as in Cycles and EEVEE. Drawing
    offsets with the window's density lets all samples weigh the same.
    """
    cumulative, x = _quantiles()
    u = (0.5 + _R2 * sample) % 1.0
    return np.interp(u, cumulative, x) * (2 * width)
