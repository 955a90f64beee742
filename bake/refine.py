"""Points inside triangles that light is gathered at too, where the corners do not tell what lies between them.

After J. Křivánek, S. Pattanaik, J. Žára, "Adaptive Mesh Subdivision for Precomputed Radiance Transfer", SCCG 2004. The
mesh itself stays as it is: triangles are cut in thought, and a pixel walks down the cuts to the three points around it.

1. What is received is found in the middle of a triangle's longest edge, and at probes: where rays from all that stands
   around land, so that a small thing on a large plane is not overlooked.
2. Where interpolation errs there by more than is wanted, the triangle is cut in two across its longest edge, worst
   first. Whatever shares the edge is cut with it (M.-C. Rivara 1984), so that there are no cracks.
3. Until nothing errs, or there are as many points as there may be.

Triangle t is node t of the tree; cut k has the nodes T + 2 k and T + 2 k + 1.
"""

from __future__ import annotations

from collections.abc import Generator, Hashable
from dataclasses import dataclass, replace

import numpy as np

from ..scene.data import Array, Instance, Scene, Visibility
from . import lobes
from .occlusion import Caster, make_caster
from .surfaces import INWARDS, LIFT, Surfaces, mesh_vertices
from .transfer import Progress, Sampling, diffuse

# Cuts from a triangle down to the smallest: half the length every two of them.
_DEEPEST = 40
# Points evenly spread over the object have a distance. Triangles of the mesh that are smaller are left alone, and none
# is cut that is smaller than this part of it.
_FINEST = 1.0 / 64.0
# Rays leave the surface by this part of the edge that is cut, and by no less than this part of the distance from the
# origin, which rays are rounded by.
_LIFT, _LEAST_LIFT = 0.01, 2e-6
# Of what is cut in one round: how much less it may matter than the worst.
_NEARLY = 0.3
# How many rays look for places of probes.
_RAYS = 8192
# And at least so many look at the light of a point, however few a bake has: cuts are not to follow their noise.
_DIRECTIONS = 2048
_MOST_SOURCES = 4096


@dataclass(frozen=True, eq=False)
class Detail:
    """The points inside the triangles of one object, and the cuts that lead to them."""

    splits: (
        Array  # (cuts, 3) uint32: the node, which of its edges, the point in the middle as a row behind the vertices
    )
    origins: Array  # (points, 3) float64, world space: where rays start
    normals: Array  # (points, 3) float64, world space, unit
    error: float  # the largest that was found and left, in parts of what an open place receives


def tree(splits: Array, triangles: int) -> Array:
    """(nodes, 4) float32: the first of a node's two, the row in the middle, the edge; the first is 0 where there is no
    cut. As prt_rows_lib.glsl reads it."""
    nodes = np.zeros((triangles + 2 * len(splits), 4), np.float32)
    nodes[splits[:, 0], 0] = triangles + 2.0 * np.arange(len(splits))
    nodes[splits[:, 0], 1], nodes[splits[:, 0], 2] = splits[:, 2], splits[:, 1]
    return nodes


def walk(nodes: Array, at: Array, rows: Array, weights: Array) -> tuple[Array, Array, Array]:
    """From the nodes ``at`` (n,) down to the last ones: those, their three rows (n, 3) and the weights of these.

    ``rows`` and ``weights`` (n, 3) are those of the nodes ``at``. Twin of prt_walk() in prt_rows_lib.glsl.
    """
    at, rows, weights = at.copy(), rows.copy(), weights.astype(np.float64)
    while len(inner := np.nonzero(nodes[at, 0] > 0)[0]):
        child, middle, edge = nodes[at[inner], :3].astype(np.int64).T
        order = (edge[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(rows[inner], order, axis=1).T
        wa, wb, wc = np.take_along_axis(weights[inner], order, axis=1).T
        near_a = wa >= wb
        at[inner] = child + ~near_a
        rows[inner] = np.stack([np.where(near_a, a, middle), np.where(near_a, middle, b), c], axis=1)
        less = 2.0 * np.minimum(wa, wb)
        apart = np.abs(wa - wb)
        weights[inner] = np.stack([np.where(near_a, apart, less), np.where(near_a, less, apart), wc], axis=1)
    return at, rows, weights


def refine(
    scene: Scene,
    surfaces: Surfaces,
    caster: Caster,
    instance: Instance,
    sampling: Sampling,
    limit: int,
    tolerance: float,
) -> Generator[Progress, None, Detail | None]:
    """Points of one object, no more than ``limit``; None where its vertices are enough.

    ``tolerance``: which error is left alone, in parts of what an open place receives. Without bounces.
    """
    sampling = replace(sampling, bounces=0, directions=max(sampling.directions, _DIRECTIONS))
    work = _Refinement(scene, surfaces, caster, instance, sampling, limit, tolerance)
    if not work.considered().any():
        return None
    yield from work.place_probes(scene)
    while True:
        wanted = yield from work.wanted()
        if not wanted.any() or not work.cut(wanted):
            return work.result()


@dataclass(frozen=True, eq=False)
class _Edges:
    """Those of the last nodes, each once."""

    ends: Array  # (e, 2): rows, ascending
    keys: Array  # (e,): a number for each pair of ends
    of: Array  # (leaves, 3): the edges of each node; edge k leads from its corner k to the next
    rank: Array  # (e,): by length
    longest: Array  # (leaves,): 0..2
    inwards: Array  # (e, 3): from the middle to the middles of the triangles that meet there


class _Refinement:
    """The cuts so far, and what is known of the light at their points."""

    def __init__(
        self,
        scene: Scene,
        surfaces: Surfaces,
        caster: Caster,
        instance: Instance,
        sampling: Sampling,
        limit: int,
        tolerance: float,
    ) -> None:
        mesh, run = scene.meshes[instance.mesh], surfaces.runs[instance.key]
        first, vertices = mesh_vertices(mesh)
        matrix = np.asarray(instance.world_from_object, np.float64)
        self.surfaces, self.caster, self.sampling = surfaces, caster, sampling
        self.limit, self.tolerance = limit, tolerance
        self.places = mesh.positions[first].astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        self.normals = surfaces.normals[run]  # of points not of unit length, as a pixel's before it is normalised
        self.origins = surfaces.positions[run]
        self.lift = LIFT * float(np.linalg.norm(np.ptp(self.places, axis=0)))
        self.least_lift = _LEAST_LIFT * float(np.abs(self.places).max(initial=0.0))
        self.vertices = len(first)
        self.corners = vertices.reshape(-1, 3)  # of all nodes: rows
        self.triangles = len(self.corners)
        self.depth = np.zeros(self.triangles, np.int64)
        self.leaves = np.arange(self.triangles)
        self.splits = np.zeros((0, 3), np.int64)
        areas = self._areas(self.leaves)
        spacing = areas.sum() / limit
        # By the square of a side: of two triangles that are a square together.
        self.may = 2.0 * areas >= spacing  # of all nodes
        self.finest = spacing * _FINEST**2
        self.open = float(np.linalg.norm(lobes.cosine(sampling.bands) / np.pi))
        self.light = np.full((self.vertices, sampling.bands**2), np.nan, np.float32)
        self.middles: dict[int, tuple[Array, Array, float]] = {}  # by edge: where rays start, light, error
        self.error = 0.0

    @property
    def points(self) -> int:
        return len(self.places) - self.vertices

    @property
    def progress(self) -> Progress:
        return Progress(min(1.0, self.points / self.limit), "detail")

    def considered(self) -> Array:
        """(leaves,) bool: large enough to be looked at."""
        large = 2.0 * self._areas(self.leaves) >= self.finest
        return self.may[self.leaves] & large & (self.depth[self.leaves] < _DEEPEST)

    def place_probes(self, scene: Scene) -> Generator[Progress, None, None]:
        """Where rays from random places of all that blocks light land on this object."""
        own = self.places[self.corners]
        origins, directions = _sources(scene)
        found = make_caster(own, "numpy" if self.caster.name == "numpy" else "").hits(origins, directions)
        triangles = found.triangles.clip(0)
        weights = np.stack([1.0 - found.u - found.v, found.u, found.v], axis=1).astype(np.float64)
        rows = self.corners[triangles]
        normals = _unit((weights[:, :, None] * self.normals[rows]).sum(axis=1))
        hit = (found.triangles >= 0) & self.may[triangles] & ((normals * directions).sum(axis=1) < 0)
        self.at, self.rows, self.weights = triangles[hit], rows[hit], weights[hit]
        places = (weights[hit][:, :, None] * self.places[rows[hit]]).sum(axis=1)
        self.probed = yield from self._received(places + self.least_lift * normals[hit], normals[hit])
        self.unlike = np.full(len(places), np.nan)  # the error of each probe, once it is known

    def wanted(self) -> Generator[Progress, None, Array]:
        """(leaves,) bool: those to be cut next, by the light in the middles of their longest edges and at probes."""
        self.edges = edges = self._find_edges()
        at = np.nonzero(self.considered())[0]
        longest = edges.of[at, edges.longest[at]]
        new = np.unique(longest)
        new = new[[key not in self.middles for key in edges.keys[new].tolist()]]
        yield from self._look(np.unique(edges.ends[new]))
        origins, normals = self._middle(edges, new)
        found = yield from self._received(origins, _unit(normals))
        errors = self._unlike(found, self.light[edges.ends[new]].mean(axis=1))
        self.middles |= dict(
            zip(edges.keys[new].tolist(), zip(origins, found, errors.tolist(), strict=True), strict=True)
        )
        error = np.zeros(len(self.leaves))
        error[at] = [self.middles[key][2] for key in edges.keys[longest].tolist()]
        yield from self._probe()
        place = np.full(len(self.corners), -1)
        place[self.leaves[at]] = at
        there = place[self.at] >= 0
        np.maximum.at(error, place[self.at[there]], self.unlike[there])
        self.error = float(error.max(initial=0.0))
        matters = np.where(error > self.tolerance, error * np.sqrt(self._areas(self.leaves)), 0.0)
        self.matters = matters
        return matters > _NEARLY * matters.max(initial=0.0)

    def cut(self, wanted: Array) -> bool:
        """Cut these and what has to be cut with them, as far as there is room; whether there was any."""
        order = np.argsort(-np.where(wanted, self.matters, 0.0), kind="stable")[: wanted.sum()]
        while True:
            marked = self._with_neighbours(order)
            if marked.sum() <= self.limit - self.points:
                break
            order = order[: len(order) // 2]
        if not len(order):
            return False
        self._add(marked)
        return True

    def result(self) -> Detail | None:
        if not self.points:
            return None
        inside = slice(self.vertices, None)
        return Detail(self.splits.astype(np.uint32), self.origins[inside], _unit(self.normals[inside]), self.error)

    def _areas(self, nodes: Array) -> Array:
        a, b, c = self.places[self.corners[nodes]].transpose(1, 0, 2)
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)

    def _find_edges(self) -> _Edges:
        corners = self.corners[self.leaves]
        pairs = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2), axis=2)
        keys, of = np.unique(pairs[..., 0] << 32 | pairs[..., 1], return_inverse=True)
        of = of.reshape(-1, 3)
        ends = np.stack([keys >> 32, keys & 0xFFFFFFFF], axis=1)
        lengths = np.linalg.norm(self.places[ends[:, 0]] - self.places[ends[:, 1]], axis=1)
        rank = np.empty(len(keys), np.int64)
        rank[np.argsort(lengths, kind="stable")] = np.arange(
            len(keys)
        )  # alike ones by their numbers: the same for both
        middles = np.repeat(self.places[corners].mean(axis=1), 3, axis=0)
        meeting = np.bincount(of.reshape(-1), minlength=len(keys))[:, None]
        inwards = np.stack([np.bincount(of.reshape(-1), axis, len(keys)) for axis in middles.T], axis=1) / meeting
        return _Edges(ends, keys, of, rank, rank[of].argmax(axis=1), inwards - self.places[ends].mean(axis=1))

    def _middle(self, edges: _Edges, which: Array) -> tuple[Array, Array]:
        """Where rays from the middles of edges start, and the normals there."""
        ends = edges.ends[which]
        normals = self.normals[ends].mean(axis=1)
        up = _unit(normals)
        inwards = edges.inwards[which]
        inwards = inwards - (inwards * up).sum(axis=1, keepdims=True) * up
        lengths = np.linalg.norm(self.places[ends[:, 0]] - self.places[ends[:, 1]], axis=1)
        lift = np.clip(_LIFT * lengths, self.least_lift, self.lift)[:, None]
        return self.places[ends].mean(axis=1) + lift * up + INWARDS * inwards, normals

    def _with_neighbours(self, leaves: Array) -> Array:
        """(edges,) bool: the longest ones of these, and of all that have one of those."""
        edges = self.edges
        longest = edges.of[np.arange(len(self.leaves)), edges.longest]
        marked = np.zeros(len(edges.keys), bool)
        marked[longest[leaves]] = True
        while True:
            more = longest[marked[edges.of].any(axis=1)]
            if marked[more].all():
                return marked
            marked[more] = True

    def _add(self, marked: Array) -> None:
        """Cut every edge that is marked."""
        edges, cut = self.edges, np.nonzero(marked)[0]
        rows = np.full(len(marked) + 1, -1)  # the last stands for edges that are new
        rows[cut] = len(self.places) + np.arange(len(cut))
        rank = np.append(np.where(marked, edges.rank, -1), -1)
        origins, normals = self._middle(edges, cut)
        known = [self.middles.get(key) for key in edges.keys[cut].tolist()]
        nothing = np.full(self.light.shape[1], np.nan, np.float32)
        self.places = np.concatenate([self.places, self.places[edges.ends[cut]].mean(axis=1)])
        self.normals = np.concatenate([self.normals, normals])
        self.origins = np.concatenate([self.origins, origins])
        self.light = np.concatenate([self.light, [nothing if k is None else k[1] for k in known]])
        nodes, of = self.leaves, edges.of
        done = []
        while True:
            edge = rank[of].argmax(axis=1)
            inner = rank[of].max(axis=1) >= 0
            done.append(nodes[~inner])
            if not inner.any():
                break
            nodes, of = self._halve(nodes[inner], of[inner], edge[inner], rows)
        self.leaves = np.concatenate(done)
        before = self.at
        self.at, self.rows, self.weights = walk(tree(self.splits, self.triangles), self.at, self.rows, self.weights)
        self.unlike[self.at != before] = np.nan

    def _halve(self, nodes: Array, of: Array, edge: Array, rows: Array) -> tuple[Array, Array]:
        """Cut nodes across one edge each; the new ones, and their edges."""
        order = (edge[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(self.corners[nodes], order, axis=1).T
        ab, bc, ca = np.take_along_axis(of, order, axis=1).T
        middle, new = rows[ab], np.full(len(nodes), len(rows) - 1)
        halves = np.stack([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)], axis=1)
        sides = np.stack([np.stack([new, new, ca], axis=1), np.stack([new, bc, new], axis=1)], axis=1)
        first = len(self.corners)
        self.corners = np.concatenate([self.corners, halves.reshape(-1, 3)])
        self.depth = np.concatenate([self.depth, np.repeat(self.depth[nodes] + 1, 2)])
        self.may = np.concatenate([self.may, np.repeat(self.may[nodes], 2)])
        self.splits = np.concatenate([self.splits, np.stack([nodes, edge, middle], axis=1)])
        return first + np.arange(2 * len(nodes)), sides.reshape(-1, 3)

    def _probe(self) -> Generator[Progress, None, None]:
        """Compare the probes whose triangle was cut with what is interpolated there."""
        new = np.nonzero(np.isnan(self.unlike))[0]
        yield from self._look(np.unique(self.rows[new]))
        between = (self.weights[new, :, None] * self.light[self.rows[new]]).sum(axis=1)
        self.unlike[new] = self._unlike(self.probed[new], between)

    def _look(self, rows: Array) -> Generator[Progress, None, None]:
        """Have the light at these rows."""
        rows = rows[np.isnan(self.light[rows, 0])]
        self.light[rows] = yield from self._received(self.origins[rows], _unit(self.normals[rows]))

    def _unlike(self, light: Array, other: Array) -> Array:
        return np.linalg.norm(light - other, axis=1) / self.open

    def _received(self, origins: Array, normals: Array) -> Generator[Progress, None, Array]:
        """(n, bands²)"""
        yield self.progress
        if not len(origins):
            return np.zeros((0, self.light.shape[1]), np.float32)
        work = diffuse(replace(self.surfaces, positions=origins, normals=normals), self.caster, self.sampling)
        while True:
            try:
                next(work)
            except StopIteration as end:
                return end.value[:, 0]
            yield self.progress


def _sources(scene: Scene) -> tuple[Array, Array]:
    """(n, 3) origins and directions of rays from all that blocks light: from each instance and each of its triangles
    alike, so that what is small or fine has as many as what is large."""
    random = np.random.default_rng(1)
    those = [i for i in scene.instances if i.visibility & Visibility.SHADOW and scene.meshes[i.mesh].triangle_count]
    those = those[:: max(1, len(those) // _MOST_SOURCES)]
    each = max(1, _RAYS // max(1, len(those)))
    origins = [np.zeros((0, 3))]
    for instance in those:
        mesh, matrix = scene.meshes[instance.mesh], instance.world_from_object
        chosen = random.integers(0, mesh.triangle_count, each)
        corners = mesh.positions.reshape(-1, 3, 3)[chosen].astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        origins.append((random.dirichlet([1.0, 1.0, 1.0], each)[:, :, None] * corners).sum(axis=1))
    places = np.concatenate(origins)
    directions = _unit(random.normal(size=places.shape))
    size = float(np.linalg.norm(np.ptp(places, axis=0))) if len(places) else 0.0
    return places + LIFT * size * directions, directions


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)


def with_details(surfaces: Surfaces, details: dict[Hashable, Detail]) -> Surfaces:
    """The surfaces with the points of the objects' details behind all other rows of the vertex arrays."""
    inside, count = {}, len(surfaces.positions)
    for key, detail in details.items():
        inside[key] = slice(count, count + len(detail.origins))
        count = inside[key].stop
    return replace(
        surfaces,
        positions=np.concatenate([surfaces.positions, *(d.origins for d in details.values())]),
        normals=np.concatenate([surfaces.normals, *(d.normals for d in details.values())]),
        inside=inside,
    )
