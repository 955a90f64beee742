"""Blender's hair curves, particle hair and point clouds -> Mesh, as the tubes and balls of strands.py."""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Iterator

import numpy as np

from .data import Array, Mesh
from .strands import Curves, Triangles, balls, tubes

CURVE_RADIUS, POINT_RADIUS = 0.005, 0.01  # metres: Cycles', of curves and of points without the attribute
SURFACE_UV = "surface_uv_coordinate"  # the attribute that says where on a surface a curve grows
CATMULL_ROM, POLY, BEZIER, NURBS = range(4)


class HairReader:
    """Makes meshes of what has no triangles; ``previous`` are the last scene's, by their content."""

    def __init__(self, previous) -> None:
        self._previous = previous

    def read(self, obj, warn) -> Mesh:
        """The mesh of a CURVES or POINTCLOUD object."""
        data = obj.data
        if obj.type == "POINTCLOUD":
            points, radii = _values(data, "position", 3), _radii(data, len(data.points), POINT_RADIUS)
            return self._mesh(("balls", _hashed(points, radii)), 0, lambda: balls(points, radii))
        curves = _curves(data)
        kinds = _values(data, "curve_type", 1, len(data.curves), np.int8)
        if (kinds == NURBS).any():
            warn(f"Object '{obj.name}': its NURBS curves are drawn through their control points")
        return self._tubes(curves, 0, SURFACE_UV)

    def particles(self, obj, system, *, for_viewport: bool) -> Mesh:
        """The mesh of a particle system's strands, in the space of its object."""
        curves = _strands(obj, system, for_viewport)
        maps = obj.data.uv_layers
        active = next((layer.name for layer in maps if layer.active_render), SURFACE_UV)
        return self._tubes(curves, max(system.settings.material - 1, 0), active)

    def _tubes(self, curves: Curves, slot: int, uv_map: str) -> Mesh:
        arrays = [curves.points, curves.radii, curves.offsets, curves.cyclic, curves.straight]
        arrays += [array for array in (curves.uvs, curves.bezier, *(curves.handles or ())) if array is not None]
        return self._mesh(("tubes", _hashed(*arrays), slot, uv_map), slot, lambda: tubes(curves), uv_map)

    def _mesh(self, key: Hashable, slot: int, make, uv_map: str = "") -> Mesh:
        return self._previous.get(key) or _mesh(key, make(), slot, uv_map)


def has_strands(system) -> bool:
    """Whether a particle system is drawn as hair."""
    return system.settings.type == "HAIR" and system.settings.render_type == "PATH"


def _mesh(key: Hashable, found: Triangles, slot: int, uv_map: str) -> Mesh:
    count = len(found.positions) // 3
    bounds = np.stack((found.positions.min(0), found.positions.max(0))) if count else np.zeros((2, 3), np.float32)
    uvs = {} if found.uvs is None else {uv_map: found.uvs}
    return Mesh(
        key=key,
        positions=found.positions,
        normals=found.normals,
        uvs=uvs,
        active_uv=uv_map if uvs else "",
        slots=((slot, 0, count),) if count else (),
        bounds=bounds,
    )


def _curves(data) -> Curves:
    """A Curves data-block's arrays."""
    points, count = _values(data, "position", 3), len(data.curves)
    offsets = np.empty(count + 1, np.int32)
    if count:
        data.curve_offset_data.foreach_get("value", offsets)
    kinds = _values(data, "curve_type", 1, count, np.int8)
    bezier = kinds == BEZIER
    handles = None
    if bezier.any() and "handle_left" in data.attributes and "handle_right" in data.attributes:
        handles = _values(data, "handle_left", 3), _values(data, "handle_right", 3)
    cyclic = _values(data, "cyclic", 1, count, np.bool_)
    uvs = _values(data, SURFACE_UV, 2) if SURFACE_UV in data.attributes else None
    if uvs is not None and len(uvs) != count:
        uvs = None
    straight = (kinds == POLY) | (kinds == NURBS)
    return Curves(points, _radii(data, len(points), CURVE_RADIUS), offsets, cyclic, straight, uvs, handles, bezier)


_FIELDS = {"FLOAT_VECTOR": "vector", "FLOAT2": "vector"}


def _values(data, name: str, width: int, count: int = 0, dtype: type = np.float32) -> Array:
    """An attribute; where there is none, ``count`` zeros."""
    attribute = data.attributes.get(name)
    if attribute is None:
        return np.zeros((count, width) if width > 1 else count, dtype)
    array = np.empty(len(attribute.data) * width, dtype)
    attribute.data.foreach_get(_FIELDS.get(attribute.data_type, "value"), array)
    return array.reshape(-1, width) if width > 1 else array


def _radii(data, count: int, otherwise: float) -> Array:
    found = "radius" in data.attributes
    return _values(data, "radius", 1) if found else np.full(count, otherwise, np.float32)


def _strands(obj, system, for_viewport: bool) -> Curves:
    """A particle system's hair as Cycles takes it: children in the place of their parents, where there are any."""
    settings = system.settings
    steps = 2 ** (settings.display_step if for_viewport else settings.render_step) + 1
    if settings.kink == "SPIRAL":
        steps += settings.kink_extra_steps
    parents, children = len(system.particles), len(system.child_particles)
    if for_viewport:
        children = int(children * settings.display_percentage / 100)
    has_children = settings.child_type != "NONE" and children > 0
    numbers = range(parents, parents + children) if has_children else range(parents)
    world = [system.co_hair(obj, particle_no=n, step=s) for n, s in _each(numbers, steps)]
    world = np.array(world, np.float64).reshape(-1, 3)
    inverse = np.array(obj.matrix_world.inverted_safe())
    points = (world @ inverse[:3, :3].T + inverse[:3, 3]).reshape(-1, steps, 3).astype(np.float32)
    count = len(points)
    along = np.concatenate([np.zeros((count, 1)), np.cumsum(np.linalg.norm(np.diff(points, axis=1), axis=2), 1)], 1)
    lengths = along[:, -1:]
    radii = _shaped_radii(settings, along / np.where(lengths > 0, lengths, 1.0))
    return Curves(
        points.reshape(-1, 3),
        radii.astype(np.float32).ravel(),
        np.arange(count + 1) * steps,
        np.zeros(count, bool),
        np.zeros(count, bool),
        _roots(obj, system, numbers),
    )


def _each(numbers: range, steps: int) -> Iterator[tuple[int, int]]:
    return ((number, step) for number in numbers for step in range(steps))


def _shaped_radii(settings, part: Array) -> Array:
    """Radii at a part of each strand's length, by the settings' shape (Cycles' formula)."""
    root, tip = (0.5 * settings.radius_scale * size for size in (settings.root_radius, settings.tip_radius))
    rest = 1.0 - part
    if settings.shape != 0.0:
        rest = rest ** (1.0 + settings.shape if settings.shape < 0.0 else 1.0 / max(1.0 - settings.shape, 1e-6))
    radii = rest * (root - tip) + tip
    if settings.use_close_tip:
        radii[:, -1] = 0.0
    return radii


def _roots(obj, system, numbers: range) -> Array | None:
    """(c, 2) UV coordinates where the strands grow."""
    modifier = next((m for m in obj.modifiers if m.type == "PARTICLE_SYSTEM" and m.particle_system == system), None)
    layer = next((n for n, map_ in enumerate(obj.data.uv_layers) if map_.active_render), None)
    if modifier is None or layer is None or not numbers:
        return None
    parents = len(system.particles)
    found = []
    for number in numbers:
        particle = system.particles[number if number < parents else 0]
        found.append(system.uv_on_emitter(modifier, particle=particle, particle_no=number, uv_no=layer))
    return np.array(found, np.float32)


def _hashed(*arrays: Array) -> bytes:
    digest = hashlib.blake2b(digest_size=16)
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()
