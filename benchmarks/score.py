"""How far a picture is from its path-traced reference. Plain numpy, rows in any one order."""

from __future__ import annotations

import numpy as np

Array = np.ndarray

# Cells of 4 x 4 pixels take a reference's remaining noise out of the figures, not a wrong level, colour or shape.
CELL = 4
# The worst cells of a picture are edges that two renderers place half a pixel apart.
KEPT = 0.999
# What keeps black cells from counting without end: this part of the reference's squared mean.
FLOOR = 0.01


def energy(reference: Array, test: Array) -> float:
    """Mean over mean; 1 is right."""
    return float(test.mean(dtype=np.float64) / reference.mean(dtype=np.float64))


def relative_squared_error(reference: Array, test: Array) -> float:
    """Mean over cells of the squared difference over the squared reference (kept from 0 by 1 % of its mean squared)."""
    error = cell_errors(reference, test)
    return float(np.sort(error.ravel())[: max(int(error.size * KEPT), 1)].mean())


def cell_errors(reference: Array, test: Array) -> Array:
    """The relative squared error of every cell: (h // 4, w // 4)."""
    r, t = cells(reference), cells(test)
    return ((t - r) ** 2).mean(-1) / ((r**2).mean(-1) + FLOOR * float(reference.mean()) ** 2)


def cells(image: Array) -> Array:
    """Means of 4 x 4 pixels: (h // 4, w // 4, channels)."""
    height, width = (n - n % CELL for n in image.shape[:2])
    return image[:height, :width].reshape(height // CELL, CELL, width // CELL, CELL, -1).mean((1, 3))


def scores(reference: Array, test: Array) -> dict[str, float]:
    """Both figures by name."""
    return {"energy": energy(reference, test), "relmse": relative_squared_error(reference, test)}
