"""Points spread over the scene's triangles by area, or by the light that they emit. Plain numpy, no GPU.

The triangles of a mesh are sorted once by the direction they face, into the cells of ``_cells``, with a running sum of
their areas. A cell of a placed mesh is then one entry of the distribution: its world area follows from the instance's
matrix alone, whatever its scale, and rigid moves change nothing. What a cell's area is estimated wrongly by (only where
it is curved and scaled unevenly) the weight of each point makes good.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from .data import LUMINANCE, Array, Material, Mesh

# Cells along each side of a face of the cube that directions are sorted by. Odd: the axes lie in the middle of cells.
_CELLS_A_SIDE = 3
# Scales along different directions that differ by less than such a part, squared, are one.
_EVEN = 1e-6
# At most so many objects are huge: those that have so many times the area of all others.
_MOST_HUGE, _HUGE = 4, 32.0
# Points of huge objects that are tried for each that is kept, where those in a box count more.
FOCUS_TRIES = 32
# Pairs (i, j) of the six different elements of a symmetric matrix, and how often each counts in a product of two.
_PAIRS, _TIMES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)), np.array([1.0, 1, 1, 2, 2, 2])


@dataclass(frozen=True, eq=False)
class Part:
    """A run of triangles of one mesh with one material, placed by some rows of the table of instances."""

    mesh: Mesh
    first_triangle: int
    triangle_count: int
    first_instance: int
    instance_count: int
    material: int
    attributes: tuple[
        tuple[str, str], ...
    ] = ()  # what its material asks of a mesh: Mesh.corner_attribute()'s arguments
    density: float = 1.0  # how many points an area gets, against other parts

    @property
    def key(self) -> tuple[Hashable, int, int]:
        return self.mesh.key, self.first_triangle, self.triangle_count

    @property
    def layout(self) -> tuple:
        """All but the matrices that points depend on."""
        return self.key, self.first_instance, self.instance_count, self.material, self.attributes, self.density


@dataclass(frozen=True, eq=False)
class Points:
    """n points in object space. Any run of them is spread as evenly as all of them are, if thinner.

    ``weights`` are m² of the world: the area that a point stands for, both sides of it taken as one surface, so that
    they add up to the area of all surfaces. Normals are on the side that the point is on; either is as likely.
    """

    instances: Array  # (n,) int64: row in the table of instances
    materials: Array  # (n,) int64
    positions: Array  # (n, 3) float64
    normals: Array  # (n, 3) float64: shading normal, interpolated and not unit
    geometric_normals: Array  # (n, 3) float64: unit normal of the triangle
    backfacing: Array  # (n,) float64: 1 where a point is on the side that the mesh's faces look away from
    attributes: Array  # (n, k, 4) float64: by Part.attributes, k the most that a part has; what is not there is 0
    weights: Array  # (n,) float64, m²

    def __len__(self) -> int:
        return len(self.weights)


_SortedKey = tuple[Hashable, bool]  # Part.key, and whether all of its instances are scaled evenly
_NO_ROWS, _NO_VECTORS = np.zeros(0, np.int64), np.zeros((0, 3))
_NO_POINTS = Points(
    _NO_ROWS, _NO_ROWS, _NO_VECTORS, _NO_VECTORS, _NO_VECTORS, np.zeros(0), np.zeros((0, 0, 4)), weights=np.zeros(0)
)


@dataclass(frozen=True, eq=False)
class _Triangles:
    """The triangles of a part, sorted by cell. Only cells with an area are listed."""

    order: Array  # (t,) int32: number within the part
    areas: Array  # (t,) float64: running sum in that order, object space
    starts: Array  # (cells + 1,) float64: the running sum ahead of each cell, and all of it
    moments: Array  # (cells, 6) float64: sum of area times normal times normal transposed, by _PAIRS

    @property
    def cells(self) -> int:
        return len(self.moments)


@dataclass(frozen=True, eq=False)
class _Entries:
    """The distribution that points are drawn from: a row for each cell of each placed part."""

    sums: Array  # (e,) float64: running sum of estimated area times density
    starts: Array  # (parts + 1,) int: the first entry of each part

    @property
    def total(self) -> float:
        return float(self.sums[-1]) if len(self.sums) else 0.0


class SurfaceSampler:
    """Draws points; keeps what it found out about each mesh for as long as that is asked for."""

    def __init__(self) -> None:
        self._triangles: dict[_SortedKey, _Triangles] = {}

    def sample(
        self,
        parts: Sequence[Part],
        matrices: Array,
        count: int,
        seed: int = 0,
        huge_share: float = 1.0,
        focus: Array | None = None,
    ) -> Points:
        """``count`` points, or none where nothing has an area. matrices: (n, 4, 4) of all instances.

        Objects that would leave next to nothing to the others (a ground plane) get ``huge_share`` of the points, and
        have half of those in the box ``focus``, (2, 3), if so many can be found there.
        """
        cofactors = cofactor_matrices(matrices)
        triangles = self._sorted(parts, cofactors)
        measures = _measures(parts, triangles, cofactors)
        huge = _limit_huge(measures, huge_share) if huge_share < 1.0 and measures else _NO_ROWS
        entries = _entries(measures)
        if count < 1 or entries.total <= 0.0:
            return _NO_POINTS
        points, placed = _draw(parts, triangles, cofactors, entries, _low_discrepancy(count, seed))
        mine = np.flatnonzero(np.isin(placed, huge))
        if focus is None or not len(mine):
            return points
        only_huge = _entries(_only(measures, huge))
        numbers = _low_discrepancy(FOCUS_TRIES * len(mine), seed + 1)
        tried, _ = _draw(parts, triangles, cofactors, only_huge, numbers)
        return _replaced(points, mine, _focused(tried, matrices, focus, len(mine)))

    def _sorted(self, parts: Sequence[Part], cofactors: Array) -> list[_Triangles]:
        even = _are_even(cofactors)
        keys: list[_SortedKey] = []
        wanted: dict[_SortedKey, Part] = {}
        for part in parts:
            rows = slice(part.first_instance, part.first_instance + part.instance_count)
            keys.append((part.key, bool(even[rows].all())))
            wanted[keys[-1]] = part
        kept = {key: known for key, known in self._triangles.items() if key in wanted}
        new = {key: _sorted_triangles(part, even=key[1]) for key, part in wanted.items() if key not in kept}
        self._triangles = kept | new
        return [self._triangles[key] for key in keys]


def emission_density(material: Material) -> float:
    """Luminance of what a material emits, on average over it."""
    return float(np.maximum(np.asarray(material.emission, np.float64), 0.0) @ LUMINANCE)


def cofactor_matrices(matrices: Array) -> Array:
    """(n, 3, 3) that take an area vector (a normal as long as its area) of (n, 4, 4) matrices' space to the world."""
    x, y, z = (np.asarray(matrices, np.float64)[:, :3, k] for k in range(3))
    return np.stack((np.cross(y, z), np.cross(z, x), np.cross(x, y)), axis=-1)


def gram_matrices(matrices: Array) -> Array:
    """(n, 3, 3): what of (n, 4, 4) matrices no rigid move changes."""
    linear = np.asarray(matrices, np.float64)[:, :3, :3]
    return linear.swapaxes(1, 2) @ linear


def _are_even(cofactors: Array) -> Array:
    """(n,) whether matrices with these (n, 3, 3) cofactors scale all directions alike."""
    squares = cofactors.swapaxes(1, 2) @ cofactors
    size = np.trace(squares, axis1=1, axis2=2)[:, None, None] / 3.0
    return (np.abs(squares - size * np.eye(3)) <= _EVEN * size).all((1, 2))


def _sorted_triangles(part: Part, *, even: bool) -> _Triangles:
    """Area, direction and moments of every triangle of a part; a second's work for some ten million of them.

    ``even``: it is never scaled unevenly, and directions need not be told apart: one cell, and half of the work.
    """
    last = part.first_triangle + part.triangle_count
    corners = part.mesh.positions[3 * part.first_triangle : 3 * last].reshape(-1, 3, 3)
    a, b = (np.ascontiguousarray((corners[:, k] - corners[:, 0]).T) for k in (1, 2))
    normal = np.stack([a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))])
    doubled = np.sqrt((normal * normal).sum(0))
    if even:
        sums = np.cumsum(doubled, dtype=np.float64) * 0.5
        total = sums[-1:]
        moments = [np.full_like(total, (total[0] if i == j else 0.0) / 3.0) for i, j in _PAIRS]
        found = slice(0, int(total[0] > 0.0))
        starts = np.concatenate(([0.0], total[found]))
        return _Triangles(np.arange(len(doubled), dtype=np.int32), sums, starts, np.stack(moments, -1)[found])
    cell = _cells(normal)
    count = 3 * _CELLS_A_SIDE**2
    order = np.argsort(cell, kind="stable").astype(np.int32)
    sums = np.cumsum(doubled[order], dtype=np.float64) * 0.5
    ends = np.cumsum(np.bincount(cell, minlength=count))
    starts = np.concatenate(([0.0], sums))[np.concatenate(([0], ends))]
    with np.errstate(all="ignore"):
        scaled = np.where(doubled > 0.0, normal / doubled, 0.0)
    moments = [np.bincount(cell, 0.5 * normal[i] * scaled[j], count) for i, j in _PAIRS]
    used = np.flatnonzero(np.diff(starts) > 0.0)
    kept = np.concatenate((starts[used], starts[-1:]))
    return _Triangles(order, sums, kept, np.stack(moments, -1)[used])


def _cells(normal: Array) -> Array:
    """(t,) uint8: which way (3, t) normals point, a line's two directions being one."""
    size = np.abs(normal)
    axis = np.where(size[0] >= np.maximum(size[1], size[2]), 0, np.where(size[1] >= size[2], 1, 2))
    number = axis.astype(np.uint8)
    along = np.choose(axis, normal)
    for turn in (1, 2):
        across = np.choose(axis, [normal[(k + turn) % 3] for k in range(3)])
        with np.errstate(all="ignore"):
            place = (across / along + 1.0) * (0.5 * _CELLS_A_SIDE)
        # fmin and fmax put what has no direction, and no area, into any cell.
        number = number * _CELLS_A_SIDE + np.fmax(np.fmin(place, _CELLS_A_SIDE - 1), 0).astype(np.uint8)
    return number


def _measures(parts: Sequence[Part], triangles: Sequence[_Triangles], cofactors: Array) -> list[Array]:
    """Of each part, (rows, cells): estimated area of each cell of each placed one, times density."""
    # The square of an area vector's stretch is a quadratic form of its direction.
    squares = cofactors.swapaxes(1, 2) @ cofactors
    forms = np.stack([squares[:, i, j] for i, j in _PAIRS], -1) * _TIMES
    measures = []
    for part, known in zip(parts, triangles, strict=True):
        rows = forms[part.first_instance : part.first_instance + part.instance_count]
        # By Cauchy and Schwarz at least the world area, and just that where a cell is flat or the scale even.
        area = np.sqrt(np.maximum(np.diff(known.starts) * (rows @ known.moments.T), 0.0)) * part.density
        measures.append(np.where(np.isfinite(area), area, 0.0))
    return measures


def _entries(measures: Sequence[Array]) -> _Entries:
    starts = np.cumsum([0, *(measure.size for measure in measures)])
    return _Entries(np.cumsum(np.concatenate([np.zeros(0), *(measure.ravel() for measure in measures)])), starts)


def _limit_huge(measures: Sequence[Array], share: float) -> Array:
    """Make the few that have nearly all of the area ``share`` of it; (rows, cells) a part, changed in place.

    Returns which they are, counted over the rows of all parts.
    """
    totals = np.concatenate([measure.sum(1) for measure in measures])
    order = np.argsort(-totals, kind="stable")
    for number in range(1, _MOST_HUGE + 1):
        huge, rest = totals[order[:number]].sum(), totals[order[number:]].sum()
        if 0.0 < rest * _HUGE < huge:
            factors = np.ones(len(totals))
            factors[order[:number]] = share / (1.0 - share) * rest / huge
            ends = np.cumsum([len(measure) for measure in measures])
            for measure, factor in zip(measures, np.split(factors, ends[:-1]), strict=True):
                measure *= factor[:, None]
            return order[:number]
    return _NO_ROWS


def _only(measures: Sequence[Array], kept: Array) -> list[Array]:
    """The measures of some placed parts, counted over the rows of all; 0 of the others."""
    wanted = np.isin(np.arange(sum(len(measure) for measure in measures)), kept)
    ends = np.cumsum([len(measure) for measure in measures])
    return [measure * rows[:, None] for measure, rows in zip(measures, np.split(wanted, ends[:-1]), strict=True)]


def _draw(
    parts: Sequence[Part], triangles: Sequence[_Triangles], cofactors: Array, entries: _Entries, numbers: Array
) -> tuple[Points, Array]:
    """Points by (n, 3) numbers in [0, 1), and where each lies, counted over the rows of all parts."""
    # A point's first number tells its side and its place in the distribution: each side is covered evenly.
    side, place = np.divmod(2.0 * numbers[:, 0], 1.0)
    chosen, within, shares = _choose(entries, place)
    part = np.searchsorted(entries.starts, chosen, "right") - 1
    cells = np.array([t.cells for t in triangles], np.int64)
    row, cell = np.divmod(chosen - entries.starts[part], np.maximum(cells[part], 1))
    instances = np.array([p.first_instance for p in parts], np.int64)[part] + row
    corners = _gather(parts, triangles, part, cell, within)
    points = _place(corners, numbers[:, 1:], np.where(side < 1.0, 1.0, -1.0))
    stretch = np.linalg.norm(np.einsum("nij,nj->ni", cofactors[instances], points["geometric_normals"]), axis=1)
    weights = corners["cell_area"] * stretch / (len(numbers) * shares)
    materials = np.array([p.material for p in parts], np.int64)[part]
    first_rows = np.cumsum([0, *(p.instance_count for p in parts)])
    return Points(instances=instances, materials=materials, weights=weights, **points), first_rows[part] + row


def _focused(tried: Points, matrices: Array, focus: Array, count: int) -> Points:
    """``count`` of many points, half of them in a box; those of each side stand for all of that side."""
    placed = matrices[tried.instances]
    world = np.einsum("nij,nj->ni", placed[:, :3, :3], tried.positions) + placed[:, :3, 3]
    inside = ((world >= focus[0]) & (world <= focus[1])).all(1)
    here, there = np.flatnonzero(inside), np.flatnonzero(~inside)
    wanted = max(min(len(here), count // 2), count - len(there))
    kept, scales, places = [], [], []
    for group, some in ((here, here[:wanted]), (there, there[: count - wanted])):
        kept.append(some)
        scales.append(np.full(len(some), tried.weights[group].sum() / max(tried.weights[some].sum(), 1e-300)))
        places.append((np.arange(len(some)) + 0.5) / max(len(some), 1))
    # Mixed, so that any run of them is as even as all.
    order = np.argsort(np.concatenate(places), kind="stable")
    rows = np.concatenate(kept)[order]
    chosen = {entry.name: getattr(tried, entry.name)[rows] for entry in fields(Points)}
    chosen["weights"] = chosen["weights"] * np.concatenate(scales)[order]
    return Points(**chosen)


def _replaced(points: Points, rows: Array, by: Points) -> Points:
    arrays = {entry.name: getattr(points, entry.name).copy() for entry in fields(Points)}
    for name, array in arrays.items():
        array[rows] = getattr(by, name)
    return Points(**arrays)


def _low_discrepancy(count: int, seed: int) -> Array:
    """(count, 3) in [0, 1): multiples of powers of the root of x⁴ = x + 1, of which any run is as even as a start.

    Roberts 2018, "The unreasonable effectiveness of quasirandom sequences".
    """
    root = 1.0
    for _ in range(64):
        root = (1.0 + root) ** 0.25
    step = root ** -np.arange(1.0, 4.0)
    return np.modf(np.random.default_rng(seed).random(3) + np.arange(count)[:, None] * step)[0]


def _choose(entries: _Entries, place: Array) -> tuple[Array, Array, Array]:
    """Of points at ``place`` (n,) 0..1 in the distribution: entry, how far into it 0..1, and the entry's share."""
    target = np.minimum(place * entries.total, np.nextafter(entries.total, 0.0))
    chosen = np.searchsorted(entries.sums, target, "right")
    before = np.where(chosen > 0, entries.sums[chosen - 1], 0.0)
    measure = entries.sums[chosen] - before
    return chosen, (target - before) / measure, measure / entries.total


def _gather(parts: Sequence[Part], triangles: Sequence[_Triangles], part: Array, cell: Array, within: Array) -> dict:
    """What the meshes hold at the corners of each point's triangle."""
    count, most = len(part), max((len(p.attributes) for p in parts), default=0)
    found = {
        "positions": np.zeros((count, 3, 3)),
        "normals": np.zeros((count, 3, 3)),
        "attributes": np.zeros((count, 3, 4 * most)),
        "cell_area": np.zeros(count),
    }
    order = np.argsort(part, kind="stable")
    hit, first = np.unique(part[order], return_index=True)
    for number, start, end in zip(hit, first, [*first[1:], count], strict=True):
        mine = order[start:end]
        known, mesh = triangles[number], parts[number].mesh
        low, high = known.starts[cell[mine]], known.starts[cell[mine] + 1]
        # Strictly below the cell's end: what is found there has an area.
        target = np.minimum(low + within[mine] * (high - low), np.nextafter(high, 0.0))
        triangle = known.order[np.searchsorted(known.areas, target, "right")] + parts[number].first_triangle
        found["cell_area"][mine] = high - low
        for name, layer in {"positions": mesh.positions, "normals": mesh.normals}.items():
            found[name][mine] = layer.reshape(-1, 3, layer.shape[1])[triangle]
        for place, named in enumerate(parts[number].attributes):
            layer = mesh.corner_attribute(*named)
            width = layer.shape[1]
            found["attributes"][mine, :, 4 * place : 4 * place + width] = layer.reshape(-1, 3, width)[triangle]
    return found


def _place(corners: dict, numbers: Array, side: Array) -> dict:
    """Points within their triangles; ``numbers`` (n, 2) in [0, 1)."""
    root = np.sqrt(numbers[:, 0])
    shares = np.stack((1.0 - root, root * (1.0 - numbers[:, 1]), root * numbers[:, 1]), -1)
    points = {name: np.einsum("nc,ncd->nd", shares, corners[name]) for name in ("positions", "normals", "attributes")}
    points["attributes"] = points["attributes"].reshape(len(numbers), -1, 4)
    a, b, c = corners["positions"].swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    points["geometric_normals"] = normal * side[:, None]
    points["normals"] *= side[:, None]
    points["backfacing"] = (side < 0.0).astype(np.float64)
    return points
