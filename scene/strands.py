"""Hair and points as triangles: tubes around curves, balls around points. Plain numpy, without Blender.

They are solid and not turned to the camera: light maps see them from elsewhere, and what casts a shadow must not depend
on who looks. A tube of few sides is just so much thicker than the circle that it stands for that its outline, averaged
over all directions, is as wide; a ball of few faces likewise is as large as its disc.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .data import Array

# Sides of a tube and steps of a curve between two of its points, by how many triangles that makes.
_TUBES = ((8, 4), (6, 4), (4, 4), (3, 4), (3, 2), (3, 1))
_BALLS = (320, 80, 20, 8)  # faces of a ball
_MOST_TRIANGLES = 400_000  # of one object; beyond, the coarsest is taken


@dataclass(frozen=True, eq=False)
class Curves:
    """c curves through n points; those of curve k are ``offsets[k]`` to ``offsets[k + 1]``."""

    points: Array  # (n, 3) float32
    radii: Array  # (n,) float32
    offsets: Array  # (c + 1,) int
    cyclic: Array  # (c,) bool
    straight: Array  # (c,) bool: straight between points; else a Catmull-Rom curve, unless there are handles
    uvs: Array | None = None  # (c, 2) float32: where on a surface each grows
    handles: tuple[Array, Array] | None = None  # (n, 3) before and after each point, for Bézier curves
    bezier: Array | None = None  # (c,) bool: curves that go by their handles


@dataclass(frozen=True, eq=False)
class Triangles:
    """Corner arrays as in ``Mesh``."""

    positions: Array
    normals: Array
    uvs: Array | None = None


def tubes(curves: Curves) -> Triangles:
    """Open tubes around the curves. Curves of one point, and with points that are not finite, are left out."""
    curves = _whole(curves)
    segments = int((np.diff(curves.offsets) - 1 + curves.cyclic).sum())
    sides, steps = next((t for t in _TUBES if segments * t[0] * t[1] * 2 <= _MOST_TRIANGLES), _TUBES[-1])
    points, radii, starts, owner = _sampled(curves, steps)
    across, other = _frames(points, starts)
    turn = 2 * np.pi * np.arange(sides) / sides
    out = np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * other[:, None]  # (m, sides, 3)
    wide = math.pi / (sides * math.sin(math.pi / sides))
    ring = points[:, None] + wide * radii[:, None, None] * out
    lower = np.delete(np.arange(len(points)), starts[1:] - 1)
    corner = ((0, 0), (0, 1), (1, 1), (0, 0), (1, 1), (1, 0))
    rows = np.stack([lower + up for up, _ in corner], -1)[:, None].repeat(sides, 1)  # (segments, sides, 6)
    columns = np.stack([(np.arange(sides) + along) % sides for _, along in corner], -1)[None]
    positions = ring[rows, columns].reshape(-1, 3)
    normals = out[rows, columns].reshape(-1, 3)
    uvs = None if curves.uvs is None else curves.uvs[owner[lower]].repeat(6 * sides, 0).astype(np.float32)
    return _with_area(Triangles(positions.astype(np.float32), normals.astype(np.float32), uvs))


def balls(points: Array, radii: Array) -> Triangles:
    """A ball around each of the points (n, 3)."""
    fine = np.isfinite(points).all(1) & np.isfinite(radii) & (radii > 0)
    points, radii = points[fine], radii[fine]
    faces = next((count for count in _BALLS if count * len(points) <= _MOST_TRIANGLES), _BALLS[-1])
    corners = _ball(faces)  # (3 faces, 3)
    a, b, c = corners.reshape(-1, 3, 3).swapaxes(0, 1)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    size = math.sqrt(4 * math.pi / area)  # the outline of a convex body is a quarter of its surface, on average
    positions = points[:, None] + size * radii[:, None, None] * corners
    normals = np.broadcast_to(corners, positions.shape)
    return Triangles(positions.reshape(-1, 3).astype(np.float32), normals.reshape(-1, 3).astype(np.float32))


def _whole(curves: Curves) -> Curves:
    """The curves that can be drawn: of two points or more, all finite."""
    lengths = np.diff(curves.offsets)
    owner = np.arange(len(lengths)).repeat(lengths)
    bad = ~(np.isfinite(curves.points).all(1) & np.isfinite(curves.radii))
    keep = (lengths > 1) & (np.bincount(owner, bad, len(lengths)) == 0)
    if keep.all():
        return curves
    of_points = keep[owner]
    handles = curves.handles and (curves.handles[0][of_points], curves.handles[1][of_points])
    return Curves(
        curves.points[of_points],
        curves.radii[of_points],
        np.concatenate(([0], np.cumsum(lengths[keep]))),
        curves.cyclic[keep],
        curves.straight[keep],
        None if curves.uvs is None else curves.uvs[keep],
        handles,
        None if curves.bezier is None else curves.bezier[keep],
    )


def _sampled(curves: Curves, steps: int) -> tuple[Array, Array, Array, Array]:
    """Points along the curves, their radii, where each curve's begin (and all end), and each one's curve."""
    lengths = np.diff(curves.offsets)
    segments = lengths - 1 + curves.cyclic
    counts = segments * steps + 1
    starts = np.concatenate(([0], np.cumsum(counts)))
    owner = np.arange(len(lengths)).repeat(counts)
    place = np.arange(starts[-1]) - starts[:-1].repeat(counts)
    segment = np.minimum(place // steps, segments[owner] - 1)
    part = ((place - segment * steps) / steps)[:, None]
    first, length, cyclic = curves.offsets[:-1][owner], lengths[owner], curves.cyclic[owner]

    def point(shift: int) -> Array:
        number = segment + shift
        return first + np.where(cyclic, number % length, np.clip(number, 0, length - 1))

    before, low, high, after = (point(shift) for shift in (-1, 0, 1, 2))
    p, straight = curves.points.astype(np.float64), curves.straight[owner][:, None]
    near = p[low] + np.where(straight, p[high] - p[low], 0.5 * (p[high] - p[before])) / 3.0
    far = p[high] - np.where(straight, p[high] - p[low], 0.5 * (p[after] - p[low])) / 3.0
    if curves.handles is not None and curves.bezier is not None:
        bent = curves.bezier[owner][:, None]
        near, far = np.where(bent, curves.handles[1][low], near), np.where(bent, curves.handles[0][high], far)
    rest = 1.0 - part
    found = rest**3 * p[low] + 3 * rest**2 * part * near + 3 * rest * part**2 * far + part**3 * p[high]
    radii = rest[:, 0] * curves.radii[low] + part[:, 0] * curves.radii[high]
    return found, radii, starts, owner


def _frames(points: Array, starts: Array) -> tuple[Array, Array]:
    """Two unit vectors across each point's curve, carried along it without a twist."""
    tangents = np.zeros_like(points)
    tangents[:-1] += points[1:] - points[:-1]
    tangents[starts[1:-1] - 1] = 0.0  # from one curve to the next
    tangents[1:] += np.where(np.isin(np.arange(1, len(points)), starts)[:, None], 0.0, points[1:] - points[:-1])
    tangents = _unit(tangents, (0.0, 0.0, 1.0))
    across = np.zeros_like(points)
    first, counts = starts[:-1], np.diff(starts)
    away = np.eye(3)[np.abs(tangents[first]).argmin(1)] if len(first) else np.zeros((0, 3))
    across[first] = _unit(np.cross(tangents[first], away), (1.0, 0.0, 0.0))
    for place in range(1, int(counts.max(initial=0))):
        here = first[counts > place] + place
        carried, along = across[here - 1], tangents[here]
        carried = carried - (carried * along).sum(1, keepdims=True) * along
        again = np.cross(along, np.eye(3)[np.abs(along).argmin(1)])
        short = (np.abs(carried).max(1) < 1e-3)[:, None]
        across[here] = _unit(np.where(short, again, carried), (1.0, 0.0, 0.0))
    return across, np.cross(tangents, across)


def _unit(vectors: Array, otherwise: tuple[float, float, float]) -> Array:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-20, vectors / np.maximum(length, 1e-20), otherwise)


def _with_area(found: Triangles) -> Triangles:
    """Without triangles that are points or lines, as where a tube ends in a tip."""
    a, b, c = found.positions.reshape(-1, 3, 3).swapaxes(0, 1)
    keep = (a != b).any(1) & (b != c).any(1) & (c != a).any(1)
    if keep.all():
        return found
    corners = keep.repeat(3)
    uvs = None if found.uvs is None else found.uvs[corners]
    return Triangles(found.positions[corners], found.normals[corners], uvs)


def _ball(faces: int) -> Array:
    """Corners of an octahedron (8), an icosahedron (20) or what comes of splitting that: unit, seen from outside."""
    if faces == 8:
        signs = [(x, y, z) for x in (1, -1) for y in (1, -1) for z in (1, -1)]
        corners = [np.diag(s) if np.prod(s) > 0 else np.diag(s)[::-1] for s in signs]
        return np.array(corners, np.float64).reshape(-1, 3)
    golden = (1 + math.sqrt(5)) / 2
    points = np.array([(0, s, t * golden) for s in (-1, 1) for t in (-1, 1)], np.float64)
    points = np.concatenate([np.roll(points, turn, 1) for turn in range(3)]) / math.hypot(1, golden)
    near = np.linalg.norm(points[:, None] - points, axis=2) < 1.2
    close = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[np.ix_((i, j, k), (i, j, k))].all()
    ]
    triangles = points[np.array(close)]
    a, b, c = triangles.swapaxes(0, 1)
    from_inside = (np.cross(b - a, c - a) * a).sum(1) < 0
    triangles[from_inside] = triangles[from_inside][:, ::-1]
    while len(triangles) < faces:
        a, b, c = triangles.swapaxes(0, 1)
        ab, bc, ca = (m / np.linalg.norm(m, axis=1, keepdims=True) for m in (a + b, b + c, c + a))
        triangles = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return triangles.reshape(-1, 3)
