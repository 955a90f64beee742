"""Blender's shader node tree -> NodeGraph: links followed through groups, reroutes and muted nodes, numbers put aside.

What a node means is known to the generator alone (`gpu_shaders.materials`); a kind that it cannot express is replaced
here by the nearest value that it can, and named.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping

import bpy
import numpy as np

from ..gpu_shaders.materials import gives, is_supported
from .data import Image
from .node_graph import (
    COLOR,
    FLOAT,
    SHADER,
    VECTOR,
    FilledGraph,
    Input,
    Link,
    Node,
    NodeGraph,
    Place,
    ReadGraph,
    Slot,
    Values,
)
from .node_tables import curve_rows
from .nodes import MAX_STEPS, Socket, active_output, find_input, node_tree, step_back

ReadImage = Callable[[object, object], Hashable | None]  # an image and its user -> its key, None where it is missing
# A Sky Texture node -> the key of its picture, and its sun: a number or a colour by name.
ReadSky = Callable[[object], tuple[Hashable, Mapping[str, tuple[float, ...]]]]

ImageOf = Callable[[Hashable], Image | None]

MAX_DEPTH = 50  # calls within one another: nodes are read inputs first, so only circles of links go deeper than a few
MAX_IMAGES = 16  # of one material: what is left of a shader's 32 samplers for its other inputs and those of the frame
MOST = 1e20  # Blender makes 3e38 of an infinite number, of which a product is infinite in single precision
MAGENTA = (1.0, 0.0, 1.0)  # Blender's colour for a missing image

TYPES = {"VALUE": FLOAT, "INT": FLOAT, "BOOLEAN": FLOAT, "VECTOR": VECTOR, "ROTATION": VECTOR, "RGBA": COLOR}
TYPES["SHADER"] = SHADER
# Inputs that take a place of the surface where nothing is linked to them.
NORMALS = {"Normal", "Coat Normal"}
# What a node shows in its own output.
CONSTANTS = {"ShaderNodeRGB", "ShaderNodeValue"}
# Shaders that cannot be expressed are shown as diffuse surfaces of this input.
DIFFUSE_OF = ("Base Color", "Color")


def read_graph(
    material, read_image: ReadImage, read_sky: ReadSky | None = None, image_of: ImageOf | None = None
) -> ReadGraph:
    """The graph of a bpy material's or world's surface. Black where nothing is linked to its output, as in Cycles.

    A material without nodes is a Diffuse BSDF of its viewport colour. A Sky Texture is read where ``read_sky`` does.
    Without ``image_of`` all images are taken for scene-linear ones of one tile.
    """
    reader = _Reader(read_image, read_sky, image_of or (lambda key: None))
    tree, socket = node_tree(material), None
    if tree is None:
        surface = reader.diffuse(tuple(material.diffuse_color[:3]))
    else:
        output = active_output(tree)
        socket = find_input(output, "Surface") if output else None
        if output:
            reader.displace(find_input(output, "Displacement"))
        if socket:
            reader.read_inputs_first(socket)
        surface = reader.source(socket, SHADER).source if socket else None
        if output and surface is None and reader.has_volume(output):
            surface = reader.transparent()
    if isinstance(surface, Slot) and socket and socket.socket.is_linked:
        surface = reader.constant(surface)
    link = surface if isinstance(surface, Link) else None
    graph = NodeGraph(tuple(reader.nodes), link)
    filled = FilledGraph(graph, reader.values.array().tobytes(), tuple(reader.images))
    unsupported = list(reader.unsupported)
    if reader.crowded_out:
        unsupported.append(
            f"{reader.crowded_out} of its images are too many ({MAX_IMAGES} fit), magenta is shown instead"
        )
    return ReadGraph(filled, tuple(unsupported))


class _Reader:
    def __init__(self, read_image: ReadImage, read_sky: ReadSky | None, image_of: ImageOf):
        self.nodes: list[Node] = []
        self.values = Values()
        self.images: dict[Hashable, None] = {}
        self.unsupported: dict[str, None] = {}
        self._normal: Link | Place = Place("normal")  # what normals are that nothing is linked to
        self.crowded_out = 0  # images beyond what one shader can have
        self._read_image = read_image
        self._read_sky = read_sky
        self._image_of = image_of
        self._links: dict[tuple, int | None] = {}  # None: being read
        self._depth = 0

    def read_inputs_first(self, socket: Socket) -> None:
        """Read every node behind a socket, those further back before: trees are deeper than calls may go."""
        waiting, seen = [socket], set()
        while waiting:
            found, _ = self._follow(waiting[-1])
            key = _key(found)
            if not found.socket.is_output or found.node.mute or found.node.bl_idname in CONSTANTS or key in self._links:
                waiting.pop()
            elif key in seen:
                waiting.pop()
                self._read(found)
            else:
                seen.add(key)
                waiting += [Socket(s, found.groups) for s in found.node.inputs if s.enabled and s.is_linked]

    def _read(self, found: Socket) -> None:
        key = _key(found)
        self._links[key] = None
        self._depth += 1
        self._links[key] = self._node(found)
        self._depth -= 1

    def displace(self, socket: Socket | None) -> None:
        """Have a Displacement node's height as a bump under all shaders: what it does to light, if not to outlines."""
        found = self._follow(socket)[0] if socket else None
        if socket is None or found is None or not found.socket.is_output or found.node.mute:
            return
        height, scale = found.input("Height"), found.input("Scale")
        if found.node.bl_idname != "ShaderNodeDisplacement" or height is None or scale is None:
            self._name(found.node, "is not supported, nothing is displaced")
            return
        self.read_inputs_first(height)
        self.read_inputs_first(scale)
        inputs = (
            Input("Height", FLOAT, self.source(height, FLOAT).source),
            Input("Strength", FLOAT, self.values.add(FLOAT, (1.0,))),
            Input("Distance", FLOAT, self.source(scale, FLOAT).source),
            Input("Normal", VECTOR, self._normal),
        )
        self.nodes.append(Node("ShaderNodeBump", inputs, (("Normal", VECTOR),), (("invert", False),)))
        self._normal = Link(len(self.nodes) - 1, "Normal")

    # Where values come from

    def source(self, socket: Socket, type: str) -> Input:
        """An input of a node, by what really feeds it."""
        name = socket.socket.identifier
        found, through_number = self._follow(socket)
        if not found.socket.is_output:
            return Input(name, type, self._constant(socket, found))
        source = self._output(found, socket)
        ends = {type, TYPES.get(found.socket.type)}
        if through_number and isinstance(source, Link) and FLOAT not in ends:
            # A group's or reroute's number between two colours makes them grey.
            single = Input("Value", FLOAT, source)
            self.nodes.append(Node("Number", (single,), (("Value", FLOAT),)))
            source = Link(len(self.nodes) - 1, "Value")
        return Input(name, type, source)

    def _follow(self, socket: Socket) -> tuple[Socket, bool]:
        """The output or unlinked input at a link's other end, and whether a number was passed on the way."""
        at, numbers = socket, 0
        for _ in range(MAX_STEPS):
            back = step_back(at)
            if back is None:
                break
            at = back
            numbers += TYPES.get(at.socket.type) == FLOAT
        return at, numbers > 0

    def _constant(self, socket: Socket, found: Socket) -> Slot | Link | Place | None:
        node, own = socket.node, found.socket == socket.socket
        name = socket.socket.identifier
        if own and name in NORMALS and node.bl_idname != "ShaderNodeNormal":
            return self._normal
        if own and name == "Vector" and node.bl_idname.startswith("ShaderNodeTex"):
            if node.bl_idname == "ShaderNodeTexEnvironment":
                return Place("position")
            image = node.bl_idname == "ShaderNodeTexImage"
            return Place("uv" if image and node.projection == "FLAT" else "generated")
        if own and name == "Tangent":
            return Place("tangent")
        return self._slot(found.socket)

    def _slot(self, socket) -> Slot | None:
        """The slot of a socket's own number; None for a shader."""
        type = TYPES.get(socket.type)
        if type is None or type == SHADER:
            return None
        return self.values.add(type, numbers(socket.default_value, type))

    def zero(self, type: str | None) -> Slot | None:
        return self.values.add(FLOAT, (0.0,)) if type not in (SHADER, None) else None

    def _output(self, found: Socket, asked: Socket) -> Link | Slot | None:
        """The link to an output, after its node was read; what stands for it where that cannot be."""
        node = found.node
        if node.mute:
            return self.zero(TYPES.get(found.socket.type))
        if node.bl_idname in CONSTANTS:
            return self._slot(found.socket)
        key = _key(found)
        if key not in self._links:
            if self._depth >= MAX_DEPTH:
                return self._instead(found, asked, "is part of a circle of links")
            self._read(found)
        index = self._links[key]
        if index is None:
            return self._instead(found, asked, "is part of a circle of links")
        if not gives(self.nodes[index], found.socket.identifier):
            return self._instead(found, asked, f"does not give '{found.socket.name}'")
        return Link(index, found.socket.identifier)

    # Nodes

    def _node(self, found: Socket) -> int | None:
        node = found.node
        if node.bl_idname == "ShaderNodeTexSky" and self._read_sky is not None:
            return self._sky(found, self._read_sky)
        if not is_supported(node.bl_idname):
            return None
        if node.bl_idname in {"ShaderNodeTexImage", "ShaderNodeTexEnvironment"}:
            return self._image(found)
        if node.bl_idname == "ShaderNodeTexCoord" and node.object is not None and node.outputs["Object"].is_linked:
            self._name(node, f"takes coordinates of the object itself, not of '{node.object.name}'")
        table = curve_rows(node)
        extra, options = self._properties(node)
        if node.bl_idname == "ShaderNodeTexVoronoi" and bpy.app.version < (5, 0, 0):
            options.append(("float_hash", True))  # its cells lay elsewhere
        if node.bl_idname == "ShaderNodeNormal":  # which keeps its number in its output
            extra.append(("direction", self._slot(node.outputs["Normal"])))
        if table is not None:
            rows, low, high, extended = table
            extra += [("low", self.values.add(FLOAT, (low,))), ("high", self.values.add(FLOAT, (high,)))]
            options.append(("extended", extended))
        return self._append(found, extra, options, self.values.add_table(table[0]) if table is not None else -1)

    def _append(self, found: Socket, extra: list, options: list, table: int = -1, image: int = -1) -> int:
        node = found.node
        inputs = [
            self.source(Socket(s, found.groups), TYPES[s.type])
            for s in node.inputs
            if s.enabled and s.type in TYPES and s.identifier != "Weight"
        ]
        inputs += [Input(name, slot.type, slot) for name, slot in extra]
        outputs = tuple((s.identifier, TYPES[s.type]) for s in node.outputs if s.enabled and s.type in TYPES)
        self.nodes.append(Node(node.bl_idname, tuple(inputs), outputs, tuple(options), table, image))
        return len(self.nodes) - 1

    def _properties(self, node) -> tuple[list, list]:
        """A node's own properties: numbers as slots, the rest as options."""
        extra, options = [], []
        common = node.bl_rna.base.properties
        for prop in node.bl_rna.properties:
            if prop.identifier in common or prop.type in {"POINTER", "COLLECTION"} or getattr(prop, "is_array", False):
                continue
            value = getattr(node, prop.identifier)
            if prop.type in {"INT", "FLOAT"}:
                extra.append((prop.identifier, self.values.add(FLOAT, (float(value),))))
            else:
                options.append((prop.identifier, value))
        return extra, options

    def _image(self, found: Socket) -> int:
        node = found.node
        key = self._read_image(node.image, node.image_user) if node.image is not None else None
        full = key is not None and key not in self.images and len(self.images) >= MAX_IMAGES
        if full:
            self.crowded_out += 1
        if node.image is None:
            self._name(node, "has no image, magenta is shown")
        if key is None or full:
            return self._plain(node, MAGENTA)
        self.images.setdefault(key)
        extra, options = self._properties(node)
        # As in Cycles: a colour whose alpha goes nowhere is dark where it is transparent.
        straight = any(s.identifier == "Alpha" and s.is_linked for s in node.outputs)
        apart = node.image.colorspace_settings.is_data or node.image.alpha_mode == "CHANNEL_PACKED"
        image, table = self._image_of(key), -1
        options.append(("alpha", "DATA" if apart else "STRAIGHT" if straight else "TIMES"))
        options.append(("is_srgb", image is not None and image.is_srgb))
        options.append(("tiled", image is not None and bool(image.tiles)))
        if image is not None and image.tiles:
            rows = _tile_rows(image)
            table = self.values.add_table(rows)
            extra.append(("tiles", self.values.add(FLOAT, (float(len(rows)),))))
        return self._append(found, extra, options, table, list(self.images).index(key))

    def _sky(self, found: Socket, read_sky: ReadSky) -> int:
        key, sun = read_sky(found.node)
        self.images.setdefault(key)
        vector = found.input("Vector")
        inputs = [self.source(vector, VECTOR) if vector else Input("Vector", VECTOR, Place("generated"))]
        for name, given in sun.items():
            type = FLOAT if len(given) == 1 else COLOR
            inputs.append(Input(name, type, self.values.add(type, given)))
        self.nodes.append(Node("Sky", tuple(inputs), (("Color", COLOR),), image=list(self.images).index(key)))
        return len(self.nodes) - 1

    def constant(self, slot: Slot) -> Link:
        """A link to a constant, for what takes links only."""
        self.nodes.append(Node("Plain", (Input("Color", COLOR, slot),), (("Color", COLOR),)))
        return Link(len(self.nodes) - 1, "Color")

    def _plain(self, node, rgb) -> int:
        """A node that gives one colour in all its outputs, and no transparency."""
        color = Input("Color", COLOR, self.values.add(COLOR, rgb))
        one = Input("Alpha", FLOAT, self.values.add(FLOAT, (1.0,)))
        self.nodes.append(Node("Plain", (color, one), (("Color", COLOR), ("Alpha", FLOAT))))
        return len(self.nodes) - 1

    def has_volume(self, output) -> bool:
        """Whether a material is nothing but a volume, whose surface is not seen."""
        volume = find_input(output, "Volume")
        found = self._follow(volume)[0] if volume else None
        if found is None or not found.socket.is_output:
            return False
        self._name(found.node, "is a volume, nothing is drawn")
        return True

    def transparent(self) -> Link:
        """A shader that lets everything pass."""
        white = Input("Color", COLOR, self.values.add(COLOR, (1.0, 1.0, 1.0)))
        self.nodes.append(Node("ShaderNodeBsdfTransparent", (white,), (("BSDF", SHADER),)))
        return Link(len(self.nodes) - 1, "BSDF")

    # What cannot be read

    def _name(self, node, what: str) -> None:
        self.unsupported.setdefault(f"node '{node.name}' {what}")

    def _instead(self, found: Socket, asked: Socket, why: str) -> Link | Slot | None:
        """What stands for an output that cannot be had: an input of its own kind, or the asking socket's number."""
        node, type = found.node, TYPES.get(found.socket.type)
        if not is_supported(node.bl_idname):
            why = "is not supported"
        if type == SHADER:
            return self._instead_of_shader(found, why)
        passed = next((s for s in node.inputs if s.enabled and TYPES.get(s.type) == type and s.is_linked), None)
        if passed is not None and not is_supported(node.bl_idname) and self._depth < MAX_DEPTH:
            self._name(node, f"{why}, its input '{passed.name}' is passed on")
            self._depth += 1
            source = self.source(Socket(passed, found.groups), type or FLOAT).source
            self._depth -= 1
            return source if not isinstance(source, Place) else self._slot(asked.socket)
        self._name(node, f"{why}, the socket's own value is shown")
        return self._slot(asked.socket)

    def _instead_of_shader(self, found: Socket, why: str) -> Link | None:
        for name in DIFFUSE_OF:
            color = found.input(name)
            if color is not None and self._depth < MAX_DEPTH:
                self._name(found.node, f"{why}, it is shown as diffuse")
                self._depth += 1
                given = Input("Color", COLOR, self.source(color, COLOR).source)
                self._depth -= 1
                return self._diffuse(given)
        self._name(found.node, f"{why}, it reflects nothing")
        return None

    def diffuse(self, rgb) -> Link:
        return self._diffuse(Input("Color", COLOR, self.values.add(COLOR, rgb)))

    def _diffuse(self, color: Input) -> Link:
        roughness = Input("Roughness", FLOAT, self.values.add(FLOAT, (0.0,)))
        normal = Input("Normal", VECTOR, self._normal)
        self.nodes.append(Node("ShaderNodeBsdfDiffuse", (color, roughness, normal), (("BSDF", SHADER),)))
        return Link(len(self.nodes) - 1, "BSDF")


def _key(found: Socket) -> tuple[int, ...]:
    """A node within the groups that lead to it."""
    return (found.node.as_pointer(), *(group.as_pointer() for group in found.groups))


def numbers(value, type: str) -> tuple[float, ...]:
    """A socket's value as the one or three numbers of its type, within MOST; what is not finite counts as 0."""
    several = [float(v) for v in value] if hasattr(value, "__len__") else [float(value)]
    count = 1 if type == FLOAT else 3
    several = (several * count if len(several) == 1 else several)[:count]
    return tuple(min(max(v, -MOST), MOST) if math.isfinite(v) else 0.0 for v in several)


def _tile_rows(image: Image) -> np.ndarray:
    """(n, 4): where the tiles 1001, 1002, … lie in an image, x, y, width, height; zeros where there is none."""
    rows = np.zeros((max(tile[0] for tile in image.tiles) - 1000, 4))
    for number, *place in image.tiles:
        rows[number - 1001] = place
    return rows
