"""Blender material -> Material: its node graph, and what that looks like on the whole."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field

import numpy as np

from ..gpu_shaders.materials import generate
from .data import Array, Material
from .images import ImageReader
from .node_graph import FilledGraph, Input, Link, Node, ReadGraph, Slot
from .node_look import Look, look_of
from .node_reader import MOST, read_graph
from .nodes import active_output, find_input, node_tree, source

# Fields of a generated shader's point that an Object Info node gives.
OBJECT_INFO = {"object_color", "object_index", "object_random"}


@dataclass
class MaterialTable:
    """Indices for materials in the order they are met; index 0 is what a face without a material wears."""

    images: ImageReader
    warn: Callable[[str], None]
    materials: list[Material] = field(default_factory=lambda: [Material("Default")])
    _index: dict[int, int] = field(default_factory=dict)
    _approximated: dict[str, dict[str, None]] = field(default_factory=dict)
    _asked: dict[tuple[int, ...], tuple[tuple[str, ...], bool]] = field(default_factory=dict)
    _means: dict[Hashable, Array] = field(default_factory=dict)

    def index(self, material) -> int:
        """The index of a bpy material (None: the default), which is read when it is first met."""
        if material is None:
            return 0
        uid = (material.original or material).session_uid
        if uid not in self._index:
            self.materials.append(self._read(material))
            self._index[uid] = len(self.materials) - 1
        return self._index[uid]

    def asked(self, indices: tuple[int, ...]) -> tuple[tuple[str, ...], bool]:
        """Which attributes some materials ask meshes for beside UV maps, and whether they ask for Object Info."""
        if indices not in self._asked:
            codes = [generate(m.graph.graph) for m in (self.materials[i] for i in indices) if m.graph is not None]
            names = {a.name for code in codes for a in code.mesh_fields.values() if a.field == "color"}
            asks_object = any(OBJECT_INFO.intersection(code.needs) for code in codes)
            self._asked[indices] = tuple(sorted(names)), asks_object
        return self._asked[indices]

    def finish(self) -> tuple[Material, ...]:
        """The table; gives the warnings that are counted over the scene."""
        for how, names in self._approximated.items():
            shown = ", ".join(f"'{name}'" for name in list(names)[:3])
            more = ", …" if len(names) > 3 else ""
            noun = "material" if len(names) == 1 else "materials"
            self.warn(f"{len(names)} {noun} ({shown}{more}): {how}")
        return tuple(self.materials)

    def _read(self, material) -> Material:
        read = read_graph(material, self.images.read, image_of=self.images.images.get)
        if read.unsupported:
            self.warn(f"Material '{material.name}': {'; '.join(read.unsupported)}")
        for how in _approximations(read, material):
            self._approximated.setdefault(how, {})[material.name] = None
        filled = read.filled
        look = look_of(filled, lambda place: self._mean(filled.images[place]))
        return Material(
            material.name,
            **_fields(look),
            base_color_texture=look.texture,
            graph=None if look.is_exact else filled,
            index=material.pass_index,
            passes_lamps=material.use_transparent_shadow,
            culled=material.use_backface_culling,
            culled_by_lamps=material.use_backface_culling_shadow,
        )

    def _mean(self, image: Hashable) -> Array:
        """RGBA, (4,) float64: of every so many rows and columns, as it is a guess anyway."""
        if image not in self._means:
            read = self.images.images[image]
            rows, columns = (max(n // 64, 1) for n in read.pixels.shape[:2])
            self._means[image] = read.linear(read.pixels[::rows, ::columns]).mean((0, 1), dtype=np.float64)
        return self._means[image]


def _fields(look: Look) -> dict:
    """The constants of a Material."""
    colors = {name: tuple(getattr(look, name).clip(-MOST, MOST).tolist()) for name in ("emission", "specular")}
    base = tuple(look.base.clip(0.0, 1.0).tolist())
    numbers = {name: float(getattr(look, name)) for name in ("metallic", "roughness", "layered", "passing")}
    return {"base_color": base, **colors, **numbers}


GLASS = "what is refracted passes straight on"
SUBSURFACE = "subsurface scattering is shown as diffuse"
SHEEN = "sheen is shown as diffuse, without its rim"
# What is shown as something near it: nodes, and inputs of the Principled BSDF that are not 0.
APPROXIMATED_NODES = {
    "ShaderNodeBsdfGlass": GLASS,
    "ShaderNodeBsdfRefraction": GLASS,
    "ShaderNodeSubsurfaceScattering": SUBSURFACE,
    "ShaderNodeBsdfTranslucent": "translucent light is shown as diffuse",
    "ShaderNodeBsdfToon": "toon shading is soft",
    "ShaderNodeBsdfSheen": SHEEN,
    "ShaderNodeBevel": "edges are not bevelled",
    "ShaderNodeAmbientOcclusion": "a material's ambient occlusion is that of an open place",
    "ShaderNodeWireframe": "no wires are shown",
    "ShaderNodeTangent": "tangents do not follow UV maps",
    "ShaderNodeHairInfo": "Curves Info tells of no strand",
    "ShaderNodeParticleInfo": "Particle Info tells a random number and the place only",
    "ShaderNodePointInfo": "Point Info tells a random number and the place only",
}
OTHER_LOBES = {"BECKMANN", "ASHIKHMIN_SHIRLEY"}
# Outputs of nodes that tell more than that.
APPROXIMATED_OUTPUTS = {
    ("ShaderNodeNewGeometry", "Pointiness"): "pointiness is that of a flat place",
    ("ShaderNodeNewGeometry", "Random Per Island"): "islands of a mesh share one random number",
    ("ShaderNodeNewGeometry", "Parametric"): "parametric coordinates are 0",
}
APPROXIMATED_INPUTS = {
    "Transmission Weight": GLASS,
    "Subsurface Weight": SUBSURFACE,
    "Sheen Weight": SHEEN,
    "Coat Weight": "a coat and what it covers share one lobe",
    "Anisotropic": "highlights are round, not anisotropic",
    "Thin Film Thickness": "thin films are not shown",
}


def _approximations(read: ReadGraph, material) -> list[str]:
    """Lines for what of a material is shown as something near it, each once."""
    found, nodes = [], read.filled.graph.nodes
    for node in nodes:
        if node.kind in APPROXIMATED_NODES and not _is_right(node):
            found.append(APPROXIMATED_NODES[node.kind])
        if dict(node.options).get("distribution") in OTHER_LOBES:
            found.append("highlights have GGX's tails, not those of other distributions")
        for link in (given.source for given in node.inputs if isinstance(given.source, Link)):
            output = nodes[link.node].kind, link.output
            found += [APPROXIMATED_OUTPUTS[output]] if output in APPROXIMATED_OUTPUTS else []
        if node.kind == "ShaderNodeBsdfPrincipled":
            found += [
                APPROXIMATED_INPUTS[given.name]
                for given in node.inputs
                if given.name in APPROXIMATED_INPUTS and not _is_zero(given, read.filled)
            ]
    tree = node_tree(material)
    output = active_output(tree) if tree else None
    displacement = find_input(output, "Displacement") if output else None
    if displacement and source(displacement).socket.is_output and material.displacement_method != "BUMP":
        found.append("displacement is shown as a bump")
    return list(dict.fromkeys(found))


def _is_right(node: Node) -> bool:
    """Whether a node of those kinds is used in a way that is exact."""
    return node.kind == "ShaderNodeTangent" and node.option("direction_type") != "UV_MAP"


def _is_zero(given: Input, filled: FilledGraph) -> bool:
    return isinstance(given.source, Slot) and filled.table.ravel()[given.source.index] == 0.0
