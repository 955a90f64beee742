"""How far a render is from its path-traced reference, and how to read either."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR

# Cells of 4 x 4 pixels take a reference's remaining noise out of the figures, not a wrong level, colour or shape.
CELL = 4
# The worst cells of a picture are edges that two renderers place half a pixel apart.
KEPT = 0.999

# Blender below 5.0 writes short names, and the references were written with long ones.
LONG_NAMES = {"DiffDir": "Diffuse Direct", "DiffInd": "Diffuse Indirect", "DiffCol": "Diffuse Color"}


def read_passes(path: Path) -> dict[str, np.ndarray]:
    """Every pass of a multi-layer EXR by its long name: (h, w, 3) float32, row 0 at the top."""
    channels: dict[str, dict[str, np.ndarray]] = {}
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                full = name if "." in name else f"{part.name()}.{name}"
                *layer, axis = full.split(".")
                short = layer[-1]
                channels.setdefault(LONG_NAMES.get(short, short), {})[axis] = np.asarray(channel.pixels, np.float32)
    return {
        name: np.nan_to_num(np.stack([axes[a] for a in axes_in_order], -1))
        for name, axes in channels.items()
        if len(axes_in_order := [a for a in "RGBXYZ" if a in axes]) == 3
    }


def diffuse(passes: dict[str, np.ndarray], which: str) -> np.ndarray:
    """Radiance of "Direct" or "Indirect" diffuse light: the pass times the colour."""
    return passes[f"Diffuse {which}"] * passes["Diffuse Color"]


def energy(reference: np.ndarray, test: np.ndarray) -> float:
    """Mean over mean; 1 is right."""
    return float(test.mean() / reference.mean())


def relative_squared_error(reference: np.ndarray, test: np.ndarray) -> float:
    """Mean over cells of the squared difference over the squared reference (kept from 0 by 1 % of its mean squared)."""
    r, t = _cells(reference), _cells(test)
    error = ((t - r) ** 2).mean(-1) / ((r**2).mean(-1) + 0.01 * float(reference.mean()) ** 2)
    return float(np.sort(error.ravel())[: int(error.size * KEPT)].mean())


def _cells(image: np.ndarray) -> np.ndarray:
    height, width = (n - n % CELL for n in image.shape[:2])
    return image[:height, :width].reshape(height // CELL, CELL, width // CELL, CELL, -1).mean((1, 3))
