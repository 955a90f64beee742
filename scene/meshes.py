"""Blender mesh -> Mesh: triangles expanded to corners, sorted by material slot.

The arrays are read through Blender's attribute layers and its triangle array, which costs a few milliseconds for a
million triangles; the slow per-item RNA path is never taken.
"""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Hashable, Iterable

import numpy as np

from .data import Array, Mesh

# By an attribute's type: what foreach_get is asked for, numbers an element, and their dtype.
LAYERS = {
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "INT8": ("value", 1, np.int8),
    "BOOLEAN": ("value", 1, np.bool_),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT2": ("vector", 2, np.float32),
    "INT32_2D": ("value", 2, np.int32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
    "QUATERNION": ("value", 4, np.float32),
    "FLOAT4X4": ("value", 16, np.float32),
}
# A triangle whose doubled area is below this share of its longest edge squared is a line within float32's precision.
FLATNESS = 1e-7


def mesh_key(mesh, wanted: tuple[str, ...] = ()) -> tuple:
    """Names the state of an evaluated bpy mesh, quickly: where it is the same, so is ``content_key``.

    The session uid of evaluated data is new after every evaluation of the geometry and shared by all instances.
    """
    return (mesh.session_uid, len(mesh.materials), _active_uv(mesh), *wanted)


def content_key(mesh, wanted: tuple[str, ...] = ()) -> Hashable:
    """The Mesh.key of a bpy mesh, the same for all whose arrays are: a second's work for some 20 million triangles."""
    return (_content_hash(mesh), len(mesh.materials), _active_uv(mesh), *wanted)


def read_mesh(mesh, key: Hashable, owner: str, wanted: tuple[str, ...] = ()) -> Mesh:
    """Read a bpy mesh into numpy. All arrays are copies: nothing refers to Blender's memory afterwards.

    ``owner`` names the object in warnings; ``wanted`` the attributes that are read, "" for the active colour. A mesh
    without one good triangle comes back with no triangles.
    """
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    if count == 0:
        return _empty(key, ())
    corners = _triangle_corners(mesh, count)
    triangle_points = _positions(mesh).take(_corner_vertices(mesh).take(corners), axis=0)
    good, bad_count, face_normals = _usable(triangle_points)
    warnings = ()
    if bad_count:
        warnings = (f"Object '{owner}': {bad_count} triangles have corners that are not finite; they are left out",)
    triangle_slots = _triangle_slots(mesh, count)
    order = _order_by_slot(triangle_slots, good)
    if len(order) == 0:
        return _empty(key, warnings)
    if not _is_identity(order, count):
        corners, triangle_points, face_normals = corners[order], triangle_points[order], face_normals[order]
    middle, half = (np.array(v, np.float32) for v in (mesh.texspace_location, mesh.texspace_size))
    flat = np.ascontiguousarray(corners).reshape(-1)
    points = np.ascontiguousarray(triangle_points).reshape(-1, 3)
    return Mesh(
        key=key,
        positions=points,
        normals=_normals(mesh, flat, face_normals),
        uvs=_uvs(mesh, flat),
        active_uv=_active_uv(mesh),
        slots=_slot_ranges(triangle_slots[order]),
        bounds=_bounds(points),
        warnings=warnings,
        attributes=_attributes(mesh, flat, order, wanted),
        texture_space=np.stack((middle - half, middle + half)),
    )


def _empty(key: Hashable, warnings: tuple[str, ...]) -> Mesh:
    nothing = np.zeros((0, 3), np.float32)
    return Mesh(key, nothing, nothing, {}, "", (), np.zeros((2, 3), np.float32), warnings)


def _triangle_corners(mesh, count: int) -> Array:
    """(T, 3) int32 corner indices: a view of Blender's own array, valid until the depsgraph changes."""
    first = mesh.loop_triangles[0].as_pointer()
    return np.ctypeslib.as_array((ctypes.c_int * (3 * count)).from_address(first)).reshape(count, 3)


def _layer(collection, name: str, width: int, dtype: type) -> Array:
    array = np.empty(len(collection) * width, dtype)
    collection.foreach_get(name, array)
    return array.reshape(-1, width) if width > 1 else array


def _positions(mesh) -> Array:
    return _layer(mesh.attributes["position"].data, "vector", 3, np.float32)


def _corner_vertices(mesh) -> Array:
    return _layer(mesh.attributes[".corner_vert"].data, "value", 1, np.int32)


def _triangle_slots(mesh, count: int) -> Array:
    """(T,) material slot of each triangle. An index beyond the slots means the last one, as in Blender."""
    attribute = mesh.attributes.get("material_index")
    last = max(len(mesh.materials), 1) - 1
    if attribute is None or attribute.domain != "FACE" or attribute.data_type != "INT" or last == 0:
        return np.zeros(count, np.int32)
    faces = _layer(attribute.data, "value", 1, np.int32)
    polygons = _layer(mesh.loop_triangle_polygons, "value", 1, np.int32)
    return np.clip(faces, 0, last).take(polygons)


def _usable(points: Array) -> tuple[Array, int, Array]:
    """Which of the (T, 3, 3) triangles can be drawn, how many have non-finite corners, and all unit face normals."""
    with np.errstate(all="ignore"):
        a, b = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
        normals = np.empty_like(a)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            normals[:, i] = a[:, j] * b[:, k] - a[:, k] * b[:, j]
        length = np.sqrt(np.einsum("ij,ij->i", normals, normals))
        longest = np.maximum(np.einsum("ij,ij->i", a, a), np.einsum("ij,ij->i", b, b))
        finite = np.isfinite(longest)  # not where any corner is not: what is subtracted from it is neither
        good = finite & (length > FLATNESS * longest)
        normals /= length[:, None]
    return good, int(len(points) - np.count_nonzero(finite)), normals


def _bounds(points: Array) -> Array:
    """(2, 3) lower and upper corner of (n, 3) points, column by column: along short rows numpy is 20 times as slow."""
    columns = [points[:, k] for k in range(3)]
    return np.array([[c.min() for c in columns], [c.max() for c in columns]], points.dtype)


def _order_by_slot(slots: Array, good: Array) -> Array:
    """Indices of the good triangles, ascending by slot and otherwise in Blender's order."""
    kept = np.flatnonzero(good)
    if not slots.any():
        return kept
    return kept[np.argsort(slots[kept], kind="stable")]


def _is_identity(order: Array, count: int) -> bool:
    return len(order) == count and bool((order[1:] > order[:-1]).all())


def _slot_ranges(slots: Array) -> tuple[tuple[int, int, int], ...]:
    if slots[0] == slots[-1]:  # sorted, so that all are
        return ((int(slots[0]), 0, len(slots)),)
    values, first, counts = np.unique(slots, return_index=True, return_counts=True)
    return tuple((int(v), int(f), int(c)) for v, f, c in zip(values, first, counts, strict=True))


def _normals(mesh, corners: Array, face_normals: Array) -> Array:
    """(3T, 3) shading normals; where Blender has none (a corner at a degenerate fan) the face's own stands in."""
    normals = _layer(mesh.corner_normals, "vector", 3, np.float32).take(corners, axis=0)
    with np.errstate(all="ignore"):
        length = np.einsum("ij,ij->i", normals, normals)
    bad = np.flatnonzero(~(np.abs(length - 1.0) < 0.01))
    if len(bad):
        normals[bad] = face_normals[bad // 3]
    return normals


def _uvs(mesh, corners: Array) -> dict[str, Array]:
    uvs = {}
    for layer in mesh.uv_layers:
        values = _layer(layer.uv, "vector", 2, np.float32)
        if not np.isfinite(values.sum()):
            values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
        uvs[layer.name] = values.take(corners, axis=0)
    return uvs


def _attributes(mesh, corners: Array, triangles: Array, wanted: Iterable[str]) -> dict[str, Array]:
    """(3T, 4) float32 each, a number as a grey and what has no alpha with 1. Those that are not there are left out."""
    found = {}
    for name in wanted:
        attribute = _attribute(mesh, name)
        layer = LAYERS.get(attribute.data_type) if attribute is not None else None
        if attribute is None or layer is None or layer[1] > 4 or attribute.domain not in {"POINT", "CORNER", "FACE"}:
            continue
        width = layer[1]
        values = _layer(attribute.data, *layer).reshape(-1, width)
        if attribute.domain == "POINT":
            rows = _corner_vertices(mesh).take(corners)
        elif attribute.domain == "CORNER":
            rows = corners
        else:
            rows = np.repeat(_layer(mesh.loop_triangle_polygons, "value", 1, np.int32)[triangles], 3)
        array = np.zeros((len(corners), 4), np.float32)
        array[:, 3] = 1.0
        array[:, : max(width, 3) if width == 1 else width] = values.take(rows, axis=0)
        found[name] = np.nan_to_num(array, nan=0.0, posinf=0.0, neginf=0.0)
    return found


def _attribute(mesh, name: str):
    """An attribute of a bpy mesh by name, "" for the colour that is marked for render; None where it is not there."""
    if name:
        return mesh.attributes.get(name)
    index = mesh.color_attributes.render_color_index
    return mesh.color_attributes[index] if 0 <= index < len(mesh.color_attributes) else None


def _active_uv(mesh) -> str:
    """The UV map marked for render (the camera icon), which is what a texture without a UV Map node uses."""
    for layer in mesh.uv_layers:
        if layer.active_render:
            return layer.name
    return mesh.uv_layers[0].name if len(mesh.uv_layers) else ""


def _content_hash(mesh) -> bytes:
    """Of all that `read_mesh` might read: triangles, normals, and every attribute that is not an edge's or hidden."""
    mesh.calc_loop_triangles()
    digest = hashlib.blake2b(digest_size=16)
    count = len(mesh.loop_triangles)
    if count:
        digest.update(_triangle_corners(mesh, count).data)
        digest.update(_corner_vertices(mesh).data)
        digest.update(_layer(mesh.loop_triangle_polygons, "value", 1, np.int32).data)
        digest.update(_layer(mesh.corner_normals, "vector", 3, np.float32).data)
    for attribute in mesh.attributes:
        known = LAYERS.get(attribute.data_type)
        if known and attribute.domain != "EDGE" and not attribute.name.startswith("."):
            digest.update(f"{attribute.name} {attribute.domain} {attribute.data_type}".encode())
            digest.update(_layer(attribute.data, *known).data)
    digest.update(np.array((*mesh.texspace_location, *mesh.texspace_size), np.float32).data)
    return digest.digest()
