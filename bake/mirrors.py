"""What rays see of surfaces that reflect by a lobe: bounces that keep their direction (Sloan, Kautz, Snyder 2002).

Each vertex of such a triangle has a matrix: what light of the bounce before arrives there, and from where. A ray that
hits the triangle looks it up as a pixel would: convolved with the GGX lobe of the triangle's roughness as it is seen
from where the ray comes (``view_table``), times how much that lobe reflects.
"""

from __future__ import annotations

import logging

import numpy as np

from . import lobes, sh
from .matrices import Arriving, hemisphere
from .separable import tangents
from .sphere import Array
from .surfaces import Surfaces
from .view_table import ggx, ggx_albedo, plane_directions, weights

_logger = logging.getLogger("rebound")  # by name: as an extension the package is bl_ext.….rebound

# Detail of what arrives, in bands: a lobe of roughness 0.4 passes on little more. Fewer where the matrices of all
# vertices would be larger than this, in bytes.
_BANDS = 5
_ROOM = 1 << 30
# Roughnesses that are told apart, and views of each, evenly over sqrt(1 - cosine).
_ROUGHNESSES = 32
_VIEWS = 32
# Rays whose lobes are worked out together: some MB, which stay in the processor's cache.
_PIECE = 16384


class Mirrors:
    """The triangles of ``surfaces`` with a lobe of their own, and the vertices (G,) that need a matrix for them."""

    def __init__(self, surfaces: Surfaces, light: int) -> None:
        self._surfaces = surfaces
        shiny = surfaces.mirrored.any(axis=1) & surfaces.blocks
        self.vertices = np.unique(surfaces.triangle_vertices[shiny])
        self.rows = np.full(len(surfaces.positions), -1, np.int64)  # of the matrices, a vertex
        self.rows[self.vertices] = np.arange(len(self.vertices))
        self.bands = self._affordable(light, surfaces.mirrored.shape[1])
        steps = np.round(surfaces.roughness[shiny] * _ROUGHNESSES).astype(np.int64)
        levels, level = np.unique(steps, return_inverse=True)
        self._level = np.full(len(shiny), -1, np.int64)
        self._level[shiny] = level
        self._tabulate([float(step) / _ROUGHNESSES for step in levels])
        self._above = lobes.turn(hemisphere(self.bands), surfaces.normals[self.vertices])

    def _affordable(self, light: int, channels: int) -> int:
        wanted = min(_BANDS, sh.MAX_BANDS + 1 - light)
        each = len(self.vertices) * channels * light**2 * np.dtype(np.float32).itemsize
        bands = max(1, min(wanted, int(np.sqrt(_ROOM / max(each, 1)))))
        if bands < wanted:
            _logger.warning(
                "Reflections in bounces are softer than could be, of %d bands in place of %d: metals have %d vertices",
                bands,
                wanted,
                len(self.vertices),
            )
        return bands

    def _tabulate(self, roughnesses: list[float]) -> None:
        cosines = [1.0 - slant * slant for slant in np.linspace(0.0, 1.0, _VIEWS)]
        self._weights = np.stack([weights(ggx, self.bands, roughnesses, c) for c in cosines], axis=1)
        self._albedos = np.array([[ggx_albedo(roughness, c) for c in cosines] for roughness in roughnesses])
        nodes, steps = np.polynomial.legendre.leggauss(16)
        half = 0.5 * (nodes + 1.0)
        singles = np.array([[ggx_albedo(roughness, c)[0] for c in half] for roughness in roughnesses])
        self._means = singles @ (steps * half)  # over all directions of even light

    def told_apart(self, triangles: Array) -> Array:
        """(n,) bool: which of ``triangles`` have a lobe of their own."""
        return self._level[triangles] >= 0

    def seen(self, triangles: Array, u: Array, v: Array, towards: Array, matrices: Array) -> Array:
        """(n, channels, light²): transfer of the lobes' light along rays ``towards`` (n, 3) that hit such triangles.

        ``matrices`` (G, result², 1 or channels, light²): what arrives at the vertices.
        """
        surfaces = self._surfaces
        corners = surfaces.triangle_vertices[triangles]
        parts = np.stack([1.0 - u - v, u, v], axis=1)
        parts[corners[:, 0] == corners[:, 1]] = 1.0, 0.0, 0.0  # pieces of large triangles have one vertex
        normals = (parts[:, :, None] * surfaces.normals[corners]).sum(axis=1)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        rows = self.rows[corners]
        looks = np.empty((len(rows), self.bands**2), np.float32)
        albedos = np.empty((len(rows), surfaces.mirrored.shape[1]), np.float32)
        for first in range(0, len(rows), _PIECE):
            some = slice(first, first + _PIECE)
            cosines = -(normals[some] * towards[some]).sum(axis=1).clip(-1.0, 0.0)
            place = _Place(self._level[triangles[some]], cosines)
            lobe = self._lobes(place, normals[some], towards[some], cosines)
            # The same light from all of the hemisphere comes back as it is, between the normals of corners too.
            above = (parts[some, :, None] * self._above[rows[some]]).sum(axis=1)
            looks[some] = lobe / (lobe * above).sum(axis=1, keepdims=True).clip(0.5, 2.0)
            albedos[some] = self._reflected(place, triangles[some])
        found = _products(looks, rows, parts, matrices)
        return found * albedos[:, :, None]

    def _lobes(self, place: _Place, normals: Array, towards: Array, cosines: Array) -> Array:
        """(n, result²): what coefficients of arriving radiance are multiplied with to be what is seen.

        Seen with its image below the horizon: a band-limited lobe has no step there that some of it would fall into.
        """
        across = cosines[:, None] * normals + towards
        length = np.linalg.norm(across, axis=1, keepdims=True)
        across = np.where(length > 1e-6, across / np.maximum(length, 1e-6), tangents(normals))
        table, total = place.of(self._weights), np.zeros((len(normals), self.bands**2))
        orders = sh.band_of(self.bands)
        for k, (along, _, up) in enumerate(plane_directions(self.bands)):
            over, under = along * across + up * normals, along * across - up * normals
            total += table[:, k, orders] * (sh.evaluate(over, self.bands) + sh.evaluate(under, self.bands))
        return total

    def _reflected(self, place: _Place, triangles: Array) -> Array:
        """(n, channels): of even light. As ``bxdf_lib.glsl`` has it, and no more than is not scattered."""
        single, grazing = place.of(self._albedos).T[:, :, None]
        mean = self._means[place.level][:, None]
        straight = self._surfaces.mirrored[triangles]
        fresnel = straight + (1.0 - straight) / 21.0  # Schlick's term averaged over all directions
        again = 1.0 + fresnel * mean / (1.0 - fresnel * (1.0 - mean)) * (1.0 - single) / single
        albedo = (straight * (single - grazing) + grazing) * again
        return np.minimum(albedo, 1.0 - self._surfaces.reflectance[triangles])


class _Place:
    """Where rays look up tables of (roughnesses, views, ...)."""

    def __init__(self, level: Array, cosines: Array) -> None:
        place = np.sqrt(1.0 - cosines) * (_VIEWS - 1)
        self.level = level
        self._lower = place.astype(np.int64).clip(0, _VIEWS - 2)
        self._part = place - self._lower

    def of(self, table: Array) -> Array:
        """(n, ...), linear between views."""
        part = self._part.reshape(-1, *[1] * (table.ndim - 2))
        return table[self.level, self._lower] * (1.0 - part) + table[self.level, self._lower + 1] * part


class AtMirrors:
    """Matrices of what arrives at the vertices of mirrors, gathered piece by piece of all vertices.

    A piece's rays are told by the vertices they leave, ascending, and by their numbers among ``directions``.
    """

    def __init__(self, surfaces: Surfaces, light: int, directions: Array) -> None:
        self.mirrors = Mirrors(surfaces, light)
        self._surfaces = surfaces
        self._arriving = Arriving(directions, light, self.mirrors.bands)
        self.direct = np.empty((len(self.mirrors.vertices), self.mirrors.bands**2, 1, light**2), np.float32)

    def add_sky(self, piece: Array, vertices: Array, numbers: Array) -> None:
        """What comes from the sky, where these rays are blocked."""
        rows, own, mine, at = self._of_mirrors(piece, vertices)
        found = self._arriving.from_the_sky(self._surfaces.normals[own], at, numbers[mine])
        self.direct[rows] = found[:, :, None]

    def start(self, channels: int) -> Array:
        """(G, result², channels, light²) for another bounce: what comes from the sky."""
        return np.repeat(self.direct, channels, axis=2)

    def add(self, matrices: Array, piece: Array, vertices: Array, numbers: Array, light: Array) -> None:
        """What comes along these rays: ``light`` (n, channels, light²)."""
        rows, own, mine, at = self._of_mirrors(piece, vertices)
        matrices[rows] += self._arriving.by_surfaces(len(own), at, numbers[mine], light[mine])

    def _of_mirrors(self, piece: Array, vertices: Array) -> tuple[Array, Array, Array, Array]:
        """Rows of the matrices and vertices of those of ``piece``; which of the rays leave them, and from which."""
        rows = self.mirrors.rows[piece]
        own = piece[rows >= 0]
        mine = np.nonzero(self.mirrors.rows[vertices] >= 0)[0]
        return rows[rows >= 0], own, mine, np.searchsorted(own, vertices[mine])


def _products(looks: Array, rows: Array, parts: Array, matrices: Array) -> Array:
    """(n, channels, light²): ``looks`` (n, result²) times the matrices ``rows`` (n, 3), mixed by ``parts`` (n, 3).

    One product a vertex, of all rays that see it.
    """
    found = np.zeros((len(looks), matrices.shape[2] * matrices.shape[3]), np.float32)
    rays, corner = np.nonzero(parts > 0.0)
    at = rows[rays, corner]
    order = np.argsort(at, kind="stable")
    vertices, starts = np.unique(at[order], return_index=True)
    for vertex, first, last in zip(vertices, starts, np.append(starts, len(order))[1:], strict=True):
        mine = order[first:last]
        some = rays[mine]
        light = matrices[vertex].reshape(looks.shape[1], -1)
        found[some] += (looks[some] * parts[some, corner[mine], None].astype(np.float32)) @ light
    return found.reshape(len(looks), *matrices.shape[2:])
