"""What a node graph looks like on the whole, without a GPU: light transport is planned by it, and previews have it.

A surface of constants is told exactly (``Look.is_exact``) and needs no shader of its own. Whatever a texture or another
node makes is a guess at its mean, and never quite nothing: what may emit, shine or let light pass is taken to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from .data import LUMINANCE, Array, Texture
from .node_graph import COLOR, FLOAT, SHADER, TABLE_SIZE, FilledGraph, Input, Link, Node, Place, Slot

# What Schlick's Fresnel term adds to a black F0, averaged over all directions of even light.
MEAN_FRESNEL = 1.0 / 21.0
SHEEN = 0.1  # what it reflects of even light at its default roughness
LARGEST_F0 = 0.98  # of a dielectric: IOR 200
UNKNOWN = 0.5  # what a node makes whose mathematics are left to the GPU
LEAST_GUESS, MOST_GUESS = 0.05, 0.95  # of a factor that is not constant

MeanOfImage = Callable[[int], Array]  # an image's place among the material's -> its mean, RGBA


@dataclass(frozen=True, eq=False)
class Value:
    """A number or a colour, (3,) float64, and whether it is the same all over."""

    rgb: Array
    is_exact: bool = True

    @property
    def number(self) -> float:
        same = self.rgb[0] == self.rgb[1] == self.rgb[2]
        return float(self.rgb[0] if same else self.rgb @ LUMINANCE)

    @property
    def factor(self) -> float:
        low, high = (0.0, 1.0) if self.is_exact else (LEAST_GUESS, MOST_GUESS)
        return min(max(self.number, low), high)


def _triple(value: float) -> Array:
    return np.full(3, float(value))


def _black() -> Array:
    return _triple(0.0)


@dataclass(frozen=True, eq=False)
class Look:
    """How a surface reflects and what it emits, as ``scene.data.Material`` has it. Colours are (3,) float64."""

    base: Array = field(default_factory=_black)
    emission: Array = field(default_factory=_black)
    metallic: float = 0.0
    specular: Array = field(default_factory=_black)
    roughness: float = 0.5
    layered: float = 1.0
    passing: float = 0.0  # 0..1: of light that goes on through the surface, straight or refracted
    is_exact: bool = True
    texture: Texture | None = None  # the image that is the base colour

    @property
    def is_glossy(self) -> bool:
        return self.metallic > 0.0 or bool(self.specular.any())

    @property
    def without_metal(self) -> Look:
        """The same with its metal in the specular colour."""
        layer = (1.0 - self.metallic) * self.specular
        specular = layer + self.metallic * self.base
        layered = self.layered * float(layer.mean() / specular.mean()) if specular.any() else self.layered
        return replace(self, base=(1.0 - self.metallic) * self.base, metallic=0.0, specular=specular, layered=layered)


def look_of(filled: FilledGraph, mean_of_image: MeanOfImage) -> Look:
    """The look of a graph's surface. Black where there is none, as in Cycles."""
    return _Looker(filled, mean_of_image).look()


class _Looker:
    def __init__(self, filled: FilledGraph, mean_of_image: MeanOfImage) -> None:
        self.filled = filled
        self.numbers = filled.table.ravel()
        self.mean_of_image = mean_of_image
        self.values: dict[Link, Value] = {}
        self.looks: dict[int, Look] = {}

    def look(self) -> Look:
        for index, node in enumerate(self.filled.graph.nodes):
            inputs = {given.name: given for given in node.inputs}
            if any(type == SHADER for _, type in node.outputs):
                self.looks[index] = self.shader(node, inputs)
            else:
                known = {name: self.value(given) for name, given in inputs.items()}
                for output, type in node.outputs:
                    self.values[Link(index, output)] = self.made(node, output, type, known)
        surface = self.filled.graph.surface
        if surface is None:
            return Look()
        if surface.node in self.looks:
            return self.looks[surface.node]
        value = self.values[surface]  # a colour as a surface is emitted
        return Look(emission=value.rgb, is_exact=value.is_exact)

    # Numbers

    def value(self, given: Input) -> Value:
        source = given.source
        if isinstance(source, Slot):
            start = source.index
            count = 1 if source.type == FLOAT else 3
            numbers = self.numbers[start : start + count].astype(np.float64)
            return Value(numbers if count == 3 else _triple(numbers[0]))
        if isinstance(source, Link):
            return self.values.get(source, Value(_triple(UNKNOWN), False))
        return Value(_triple(UNKNOWN), False)

    def made(self, node: Node, output: str, type: str, known: Mapping[str, Value]) -> Value:
        """What a node that is no shader gives on average."""
        if node.kind in {"Plain", "Number"}:
            return known.get(output, next(iter(known.values())))
        if node.image >= 0:
            mean = self.mean_of_image(node.image)
            return Value(_triple(mean[3]) if output == "Alpha" else mean[:3] * mean[3], False)
        if node.kind in {"ShaderNodeMix", "ShaderNodeMixRGB"}:
            return self.mixed(node, known)
        if node.kind == "ShaderNodeMath" and node.option("operation") == "MULTIPLY":
            return Value(np.prod([v.rgb for v in list(known.values())[:2]], axis=0), False)
        if node.kind == "ShaderNodeValToRGB":
            rows = self.filled.table[node.table : node.table + TABLE_SIZE]
            return Value(_triple(rows[:, 3].mean()) if output == "Alpha" else rows[:, :3].mean(0, np.float64), False)
        colors = [known[i.name].rgb for i in node.inputs if i.type == COLOR]
        return Value(np.mean(colors, axis=0) if type == COLOR and colors else _triple(UNKNOWN), False)

    @staticmethod
    def mixed(node: Node, known: Mapping[str, Value]) -> Value:
        """A Mix node; what other blends than a plain mix and a product make lies between their colours too."""
        names = [i.name for i in node.inputs if "fac" not in i.name.lower()][-2:]
        factors = [known[i.name].factor for i in node.inputs if "fac" in i.name.lower()]
        a, b = (known[name].rgb for name in names)
        factor = factors[0] if factors else UNKNOWN
        blended = a * b if dict(node.options).get("blend_type") == "MULTIPLY" else b
        return Value((1.0 - factor) * a + factor * blended, False)

    # Shaders

    def shader(self, node: Node, inputs: Mapping[str, Input]) -> Look:
        given = {name: self.value(i) for name, i in inputs.items() if i.type != SHADER}
        plain = all(isinstance(i.source, Place) or given[n].is_exact for n, i in inputs.items() if n in given)
        make = _SHADERS.get(node.kind)
        if node.kind in {"ShaderNodeMixShader", "ShaderNodeAddShader"}:
            a, b = (self.under(i) for i in node.inputs if i.type == SHADER)
            factor = given["Fac"].factor if "Fac" in given else None
            return _sum(a, 1.0 if factor is None else 1.0 - factor, b, 1.0 if factor is None else factor, plain)
        if make is None:
            return Look(base=_triple(UNKNOWN), is_exact=False)
        made = make(node, given)
        color = inputs.get("Base Color") or inputs.get("Color")
        return replace(made, is_exact=made.is_exact and plain, texture=self.texture(color))

    def under(self, given: Input) -> Look:
        """The shader that is linked to an input of one."""
        source = given.source
        if not isinstance(source, Link):
            return Look()
        if source.node in self.looks:
            return self.looks[source.node]
        value = self.values[source]
        return Look(emission=value.rgb, is_exact=value.is_exact)

    def texture(self, color: Input | None) -> Texture | None:
        """The image behind a colour, where nothing but a UV map lies between."""
        if color is None or not isinstance(color.source, Link):
            return None
        node = self.filled.graph.nodes[color.source.node]
        if node.kind != "ShaderNodeTexImage" or node.image < 0 or node.option("projection") != "FLAT":
            return None
        place = node.inputs[0].source
        named = self.filled.graph.nodes[place.node] if isinstance(place, Link) else None
        if named is not None and named.kind not in {"ShaderNodeUVMap", "ShaderNodeTexCoord"}:
            return None
        if isinstance(place, Link) and place.output != "UV":
            return None
        uv_map = str(named.option("uv_map")) if named is not None and named.kind == "ShaderNodeUVMap" else ""
        repeat, closest = node.option("extension") == "REPEAT", node.option("interpolation") == "Closest"
        return Texture(self.filled.images[node.image], uv_map, repeat=repeat, closest=closest)


def _sum(a: Look, wa: float, b: Look, wb: float, plain: bool) -> Look:
    """A weighted sum of two; exact where no lobe is in it, as one lobe cannot stand for two."""
    dull = not (a.is_glossy or b.is_glossy or a.passing or b.passing)
    a, b = a.without_metal, b.without_metal
    la, lb = wa * float(a.specular.mean()), wb * float(b.specular.mean())
    of_a = la / (la + lb) if la + lb else 1.0
    return Look(
        np.minimum(wa * a.base + wb * b.base, 1.0),
        wa * a.emission + wb * b.emission,
        specular=np.minimum(wa * a.specular + wb * b.specular, 1.0),
        roughness=of_a * a.roughness + (1.0 - of_a) * b.roughness,
        layered=of_a * a.layered + (1.0 - of_a) * b.layered,
        passing=min(wa * a.passing + wb * b.passing, 1.0),
        is_exact=dull and plain and a.is_exact and b.is_exact,
    )


Inputs = Mapping[str, Value]


def _f0(ior: float) -> float:
    ior = max(ior, 1e-3)
    return min(((ior - 1.0) / (ior + 1.0)) ** 2, LARGEST_F0)


def _principled(_node: Node, given: Inputs) -> Look:
    level = max(given["Specular IOR Level"].number, 0.0)
    f0 = min(_f0(given["IOR"].number) * 2.0 * level, LARGEST_F0)
    emission = given["Emission Color"].rgb * given["Emission Strength"].number
    alpha, metallic = given["Alpha"].factor, given["Metallic"].factor
    through = alpha * (1.0 - metallic) * given["Transmission Weight"].factor
    passing = 1.0 - alpha + through * float(given["Base Color"].rgb.mean())
    bare = not (passing or given["Coat Weight"].number or given["Sheen Weight"].number)
    return Look(
        given["Base Color"].rgb * (1.0 if bare else alpha * (1.0 - given["Transmission Weight"].factor)),
        alpha * np.maximum(emission, 0.0),
        metallic=metallic,
        specular=np.clip(f0 * np.maximum(given["Specular Tint"].rgb, 0.0), 0.0, 1.0) * alpha,
        roughness=given["Roughness"].factor,
        passing=passing,
        is_exact=bare,
    )


def _diffuse(_node: Node, given: Inputs) -> Look:
    return Look(given["Color"].rgb)


def _sheen(_node: Node, given: Inputs) -> Look:
    return Look(SHEEN * given["Color"].rgb)


def _toon(node: Node, given: Inputs) -> Look:
    if node.option("component") != "GLOSSY":
        return _diffuse(node, given)
    return _glossy(node, {"Color": given["Color"], "Roughness": given["Size"]})


def _specular(_node: Node, given: Inputs) -> Look:
    alpha = 1.0 - given["Transparency"].factor
    return Look(
        alpha * given["Base Color"].rgb,
        alpha * np.maximum(given["Emissive Color"].rgb, 0.0),
        specular=alpha * np.clip(given["Specular"].rgb, 0.0, 1.0),
        roughness=given["Roughness"].factor,
        passing=1.0 - alpha,
        is_exact=alpha == 1.0 and given["Clear Coat"].is_exact and not given["Clear Coat"].number,
    )


def _emission(_node: Node, given: Inputs) -> Look:
    return Look(emission=given["Color"].rgb * given["Strength"].number)


def _glossy(_node: Node, given: Inputs) -> Look:
    # It knows no Fresnel term: a metal that reflects as much on average over all directions.
    base = np.maximum((given["Color"].rgb - MEAN_FRESNEL) / (1.0 - MEAN_FRESNEL), 0.0)
    return Look(base, metallic=1.0, roughness=given["Roughness"].factor)


def _metal(node: Node, given: Inputs) -> Look:
    base = given["Base Color"].rgb if "Base Color" in given else _triple(UNKNOWN)
    if node.option("fresnel_type") == "PHYSICAL_CONDUCTOR":
        n, k = given["IOR"].rgb, given["Extinction"].rgb
        base = ((n - 1.0) ** 2 + k * k) / np.maximum((n + 1.0) ** 2 + k * k, 1e-6)
    return Look(base, metallic=1.0, roughness=given["Roughness"].factor)


def _glass(node: Node, given: Inputs) -> Look:
    f0 = _f0(given["IOR"].number) if node.kind == "ShaderNodeBsdfGlass" else 0.0
    color = given["Color"].rgb
    passing = float(color.mean())
    return Look(specular=f0 * color, roughness=given["Roughness"].factor, passing=passing, is_exact=False)


def _transparent(_node: Node, given: Inputs) -> Look:
    return Look(passing=min(float(given["Color"].rgb.mean()), 1.0), is_exact=False)


_SHADERS: dict[str, Callable[[Node, Inputs], Look]] = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeBsdfTranslucent": _diffuse,
    "ShaderNodeBsdfToon": _toon,
    "ShaderNodeBsdfSheen": _sheen,
    "ShaderNodeEeveeSpecular": _specular,
    "ShaderNodeSubsurfaceScattering": _diffuse,
    "ShaderNodeEmission": _emission,
    "ShaderNodeBsdfAnisotropic": _glossy,
    "ShaderNodeBsdfMetallic": _metal,
    "ShaderNodeBsdfGlass": _glass,
    "ShaderNodeBsdfRefraction": _glass,
    "ShaderNodeBsdfTransparent": _transparent,
}
