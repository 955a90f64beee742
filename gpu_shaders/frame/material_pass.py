"""Passes that ask surfaces for their material: a program for what is the same all over, and one for each node graph."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

from ...device.shader import Shader
from ..materials import MaterialShader
from .structs import MATERIAL_VIEW

# What a material can be asked with, in the terms of a MaterialPlace `place`, of its Instance and of the view.
FIELDS = {
    "position": "place.position",
    "normal": "place.normal",
    "geometric_normal": "place.geometric",
    "tangent": "material_tangent(place.normal)",
    "incoming": "place.toward",
    "backfacing": "place.backfacing",
    "generated": "(place.object_position - instance.texture_origin) * instance.texture_scale",
    "object_position": "place.object_position",
    "object_normal": "normalize(place.normal * mat3(instance.world_from_object))",
    "camera_position": "(material_view.camera_from_world * vec4(place.position, 1.0)).xyz",
    "world_from_object": "instance.world_from_object",
    "camera_from_world": "material_view.camera_from_world",
    "window": "material_window(material_view.window_from_world * vec4(place.position, 1.0))",
    "camera_ray": "float(MATERIAL_CAMERA_RAY)",
    "object_location": "instance.world_from_object[3].xyz",
    "object_color": "instance.color",
    "object_index": "instance.index",
    "object_random": "instance.random",
    "material_index": "material_fetch(material_tx, MATERIAL_INDEX).index",
}
SIZES = {"uv": ("VEC2", "vec2"), "color": ("VEC4", "vec4")}
SWIZZLES = {"uv": "xy", "color": "xyzw"}
_POINT_ATTRIBUTE = """vec4 point_attribute(int number)
{
  int at = v_point * pc_attributes + number;
  return texelFetch(attribute_tx, ivec2(at % ATTRIBUTE_WIDTH, at / ATTRIBUTE_WIDTH), 0);
}

"""
_PLACES = """vec3 material_tangent(vec3 normal)
{
  vec3 around = vec3(-normal.y, normal.x, 0.0);
  return dot(around, around) > 0.0 ? normalize(around) : vec3(1.0, 0.0, 0.0);
}

vec3 material_window(vec4 clip)
{
  return vec3(0.5 + 0.5 * clip.xy / clip.w, 0.0);
}
"""


def attribute_sampler(field: str) -> str:
    """The texture of one of ``MaterialShader.mesh_fields``, where meshes are drawn."""
    return f"{field}_tx"


@lru_cache(maxsize=4096)
def material_program(plain: Shader, code: MaterialShader | None, passes: bool = False, culls: bool = False) -> Shader:
    """The variant of a pass for a graph. ``plain``: its declaration for constants; ``passes``: some light goes through;
    ``culls``: nothing is drawn of the backs of faces.

    Where it draws meshes it gets their attributes from `uv_tx`, `uv_0_tx`, `color_1_tx`, …; a pass that does not, from
    attribute_tx, in the order of ``MaterialShader.mesh_fields`` for each point.
    """
    passing = _defines(PASSES=passes, CULLS=culls)
    if code is None:
        return replace(plain, defines=(*plain.defines, *passing)) if passing else plain
    meshes = "chunk_tx" in plain.samplers
    asks_view = any(FIELDS.get(need, "").find("material_view") >= 0 for need in code.needs)
    # Of fields that need the instance, those of a point are always there.
    asks_object = meshes and any(word in FIELDS.get(n, "") for n in code.needs for word in ("instance", "object_pos"))
    drawn = _defines(GRAPH=meshes, OBJECT=asks_object)
    files = {"frame/material_lib.glsl": _evaluate(code, meshes)}
    varyings = dict(plain.varyings)
    samplers = {**plain.samplers, **code.samplers}
    if meshes:
        files["frame/material_corner_lib.glsl"] = _corner(code)
        varyings |= {f"v_{name}": SIZES[a.field][0] for name, a in code.mesh_fields.items()}
        samplers |= dict.fromkeys(map(attribute_sampler, code.mesh_fields), "FLOAT_2D")
        varyings |= {"v_object_position": "VEC3"} if asks_object else {}
    return replace(
        plain,
        varyings=varyings,
        samplers=samplers,
        uniforms={**plain.uniforms, **({"material_view": MATERIAL_VIEW} if asks_view else {})},
        constants=plain.constants if meshes else {**plain.constants, "pc_values": "INT"},
        defines=(*plain.defines, *code.defines, *passing, *drawn),
        files={**plain.files, **files},
    )


def _defines(**wanted: bool) -> tuple[tuple[str, str], ...]:
    return tuple((f"MATERIAL_{name}", "1") for name, is_wanted in wanted.items() if is_wanted)


def _evaluate(code: MaterialShader, meshes: bool) -> str:
    """The file in the place of frame/material_lib.glsl."""
    attributes: Mapping[str, str] = {
        name: f"v_{name}" if meshes else f"{SIZES[a.field][1]}(point_attribute({number}))"
        for number, (name, a) in enumerate(code.mesh_fields.items())
    }
    given = {need: attributes.get(need) or FIELDS[need] for need in code.needs}
    attribute_line = "" if meshes else _POINT_ATTRIBUTE
    object_line = "  Instance instance = instance_fetch(instance_tx, place.instance);\n"
    fields = "".join(f"  point.{need} = {expression};\n" for need, expression in given.items())
    return (
        f'#include "frame/surface_lib.glsl"\n{attribute_line}{code.text}\n'
        f'#include "frame/material_graph_lib.glsl"\n{_PLACES}\n'
        "Surface material_evaluate(inout MaterialPlace place)\n{\n"
        f"{object_line if 'instance.' in fields else ''}  MaterialPoint point;\n{fields}"
        "  return material_surface_of(material_surface(point), place);\n}\n"
    )


def _corner(code: MaterialShader) -> str:
    lines = "".join(
        f"  v_{name} = texelFetch({attribute_sampler(name)}, texel, 0).{SWIZZLES[a.field]};\n"
        for name, a in code.mesh_fields.items()
    )
    at = "  ivec2 texel = mesh_texel(on_page);\n" if lines else ""
    return f'#include "frame/mesh_lib.glsl"\n\nvoid material_corner(int on_page)\n{{\n{at}{lines}}}\n'
