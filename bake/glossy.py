"""Glossy transfer: what each vertex makes of light from far away as incoming light of its own, one matrix a channel.

Sloan, Kautz, Snyder 2002: see ``matrices``. To be convolved with the lobe of a material and looked up where the view is
mirrored.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np

from . import sh
from .matrices import Arriving, open_matrices
from .occlusion import Caster
from .sphere import Array, spread
from .surfaces import Surfaces
from .transfer import Lit, Progress, Sampling, passed_on, pieces, reflected, scaled, trace


def what_is_seen(sampling: Sampling) -> Sampling:
    """The bake of what surfaces that block pass on: a bounce less."""
    return replace(sampling, bounces=sampling.bounces - 1)


def glossy(
    surfaces: Surfaces, caster: Caster, sampling: Sampling, result: int, rows: Array, lit: Lit | None = None
) -> Generator[Progress, None, Array]:
    """Matrices (len(rows), channels, result², bands²) float32 of the vertices ``rows``, ascending; world axes.

    ``result`` bands of the arriving radiance, ``sampling.bands`` of the light, together at most 12. With bounces what
    the surfaces pass on is found first. Closing the generator ends the bake.
    """
    if sampling.bands + result - 1 > sh.MAX_BANDS:
        raise ValueError(f"glossy transfer of {sampling.bands} bands to {result}: their sum can be {sh.MAX_BANDS + 1}")
    if not sampling.shadows:
        return open_matrices(surfaces.normals[rows], sampling.bands, result)[:, None].astype(np.float32)
    start = 0.0
    if lit is None and sampling.bounces:
        lit, start = (yield from scaled(passed_on(surfaces, caster, what_is_seen(sampling)), 0.0, 0.5)), 0.5
    directions = spread(sampling.directions)
    arriving = Arriving(directions, sampling.bands, result)
    channels = 1 if lit is None else surfaces.reflectance.shape[1]
    matrices = np.empty((len(rows), channels, result**2, sampling.bands**2), np.float32)
    work, done = pieces(rows, sampling.directions), 0
    for piece in work:
        yield Progress(start + (1.0 - start) * done / len(rows), "glossy")
        blocked = trace(surfaces, caster, piece, directions, lit is not None)
        at = np.searchsorted(piece, blocked.vertices)
        found = matrices[done : done + len(piece)]
        found[:] = arriving.from_the_sky(surfaces.normals[piece], at, blocked.directions)[:, None]
        if lit is not None:
            light = reflected(surfaces, blocked, directions, lit)
            found += np.swapaxes(arriving.by_surfaces(len(piece), at, blocked.directions, light), 1, 2)
        done += len(piece)
    return matrices
