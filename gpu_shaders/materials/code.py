"""What a node's GLSL is made of: expressions, libraries, attributes, and the fields of the point that they look at."""

from __future__ import annotations

from dataclasses import dataclass, field

# What a shader can be asked for at a surface point, and its type; `uv`, `color` and `vector` with a number are
# attributes by name. Directions are of the world; `incoming` goes from the surface to the viewer.
POINT_FIELDS = {
    "position": "vec3",
    "normal": "vec3",
    "geometric_normal": "vec3",
    "tangent": "vec3",
    "incoming": "vec3",
    "backfacing": "float",
    "generated": "vec3",
    "object_position": "vec3",
    "object_normal": "vec3",
    "camera_position": "vec3",  # z grows away from the camera
    "world_from_object": "mat4",
    "camera_from_world": "mat4",
    "window": "vec3",
    "camera_ray": "float",
    "object_location": "vec3",
    "object_color": "vec4",
    "object_index": "float",
    "object_random": "float",
    "material_index": "float",
    "footprint": "float",  # angle that a sample of a world stands for, radians; 0: exactly one direction
    "uv": "vec2",
    "color": "vec4",
}


@dataclass(frozen=True)
class Attribute:
    """An attribute of the mesh by name: a UV map, or a colour with alpha, vector or number. "" means the active one."""

    field: str  # "uv" or "color"
    name: str


ACTIVE_UV = Attribute("uv", "")


@dataclass(frozen=True)
class Code:
    """What a node becomes. An output without an expression is not supported."""

    outputs: dict[str, str]
    libraries: tuple[str, ...] = ()
    setup: str = ""  # statements ahead of them; {v} is a name that no other node has
    attributes: dict[str, Attribute] = field(default_factory=dict)  # word in braces -> what it stands for
