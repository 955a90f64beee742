"""Grids of pixels that gather light for those around them: every n-th pixel of every n-th row."""

import numpy as np

from ...scene.data import View

STRIDES = {"FULL": 1, "HALF": 2, "QUARTER": 4, "EIGHTH": 8}  # pixels from one that gathers to the next
COARSEST = max(STRIDES.values())


def grid_size(view: View, stride: int) -> tuple[int, int]:
    """How many of the picture's pixels gather, along its width and height."""
    return -(-view.width // stride), -(-view.height // stride)


def grid_offset(seed: int, sample: int, stride: int) -> tuple[int, int]:
    """Where the grid begins: at another pixel in every sample, so that its pattern averages out."""
    x, y = np.random.default_rng((seed, sample)).integers(0, stride, 2)
    return int(x), int(y)
