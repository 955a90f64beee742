"""Nodes on a sheet: many materials beside one another, by Cycles and by the GLSL that is generated from them.

Each cell is a piece of one mesh with two vector attributes, "a" and "b", random at its vertices. Cycles renders what
the attributes are at each pixel's sample, and what the material makes of them; the GLSL gets the former.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import bpy
import numpy as np

from rebound.device import Shader
from rebound.gpu_shaders.frame.tables import replace_texels
from rebound.gpu_shaders.materials import generate
from rebound.scene.images import ImageReader
from rebound.scene.node_reader import read_graph
from rebound.tests.support.blender_build import link

CELL = 16  # pixels of a cell's side
QUADS = 4  # of a cell's side
COLUMNS = 16
SEED = 7


@dataclass(frozen=True)
class NodeCase:
    """A node under test: properties, constants of inputs by identifier, or what feeds them: "a", "b.x", …"""

    kind: str
    output: str
    inputs: dict = field(default_factory=dict)
    properties: dict = field(default_factory=dict)
    low: float = -2.0  # range of the attributes
    high: float = 2.0
    setup: Callable | None = None  # called with the node
    tolerance: float = 1e-3
    reason: str = ""  # for another tolerance
    flat: bool = False  # the same all over: a limit, or a factor of 0
    tilt: tuple[float, float, float] = (0.0, 0.0, 1.0)  # the cell's normal, not of unit length

    @property
    def name(self) -> str:
        return "-".join([self.kind.removeprefix("ShaderNode"), self.output, *map(str, self.properties.values())])


def by_identifier(sockets, identifier):
    return next(s for s in sockets if s.identifier == identifier)


def new_material(name):
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    made.node_tree.nodes.clear()
    return made


def emit(tree, socket) -> None:
    """Let a material emit what a socket gives."""
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(socket, emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])


def attribute(tree, place: str):
    """The socket of "a", or of its component "a.x"."""
    name, _, axis = place.partition(".")
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name = name
    if not axis:
        return node.outputs["Vector"]
    parts = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(node.outputs["Vector"], parts.inputs[0])
    return parts.outputs["XYZ".index(axis.upper())]


def case_material(case: NodeCase):
    """A material that emits the node's output."""
    made = new_material(case.name)
    tree = made.node_tree
    node = tree.nodes.new(case.kind)
    for name, value in case.properties.items():
        setattr(node, name, value)
    for name, value in case.inputs.items():
        socket = by_identifier(node.inputs, name)
        if isinstance(value, str):
            tree.links.new(attribute(tree, value), socket)
        else:
            socket.default_value = value
    if case.setup:
        case.setup(node)
    emit(tree, by_identifier(node.outputs, case.output))
    return made


def sheet_mesh(cases):
    """One mesh, a material slot and QUADS² quads for each case; returns (mesh, columns, rows)."""
    columns = min(COLUMNS, len(cases))
    rows = -(-len(cases) // columns)
    rng = np.random.default_rng(SEED)
    line = np.arange(QUADS + 1) / QUADS
    grid = np.stack(np.meshgrid(line, line), -1).reshape(-1, 2)
    corner = np.arange(QUADS)[None, :] + (QUADS + 1) * np.arange(QUADS)[:, None]
    quads = (corner.reshape(-1, 1) + [0, 1, QUADS + 2, QUADS + 1]).tolist()
    points, faces, values = [], [], {"a": [], "b": []}
    for k, case in enumerate(cases):
        faces += [[len(points) * len(grid) + i for i in quad] for quad in quads]
        heights = -(grid @ np.array(case.tilt[:2])) / case.tilt[2]
        points.append(np.column_stack([grid + [k % columns, k // columns], heights]))
        for value in values.values():
            value.append(rng.uniform(case.low, case.high, (len(grid), 3)))
    mesh = bpy.data.meshes.new("Sheet")
    mesh.from_pydata(np.concatenate(points).tolist(), [], faces)
    for name, value in values.items():
        layer = mesh.attributes.new(name, "FLOAT_VECTOR", "POINT")
        layer.data.foreach_set("vector", np.concatenate(value).astype(np.float32).ravel())
    uv = np.concatenate(points)[np.array(faces).ravel(), :2]
    mesh.uv_layers.new(name="UV").uv.foreach_set("vector", uv.astype(np.float32).ravel())
    slots = np.repeat(np.arange(len(cases)), QUADS * QUADS)
    mesh.polygons.foreach_set("material_index", slots.astype(np.int32))
    mesh.update()
    return mesh, columns, rows


def render_sheet(folder, cases, materials):
    """What Cycles gives for "a", "b" and each material: three arrays (n, CELL, CELL, 3), row 0 at the bottom."""
    scene = bpy.context.scene
    mesh, columns, rows = sheet_mesh(cases)
    for made in materials:
        mesh.materials.append(made)
    link("Sheet", mesh)
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", max(columns, rows)
    scene.camera = link("Camera", camera, location=(columns / 2, rows / 2, 50))
    pictures = []
    for place in ("a", "b"):
        made = new_material(place)
        emit(made.node_tree, attribute(made.node_tree, place))
        bpy.context.view_layer.material_override = made
        pictures.append(_render(scene, folder / f"{place}.exr", columns, rows))
    bpy.context.view_layer.material_override = None
    pictures.append(_render(scene, folder / "nodes.exr", columns, rows))
    return [_cells(picture, len(cases), columns) for picture in pictures]


def _render(scene, path, columns, rows):
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = columns * CELL, rows * CELL
    cycles.device, cycles.samples, cycles.use_denoising = "CPU", 1, False
    cycles.use_adaptive_sampling, cycles.max_bounces = False, 0
    cycles.sample_clamp_direct = 0
    cycles.pixel_filter_type = "BOX"
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    render.filepath, render.use_file_extension = str(path), False
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], -1)[..., :3].copy()


def _cells(picture, count, columns):
    rows = picture.shape[0] // CELL
    cells = picture.reshape(rows, CELL, columns, CELL, 3).swapaxes(1, 2)
    return cells.reshape(-1, CELL, CELL, 3)[:count]


def image_texture(device, image):
    """An image of the scene's, as the GPU has it."""
    size = image.pixels.shape[1::-1]
    return device.texture(size, "RGBA8" if image.pixels.dtype == np.uint8 else "RGBA32F", image.pixels)


# What the sheet is like: it lies in the plane z = 0, a cell one metre wide, UV along its sides.
POINT = {
    "position": "vec3(uv, 0.0)",
    "object_position": "vec3(uv, 0.0)",
    "world_from_object": "mat4(1.0)",
}


def _fail(line):
    raise AssertionError(line)


def evaluate_material(device, material, a, b, tilt=(0.0, 0.0, 1.0)):
    """What the generated GLSL emits where the attributes are a and b, (h, w, 3) each: (h, w, 3) float32."""
    reader = ImageReader({}, _fail, lambda call: call())
    read = read_graph(material, reader.read, image_of=reader.images.get)
    assert not read.unsupported, read.unsupported
    shader = generate(read.filled.graph)
    given = {f"color_{k}": f"{n.name}_tx" for k, n in enumerate(shader.attributes) if n.field == "color"}
    normal = "normalize(vec3({}, {}, {}))".format(*tilt)
    point = (
        POINT
        | {"object_normal": normal}
        | {need: f"texelFetch({texture}, pixel, 0)" for need, texture in given.items()}
    )
    fields = "".join(
        f"  point.{need} = {point.get(need, 'uv' if need.startswith('uv') else 'vec3(0.0, 0.0, 1.0)')};\n"
        for need in shader.needs
    )
    text = (
        f"{shader.text}\nvoid main()\n{{\n  ivec2 pixel = ivec2(gl_FragCoord.xy);\n  MaterialPoint point;\n{fields}"
        "  out_value = vec4(material_surface(point).emission, 1.0);\n}\n"
    )
    path = "test/material_frag.glsl"
    textures = {"a_tx": a, "b_tx": b}
    sent = {
        name: device.texture((CELL, CELL), "RGBA32F", np.dstack([value, np.ones((CELL, CELL, 1), np.float32)]))
        for name, value in textures.items()
        if name in given.values()
    }
    program = Shader(
        "material_test",
        fragment=path,
        files={path: text},
        outputs={"out_value": "VEC4"},
        samplers=shader.samplers | dict.fromkeys(sent, "FLOAT_2D"),
        constants={"pc_values": "INT"},
        defines=shader.defines,
    )
    result = device.texture((CELL, CELL), "RGBA32F")
    sent["value_tx"] = replace_texels(device, read.filled.table, None)
    sent |= {f"image_{k}_tx": image_texture(device, reader.images[key]) for k, key in enumerate(read.filled.images)}
    device.fullscreen(program, device.target([result]), pc_values=0, **sent)
    return device.read(result)[..., :3]


def deviations(device, folder, cases) -> list[float]:
    """The largest deviation of each case from Cycles, relative where the value is above 1; infinite if not a number."""
    materials = [case_material(case) for case in cases]
    a, b, expected = render_sheet(folder, cases, materials)
    found = [
        evaluate_material(device, material, first, second, case.tilt)
        for case, material, first, second in zip(cases, materials, a, b, strict=True)
    ]
    largest = []
    for case, ours, theirs in zip(cases, found, expected, strict=True):
        assert np.isfinite(theirs).all(), case.name
        assert case.flat or np.ptp(theirs) > 0, f"{case.name}: Cycles shows nothing to test"
        deviation = np.abs(ours - theirs) / np.maximum(np.abs(theirs), 1.0)
        largest.append(float(np.nan_to_num(deviation, nan=np.inf).max()))
    return largest
