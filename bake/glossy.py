"""Glossy transfer: what each vertex makes of light from far away as incoming light of its own, one matrix a channel.

Sloan, Kautz, Snyder 2002: the matrix (result², light²) turns the coefficients of the light into those of the radiance
that arrives at the vertex: the light of the directions above its horizon that nothing blocks, and the diffuse light
of the surfaces that do. To be convolved with the lobe of a material and looked up where the view is mirrored.

As in ``transfer``, what is not blocked is exact (a hemisphere's product matrix) and only the rest is sampled.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np

from . import lobes, sh
from .occlusion import Caster
from .sphere import Array, quadrature, spread
from .surfaces import Surfaces
from .transfer import Blocked, Progress, Sampling, diffuse, pieces, reflected, scaled, trace


def hemisphere(bands: int) -> Array:
    """The lobe that is 1 above the horizon and 0 below: exact integrals of the Legendre polynomials over 0..1."""
    nodes, weights = np.polynomial.legendre.leggauss(bands)
    z = 0.5 * (nodes + 1.0)
    axis = np.stack([np.sqrt(1.0 - z * z), np.zeros_like(z), z], axis=-1)
    orders = np.arange(bands)
    return np.pi * weights @ sh.evaluate(axis, bands)[:, orders * (orders + 1)]


def open_matrices(normals: Array, light: int, result: int) -> Array:
    """(V, result², light²): the transfer of a vertex that sees all of its hemisphere. Exact."""
    bands = light + result - 1  # the highest order that a product of two can have
    above = lobes.turn(hemisphere(bands), normals)
    directions, weights = quadrature(2 * (bands - 1))
    # The tensor of products, without the limit of MAX_BANDS on one of its axes' reach.
    pairs = np.einsum("di,dj->dij", sh.evaluate(directions, result), sh.evaluate(directions, light))
    tensor = (sh.evaluate(directions, bands) * weights[:, None]).T @ pairs.reshape(len(directions), -1)
    return (above @ tensor).reshape(len(normals), result**2, light**2)


def what_is_seen(sampling: Sampling) -> Sampling:
    """The bake of diffuse transfer whose vectors are those of the surfaces that block: a bounce less."""
    return replace(sampling, bounces=sampling.bounces - 1)


def glossy(
    surfaces: Surfaces, caster: Caster, sampling: Sampling, result: int, rows: Array, lit: Array | None = None
) -> Generator[Progress, None, Array]:
    """Matrices (len(rows), channels, result², bands²) float32 of the vertices ``rows``, ascending; world axes.

    ``result`` bands of the arriving radiance, ``sampling.bands`` of the light, together at most 12. With bounces the
    vertices' diffuse transfer is found first. Closing the generator ends the bake.
    """
    if sampling.bands + result - 1 > sh.MAX_BANDS:
        raise ValueError(f"glossy transfer of {sampling.bands} bands to {result}: their sum can be {sh.MAX_BANDS + 1}")
    if not sampling.shadows:
        return open_matrices(surfaces.normals[rows], sampling.bands, result)[:, None].astype(np.float32)
    start = 0.0
    if lit is None and sampling.bounces:
        lit, start = (yield from scaled(diffuse(surfaces, caster, what_is_seen(sampling)), 0.0, 0.5)), 0.5
    directions = spread(sampling.directions)
    weight = 4.0 * np.pi / sampling.directions
    out, back = sh.evaluate(directions, result), sh.evaluate(directions, sampling.bands)
    pairs = np.einsum("di,dj->dij", out, back).reshape(sampling.directions, -1)
    channels = 1 if lit is None else surfaces.reflectance.shape[1]
    matrices = np.empty((len(rows), channels, result**2, sampling.bands**2), np.float32)
    work, done = pieces(rows, sampling.directions), 0
    for piece in work:
        yield Progress(start + (1.0 - start) * done / len(rows), "glossy")
        blocked = trace(surfaces, caster, piece, directions, lit is not None)
        lost = np.zeros((len(piece), sampling.directions))
        lost[np.searchsorted(piece, blocked.vertices), blocked.directions] = weight
        found = open_matrices(surfaces.normals[piece], sampling.bands, result)
        found -= (lost @ pairs).reshape(found.shape)
        matrices[done : done + len(piece)] = found[:, None]
        if lit is not None:
            matrices[done : done + len(piece)] += weight * _bounced(surfaces, blocked, lit, out, piece)
        done += len(piece)
    return matrices


def _bounced(surfaces: Surfaces, blocked: Blocked, lit: Array, out: Array, rows: Array) -> Array:
    """(len(rows), channels, result², light²): what arrives by way of the surfaces that block, one product a ray."""
    light = reflected(surfaces, blocked, lit)
    total = np.zeros((len(rows), light.shape[1], out.shape[1], lit.shape[2]), np.float32)
    starts = np.searchsorted(blocked.vertices, rows)
    for row, first, last in zip(range(len(rows)), starts, [*starts[1:], len(light)], strict=True):
        rays = slice(first, last)
        total[row] = np.tensordot(out[blocked.directions[rays]], light[rays], axes=(0, 0)).transpose(1, 0, 2)
    return total


def turn_matrices(matrices: Array, frame: Array) -> Array:
    """The matrices (..., result², light²) for light and result along the axes ``frame`` (3, 3), not the world's."""
    turned = np.swapaxes(sh.rotate(matrices, frame.T), -1, -2)
    return np.swapaxes(sh.rotate(turned, frame.T), -1, -2)
