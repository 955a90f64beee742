"""The code of nodes that make numbers, vectors and colours of others."""

from __future__ import annotations

from ...scene.node_graph import Node
from .code import Code

_A, _B, _C = "{Value}", "{Value_001}", "{Value_002}"
MATH = {
    "ADD": f"{_A} + {_B}", "SUBTRACT": f"{_A} - {_B}", "MULTIPLY": f"{_A} * {_B}",
    "DIVIDE": f"number_divide({_A}, {_B})", "MULTIPLY_ADD": f"{_A} * {_B} + {_C}",
    "POWER": f"number_power({_A}, {_B})", "LOGARITHM": f"number_logarithm({_A}, {_B})",
    "SQRT": f"sqrt(max({_A}, 0.0))", "INVERSE_SQRT": f"number_inverse_root({_A})", "ABSOLUTE": f"abs({_A})",
    "EXPONENT": f"exp({_A})", "MINIMUM": f"min({_A}, {_B})", "MAXIMUM": f"max({_A}, {_B})",
    "LESS_THAN": f"float({_A} < {_B})", "GREATER_THAN": f"float({_A} > {_B})", "SIGN": f"sign({_A})",
    "COMPARE": f"number_compare({_A}, {_B}, {_C})", "SMOOTH_MIN": f"number_smooth_minimum({_A}, {_B}, {_C})",
    "SMOOTH_MAX": f"-number_smooth_minimum(-({_A}), -({_B}), {_C})", "ROUND": f"floor({_A} + 0.5)",
    "FLOOR": f"floor({_A})", "CEIL": f"ceil({_A})", "TRUNC": f"trunc({_A})", "FRACT": f"fract({_A})",
    "MODULO": f"number_modulo({_A}, {_B})", "FLOORED_MODULO": f"number_floored_modulo({_A}, {_B})",
    "WRAP": f"number_wrap({_A}, {_B}, {_C})", "SNAP": f"floor(number_divide({_A}, {_B})) * {_B}",
    "PINGPONG": f"number_pingpong({_A}, {_B})", "SINE": f"sin({_A})", "COSINE": f"cos({_A})", "TANGENT": f"tan({_A})",
    "ARCSINE": f"asin(clamp({_A}, -1.0, 1.0))", "ARCCOSINE": f"acos(clamp({_A}, -1.0, 1.0))",
    "ARCTANGENT": f"atan({_A})", "ARCTAN2": f"number_arctan2({_A}, {_B})", "SINH": f"sinh({_A})",
    "COSH": f"cosh({_A})", "TANH": f"tanh({_A})", "RADIANS": f"radians({_A})", "DEGREES": f"degrees({_A})",
}  # fmt: skip


def math(node: Node) -> Code:
    value = MATH[str(node.option("operation"))]
    return Code({"Value": f"clamp({value}, 0.0, 1.0)" if node.option("use_clamp") else value}, ("number",))


_U, _V, _W = "{Vector}", "{Vector_001}", "{Vector_002}"
VECTOR_MATH = {
    "ADD": f"{_U} + {_V}", "SUBTRACT": f"{_U} - {_V}", "MULTIPLY": f"{_U} * {_V}",
    "DIVIDE": f"vector_divide({_U}, {_V})", "MULTIPLY_ADD": f"{_U} * {_V} + {_W}",
    "CROSS_PRODUCT": f"cross({_U}, {_V})", "PROJECT": f"vector_project({_U}, {_V})",
    "REFLECT": f"vector_reflect({_U}, {_V})", "REFRACT": f"refract({_U}, vector_normalize({_V}), {{Scale}})",
    "FACEFORWARD": f"faceforward({_U}, {_V}, {_W})", "DOT_PRODUCT": f"dot({_U}, {_V})",
    "DISTANCE": f"distance({_U}, {_V})", "LENGTH": f"length({_U})", "SCALE": f"{_U} * {{Scale}}",
    "NORMALIZE": f"vector_normalize({_U})", "ABSOLUTE": f"abs({_U})", "POWER": f"vector_power({_U}, {_V})",
    "SIGN": f"sign({_U})", "MINIMUM": f"min({_U}, {_V})", "MAXIMUM": f"max({_U}, {_V})",
    "ROUND": f"floor({_U} + 0.5)", "FLOOR": f"floor({_U})", "CEIL": f"ceil({_U})", "FRACTION": f"fract({_U})",
    "MODULO": f"vector_modulo({_U}, {_V})", "WRAP": f"vector_wrap({_U}, {_V}, {_W})",
    "SNAP": f"floor(vector_divide({_U}, {_V})) * {_V}", "SINE": f"sin({_U})", "COSINE": f"cos({_U})",
    "TANGENT": f"tan({_U})",
}  # fmt: skip


def vector_math(node: Node) -> Code:
    value = VECTOR_MATH[str(node.option("operation"))]
    return Code({"Value": value, "Vector": value}, ("vector",))


def map_range(node: Node) -> Code:
    kind, vector = str(node.option("interpolation_type")), node.option("data_type") == "FLOAT_VECTOR"
    noun, end = ("vector", "_FLOAT3") if vector else ("number", "")
    names = [name.replace(" ", "_") + end if vector else name for name in ("From Min", "From Max", "To Min", "To Max")]
    low, high, to_low, to_high = (f"{{{name}}}" for name in names)
    value = "{Vector}" if vector else "{Value}"
    place = f"vector_divide({value} - {low}, {high} - {low})" if vector else f"number_place({value}, {low}, {high})"
    if kind == "STEPPED":
        place = f"{noun}_stepped({place}, {{Steps{end}}})"
    elif kind != "LINEAR":
        place = f"{noun}_{kind.lower()}({place})"
    result = f"{to_low} + {place} * ({to_high} - {to_low})"
    if not vector:
        result = f"({low} != {high} ? {result} : 0.0)"
    if node.option("clamp") and kind in ("LINEAR", "STEPPED"):
        result = f"{noun}_clamp_range({result}, {to_low}, {to_high})"
    return Code({"Vector" if vector else "Result": result}, ("vector",))


def clamp(node: Node) -> Code:
    if node.option("clamp_type") == "RANGE":
        return Code({"Result": "number_clamp_range({Value}, {Min}, {Max})"}, ("number",))
    return Code({"Result": "min(max({Value}, {Min}), {Max})"})


def mapping(node: Node) -> Code:
    location = "{Location}, " if node.option("vector_type") in ("POINT", "TEXTURE") else ""
    call = f"vector_mapping_{{vector_type}}({{Vector}}, {location}{{Rotation}}, {{Scale}})"
    return Code({"Vector": call}, ("vector",))


_UNIT_AXES = {"X_AXIS": "vec3(1.0, 0.0, 0.0)", "Y_AXIS": "vec3(0.0, 1.0, 0.0)", "Z_AXIS": "vec3(0.0, 0.0, 1.0)"}


def vector_rotate(node: Node) -> Code:
    kind = str(node.option("rotation_type"))
    if kind == "EULER_XYZ":
        return Code({"Vector": "vector_rotate_euler({Vector}, {Center}, {Rotation}, {invert})"}, ("vector",))
    axis, angle = _UNIT_AXES.get(kind, "{Axis}"), "-{Angle}" if node.option("invert") else "{Angle}"
    return Code({"Vector": f"vector_rotate({{Vector}}, {{Center}}, {axis}, {angle})"}, ("vector",))


# --- Colours ---------------------------------------------------------------------------------------------------------


def mix(node: Node) -> Code:
    kind = str(node.option("data_type"))
    one_factor = kind != "VECTOR" or node.option("factor_mode") == "UNIFORM"
    factor = "{Factor_Float}" if one_factor else "{Factor_Vector}"
    if node.option("clamp_factor"):
        factor = f"clamp({factor}, 0.0, 1.0)"
    if kind == "RGBA":
        result = f"color_mix_{{blend_type}}({{A_Color}}, {{B_Color}}, {factor})"
        if node.option("clamp_result"):
            result = f"clamp({result}, 0.0, 1.0)"
        return Code({"Result_Color": result}, ("color",))
    name = kind.capitalize()
    return Code({f"Result_{name}": f"mix({{A_{name}}}, {{B_{name}}}, {factor})"})


def mix_rgb(node: Node) -> Code:
    result = "color_mix_{blend_type}({Color1}, {Color2}, clamp({Fac}, 0.0, 1.0))"
    return Code({"Color": f"clamp({result}, 0.0, 1.0)" if node.option("use_clamp") else result}, ("color",))


def separate(node: Node) -> Code:
    mode = str(node.option("mode")).lower()
    parts = "{Color}" if mode == "rgb" else f"color_{mode}_from_rgb({{Color}})"
    return Code({"Red": "{v}_s.x", "Green": "{v}_s.y", "Blue": "{v}_s.z"}, ("color",), f"vec3 {{v}}_s = {parts};")


def combine(node: Node) -> Code:
    mode = str(node.option("mode")).lower()
    parts = "vec3({Red}, {Green}, {Blue})"
    return Code({"Color": parts if mode == "rgb" else f"color_rgb_from_{mode}({parts})"}, ("color",))


RAMP = Code(
    {"Color": "{v}_r.rgb", "Alpha": "{v}_r.a"}, ("table",), "vec4 {v}_r = table_row({table}, {Fac}, {extended});"
)
FLOAT_CURVE = Code(
    {"Value": "mix({Value}, table_curve({table}, ({Value} - {low}) / ({high} - {low}), {extended}).x, {Factor})"},
    ("table",),
)


def curves(name: str) -> Code:
    """Curves of the three parts of the input and output of this name."""
    curved = f"table_curves({{table}}, {{{name}}}, {{low}}, {{high}}, {{extended}})"
    return Code({name: f"mix({{{name}}}, {curved}, {{Fac}})"}, ("table",))
