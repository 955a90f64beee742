"""The procedural textures' code."""

from __future__ import annotations

from ...scene.node_graph import Node
from .code import Code

_FRACTALS = {
    "FBM": "fbm",
    "MULTIFRACTAL": "multifractal",
    "HYBRID_MULTIFRACTAL": "hybrid_multifractal",
    "RIDGED_MULTIFRACTAL": "ridged_multifractal",
    "HETERO_TERRAIN": "hetero_terrain",
}


def _dimensions(node: Node, option: str) -> int:
    return int(str(node.option(option))[0])


def noise(node: Node) -> Code:
    d = _dimensions(node, "noise_dimensions")
    name = _FRACTALS[str(node.option("noise_type"))]
    name += "_normalized" if name == "fbm" and node.option("normalize") else ""
    terms = [f"{{{given}}}" if any(i.name == given for i in node.inputs) else default for given, default in _NOISE]
    vector, w, scale, distortion, *fractal = terms
    setup = (
        f"vec4 {{v}}_p = noise_distort(noise_place({vector} * {scale}, {w} * {scale}, {d}), {distortion}, {d}); "
        f"NoiseFractal {{v}}_f = noise_settings({d}, {', '.join(fractal)});"
    )
    channel = f"noise_{name}({{v}}_p + noise_offset(%d.0, {d}), {{v}}_f)"
    color = f"vec3(noise_{name}({{v}}_p, {{v}}_f), {channel % d}, {channel % (d + 1)})"
    return Code({"Fac": f"noise_{name}({{v}}_p, {{v}}_f)", "Color": color}, ("noise",), setup)


# Input and what it counts as where the node's type has it not.
_NOISE = (
    ("Vector", "vec3(0.0)"), ("W", "0.0"), ("Scale", "1.0"), ("Distortion", "0.0"), ("Detail", "0.0"),
    ("Roughness", "0.5"), ("Lacunarity", "2.0"), ("Offset", "0.0"), ("Gain", "1.0"),
)  # fmt: skip

_METRICS = ("EUCLIDEAN", "MANHATTAN", "CHEBYCHEV", "MINKOWSKI")
_FEATURES = ("F1", "F2", "SMOOTH_F1")
_VORONOI = (
    ("Vector", "vec3(0.0)"), ("W", "0.0"), ("Scale", "1.0"), ("Detail", "0.0"), ("Roughness", "0.0"),
    ("Lacunarity", "2.0"), ("Smoothness", "0.0"), ("Exponent", "1.0"), ("Randomness", "1.0"),
)  # fmt: skip


def voronoi(node: Node) -> Code:
    d = _dimensions(node, "voronoi_dimensions")
    feature, normalized = str(node.option("feature")), str(node.option("normalize")).lower()
    terms = [f"{{{given}}}" if any(i.name == given for i in node.inputs) else default for given, default in _VORONOI]
    vector, w, scale, *settings = terms
    metric = _METRICS.index(str(node.option("distance")))
    setup = (
        f"vec4 {{v}}_p = voronoi_place({vector}, {w}, {d}); "
        f"Voronoi {{v}}_s = voronoi_settings({d}, {metric}, {', '.join(settings)});"
    )
    if feature == "DISTANCE_TO_EDGE":
        return Code({"Distance": f"voronoi_edge({{v}}_p, {scale}, {{v}}_s, {normalized})"}, ("voronoi",), setup)
    if feature == "N_SPHERE_RADIUS":
        return Code({"Radius": f"voronoi_radius({{v}}_p * {scale}, {{v}}_s)"}, ("voronoi",), setup)
    call = f"voronoi_texture({{v}}_p, {scale}, {{v}}_s, {_FEATURES.index(feature)}, {normalized})"
    outputs = {
        "Distance": "{v}_c.distance",
        "Color": "{v}_c.color",
        "Position": "vec3(0.0)" if d == 1 else "{v}_c.position.xyz",
        "W": "{v}_c.position.x" if d == 1 else "{v}_c.position.w",
    }
    return Code(outputs, ("voronoi",), f"{setup} VoronoiCell {{v}}_c = {call};")


def white_noise(node: Node) -> Code:
    d = _dimensions(node, "noise_dimensions")
    vector, w = "vec3(0.0)" if d == 1 else "{Vector}", "{W}" if d in (1, 4) else "0.0"
    setup = f"vec4 {{v}}_p = noise_place({vector}, {w}, {d});"
    return Code({"Value": f"hash_float({{v}}_p, {d})", "Color": f"hash_color({{v}}_p, {d})"}, ("noise",), setup)


_AXES = {
    ("BANDS", "X"): "1.0, 0.0, 0.0", ("BANDS", "Y"): "0.0, 1.0, 0.0", ("BANDS", "Z"): "0.0, 0.0, 1.0",
    ("BANDS", "DIAGONAL"): "0.5, 0.5, 0.5", ("RINGS", "X"): "0.0, 1.0, 1.0", ("RINGS", "Y"): "1.0, 0.0, 1.0",
    ("RINGS", "Z"): "1.0, 1.0, 0.0", ("RINGS", "SPHERICAL"): "1.0, 1.0, 1.0",
}  # fmt: skip


def wave(node: Node) -> Code:
    kind = str(node.option("wave_type"))
    axes = _AXES[kind, str(node.option(f"{kind.lower()}_direction"))]
    setup = (
        "NoiseFractal {v}_f = noise_settings(3, {Detail}, {Detail Roughness}, 2.0, 0.0, 1.0); "
        f"float {{v}}_w = pattern_wave_{{wave_profile}}(pattern_wave_phase({{Vector}} * {{Scale}}, vec3({axes}), "
        f"{str(kind == 'RINGS').lower()}, {{Distortion}}, {{v}}_f, {{Detail Scale}}, {{Phase Offset}}));"
    )
    return Code({"Color": "vec3({v}_w)", "Fac": "{v}_w"}, ("pattern",), setup)


BRICK = Code(
    {"Color": "mix(mix({Color1}, {Color2}, {v}_b.tint), {Mortar}, {v}_b.mortar)", "Fac": "{v}_b.mortar"},
    ("pattern",),
    "PatternBrick {v}_b = pattern_brick({Vector} * {Scale}, {Mortar Size}, {Mortar Smooth}, {Bias}, {Brick Width}, "
    "{Row Height}, {offset}, int({offset_frequency}), {squash}, int({squash_frequency}));",
)


_FILTERS = {"Linear": 0, "Closest": 1, "Cubic": 2, "Smart": 2}
_EXTENSIONS = {"REPEAT": 0, "EXTEND": 1, "CLIP": 2, "MIRROR": 3}
_ALPHA = {"DATA": 0, "TIMES": 1, "STRAIGHT": 2}


def image(node: Node) -> Code:
    modes, kind, tiled = _modes(node), node.option("projection"), _has(node, "tiled")
    if kind == "BOX":
        first = "tile_first({image}, {table})" if tiled else "texture_whole({image})"
        call = f"texture_box({{image}}, {first}, {{Vector}}, point.object_normal, {{projection_blend}}, {modes})"
    else:
        at = "{Vector}.xy" if kind == "FLAT" else f"texture_{str(kind).lower()}({{Vector}})"
        tiles = ", {table}, int({tiles})" if tiled else ""
        call = f"{'tile' if tiled else 'texture'}_sample({{image}}, {at}{tiles}, {modes})"
    outputs = {"Color": "{v}_i.rgb", "Alpha": "{v}_i.a"}
    return Code(outputs, ("tile" if tiled else "texture",), f"vec4 {{v}}_i = {call};")


def _modes(node: Node) -> str:
    filtering, extension = _FILTERS[str(node.option("interpolation"))], _EXTENSIONS[str(node.option("extension"))]
    return f"{filtering}, {extension}, {_ALPHA[str(node.option('alpha'))]}, {str(_has(node, 'is_srgb')).lower()}"


def _has(node: Node, name: str) -> bool:
    return bool(dict(node.options).get(name))


def environment(node: Node) -> Code:
    place = "equirectangular" if node.option("projection") == "EQUIRECTANGULAR" else "mirror_ball"
    filtering, is_srgb = _FILTERS[str(node.option("interpolation"))], str(_has(node, "is_srgb")).lower()
    call = f"texture_sample({{image}}, texture_{place}({{Vector}}), {filtering}, 0, 0, {is_srgb}).rgb"
    return Code({"Color": call}, ("texture",))


# The reader's own, of a Sky Texture: its picture, and its sun's disc.
SKY = Code(
    {
        "Color": "sky_radiance({image}, SkySun({Turn}, {Elevation}, {Radius}, {Earth}, {Bottom}, {Top}), {Vector}, "
        "point.footprint)"
    },
    ("texture", "sky"),
)
