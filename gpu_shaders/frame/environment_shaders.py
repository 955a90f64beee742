"""Programs that evaluate a world's graph: for its map, and for the background of a picture."""

from __future__ import annotations

from ...device.shader import Shader
from ...device.structs import Struct
from ...scene.node_graph import COLOR, FLOAT, SHADER, Input, Node, NodeGraph, Slot
from ...scene.node_graph import Link as GraphLink
from ..materials import MaterialShader, generate
from ..materials.code import POINT_FIELDS

WORLD_VIEW = Struct(
    "WorldView",
    world_from_clip="mat4",  # of the view turned only: its eye is the origin
    camera_from_world="mat4",  # turned only, z grows away from the camera
    eye="vec4",  # FrameInputs.eye
    size="vec2",  # pixels
)

# What a direction D stands for, as in Cycles: it is the place, and seen from where the surface would face.
_FIELDS = {
    "position": "D",
    "generated": "D",
    "object_position": "D",
    "normal": "-D",
    "geometric_normal": "-D",
    "object_normal": "-D",
    "incoming": "-D",
    "camera_position": "(camera_from_world * vec4(D, 0.0)).xyz",
    "camera_from_world": "camera_from_world",
    "world_from_object": "mat4(1.0)",
    "window": "window",
    "camera_ray": "camera_ray",
    "footprint": "footprint",
}
_LIBRARY = "frame/environment_graph_lib.glsl"


def _library(shader: MaterialShader) -> str:
    """The generated file, and a function that gives the radiance from a direction."""

    def zero(name: str) -> str:
        base, _, number = name.rpartition("_")
        return f"{POINT_FIELDS[base if number.isdigit() else name]}(0.0)"

    fields = "".join(f"  point.{name} = {_FIELDS.get(name) or zero(name)};\n" for name in shader.needs)
    return (
        f"{shader.text}\n"
        "vec3 graph_radiance(vec3 D, float camera_ray, float footprint, vec3 window, mat4 camera_from_world)\n{\n"
        f"  MaterialPoint point;\n{fields}"
        "  return clamp(material_surface(point).emission, vec3(0.0), vec3(1e30));\n}\n"
    )


def map_shader(graph: NodeGraph) -> Shader:
    """Draws a world's octahedral map: means over ``pc_steps`` x ``pc_steps`` directions a texel."""
    shader = generate(graph)
    return Shader(
        name="environment_map",
        fragment="frame/environment_map_frag.glsl",
        files={_LIBRARY: _library(shader)},
        outputs={"out_radiance": "VEC4"},
        samplers=shader.samplers,
        constants={"pc_values": "INT", "pc_side": "FLOAT", "pc_steps": "INT"},
        defines=shader.defines,
    )


def background_shader(graph: NodeGraph) -> Shader:
    """Draws a world where the G-buffer has no surface."""
    shader = generate(graph)
    return Shader(
        name="environment_background",
        fragment="frame/environment_background_frag.glsl",
        files={_LIBRARY: _library(shader)},
        outputs={"out_emission": "VEC4"},
        samplers={"albedo_tx": "FLOAT_2D", **shader.samplers},
        uniforms={"world_view": WORLD_VIEW},
        constants={"pc_values": "INT"},
        defines=shader.defines,
    )


# A world of one colour: what the checks that know no world compile.
_PLAIN = NodeGraph(
    (
        Node(
            "ShaderNodeBackground",
            (Input("Color", COLOR, Slot(0, COLOR)), Input("Strength", FLOAT, Slot(3, FLOAT))),
            (("Background", SHADER),),
        ),
    ),
    GraphLink(0, "Background"),
)
SHADERS = (map_shader(_PLAIN), background_shader(_PLAIN))
