"""Blender light -> Light, in Cycles' units; docs/lights.md has the formulas."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping

import numpy as np

from .cameras import FARTHEST
from .data import AreaShape, Array, Light, LightKind
from .nodes import RGB, active_output, find_input, node_tree, source, strength_and_color

MIN_SPREAD = math.radians(1.0)  # Blender allows 0, a laser that no grid of samples would ever hit
MAX_POWER = float(np.finfo(np.float32).max)
MAP_SCALES = {"EIGHTH": 0.125, "QUARTER": 0.25, "HALF": 0.5, "FULL": 1.0, "DOUBLE": 2.0, "QUADRUPLE": 4.0}
ROUND_SHAPES = {AreaShape.DISK, AreaShape.ELLIPSE}


def read_light(
    obj, matrix: Array, key: Hashable, lights: Mapping[str, bool], warn: Callable[[str], None]
) -> Light | None:
    """Read an evaluated light object; None for a light that gives no light.

    ``matrix`` is the (4, 4) world matrix of this very instance: a light inside a collection has several.
    ``lights`` is the ray visibility of the object and its instancer, "diffuse" and "glossy": Cycles' switches, where
    the factors are Blender's sliders.
    """
    light = obj.data
    kind = LightKind(light.type)
    if _is_portal(light) or (kind is not LightKind.POINT and not np.linalg.norm(matrix[:3, :3], axis=0).all()):
        return None
    broken = _broken_parameter(light, kind)
    if broken:
        warn(f"Light '{light.name}': its {broken} is not finite or too large; it is left out")
        return None
    shape = _shape(light, kind)
    power = light_power(light, kind, matrix, warn)
    if not any(power):
        return None
    return Light(
        key=key,
        name=obj.name,
        kind=kind,
        power=power,
        world_from_light=matrix,
        casts_shadow=bool(light.use_shadow),
        diffuse_factor=float(light.diffuse_factor) if lights["diffuse"] else 0.0,
        specular_factor=float(light.specular_factor) if lights["glossy"] else 0.0,
        **_bounce(light),
        **shape,
    )


def _bounce(light) -> dict[str, float]:
    """What Rebound's own settings of a light say; without them (it is not enabled) those of a new light."""
    own = getattr(light, "rebound", None)
    if own is None:
        return {}
    strength = float(own.bounce_strength) if own.use_bounce else 0.0
    return {"bounce": strength, "map_scale": MAP_SCALES.get(own.map_size, 1.0)}


def light_power(light, kind: LightKind, matrix: Array, warn: Callable[[str], None]) -> tuple[float, float, float]:
    """RGB power of a bpy light: energy, colour, temperature, exposure, nodes; its size too if it is not normalised."""
    color = np.array(light.color, np.float64)
    if light.use_temperature:
        color *= np.array(light.temperature_color, np.float64)
    power = color * light.energy * np.exp2(light.exposure)
    if not light.normalize:
        power *= normalization(light, kind, matrix)
    tree = node_tree(light)
    if tree is not None:
        power *= np.array(_emission(light.name, tree, warn))
    if not np.isfinite(power).all() or (power < 0.0).any():
        warn(f"Light '{light.name}': its power is negative or not a number; it is left out")
        return (0.0, 0.0, 0.0)
    power = np.minimum(power, MAX_POWER)
    return float(power[0]), float(power[1]), float(power[2])


def _emission(name: str, tree, warn: Callable[[str], None]) -> RGB:
    """What a light's nodes multiply its power by. Black where nothing is connected, as in Cycles."""
    owner = f"Light '{name}'"
    output = active_output(tree)
    surface = output and find_input(output, "Surface")
    if not surface or not surface.socket.is_linked:
        return (0.0, 0.0, 0.0)
    found = source(surface)
    if found.socket.is_output and found.node.bl_idname == "ShaderNodeEmission" and not found.node.mute:
        return strength_and_color(found, owner, "the socket's own value is used", warn)
    warn(f"{owner}: node '{found.node.name}' is not read yet; the light shines as if it had no nodes")
    return (1.0, 1.0, 1.0)


def normalization(light, kind: LightKind, matrix: Array) -> float:
    """What Cycles divides a normalised light's power by; one that is not normalised counts as this much stronger."""
    if kind is LightKind.SUN:
        half = light.angle / 2.0
        return math.pi * math.sin(half) ** 2 if half > 0.0 else 1.0
    if kind is LightKind.AREA:
        width, height = _area_size(light)
        scale = np.linalg.norm(matrix[:3, :2], axis=0)
        area = width * height * float(scale[0] * scale[1])
        return area * math.pi / 4.0 if AreaShape(light.shape) in ROUND_SHAPES else area
    area = 4.0 * math.pi * light.shadow_soft_size**2  # the object's scale does not count
    return area if area > 0.0 else 4.0


def _area_size(light) -> tuple[float, float]:
    square = AreaShape(light.shape) in {AreaShape.SQUARE, AreaShape.DISK}
    return float(light.size), float(light.size if square else light.size_y)


def _broken_parameter(light, kind: LightKind) -> str | None:
    """What Blender calls the first setting that nothing can be computed with; a power may be as large as it likes."""
    if not math.isfinite(light.energy):
        return "power"
    values = {
        "exposure": light.exposure,
        "diffuse factor": light.diffuse_factor,
        "specular factor": light.specular_factor,
    }
    if kind is LightKind.SUN:
        values["angle"] = light.angle
    elif kind is LightKind.AREA:
        width, height = _area_size(light)
        values |= {"size": width, "size Y": height, "spread": light.spread}
    else:
        values["radius"] = light.shadow_soft_size
    if kind is LightKind.SPOT:
        values |= {"spot size": light.spot_size, "spot blend": light.spot_blend}
    # Blender clamps infinity to the largest float; the first comparison is false for NaN.
    return next((name for name, value in values.items() if not abs(value) < FARTHEST), None)


def _shape(light, kind: LightKind) -> dict:
    if kind is LightKind.SUN:
        return {"angle": float(light.angle)}
    if kind is LightKind.AREA:
        spread = max(float(light.spread), MIN_SPREAD)
        return {"area_shape": AreaShape(light.shape), "area_size": _area_size(light), "area_spread": spread}
    shape = {"radius": float(light.shadow_soft_size), "soft_falloff": bool(light.use_soft_falloff)}
    if kind is LightKind.SPOT:
        shape |= {"spot_angle": float(light.spot_size), "spot_blend": float(light.spot_blend)}
    return shape


def _is_portal(light) -> bool:
    """A Cycles light portal guides rays and gives no light. The property exists while Cycles is enabled."""
    return light.type == "AREA" and bool(getattr(getattr(light, "cycles", None), "is_portal", False))
