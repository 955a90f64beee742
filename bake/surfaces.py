"""The triangles of a scene in world space, with the vertices that light is gathered at."""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..scene.data import Array, Image, Instance, Material, Mesh, Scene, Visibility

# Rays leave the surface by this part of the object's size, so that they do not hit the triangle they start on.
LIFT = 1e-4
# And from beside the vertex, along the surface, by this part of the way to the middles of its triangles: a floor's
# corner lies in the planes of two walls, and rays from there would pass behind them.
INWARDS = 0.01
# A triangle is cut into at most so many by so many.
_MOST_CUTS = 64
# Lobes that reflect no more than this at normal incidence, on average over the channels, count as scattered: those of
# dielectrics, commonly 0.04. Nearly every metal reflects more.
LEAST_MIRRORED = 0.1
# Where in a triangle its colour is looked up: four points a side's worth, as barycentric coordinates.
_SPOTS = np.array([(i + 1, j + 1, 4 - i - j) for i in range(4) for j in range(4 - i)]) / 6.0


@dataclass(frozen=True, eq=False)
class Surfaces:
    """T triangles and V vertices of every instance that blocks light, and of those to be baked."""

    corners: Array  # (T, 3, 3) float64, world space
    triangle_vertices: Array  # (T, 3) int64: rows of the vertex arrays
    facing: Array  # (T, 3) float64: unit normal of each triangle, on the side of its vertices' normals
    reflectance: Array  # (T, channels) float64, 0..1: what is scattered; one channel where all is grey
    mirrored: Array  # (T, channels) float64, 0..1: what a lobe reflects at normal incidence, where it is told apart
    roughness: Array  # (T,) float64, 0..1: of that lobe
    blocks: Array  # (T,) bool: takes part in shadows
    positions: Array  # (V, 3) float64, world space, lifted off the surface: where rays start
    normals: Array  # (V, 3) float64, world space, unit
    runs: Mapping[Hashable, slice]  # Instance.key -> its rows of the vertex arrays; behind them are those of pieces
    inside: Mapping[Hashable, slice] = field(
        default_factory=dict
    )  # and rows of points inside its triangles (refine.py)

    def rows(self, key: Hashable) -> Array:
        """Ascending: of the vertices of an instance, then of the points inside its triangles."""
        runs = [self.runs[key], self.inside.get(key, slice(0, 0))]
        return np.concatenate([np.arange(run.start, run.stop) for run in runs])


def mesh_vertices(mesh: Mesh) -> tuple[Array, Array]:
    """The first corner of each vertex (v,), and the vertex of each corner (3T,).

    Corners with one position and one normal are one vertex. The same mesh has the same vertices in the same order, so
    a file of transfer needs to hold no indices.
    """
    rows = np.ascontiguousarray(np.concatenate([mesh.positions, mesh.normals], axis=1, dtype=np.float32) + 0.0)
    _, first, vertices = np.unique(rows.view(f"V{rows.strides[0]}").reshape(-1), return_index=True, return_inverse=True)
    return first, vertices.reshape(-1)


def mesh_fingerprint(mesh: Mesh) -> str:
    """Hexadecimal SHA-256 of the shape: what a bake of it depends on."""
    digest = hashlib.sha256()
    for array in (mesh.positions, mesh.normals):
        digest.update(np.ascontiguousarray(array, np.float32).tobytes())
    return digest.hexdigest()


def frame_of(world_from_object: Array) -> Array:
    """(3, 3) rotation: the world directions of the axes that a bake of this object is kept in.

    The rotation next to the object's matrix; scale, shear and mirroring stay out of it.
    """
    u, _, v = np.linalg.svd(np.asarray(world_from_object, np.float64)[:3, :3])
    return u @ np.diag([1.0, 1.0, np.linalg.det(u) * np.linalg.det(v)]) @ v


def gather(scene: Scene, bake: frozenset[Hashable], cuts: int = 0) -> Surfaces:
    """The surfaces of ``scene``. Instances named by ``bake`` are there even where they block no light.

    With ``cuts``, triangles larger than the scene's diagonal over it are cut into pieces that each have one vertex of
    their own, in the middle: a wall of two triangles reflects what happens between its corners. 0 leaves all as they
    are.
    """
    used = [i for i in scene.instances if i.key in bake or i.visibility & Visibility.SHADOW]
    runs: dict[Hashable, slice] = {}
    parts: list[tuple[Array, ...]] = []
    count = 0
    for instance in used:
        mesh = scene.meshes[instance.mesh]
        first, vertices = mesh_vertices(mesh)
        corners, positions, normals = _placed(mesh, instance.world_from_object, first, vertices)
        facing = _facing(corners, normals[vertices.reshape(-1, 3)])
        blocks = np.full(len(corners), bool(instance.visibility & Visibility.SHADOW))
        look = _look(mesh, instance, scene)
        parts.append((corners, count + vertices.reshape(-1, 3), facing, *look, blocks, positions, normals))
        runs[instance.key] = slice(count, count + len(first))
        count += len(first)
    if not parts:
        raise ValueError("the scene has no surface that blocks light and none to bake")
    arrays = [np.concatenate(part) for part in zip(*parts, strict=True)]
    corners, rows, facing, colour, mirrored, roughness, blocks, positions, normals = arrays
    if (colour == colour[:, :1]).all() and (mirrored == mirrored[:, :1]).all():
        colour, mirrored = colour[:, :1], mirrored[:, :1]
    surfaces = Surfaces(corners, rows, facing, colour, mirrored, roughness, blocks, positions, normals, runs)
    return _cut(surfaces, cuts) if cuts else surfaces


def _cut(surfaces: Surfaces, cuts: int) -> Surfaces:
    """Each large triangle in n x n pieces of one shape, by its area: slivers are not cut into more slivers."""
    corners = surfaces.corners
    points = corners.reshape(-1, 3)
    side = np.linalg.norm(np.ptp(points, axis=0)) / cuts
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    number = np.ceil(np.sqrt(areas / (0.5 * side**2 + 1e-300))).clip(1, _MOST_CUTS).astype(np.int64)
    sources, pieces, middles = [np.nonzero(number == 1)[0]], [corners[number == 1]], []
    for n in np.unique(number[number > 1]):
        large = np.nonzero(number == n)[0]
        shape = _pieces(n)
        sources.append(np.repeat(large, len(shape)))
        pieces.append(np.einsum("pkc,tcx->tpkx", shape, corners[large]).reshape(-1, 3, 3))
        middles.append(np.tile(shape.mean(axis=1), (len(large), 1)))
    source, whole = np.concatenate(sources), len(sources[0])
    rows = surfaces.triangle_vertices[source]
    if middles:
        middle, of = np.concatenate(middles)[:, :, None], rows[whole:]
        positions = (middle * surfaces.positions[of]).sum(axis=1)
        normals = (middle * surfaces.normals[of]).sum(axis=1)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        rows[whole:] = len(surfaces.positions) + np.arange(len(of))[:, None]
        surfaces = replace(
            surfaces,
            positions=np.concatenate([surfaces.positions, positions]),
            normals=np.concatenate([surfaces.normals, normals]),
        )
    return replace(
        surfaces,
        corners=np.concatenate(pieces),
        triangle_vertices=rows,
        facing=surfaces.facing[source],
        reflectance=surfaces.reflectance[source],
        mirrored=surfaces.mirrored[source],
        roughness=surfaces.roughness[source],
        blocks=surfaces.blocks[source],
    )


def _pieces(n: int) -> Array:
    """(n², 3, 3): the barycentric coordinates of the corners of the n² pieces of a triangle, turned as it is."""
    i, j = np.nonzero(np.add.outer(np.arange(n), np.arange(n)) < n)
    upright = np.stack([np.stack([i, j]), np.stack([i + 1, j]), np.stack([i, j + 1])])  # corner, axis, piece
    i, j = i[i + j < n - 1], j[i + j < n - 1]
    hanging = np.stack([np.stack([i + 1, j]), np.stack([i + 1, j + 1]), np.stack([i, j + 1])])
    uv = np.concatenate([upright, hanging], axis=2).transpose(2, 0, 1) / n
    return np.concatenate([1.0 - uv.sum(axis=2, keepdims=True), uv], axis=2)


def _placed(mesh: Mesh, matrix: Array, first: Array, vertices: Array) -> tuple[Array, Array, Array]:
    """World-space corners of the triangles; where rays start and unit normals of the vertices."""
    linear, offset = matrix[:3, :3].astype(np.float64), matrix[:3, 3]
    points = mesh.positions.astype(np.float64) @ linear.T + offset
    # Normals go by the cofactors: the inverse transposed, and still there where the object is scaled flat.
    cofactors = np.stack([np.cross(linear[1], linear[2]), np.cross(linear[2], linear[0]), np.cross(*linear[:2])])
    normals = mesh.normals[first].astype(np.float64) @ cofactors.T
    normals *= -1.0 if np.linalg.det(linear) < 0 else 1.0
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 0, normals / np.where(lengths > 0, lengths, 1), [0.0, 0.0, 1.0])
    size = np.linalg.norm(np.ptp(points, axis=0)) if len(points) else 0.0
    middles = np.repeat(points.reshape(-1, 3, 3).mean(axis=1), 3, axis=0)
    meeting = np.maximum(np.bincount(vertices, minlength=len(first)), 1)
    inwards = np.stack([np.bincount(vertices, axis, len(first)) for axis in middles.T], axis=-1) / meeting[:, None]
    inwards -= points[first]
    inwards -= (inwards * normals).sum(axis=1, keepdims=True) * normals
    return points.reshape(-1, 3, 3), points[first] + normals * (LIFT * size) + INWARDS * inwards, normals


def _facing(corners: Array, normals: Array) -> Array:
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat *= np.where((flat * normals.sum(axis=1)).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    return flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)


def _look(mesh: Mesh, instance: Instance, scene: Scene) -> tuple[Array, Array, Array]:
    """(T, 3) what each triangle scatters, (T, 3) what its lobe reflects, (T,) roughness; a texture averaged over it.

    A lobe that is not told apart is in what is scattered, by its reflectance at normal incidence: its direction is
    lost, its energy is not.
    """
    colours, mirrored = np.zeros((2, mesh.triangle_count, 3))
    roughness = np.zeros(mesh.triangle_count)
    if not instance.visibility & Visibility.BOUNCE:
        return colours, mirrored, roughness
    for slot, first, count in mesh.slots:
        material = scene.materials[instance.materials[min(slot, len(instance.materials) - 1)]]
        run = slice(first, first + count)
        base, specular = np.broadcast_to(material.base_color, (count, 3)), np.array(material.specular)
        if material.base_color_texture is not None:
            base = _averages(mesh, run, material, scene.images)
        colours[run] = base * (1.0 - material.metallic) * (1.0 - material.layered * specular)
        mirrored[run] = base * material.metallic + (1.0 - material.metallic) * specular
        roughness[run] = material.roughness
    scattered = mirrored.mean(axis=1, keepdims=True) <= LEAST_MIRRORED
    colours += np.where(scattered, mirrored, 0.0)
    return colours.clip(0.0, 1.0), np.where(scattered, 0.0, mirrored).clip(0.0, 1.0), roughness


def is_mirror(material: Material) -> bool:
    """Whether its lobe is told apart, at least somewhere."""
    base = np.array(material.base_color if material.base_color_texture is None else (1.0, 1.0, 1.0))
    lobe = base * material.metallic + (1.0 - material.metallic) * np.array(material.specular)
    return bool(lobe.mean() > LEAST_MIRRORED)


def _averages(mesh: Mesh, run: slice, material: Material, images: Mapping[Hashable, Image]) -> Array:
    texture = material.base_color_texture
    assert texture is not None
    uvs = mesh.uvs.get(texture.uv_map or mesh.active_uv)
    if uvs is None:  # as in Blender: without a UV map all of it has one texel
        uvs = np.zeros((len(mesh.positions), 2), np.float32)
    points = np.einsum("kc,tcx->tkx", _SPOTS, uvs.reshape(-1, 3, 2)[run].astype(np.float64))
    return images[texture.image].nearest(points, repeat=texture.repeat)[..., :3].mean(axis=1)
