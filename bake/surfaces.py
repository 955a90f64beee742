"""The triangles of a scene in world space, with the vertices that light is gathered at."""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Mapping
from dataclasses import dataclass

import numpy as np

from ..scene.data import Array, Image, Instance, Material, Mesh, Scene, Visibility

# Rays leave the surface by this part of the object's size, so that they do not hit the triangle they start on.
_LIFT = 1e-4
# Where in a triangle its colour is looked up: four points a side's worth, as barycentric coordinates.
_SPOTS = np.array([(i + 1, j + 1, 4 - i - j) for i in range(4) for j in range(4 - i)]) / 6.0


@dataclass(frozen=True, eq=False)
class Surfaces:
    """T triangles and V vertices of every instance that blocks light, and of those to be baked."""

    corners: Array  # (T, 3, 3) float64, world space
    triangle_vertices: Array  # (T, 3) int64: rows of the vertex arrays
    facing: Array  # (T, 3) float64: unit normal of each triangle, on the side of its vertices' normals
    reflectance: Array  # (T, channels) float64, 0..1: diffuse; one channel where all is grey
    blocks: Array  # (T,) bool: takes part in shadows
    positions: Array  # (V, 3) float64, world space, lifted off the surface: where rays start
    normals: Array  # (V, 3) float64, world space, unit
    runs: Mapping[Hashable, slice]  # Instance.key -> its rows of the vertex arrays


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


def gather(scene: Scene, bake: frozenset[Hashable]) -> Surfaces:
    """The surfaces of ``scene``. Instances named by ``bake`` are there even where they block no light."""
    used = [i for i in scene.instances if i.key in bake or i.visibility & Visibility.SHADOW]
    runs: dict[Hashable, slice] = {}
    parts: list[tuple[Array, ...]] = []
    count = 0
    for instance in used:
        mesh = scene.meshes[instance.mesh]
        first, vertices = mesh_vertices(mesh)
        corners, positions, normals = _placed(mesh, instance.world_from_object, first)
        facing = _facing(corners, normals[vertices.reshape(-1, 3)])
        blocks = np.full(len(corners), bool(instance.visibility & Visibility.SHADOW))
        colour = _reflectance(mesh, instance, scene)
        parts.append((corners, count + vertices.reshape(-1, 3), facing, colour, blocks, positions, normals))
        runs[instance.key] = slice(count, count + len(first))
        count += len(first)
    if not parts:
        raise ValueError("the scene has no surface that blocks light and none to bake")
    corners, rows, facing, colour, blocks, positions, normals = (np.concatenate(p) for p in zip(*parts, strict=True))
    if (colour == colour[:, :1]).all():
        colour = colour[:, :1]
    return Surfaces(corners, rows, facing, colour, blocks, positions, normals, runs)


def _placed(mesh: Mesh, matrix: Array, first: Array) -> tuple[Array, Array, Array]:
    """World-space corners of the triangles; lifted positions and unit normals of the vertices."""
    linear, offset = matrix[:3, :3].astype(np.float64), matrix[:3, 3]
    points = mesh.positions.astype(np.float64) @ linear.T + offset
    # Normals go by the cofactors: the inverse transposed, and still there where the object is scaled flat.
    cofactors = np.stack([np.cross(linear[1], linear[2]), np.cross(linear[2], linear[0]), np.cross(*linear[:2])])
    normals = mesh.normals[first].astype(np.float64) @ cofactors.T
    normals *= -1.0 if np.linalg.det(linear) < 0 else 1.0
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 0, normals / np.where(lengths > 0, lengths, 1), [0.0, 0.0, 1.0])
    size = np.linalg.norm(np.ptp(points, axis=0)) if len(points) else 0.0
    return points.reshape(-1, 3, 3), points[first] + normals * (_LIFT * size), normals


def _facing(corners: Array, normals: Array) -> Array:
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat *= np.where((flat * normals.sum(axis=1)).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    return flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)


def _reflectance(mesh: Mesh, instance: Instance, scene: Scene) -> Array:
    """(T, 3): the part of light that each triangle scatters, a texture averaged over it."""
    colours = np.zeros((mesh.triangle_count, 3))
    if not instance.visibility & Visibility.BOUNCE:
        return colours
    for slot, first, count in mesh.slots:
        material = scene.materials[instance.materials[min(slot, len(instance.materials) - 1)]]
        run = slice(first, first + count)
        colours[run] = material.base_color if material.base_color_texture is None else 0.0
        if material.base_color_texture is not None:
            colours[run] = _averages(mesh, run, material, scene.images)
        colours[run] *= (1.0 - material.metallic) * (1.0 - material.layered * np.array(material.specular))
    return colours.clip(0.0, 1.0)


def _averages(mesh: Mesh, run: slice, material: Material, images: Mapping[Hashable, Image]) -> Array:
    texture = material.base_color_texture
    assert texture is not None
    uvs = mesh.uvs.get(texture.uv_map or mesh.active_uv)
    if uvs is None:  # as in Blender: without a UV map all of it has one texel
        uvs = np.zeros((len(mesh.positions), 2), np.float32)
    points = np.einsum("kc,tcx->tkx", _SPOTS, uvs.reshape(-1, 3, 2)[run].astype(np.float64))
    pixels = images[texture.image].pixels
    size = np.array(pixels.shape[1::-1])
    texels = np.floor(points * size).astype(np.int64)
    texels = texels % size if texture.repeat else texels.clip(0, size - 1)
    return pixels[texels[..., 1], texels[..., 0], :3].mean(axis=1)
