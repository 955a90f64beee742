"""Diffuse transfer: what each vertex makes of light from far away, as one vector of spherical harmonics a channel.

Sloan, Kautz, Snyder 2002, with one difference: only the *blocked* part of the sky is summed over sampled directions,
and taken off the exact cosine lobe. A vertex that sees all of its hemisphere is then exact, and bounces put back just
what the same directions took away: where everything reflects everything, a constant sky gives 1 whatever their number.

The vector of a vertex times the coefficients of the light is its irradiance / pi: the albedo of the vertex itself is
not in it. Light that comes by way of other surfaces has what they reflect in it, once a bounce: what they scatter, and
what their lobes send this way (``mirrors``).
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from . import lobes, sh
from .mirrors import AtMirrors, Mirrors
from .occlusion import Caster
from .sphere import Array, spread
from .surfaces import Surfaces

# Pairs of a vertex and a direction looked at in one piece: some tens of MB, and a fraction of a second by Embree.
_PIECE = 262144
# Rays that hit something, kept for the bounces: 1 GB. What goes beyond is traced again for each bounce.
_KEPT = 50_000_000
Result = TypeVar("Result")


@dataclass(frozen=True)
class Progress:
    """How far a bake is; yielded after every bounded piece of work."""

    part: float  # 0..1
    doing: str
    device: str = ""  # what it runs on, as soon as that is known


@dataclass(frozen=True)
class Sampling:
    """What a bake costs and how good it is."""

    bands: int = 5  # of the light, 1..11
    directions: int = 1024  # over the whole sphere, the same for every vertex
    shadows: bool = True
    bounces: int = 0  # by way of other surfaces; 0: shadows only


@dataclass(frozen=True, eq=False)
class Blocked:
    """The rays of a run of vertices that hit something, in the order of the vertices."""

    vertices: Array  # (n,) int32: row of Surfaces' vertex arrays
    directions: Array  # (n,) int32
    triangles: Array  # (n,) int32: row of Surfaces' triangles, -1 for the back of one: it blocks and reflects nothing
    u: Array  # (n,) float32
    v: Array  # (n,) float32


@dataclass(frozen=True, eq=False)
class Lit:
    """What light, of some number of bounces, arrives where rays may look: all that surfaces pass on follows from it."""

    transfer: Array  # (V, channels, bands²) float32
    mirrors: Mirrors | None = None  # None where no lobe is told apart
    matrices: Array | None = None  # (G, result², channels, bands²) float32, of the mirrors' vertices


def cosine_vectors(normals: Array, bands: int) -> Array:
    """(V, bands²) float64: transfer without shadows, exact."""
    return lobes.turn(lobes.cosine(bands) / np.pi, normals)


def pieces(rows: Array, directions: int) -> list[Array]:
    """``rows`` cut up so that each piece is a bounded work."""
    size = max(1, _PIECE // directions)
    return [rows[first : first + size] for first in range(0, len(rows), size)]


def trace(surfaces: Surfaces, caster: Caster, rows: Array, directions: Array, needs_hits: bool) -> Blocked:
    """The blocked ones of ``directions`` (N, 3) in the hemisphere of each vertex of ``rows``.

    ``caster`` holds the triangles of ``surfaces`` that block, in their order. Without ``needs_hits`` only whether a
    ray is blocked is found, which is faster.
    """
    at, number = np.nonzero(surfaces.normals[rows] @ directions.T > 0)
    towards = directions[number]
    origins = surfaces.positions[rows[at]]
    if not needs_hits:
        hit = caster.blocked(origins, towards)
        nothing = np.zeros(hit.sum(), np.float32)
        return Blocked(
            rows[at[hit]], number[hit].astype(np.int32), np.full(len(nothing), -1, np.int32), nothing, nothing
        )
    found = caster.hits(origins, towards)
    hit = found.triangles >= 0
    triangles = np.nonzero(surfaces.blocks)[0][found.triangles[hit]]
    front = (surfaces.facing[triangles] * towards[hit]).sum(axis=1) < 0
    triangles = np.where(front, triangles, -1).astype(np.int32)
    return Blocked(rows[at[hit]].astype(np.int32), number[hit].astype(np.int32), triangles, found.u[hit], found.v[hit])


def shares(surfaces: Surfaces, blocked: Blocked, directions: Array) -> Array:
    """(n,) the part of a white sky's light at its vertex that each blocked ray takes away."""
    cosines = (surfaces.normals[blocked.vertices] * directions[blocked.directions]).sum(axis=1)
    return cosines * (4.0 / len(directions))


def reflected(surfaces: Surfaces, blocked: Blocked, directions: Array, lit: Lit) -> Array:
    """(n, channels, bands²): the transfer vector of what each blocked ray sees, what the surface reflects included."""
    seen = np.nonzero(blocked.triangles >= 0)[0]
    triangles, u, v = blocked.triangles[seen], blocked.u[seen], blocked.v[seen]
    corners, across, along = surfaces.triangle_vertices[triangles], u[:, None, None], v[:, None, None]
    at = (1 - across - along) * lit.transfer[corners[:, 0]]
    at += across * lit.transfer[corners[:, 1]] + along * lit.transfer[corners[:, 2]]
    channels = surfaces.reflectance.shape[1]  # light that was not reflected yet has one for all
    found = np.zeros((len(blocked.vertices), channels, lit.transfer.shape[2]), np.float32)
    found[seen] = at * surfaces.reflectance[triangles][:, :, None]
    if lit.mirrors is not None and lit.matrices is not None:
        shiny = lit.mirrors.told_apart(triangles)
        towards = directions[blocked.directions[seen[shiny]]]
        found[seen[shiny]] += lit.mirrors.seen(triangles[shiny], u[shiny], v[shiny], towards, lit.matrices)
    return found


def sum_by_vertex(values: Array, blocked: Blocked, rows: Array) -> Array:
    """(len(rows), ...) sums of the rays' values (n, ...) over each vertex of the ascending ``rows``."""
    total = np.zeros((len(rows), *values.shape[1:]))
    if len(values):
        starts = np.searchsorted(blocked.vertices, rows)
        there = np.diff(starts, append=len(values)) > 0
        total[there] = np.add.reduceat(values, starts[there], axis=0)
    return total


def diffuse(
    surfaces: Surfaces, caster: Caster, sampling: Sampling, rows: Array | None = None
) -> Generator[Progress, None, Array]:
    """Transfer vectors (V, channels, bands²) float32 of all vertices, for light along the world's axes.

    Closing the generator ends the bake. With no bounces only ``rows``, ascending, are looked at; the others stay as
    they are without shadows. With bounces all vertices are, as any may be what a ray sees.
    """
    everything = np.arange(len(surfaces.positions))
    rows = everything if rows is None or sampling.bounces else rows
    return (yield from _bounced(surfaces, caster, sampling, rows, sampling.bounces)).transfer


def passed_on(surfaces: Surfaces, caster: Caster, sampling: Sampling) -> Generator[Progress, None, Lit]:
    """The same with what arrives at surfaces whose lobes are told apart, for rays to look at. Needs shadows."""
    rows = np.arange(len(surfaces.positions))
    return (yield from _bounced(surfaces, caster, sampling, rows, sampling.bounces + 1))


def _bounced(
    surfaces: Surfaces, caster: Caster, sampling: Sampling, rows: Array, looked_at: int
) -> Generator[Progress, None, Lit]:
    """What arrives after the bounces. Rays look at that of the first ``looked_at`` of 0, 1, ... bounces.

    Rays that hit something are kept: 20 bytes each, commonly a fifth of V * directions / 2.
    """
    first = cosine_vectors(surfaces.normals, sampling.bands)
    if not sampling.shadows:
        return Lit(first[:, None, :].astype(np.float32))
    directions = spread(sampling.directions)
    basis = sh.evaluate(directions, sampling.bands)
    gathered = AtMirrors(surfaces, sampling.bands, directions) if looked_at and surfaces.mirrored.any() else None
    passes = sampling.bounces + 1
    work = pieces(rows, sampling.directions)
    kept: list[Blocked | None] = []
    room = _KEPT
    for done, piece in enumerate(work):
        yield Progress(done / len(work) / passes, "shadows")
        blocked = trace(surfaces, caster, piece, directions, sampling.bounces > 0)
        lost = np.zeros((len(piece), sampling.directions))
        place = np.searchsorted(piece, blocked.vertices), blocked.directions
        lost[place] = shares(surfaces, blocked, directions)
        first[piece] -= lost @ basis
        if gathered is not None:
            gathered.add_sky(piece, blocked.vertices, blocked.directions)
        room -= len(blocked.vertices)
        kept.append(blocked if sampling.bounces and room >= 0 else None)
    channels = surfaces.reflectance.shape[1] if sampling.bounces else 1
    direct = np.repeat(first[:, None, :], channels, axis=1).astype(np.float32)
    total = Lit(direct) if gathered is None else Lit(direct, gathered.mirrors, gathered.direct)
    for bounce in range(sampling.bounces):
        following, needed = direct.copy(), gathered if bounce + 1 < looked_at else None
        matrices = None if needed is None else needed.start(channels)
        for done, (piece, found) in enumerate(zip(work, kept, strict=True)):
            yield Progress((bounce + 1 + done / len(work)) / passes, f"bounce {bounce + 1} of {sampling.bounces}")
            blocked = found or trace(surfaces, caster, piece, directions, True)
            light = reflected(surfaces, blocked, directions, total)
            if needed is not None and matrices is not None:
                needed.add(matrices, piece, blocked.vertices, blocked.directions, light)
            light *= shares(surfaces, blocked, directions)[:, None, None]
            following[piece] += sum_by_vertex(light, blocked, piece)
        total = Lit(following, total.mirrors if needed else None, matrices)
    return total


def scaled(work: Generator[Progress, None, Result], start: float, part: float) -> Generator[Progress, None, Result]:
    """A piece of work that is a part of a longer one."""
    while True:
        try:
            step = next(work)
        except StopIteration as end:
            return end.value
        yield Progress(start + part * step.part, step.doing)


def finish(bake: Generator[Progress, None, Result]) -> Result:
    """Run a bake to its end and return what it found."""
    while True:
        try:
            next(bake)
        except StopIteration as end:
            return end.value
