"""NodeGraph -> the GLSL function `MaterialSurface material_surface(MaterialPoint point)` and what it asks for.

A pure function of the graph: equal graphs give equal text, and so share one program. Numbers are read from the
sampler `value_tx`, VALUE_WIDTH texels a row, from texel MATERIAL_VALUES on, which is `pc_values` unless it is defined;
images from `image_0_tx`, `image_1_tx`, …
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from ...scene.node_graph import (
    COLOR,
    FLOAT,
    SHADER,
    SIZES,
    TABLE_SIZE,
    TEXEL,
    VECTOR,
    Input,
    Link,
    Node,
    NodeGraph,
    Place,
    Slot,
)
from .code import ACTIVE_UV, POINT_FIELDS, Attribute, Code
from .node_code import code_of

VALUE_WIDTH = 1024  # texels a row of value_tx
MOST_KEPT = 1024  # generated shaders: more than any file has
GLSL_TYPES = {FLOAT: "float", VECTOR: "vec3", COLOR: "vec3", SHADER: "MaterialSurface"}
DEFINES = (("TABLE_SIZE", str(TABLE_SIZE)),)

_FIELD = re.compile(r"\bpoint\.(\w+)")
_FETCH = f"""#ifndef MATERIAL_VALUES
#define MATERIAL_VALUES pc_values
#endif

vec4 value_fetch(int texel)
{{
  int at = MATERIAL_VALUES + texel;
  return texelFetch(value_tx, ivec2(at % {VALUE_WIDTH}, at / {VALUE_WIDTH}), 0);
}}
"""


@dataclass(frozen=True)
class MaterialShader:
    """A generated GLSL file, and what the shader that includes it must declare and fill in."""

    text: str
    needs: tuple[str, ...]  # fields of MaterialPoint, in the order in which it declares them
    attributes: tuple[Attribute, ...]  # what `uv_0`, `color_1`, … among them are, by number
    image_count: int
    defines: tuple[tuple[str, str], ...]

    @property
    def mesh_fields(self) -> dict[str, Attribute]:
        """The fields that a mesh gives, and what of it."""
        numbered = {f"{a.field}_{k}": a for k, a in enumerate(self.attributes)}
        return {name: numbered.get(name, ACTIVE_UV) for name in self.needs if name == "uv" or name in numbered}

    @property
    def samplers(self) -> dict[str, str]:
        """What ``Shader.samplers`` gets."""
        return {"value_tx": "FLOAT_2D"} | {f"image_{k}_tx": "FLOAT_2D" for k in range(self.image_count)}


@lru_cache(maxsize=MOST_KEPT)
def generate(graph: NodeGraph) -> MaterialShader:
    """The shader of a graph: the same object for equal graphs, while they are many but not too many."""
    writer = _Writer(_used(graph))
    for index, node in enumerate(graph.nodes):
        writer.add(index, node)
    surface = writer.expression(Input("Surface", SHADER, graph.surface))
    body = "\n".join(f"  {line}" for line in [*writer.lines, f"return {surface};"])
    needs = sorted({*_FIELD.findall(body), "normal"}, key=_order)
    fields = "".join(f"  {_field_type(name)} {name};\n" for name in needs)
    libraries = "".join(f'#include "materials/{name}_lib.glsl"\n' for name in writer.libraries)
    text = (
        f"{_FETCH}\nstruct MaterialPoint {{\n{fields}}};\n\n{libraries}\n"
        f"MaterialSurface material_surface(MaterialPoint point)\n{{\n{body}\n}}\n"
    )
    images = 1 + max((node.image for node in graph.nodes), default=-1)
    float_hash = any(dict(node.options).get("float_hash") for node in graph.nodes)
    defines = (*DEFINES, ("VORONOI_FLOAT_HASH", str(int(float_hash))))
    return MaterialShader(text, tuple(needs), tuple(writer.attributes), images, defines)


def _used(graph: NodeGraph) -> set[Link]:
    """Every output that something is linked to."""
    links = {given.source for node in graph.nodes for given in node.inputs if isinstance(given.source, Link)}
    return links | ({graph.surface} if graph.surface else set())


class _Writer:
    def __init__(self, used: set[Link]):
        self._used = used
        self.lines: list[str] = []
        self.libraries: dict[str, None] = dict.fromkeys(("surface", "color"))
        self.attributes: dict[Attribute, None] = {}
        self._texels: set[int] = set()
        self._types: dict[Link, str] = {}  # of the outputs so far

    def add(self, index: int, node: Node) -> None:
        """The statements of one node: a local for each of its outputs."""
        code = code_of(node)
        self.libraries.update(dict.fromkeys(code.libraries))
        words = self._words(node, index, code)
        if code.setup:
            self.lines.append(code.setup.format_map(words))
        for name, type in node.outputs:
            self._types[Link(index, name)] = type
            expression = code.outputs.get(name)
            if expression is not None and Link(index, name) in self._used:
                self.lines.append(f"{GLSL_TYPES[type]} n{index}_{_snake(name)} = {expression.format_map(words)};")

    def _words(self, node: Node, index: int, code: Code) -> Mapping[str, str]:
        words = {"v": f"n{index}", "table": str(node.table), "image": f"image_{node.image}_tx"}
        words |= {name: _option(value) for name, value in node.options}
        words |= {given.name: self.expression(given) for given in node.inputs}
        for place, attribute in code.attributes.items():
            self.attributes.setdefault(attribute)
            number = list(self.attributes).index(attribute)
            words[place] = f"point.{attribute.field}_{number}"
        return words

    def expression(self, given: Input) -> str:
        """What an input takes, in its own type."""
        source = given.source
        if isinstance(source, Link):
            return _convert(f"n{source.node}_{_snake(source.output)}", self._types[source], given.type)
        if isinstance(source, Slot):
            return _convert(self._slot(source), source.type, given.type)
        if isinstance(source, Place):
            return f"vec3(point.{source.name}, 0.0)" if source.name == "uv" else f"point.{source.name}"
        return "surface_black(point.normal)"

    def _slot(self, slot: Slot) -> str:
        texel, lane = divmod(slot.index, TEXEL)
        if texel not in self._texels:
            self._texels.add(texel)
            self.lines.append(f"vec4 value_{texel} = value_fetch({texel});")
        return f"value_{texel}." + "xyzw"[lane : lane + SIZES[slot.type]]


def _convert(expression: str, given: str, wanted: str) -> str:
    """Blender's implicit conversions: a colour's luminance, a vector's mean, a number thrice, a colour emitted."""
    if given == wanted or {given, wanted} == {VECTOR, COLOR}:
        return expression
    if wanted == SHADER:
        return f"surface_emission({_convert(expression, given, COLOR)}, 1.0, point.normal)"
    if given == SHADER:
        return "0.0" if wanted == FLOAT else "vec3(0.0)"
    if given == FLOAT:
        return f"vec3({expression})"
    return f"color_gray({expression})" if given == COLOR else f"dot({expression}, vec3(1.0 / 3.0))"


def _option(value: object) -> str:
    return str(value).lower()


def _snake(name: str) -> str:
    return re.sub(r"\W+", "_", name).lower()


def _field_type(name: str) -> str:
    base, _, number = name.rpartition("_")
    return POINT_FIELDS[base if number.isdigit() else name]


def _order(name: str) -> tuple[int, str]:
    names = list(POINT_FIELDS)
    base, _, number = name.rpartition("_")
    return (names.index(base), number) if number.isdigit() else (names.index(name), "")
