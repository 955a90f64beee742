"""Small Blender scenes for tests, built without operators so that they work in any context and version."""

from __future__ import annotations

import bpy

from rebound.scene.convert import convert_scene

CUBE = (
    [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)],
    [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)],
)
QUAD = ([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 1, 2, 3)])


def convert(for_viewport=False, **options):
    """The scene of the current context, evaluated."""
    return convert_scene(bpy.context.evaluated_depsgraph_get(), for_viewport=for_viewport, **options)


def link(name, data, collection=None, **settings):
    """A new object with this data, linked to a collection (default: the scene's own)."""
    obj = bpy.data.objects.new(name, data)
    (collection or bpy.context.scene.collection).objects.link(obj)
    for key, value in settings.items():
        setattr(obj, key, value)
    return obj


def mesh(name="Mesh", shape=QUAD):
    """A mesh data-block from (vertices, faces)."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(shape[0], [], shape[1])
    data.update()
    return data


def collection(name, *objects_data):
    """A collection that is not in the scene, for instancing."""
    made = bpy.data.collections.new(name)
    for data in objects_data:
        link(data.name, data, made)
    return made


def material(name, color=None):
    """A material with nodes: the default Principled BSDF, in a colour if given."""
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    if color:
        made.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*color, 1)
    return made


def shader_material(name, node_type, **inputs):
    """A material of one shader node that is linked to the output; returns (material, node)."""
    made = material(name)
    tree = made.node_tree
    tree.nodes.clear()
    shader, output = tree.nodes.new(node_type), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return made, shader


def scatter_nodes(obj, scattered=None, realize=False):
    """A geometry nodes modifier: a mesh cube, or the collection ``scattered``, instanced on a 2×2 grid of points."""
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes, links = tree.nodes, tree.links
    grid, scatter, output = (
        nodes.new("GeometryNodeMeshGrid"),
        nodes.new("GeometryNodeInstanceOnPoints"),
        nodes.new("NodeGroupOutput"),
    )
    grid.inputs["Vertices X"].default_value = grid.inputs["Vertices Y"].default_value = 2
    if scattered is None:
        source = nodes.new("GeometryNodeMeshCube")
    else:
        source = nodes.new("GeometryNodeCollectionInfo")
        source.inputs["Collection"].default_value = scattered
    links.new(grid.outputs["Mesh"], scatter.inputs["Points"])
    links.new(source.outputs[0], scatter.inputs["Instance"])
    made = scatter.outputs[0]
    if realize:
        node = nodes.new("GeometryNodeRealizeInstances")
        links.new(made, node.inputs[0])
        made = node.outputs[0]
    links.new(made, output.inputs[0])
    obj.modifiers.new("Scatter", "NODES").node_group = tree
    return tree
