"""The GLSL of each kind of node: an expression for each output, with its inputs and options in braces."""

from __future__ import annotations

from collections.abc import Callable

from ...scene.node_graph import Node
from . import texture_code, value_code
from .code import Attribute, Code


def is_supported(kind: str) -> bool:
    """Whether a node of this Blender type can be expressed."""
    return kind in _CODE


def gives(node: Node, output: str) -> bool:
    """Whether an output of a supported node can be expressed."""
    return output in code_of(node).outputs


def supported_kinds() -> tuple[str, ...]:
    """Every kind that can be, in the order of the table."""
    return tuple(_CODE)


def code_of(node: Node) -> Code:
    """The code of a supported node; KeyError for another."""
    code = _CODE[node.kind]
    return code if isinstance(code, Code) else code(node)


# --- Places ----------------------------------------------------------------------------------------------------------

_COORDINATES = Code(
    {
        "Generated": "point.generated", "Normal": "point.object_normal", "UV": "vec3(point.uv, 0.0)",
        "Object": "point.object_position", "Camera": "point.camera_position", "Window": "point.window",
        "Reflection": "-reflect(point.incoming, point.normal)",
    }
)  # fmt: skip
_GEOMETRY = Code(
    {
        "Position": "point.position", "Normal": "point.normal", "Tangent": "point.tangent",
        "True Normal": "point.geometric_normal", "Incoming": "point.incoming", "Backfacing": "point.backfacing",
        "Pointiness": "0.5", "Random Per Island": "point.object_random", "Parametric": "vec3(0.0)",
    }
)  # fmt: skip
_OBJECT = Code(
    {
        "Location": "point.object_location", "Color": "point.object_color.rgb", "Alpha": "point.object_color.a",
        "Object Index": "point.object_index", "Material Index": "point.material_index",
        "Random": "point.object_random",
    }
)  # fmt: skip
# What is not seen from the camera is lit diffusely: nothing else asks for a surface. Blocked light asks for none.
_LIGHT_PATH = Code(
    {
        "Is Camera Ray": "point.camera_ray", "Ray Length": "length(point.camera_position)",
        "Is Diffuse Ray": "1.0 - point.camera_ray", "Is Reflection Ray": "1.0 - point.camera_ray",
        "Ray Depth": "1.0 - point.camera_ray", "Diffuse Depth": "1.0 - point.camera_ray",
        **dict.fromkeys(("Is Shadow Ray", "Is Glossy Ray", "Is Singular Ray", "Is Transmission Ray"), "0.0"),
        **dict.fromkeys(("Is Volume Scatter Ray", "Glossy Depth", "Transparent Depth", "Transmission Depth"), "0.0"),
        "Portal Depth": "0.0",
    }
)  # fmt: skip


def _uv_map(node: Node) -> Code:
    return Code({"UV": "vec3({map}, 0.0)"}, attributes={"map": Attribute("uv", str(node.option("uv_map")))})


def _color_attribute(node: Node) -> Code:
    named = Attribute("color", str(node.option("layer_name")))
    return Code({"Color": "{named}.rgb", "Alpha": "{named}.a"}, attributes={"named": named})


def _attribute(node: Node) -> Code:
    named = Attribute("color", str(node.option("attribute_name")))
    outputs = {
        "Color": "{named}.rgb",
        "Vector": "{named}.rgb",
        "Alpha": "{named}.a",
        "Fac": "dot({named}.rgb, vec3(1.0 / 3.0))",
    }
    return Code(outputs, attributes={"named": named})


# What a surface is not told about itself is what it would be in the plainest case: a flat place, no wire, not of hair.
_BEVEL = Code({"Normal": "{Normal}"})
_OCCLUSION = Code({"Color": "{Color}", "AO": "1.0"})
_WIREFRAME = Code({"Fac": "0.0"})
_HAIR_INFO = Code(
    {
        **dict.fromkeys(("Is Strand", "Intercept", "Length", "Thickness"), "0.0"),
        "Tangent Normal": "point.tangent", "Random": "point.object_random",
    }
)  # fmt: skip
_PARTICLE_INFO = Code(
    {
        **dict.fromkeys(("Index", "Age", "Lifetime", "Size"), "0.0"), "Random": "point.object_random",
        "Location": "point.object_location", "Velocity": "vec3(0.0)", "Angular Velocity": "vec3(0.0)",
    }
)  # fmt: skip
_POINT_INFO = Code({"Position": "point.position", "Radius": "0.0", "Random": "point.object_random"})


def _tangent(node: Node) -> Code:
    if node.option("direction_type") == "UV_MAP":
        return Code({"Tangent": "point.tangent"})
    call = f"vector_around_{str(node.option('axis')).lower()}(point.generated - 0.5)"
    around = f"vector_transform_normal({call}, point.world_from_object)"
    return Code({"Tangent": f"vector_normalize(cross(point.normal, cross({around}, point.normal)))"}, ("vector",))


# As far as the camera is what light fell off on its way to; what is not seen from it is told no distance.
_LIGHT_FALLOFF = Code(
    {"Quadratic": "{v}_k", "Linear": "{v}_k * {v}_far", "Constant": "{v}_k * {v}_far * {v}_far"},
    (),
    "float {v}_far = point.camera_ray > 0.0 ? length(point.camera_position) : 1.0; "
    "float {v}_k = {Strength} * ({Smooth} > 0.0 ? {v}_far * {v}_far / ({Smooth} + {v}_far * {v}_far) : 1.0);",
)

_CAMERA = Code(
    {
        "View Vector": "normalize(point.camera_position)",
        "View Z Depth": "point.camera_position.z",
        "View Distance": "length(point.camera_position)",
    }
)


def _normal_map(node: Node) -> Code:
    space, uv_map = str(node.option("space")), str(node.option("uv_map"))
    color = "({Color} * vec3(1.0, -1.0, 1.0) + vec3(0.0, 1.0, 0.0))" if dict(node.options).get(
        "convention") == "DIRECTX" else "{Color}"  # fmt: skip
    if space == "TANGENT":
        call = f"relief_tangent_map({color}, {{Strength}}, point.normal, point.position, {{map}})"
        return Code({"Normal": call}, ("relief",), attributes={"map": Attribute("uv", uv_map)})
    mapped = f"2.0 * {color} - 1.0"
    if space.startswith("BLENDER"):
        mapped = f"({mapped}) * vec3(1.0, -1.0, -1.0)"
    if space.endswith("OBJECT"):
        mapped = f"vector_transform_normal({mapped}, point.world_from_object)"
    return Code({"Normal": f"relief_mixed({mapped}, {{Strength}}, point.normal)"}, ("relief", "vector"))


def _bump(node: Node) -> Code:
    distance = "-{Distance}" if node.option("invert") else "{Distance}"
    call = f"relief_bump({{Height}}, {{Strength}}, {distance}, {{Normal}}, point.position)"
    return Code({"Normal": call}, ("relief",))


# Matrices to the world and from it; the camera's are of one length, so its inverse is cheap enough to leave to GLSL.
_TO_WORLD = {"OBJECT": "point.world_from_object", "CAMERA": "inverse(point.camera_from_world)"}
_FROM_WORLD = {"OBJECT": "inverse(point.world_from_object)", "CAMERA": "point.camera_from_world"}


def _vector_transform(node: Node) -> Code:
    kind, value = str(node.option("vector_type")), "{Vector}"
    start, end = str(node.option("convert_from")), str(node.option("convert_to"))
    for matrix in (_TO_WORLD.get(start), _FROM_WORLD.get(end)) if start != end else ():
        if matrix:
            value = {
                "POINT": f"({matrix} * vec4({value}, 1.0)).xyz",
                "VECTOR": f"mat3({matrix}) * ({value})",
                "NORMAL": f"vector_transform_normal({value}, {matrix})",
            }[kind]
    return Code({"Vector": value}, ("vector",))


# --- Shaders ---------------------------------------------------------------------------------------------------------

_PRINCIPLED = Code(
    {
        "BSDF": "surface_over(surface_principled(SurfacePrincipled({Base Color}, {Metallic}, {Roughness}, {IOR}, "
        "{Specular IOR Level}, {Specular Tint}, {Transmission Weight}, {Alpha}), {Normal}), {Alpha}, "
        "{Emission Color} * {Emission Strength}, {Sheen Tint} * {Sheen Weight}, {Coat Weight}, {Coat IOR}, "
        "{Coat Roughness})"
    },
    ("surface",),
)


def _metallic(node: Node) -> Code:
    conductor = node.option("fresnel_type") == "PHYSICAL_CONDUCTOR"
    color = "surface_conductor({IOR}, {Extinction})" if conductor else "{Base Color}"
    return Code({"BSDF": f"surface_metal({color}, {{Roughness}}, {{Normal}})"}, ("surface",))


def _toon(node: Node) -> Code:
    glossy = node.option("component") == "GLOSSY"
    call = "surface_glossy({Color}, {Size}, {Normal})" if glossy else "surface_diffuse({Color}, {Normal})"
    return Code({"BSDF": call}, ("surface",))


_DIFFUSE = Code({"BSDF": "surface_diffuse({Color}, {Normal})"}, ("surface",))
_SHEEN = Code({"BSDF": "surface_diffuse({Color} * SURFACE_SHEEN, {Normal})"}, ("surface",))
_SPECULAR = Code(
    {
        "BSDF": "surface_specular({Base Color}, {Specular}, {Roughness}, {Emissive Color}, {Transparency}, {Normal}, "
        "{Clear Coat}, {Clear Coat Roughness})"
    },
    ("surface",),
)

_CODE: dict[str, Code | Callable[[Node], Code]] = {
    "ShaderNodeBsdfPrincipled": _PRINCIPLED,
    "ShaderNodeBsdfDiffuse": _DIFFUSE,
    "ShaderNodeBsdfTranslucent": _DIFFUSE,
    "ShaderNodeBsdfToon": _toon,
    "ShaderNodeBsdfSheen": _SHEEN,
    "ShaderNodeEeveeSpecular": _SPECULAR,
    "ShaderNodeSubsurfaceScattering": Code({"BSSRDF": "surface_diffuse({Color}, {Normal})"}, ("surface",)),
    "ShaderNodeBsdfAnisotropic": Code({"BSDF": "surface_glossy({Color}, {Roughness}, {Normal})"}, ("surface",)),
    "ShaderNodeBsdfMetallic": _metallic,
    "ShaderNodeBsdfGlass": Code({"BSDF": "surface_glass({Color}, {Roughness}, {IOR}, {Normal})"}, ("surface",)),
    "ShaderNodeBsdfRefraction": Code(
        {"BSDF": "surface_refraction({Color}, {Roughness}, {IOR}, {Normal})"}, ("surface",)
    ),
    "ShaderNodeBsdfTransparent": Code({"BSDF": "surface_transparent({Color}, point.normal)"}, ("surface",)),
    "ShaderNodeEmission": Code({"Emission": "surface_emission({Color}, {Strength}, point.normal)"}, ("surface",)),
    "ShaderNodeBackground": Code({"Background": "surface_emission({Color}, {Strength}, point.normal)"}, ("surface",)),
    "ShaderNodeMixShader": Code({"Shader": "surface_mix({Shader}, {Shader_001}, {Fac})"}, ("surface",)),
    "ShaderNodeAddShader": Code({"Shader": "surface_add({Shader}, {Shader_001})"}, ("surface",)),
    "ShaderNodeTexImage": texture_code.image,
    "ShaderNodeTexEnvironment": texture_code.environment,
    "ShaderNodeTexNoise": texture_code.noise,
    "ShaderNodeTexVoronoi": texture_code.voronoi,
    "ShaderNodeTexWhiteNoise": texture_code.white_noise,
    "ShaderNodeTexWave": texture_code.wave,
    "ShaderNodeTexGradient": Code(
        {
            "Color": "vec3(clamp(pattern_gradient_{gradient_type}({Vector}), 0.0, 1.0))",
            "Fac": "clamp(pattern_gradient_{gradient_type}({Vector}), 0.0, 1.0)",
        },
        ("pattern",),
    ),
    "ShaderNodeTexChecker": Code(
        {"Color": "mix({Color2}, {Color1}, {v}_k)", "Fac": "{v}_k"},
        ("pattern",),
        "float {v}_k = pattern_checker({Vector}, {Scale});",
    ),
    "ShaderNodeTexBrick": texture_code.BRICK,
    "ShaderNodeTexMagic": Code(
        {"Color": "{v}_m", "Fac": "dot({v}_m, vec3(1.0 / 3.0))"},
        ("pattern",),
        "vec3 {v}_m = pattern_magic({Vector} * {Scale}, int({turbulence_depth}), {Distortion});",
    ),
    "ShaderNodeValToRGB": value_code.RAMP,
    "ShaderNodeRGBCurve": value_code.curves("Color"),
    "ShaderNodeVectorCurve": value_code.curves("Vector"),
    "ShaderNodeFloatCurve": value_code.FLOAT_CURVE,
    "ShaderNodeMath": value_code.math,
    "ShaderNodeVectorMath": value_code.vector_math,
    "ShaderNodeMapRange": value_code.map_range,
    "ShaderNodeClamp": value_code.clamp,
    "ShaderNodeMapping": value_code.mapping,
    "ShaderNodeVectorRotate": value_code.vector_rotate,
    "ShaderNodeMix": value_code.mix,
    "ShaderNodeMixRGB": value_code.mix_rgb,
    "ShaderNodeInvert": Code({"Color": "mix({Color}, 1.0 - {Color}, {Fac})"}),
    "ShaderNodeGamma": Code({"Color": "color_gamma({Color}, {Gamma})"}, ("color",)),
    "ShaderNodeHueSaturation": Code(
        {"Color": "color_adjust_hsv({Color}, {Hue}, {Saturation}, {Value}, {Fac})"}, ("color",)
    ),
    "ShaderNodeBrightContrast": Code({"Color": "color_bright_contrast({Color}, {Bright}, {Contrast})"}, ("color",)),
    "ShaderNodeBlackbody": Code({"Color": "color_blackbody({Temperature})"}, ("color",)),
    "ShaderNodeRGBToBW": Code({"Val": "color_gray({Color})"}, ("color",)),
    "ShaderNodeSeparateColor": value_code.separate,
    "ShaderNodeCombineColor": value_code.combine,
    "ShaderNodeSeparateXYZ": Code({"X": "{Vector}.x", "Y": "{Vector}.y", "Z": "{Vector}.z"}),
    "ShaderNodeCombineXYZ": Code({"Vector": "vec3({X}, {Y}, {Z})"}),
    "ShaderNodeSeparateRGB": Code({"R": "{Image}.x", "G": "{Image}.y", "B": "{Image}.z"}),
    "ShaderNodeCombineRGB": Code({"Image": "vec3({R}, {G}, {B})"}),
    "ShaderNodeFresnel": Code({"Fac": "fresnel_node({IOR}, {Normal}, point.incoming, point.backfacing)"}, ("fresnel",)),
    "ShaderNodeLayerWeight": Code(
        {
            "Fresnel": "fresnel_weight({Blend}, {Normal}, point.incoming, point.backfacing)",
            "Facing": "fresnel_facing({Blend}, {Normal}, point.incoming)",
        },
        ("fresnel",),
    ),
    "ShaderNodeTexCoord": _COORDINATES,
    "ShaderNodeNewGeometry": _GEOMETRY,
    "ShaderNodeObjectInfo": _OBJECT,
    "ShaderNodeLightPath": _LIGHT_PATH,
    "ShaderNodeCameraData": _CAMERA,
    "ShaderNodeVectorTransform": _vector_transform,
    "ShaderNodeNormalMap": _normal_map,
    "ShaderNodeBump": _bump,
    "ShaderNodeNormal": Code(
        {
            "Normal": "vector_normalize({direction})",
            "Dot": "dot(vector_normalize({direction}), vector_normalize({Normal}))",
        },
        ("vector",),
    ),
    "ShaderNodeTangent": _tangent,
    "ShaderNodeBevel": _BEVEL,
    "ShaderNodeAmbientOcclusion": _OCCLUSION,
    "ShaderNodeWireframe": _WIREFRAME,
    "ShaderNodeHairInfo": _HAIR_INFO,
    "ShaderNodeParticleInfo": _PARTICLE_INFO,
    "ShaderNodePointInfo": _POINT_INFO,
    "ShaderNodeLightFalloff": _LIGHT_FALLOFF,
    "ShaderNodeSqueeze": Code({"Value": "1.0 / (1.0 + exp(-({Value} - {Center}) * {Width}))"}),
    "ShaderNodeUVMap": _uv_map,
    "ShaderNodeVertexColor": _color_attribute,
    "ShaderNodeAttribute": _attribute,
    # The reader's own.
    "Sky": texture_code.SKY,
    "Number": Code({"Value": "{Value}"}),
    "Plain": Code({"Color": "{Color}", "Alpha": "{Alpha}"}),
}
