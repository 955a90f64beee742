"""Blender light -> Light, in Cycles' units; docs/lights.md has the formulas."""

from __future__ import annotations

from collections.abc import Callable, Hashable

import numpy as np

from .data import AreaShape, Array, Light, LightKind
from .nodes import light_emission, node_tree


def read_light(obj, matrix: Array, key: Hashable, warn: Callable[[str], None]) -> Light | None:
    """Read an evaluated light object; None for a light that gives no light.

    ``matrix`` is the (4, 4) world matrix of this very instance: a light inside a collection has several.
    """
    light = obj.data
    power = light_power(light, warn)
    if not any(value > 0.0 for value in power):
        return None
    kind = LightKind(light.type)
    common = dict(
        key=key,
        name=obj.name,
        kind=kind,
        power=power,
        world_from_light=matrix,
        casts_shadow=bool(light.use_shadow),
        # Cycles lights diffuse surfaces or not, it knows no factor: the ray visibility is the switch, Blender's slider scales.
        diffuse_factor=float(light.diffuse_factor) if obj.visible_diffuse else 0.0,
    )
    return Light(**common, **_shape(light, kind))


def light_power(light, warn: Callable[[str], None]) -> tuple[float, float, float]:
    """RGB power of a bpy light: energy, colour, temperature, exposure, nodes, and its size where it is not normalised."""
    color = np.array(light.color, np.float64)
    if light.use_temperature:
        color *= np.array(light.temperature_color, np.float64)
    power = color * light.energy * 2.0**light.exposure * _size_factor(light)
    tree = node_tree(light)
    if tree is not None:
        power *= np.array(light_emission(light.name, tree, warn))
    if not np.isfinite(power).all():
        warn(f"Light '{light.name}': its power is not a finite number; it is left out")
        return (0.0, 0.0, 0.0)
    return tuple(float(value) for value in power)


def _size_factor(light) -> float:
    """1 for a light whose power does not depend on its size (the default)."""
    return 1.0


def _shape(light, kind: LightKind) -> dict:
    if kind is LightKind.SUN:
        return {"angle": float(light.angle)}
    if kind is LightKind.AREA:
        shape = AreaShape(light.shape)
        square = shape in {AreaShape.SQUARE, AreaShape.DISK}
        size = (float(light.size), float(light.size if square else light.size_y))
        return {"area_shape": shape, "area_size": size, "area_spread": float(light.spread)}
    shape = {"radius": float(light.shadow_soft_size), "soft_falloff": bool(light.use_soft_falloff)}
    if kind is LightKind.SPOT:
        shape |= {"spot_angle": float(light.spot_size), "spot_blend": float(light.spot_blend)}
    return shape
