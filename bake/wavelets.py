"""Diffuse transfer for light of all frequencies: rows over the Haar basis of a cube map (Ng and others 2003).

One row a vertex: its cosine times what it sees of each texel, with the texel's solid angle, over pi. Shadows only; the
bounces of ``transfer`` vary slowly with the light and are added from there.

Glossy surfaces have more of them: in the place of the cosine, the factors of the light of a lobe that is a sum of
products (``separable``).
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from . import haar
from .occlusion import Caster
from .separable import Separable, tangents
from .sphere import Array, cube_directions, cube_solid_angles, spread
from .surfaces import Surfaces
from .transfer import Blocked, Lit, Progress, Sampling, pieces, reflected, trace

# Rows of a lobe leave out so many times the energy that others do: they are a third of the size for it, and what their
# few products leave out of the lobe is more.
_LOBE_LEAVES = 10.0


def lobe_keep(keep: float) -> float:
    """The part of a lobe's rows that is kept where ``keep`` of the others is."""
    return max(1.0 - _LOBE_LEAVES * (1.0 - keep), min(keep, 0.5))


def texel_shares(normals: Array, directions: Array, size: int) -> Array:
    """(V, 6 size²): the part of a white sky's light that each texel gives each vertex; unblocked ones add up to 1.

    A texel on the horizon counts by its middle, so rows are scaled to add up to 1 before what is blocked goes.
    """
    cosines = np.maximum(normals @ directions.T, 0.0) * cube_solid_angles(size).reshape(-1)
    return cosines / cosines.sum(axis=1, keepdims=True)


def wavelet(
    surfaces: Surfaces,
    caster: Caster,
    size: int,
    keep: float,
    frame: Array,
    rows: Array,
    shadows: bool = True,
    lobe: Separable | None = None,
) -> Generator[Progress, None, tuple[haar.SparseRows, haar.SparseRows | None]]:
    """Rows of the vertices ``rows`` for a light of 6 x size² texels along the axes ``frame`` (3, 3); with a ``lobe``
    its K rows of each vertex, one vertex after another.

    ``keep``: the fraction (0..1) of the squared sum of each row that its terms keep; ``lobe_keep`` of it of all K of a
    lobe. Closing the generator ends the bake.
    """
    directions = cube_directions(size).reshape(-1, 3) @ frame.T
    angles = cube_solid_angles(size).reshape(-1)
    found: list[haar.SparseRows] = []
    mirrored: list[haar.SparseRows] = []
    work = pieces(rows, len(directions))
    for done, piece in enumerate(work):
        yield Progress(done / len(work), "wavelets")
        light = texel_shares(surfaces.normals[piece], directions, size)
        if shadows:
            blocked = trace(surfaces, caster, piece, directions, False)
            light[np.searchsorted(piece, blocked.vertices), blocked.directions] = 0.0
        found.append(haar.sparse_rows(_transformed(light, size), keep))
        if lobe is not None:
            at, seen = np.nonzero(light)
            values = np.zeros((len(piece), len(lobe.orders), len(directions)), np.float32)
            values[at, :, seen] = lobe_factors(surfaces.normals[piece], lobe, at, directions[seen]) * angles[seen, None]
            coefficients = _transformed(values, size).reshape(-1, len(directions))
            mirrored.append(haar.sparse_rows(coefficients, lobe_keep(keep), len(lobe.orders)))
    return haar.join_rows(found), haar.join_rows(mirrored) if mirrored else None


def _transformed(texels: Array, size: int) -> Array:
    return haar.forward(texels.reshape(*texels.shape[:-1], 6, size, size)).reshape(texels.shape)


def lobe_factors(normals: Array, lobe: Separable, at: Array, directions: Array) -> Array:
    """(n, K) g_k of the vertices ``at`` (n,), of ``normals`` (V, 3), towards ``directions`` (n, 3)."""
    along = tangents(normals)
    axes = np.stack([along, np.cross(normals, along), normals], axis=1)
    return lobe.of_light(np.einsum("nij,nj->ni", axes[at], directions))


def mirrored_bounces(
    surfaces: Surfaces, caster: Caster, sampling: Sampling, rows: Array, lit: Lit, lobe: Separable
) -> Generator[Progress, None, Array]:
    """(len(rows), channels, 1 + K, bands²) float32: what the surfaces around each vertex add to its matt side and to
    each row of its lobe, along the world's axes. ``lit``: a bounce less.
    """
    directions = spread(sampling.directions)
    weight = 4.0 * np.pi / sampling.directions
    channels = surfaces.reflectance.shape[1]
    total = np.zeros((len(rows), channels, 1 + len(lobe.orders), lit.transfer.shape[2]), np.float32)
    work, done = pieces(rows, sampling.directions), 0
    for piece in work:
        yield Progress(done / len(rows), "reflections of bounces")
        blocked = trace(surfaces, caster, piece, directions, True)
        total[done : done + len(piece)] = weight * _sums(surfaces, blocked, piece, directions, lit, lobe)
        done += len(piece)
    return total


def _sums(surfaces: Surfaces, blocked: Blocked, rows: Array, directions: Array, lit: Lit, lobe: Separable) -> Array:
    """(len(rows), channels, 1 + K, bands²) sums over the rays, one product a vertex."""
    towards, normals = directions[blocked.directions], surfaces.normals[blocked.vertices]
    cosines = (normals * towards).sum(axis=1)[:, None] / np.pi
    at = np.searchsorted(rows, blocked.vertices)
    factors = np.concatenate([cosines, lobe_factors(surfaces.normals[rows], lobe, at, towards)], axis=1)
    light = reflected(surfaces, blocked, directions, lit)
    total = np.zeros((len(rows), light.shape[1], factors.shape[1], light.shape[2]), np.float32)
    starts = np.searchsorted(blocked.vertices, rows)
    for row, first, last in zip(range(len(rows)), starts, [*starts[1:], len(light)], strict=True):
        total[row] = np.tensordot(factors[first:last], light[first:last], axes=(0, 0)).transpose(1, 0, 2)
    return total
