"""The node cases: each kind of node, with its options, that is held against Cycles."""

from __future__ import annotations

import itertools

import bpy

from rebound.gpu_shaders.materials import value_code

from .node_image_cases import image_cases, image_file_cases
from .node_sheet import NodeCase

GRADIENTS = ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "SPHERICAL", "QUADRATIC_SPHERE", "RADIAL")
FRACTALS = ("FBM", "MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "HETERO_TERRAIN")
DIMENSIONS = ("1D", "2D", "3D", "4D")
BLENDS = (
    "MIX",
    "DARKEN",
    "MULTIPLY",
    "BURN",
    "LIGHTEN",
    "SCREEN",
    "DODGE",
    "ADD",
    "OVERLAY",
    "SOFT_LIGHT",
    "LINEAR_LIGHT",
    "DIFFERENCE",
    "EXCLUSION",
    "SUBTRACT",
    "DIVIDE",
    "HUE",
    "SATURATION",
    "COLOR",
    "VALUE",
)
PLACES = {"1D": {"W": "b.x"}, "2D": {"Vector": "a"}, "3D": {"Vector": "a"}, "4D": {"Vector": "a", "W": "b.x"}}


def noise_cases():
    for dimensions, output in itertools.product(DIMENSIONS, ("Fac", "Color")):
        yield NodeCase(
            "ShaderNodeTexNoise",
            output,
            PLACES[dimensions] | {"Scale": 3.0, "Distortion": 0.0},
            {"noise_dimensions": dimensions},
        )
        yield NodeCase(
            "ShaderNodeTexNoise",
            output,
            PLACES[dimensions] | {"Scale": 2.0, "Distortion": 0.7, "Detail": 2.5, "Roughness": 0.6, "Lacunarity": 2.3},
            {"noise_dimensions": dimensions},
        )
    for kind, detail in itertools.product(FRACTALS, (0.0, 3.0, 2.4)):
        inputs = {"Vector": "a", "Scale": 1.5, "Detail": detail, "Roughness": 0.6, "Lacunarity": 2.1}
        properties = {"noise_type": kind} | ({"normalize": False} if kind == "FBM" else {})
        if kind in FRACTALS[2:]:
            inputs["Offset"] = 0.4
        if kind in FRACTALS[2:4]:
            inputs["Gain"] = 1.7
        yield NodeCase("ShaderNodeTexNoise", "Fac", inputs, properties)


def voronoi_cases():
    node = "ShaderNodeTexVoronoi"
    for dimensions, feature in itertools.product(DIMENSIONS, ("F1", "F2", "SMOOTH_F1")):
        for output in ("Distance", "Color", "W" if dimensions == "1D" else "Position"):
            yield NodeCase(
                node,
                output,
                PLACES[dimensions] | {"Scale": 1.5, "Randomness": 0.9},
                {"voronoi_dimensions": dimensions, "feature": feature},
            )
    for dimensions, (feature, output) in itertools.product(
        DIMENSIONS, (("DISTANCE_TO_EDGE", "Distance"), ("N_SPHERE_RADIUS", "Radius"))
    ):
        yield NodeCase(
            node, output, PLACES[dimensions] | {"Scale": 1.5}, {"voronoi_dimensions": dimensions, "feature": feature}
        )
    for metric, feature in itertools.product(("MANHATTAN", "CHEBYCHEV", "MINKOWSKI"), ("F1", "F2", "SMOOTH_F1")):
        inputs = {"Vector": "a", "Scale": 1.5} | ({"Exponent": 0.7} if metric == "MINKOWSKI" else {})
        yield NodeCase(node, "Distance", inputs, {"distance": metric, "feature": feature})
    fractal = {"Vector": "a", "Scale": 0.8, "Detail": 2.4, "Roughness": 0.6, "Lacunarity": 1.9}
    for feature, normalize in itertools.product(("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE"), (True, False)):
        yield NodeCase(node, "Distance", fractal, {"feature": feature, "normalize": normalize})


def pattern_cases():
    for kind in GRADIENTS:
        yield NodeCase("ShaderNodeTexGradient", "Fac", {"Vector": "a"}, {"gradient_type": kind}, low=-1.2, high=1.2)
    for output in ("Color", "Fac"):
        colors = {"Color1": (0.8, 0.2, 0.1, 1), "Color2": (0.1, 0.5, 0.9, 1)}
        yield NodeCase("ShaderNodeTexChecker", output, colors | {"Vector": "a", "Scale": 2.3})
        yield NodeCase("ShaderNodeTexMagic", output, {"Vector": "a", "Scale": 0.9, "Distortion": 1.3})
        for offset_frequency, squash_frequency in ((2, 2), (3, 2), (1, 3)):
            yield NodeCase(
                "ShaderNodeTexBrick",
                output,
                colors
                | {
                    "Vector": "a",
                    "Scale": 2.0,
                    "Mortar": (0.3, 0.4, 0.2, 1),
                    "Mortar Size": 0.06,
                    "Mortar Smooth": 0.3,
                    "Bias": -0.2,
                },
                {
                    "offset_frequency": offset_frequency,
                    "squash_frequency": squash_frequency,
                    "offset": 0.4,
                    "squash": 0.7,
                },
            )
    for depth in range(0, 11):
        yield NodeCase("ShaderNodeTexMagic", "Color", {"Vector": "a", "Distortion": 0.8}, {"turbulence_depth": depth})
    for profile in ("SIN", "SAW", "TRI"):
        for kind, directions in (("BANDS", "X Y Z DIAGONAL"), ("RINGS", "X Y Z SPHERICAL")):
            for direction in directions.split():
                yield NodeCase(
                    "ShaderNodeTexWave",
                    "Fac",
                    {"Vector": "a", "Scale": 0.3, "Phase Offset": 0.8},
                    {"wave_type": kind, f"{kind.lower()}_direction": direction, "wave_profile": profile},
                )
        yield NodeCase(
            "ShaderNodeTexWave",
            "Color",
            {
                "Vector": "a",
                "Scale": 0.3,
                "Distortion": 2.0,
                "Detail": 1.6,
                "Detail Scale": 1.5,
                "Detail Roughness": 0.6,
            },
            {"wave_profile": profile},
        )
    for dimensions, output in itertools.product(DIMENSIONS, ("Value", "Color")):
        yield NodeCase("ShaderNodeTexWhiteNoise", output, PLACES[dimensions], {"noise_dimensions": dimensions})


def number_cases():
    for operation in value_code.MATH:
        inputs = {"Value": "a.x", "Value_001": "b.x", "Value_002": "b.y"}
        yield NodeCase("ShaderNodeMath", "Value", inputs, {"operation": operation})
    yield NodeCase(
        "ShaderNodeMath", "Value", {"Value": "a.x", "Value_001": 2.0}, {"operation": "POWER", "use_clamp": True}
    )
    for kind, data in itertools.product(("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP"), ("FLOAT", "FLOAT_VECTOR")):
        for clamp, turned in itertools.product((False, True), repeat=2):
            ends = [(-0.5, 1.2), (0.3, 2.0)]
            (low, high), (to_low, to_high) = (end[::-1] if turned else end for end in ends)
            if data == "FLOAT":
                inputs = {"Value": "a.x", "From Min": low, "From Max": high, "To Min": to_low, "To Max": to_high}
                inputs |= {"Steps": 3.0} if kind == "STEPPED" else {}
            else:
                inputs = {
                    "Vector": "a",
                    "From_Min_FLOAT3": (low,) * 3,
                    "From_Max_FLOAT3": (high, high, 0.7),
                    "To_Min_FLOAT3": (to_low,) * 3,
                    "To_Max_FLOAT3": (to_high,) * 3,
                }
                inputs |= {"Steps_FLOAT3": (3.0, 4.0, 2.0)} if kind == "STEPPED" else {}
            yield NodeCase(
                "ShaderNodeMapRange",
                "Result" if data == "FLOAT" else "Vector",
                inputs,
                {"interpolation_type": kind, "data_type": data, "clamp": clamp},
            )
    for kind, low, high in (("MINMAX", -0.5, 1.0), ("MINMAX", 1.0, -0.5), ("RANGE", -0.5, 1.0), ("RANGE", 1.0, -0.5)):
        yield NodeCase(
            "ShaderNodeClamp",
            "Result",
            {"Value": "a.x", "Min": low, "Max": high},
            {"clamp_type": kind},
            flat=kind == "MINMAX" and low > high,
        )


def turned_normal(node):
    node.outputs["Normal"].default_value = (0.6, 0.0, 0.8)


def vector_cases():
    for output in ("Normal", "Dot"):
        yield NodeCase("ShaderNodeNormal", output, {"Normal": "a"}, setup=turned_normal)
    scalar = {"DOT_PRODUCT", "DISTANCE", "LENGTH"}
    there = bpy.types.ShaderNodeVectorMath.bl_rna.properties["operation"].enum_items
    for operation in [name for name in value_code.VECTOR_MATH if name in there]:
        inputs = {"Vector": "a", "Vector_001": "b", "Vector_002": (0.3, -0.7, 0.5)}
        if operation in ("SCALE", "REFRACT"):
            inputs["Scale"] = 0.8
        yield NodeCase(
            "ShaderNodeVectorMath", "Value" if operation in scalar else "Vector", inputs, {"operation": operation}
        )
    for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL"):
        inputs = {"Vector": "a", "Rotation": (0.3, -1.1, 2.0), "Scale": (1.5, -0.6, 2.0)}
        inputs |= {"Location": (0.4, 0.1, -0.8)} if kind in ("POINT", "TEXTURE") else {}
        yield NodeCase("ShaderNodeMapping", "Vector", inputs, {"vector_type": kind})
    for kind, invert in itertools.product(("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"), (False, True)):
        inputs = {"Vector": "a", "Center": (0.4, 0.1, -0.8)}
        inputs |= {"Rotation": (0.3, -1.1, 2.0)} if kind == "EULER_XYZ" else {"Angle": "b.x"}
        inputs |= {"Axis": "b"} if kind == "AXIS_ANGLE" else {}
        yield NodeCase("ShaderNodeVectorRotate", "Vector", inputs, {"rotation_type": kind, "invert": invert})
    for axis in "XYZ":
        yield NodeCase("ShaderNodeSeparateXYZ", axis, {"Vector": "a"})
    yield NodeCase("ShaderNodeCombineXYZ", "Vector", {"X": "b.z", "Y": "a.x", "Z": 0.3})


def color_cases():
    place = {"low": -0.1, "high": 1.3}
    for blend in BLENDS:
        inputs = {"A_Color": "a", "B_Color": "b", "Factor_Float": 0.7}
        yield NodeCase("ShaderNodeMix", "Result_Color", inputs, {"data_type": "RGBA", "blend_type": blend}, **place)
    yield NodeCase(
        "ShaderNodeMix",
        "Result_Color",
        {"A_Color": "a", "B_Color": "b", "Factor_Float": "a.y"},
        {"data_type": "RGBA", "clamp_result": True, "clamp_factor": False, "blend_type": "ADD"},
        **place,
    )
    yield NodeCase(
        "ShaderNodeMix", "Result_Float", {"A_Float": "a.x", "B_Float": "b.x", "Factor_Float": "b.y"}, **place
    )
    for mode, factor in (("UNIFORM", {"Factor_Float": 0.3}), ("NON_UNIFORM", {"Factor_Vector": (0.3, 0.8, 1.4)})):
        yield NodeCase(
            "ShaderNodeMix",
            "Result_Vector",
            {"A_Vector": "a", "B_Vector": "b"} | factor,
            {"data_type": "VECTOR", "factor_mode": mode},
            **place,
        )
    for blend in ("MIX", "OVERLAY"):
        yield NodeCase(
            "ShaderNodeMixRGB", "Color", {"Color1": "a", "Color2": "b", "Fac": 0.4}, {"blend_type": blend}, **place
        )
    for mode in ("RGB", "HSV", "HSL"):
        for part in ("Red", "Green", "Blue"):
            yield NodeCase("ShaderNodeSeparateColor", part, {"Color": "a"}, {"mode": mode}, low=0.0, high=1.0)
        yield NodeCase(
            "ShaderNodeCombineColor",
            "Color",
            {"Red": "a.x", "Green": "a.y", "Blue": "b.x"},
            {"mode": mode},
            low=0.0,
            high=1.0,
        )
    yield NodeCase("ShaderNodeInvert", "Color", {"Color": "a", "Fac": 0.7}, **place)
    for gamma in (0.0, 0.45, 2.2):
        yield NodeCase("ShaderNodeGamma", "Color", {"Color": "a", "Gamma": gamma}, flat=gamma == 0.0, **place)
    yield NodeCase(
        "ShaderNodeHueSaturation",
        "Color",
        {"Color": "a", "Hue": 0.7, "Saturation": 1.4, "Value": 0.8, "Fac": 0.9},
        **place,
    )
    yield NodeCase("ShaderNodeBrightContrast", "Color", {"Color": "a", "Bright": 0.1, "Contrast": 0.4}, **place)
    yield NodeCase("ShaderNodeRGBToBW", "Val", {"Color": "a"}, **place)
    yield NodeCase("ShaderNodeSeparateXYZ", "X", {"Vector": "a.x"}, **place)
    yield NodeCase(
        "ShaderNodeBlackbody",
        "Color",
        {"Temperature": "a.x"},
        low=700.0,
        high=14000.0,
        tolerance=1.5e-3,
        reason="polynomials fitted to what 5.2 shows, 9e-4 off; 4.5 differs from that in the last digit",
    )
    yield from table_cases()


def _ramp(interpolation):
    def setup(node):
        ramp = node.color_ramp
        ramp.interpolation = interpolation
        ramp.elements[0].color, ramp.elements[1].color = (0.9, 0.1, 0.2, 1), (0.2, 0.8, 0.4, 0.5)
        ramp.elements.new(0.37).color = (0.1, 0.3, 1.0, 0.8)

    return setup


def _curve(extend):
    def setup(node):
        node.mapping.extend = extend
        for k, curve in enumerate(node.mapping.curves):
            curve.points.new(0.3 + 0.1 * k, 0.6 - 0.15 * k)
            curve.points.new(0.7, 0.5 + 0.1 * k)
        node.mapping.update()

    return setup


def table_cases():
    for interpolation in ("LINEAR", "CONSTANT", "EASE", "CARDINAL", "B_SPLINE"):
        for output in ("Color", "Alpha"):
            yield NodeCase("ShaderNodeValToRGB", output, {"Fac": "a.x"}, low=-0.2, high=1.2, setup=_ramp(interpolation))
    for extend in ("EXTRAPOLATED", "HORIZONTAL"):
        for kind, given, output in (
            ("RGBCurve", "Color", "Color"),
            ("VectorCurve", "Vector", "Vector"),
            ("FloatCurve", "Value", "Value"),
        ):
            place = {given: "a.x" if kind == "FloatCurve" else "a"} | {"Factor" if kind == "FloatCurve" else "Fac": 0.8}
            yield NodeCase(f"ShaderNode{kind}", output, place, low=-0.4, high=1.4, setup=_curve(extend))


def _sloped(node):
    """A height that grows evenly over the sheet."""
    tree = node.id_data
    place, slope = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeVectorMath")
    slope.operation = "DOT_PRODUCT"
    slope.inputs[1].default_value = (0.7, -0.4, 0.0)
    tree.links.new(place.outputs["Object"], slope.inputs[0])
    tree.links.new(slope.outputs["Value"], node.inputs["Height"])


def relief_cases():
    for strength in (1.0, 0.4, 1.6):
        for space in ("TANGENT", "OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD"):
            yield NodeCase(
                "ShaderNodeNormalMap",
                "Normal",
                {"Color": "a", "Strength": strength},
                {"space": space, "uv_map": "UV"},
                low=0.1,
                high=0.9,
            )
    for strength, invert in itertools.product((1.0, 0.4), (False, True)):
        yield NodeCase(
            "ShaderNodeBump",
            "Normal",
            {"Strength": strength, "Distance": 0.8},
            {"invert": invert},
            setup=_sloped,
            flat=True,
        )
    spaces = ("WORLD", "OBJECT")
    for kind, start, end in itertools.product(("POINT", "VECTOR", "NORMAL"), spaces, spaces):
        yield NodeCase(
            "ShaderNodeVectorTransform",
            "Vector",
            {"Vector": "a"},
            {"vector_type": kind, "convert_from": start, "convert_to": end},
        )


GROUPS = {
    "noise": noise_cases,
    "voronoi": voronoi_cases,
    "patterns": pattern_cases,
    "numbers": number_cases,
    "vectors": vector_cases,
    "colors": color_cases,
    "images": image_cases,
    "image files": image_file_cases,
    "relief": relief_cases,
}
