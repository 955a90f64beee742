"""Diffuse transfer for light of all frequencies: rows over the Haar basis of a cube map (Ng and others 2003).

One row a vertex: its cosine times what it sees of each texel, with the texel's solid angle, over pi. Shadows only; the
bounces of ``transfer`` vary slowly with the light and are added from there.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from . import haar
from .occlusion import Caster
from .sphere import Array, cube_directions, cube_solid_angles
from .surfaces import Surfaces
from .transfer import Progress, pieces, trace


def texel_shares(normals: Array, directions: Array, size: int) -> Array:
    """(V, 6 size²): the part of a white sky's light that each texel gives each vertex; unblocked ones add up to 1.

    A texel on the horizon counts by its middle, so rows are scaled to add up to 1 before what is blocked goes.
    """
    cosines = np.maximum(normals @ directions.T, 0.0) * cube_solid_angles(size).reshape(-1)
    return cosines / cosines.sum(axis=1, keepdims=True)


def wavelet(
    surfaces: Surfaces, caster: Caster, size: int, keep: float, frame: Array, rows: Array, shadows: bool = True
) -> Generator[Progress, None, haar.SparseRows]:
    """Rows of the vertices ``rows`` for a light of 6 x size² texels along the axes ``frame`` (3, 3).

    ``keep``: the fraction (0..1) of each row's squared sum that its terms keep. Closing the generator ends the bake.
    """
    directions = cube_directions(size).reshape(-1, 3) @ frame.T
    found, work = [], pieces(rows, len(directions))
    for done, piece in enumerate(work):
        yield Progress(done / len(work), "wavelets")
        light = texel_shares(surfaces.normals[piece], directions, size)
        if shadows:
            blocked = trace(surfaces, caster, piece, directions, False)
            light[np.searchsorted(piece, blocked.vertices), blocked.directions] = 0.0
        coefficients = haar.forward(light.reshape(len(piece), 6, size, size)).reshape(len(piece), -1)
        found.append(haar.sparse_rows(coefficients, keep))
    return haar.join_rows(found)
