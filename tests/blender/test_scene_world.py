"""Worlds: what is one colour, what becomes a graph, and what is named as not read."""

import bpy
import pytest

from rebound.scene.convert import convert_scene


@pytest.fixture
def world(clean_scene):
    """A world with its Background node."""
    made = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    return made


def convert():
    return convert_scene(bpy.context.evaluated_depsgraph_get(), for_viewport=True)


def feed(world, kind: str, **values):
    """A new node that feeds the Background's colour."""
    tree = world.node_tree
    node = tree.nodes.new(kind)
    for name, value in values.items():
        setattr(node, name, value)
    tree.links.new(node.outputs[0], tree.nodes["Background"].inputs["Color"])
    return node


def test_a_texture_becomes_a_graph_with_its_image(world):
    image = bpy.data.images.new("panorama", 8, 4, float_buffer=True)
    feed(world, "ShaderNodeTexEnvironment", image=image)
    scene = convert()
    assert [node.kind for node in scene.world.graph.nodes] == ["ShaderNodeTexEnvironment", "ShaderNodeBackground"]
    assert scene.world.color == (0, 0, 0) and scene.world.shines
    assert scene.world.images == tuple(scene.images) and scene.warnings == ()


def test_a_volume_is_named(world):
    volume = world.node_tree.nodes.new("ShaderNodeVolumePrincipled")
    world.node_tree.links.new(volume.outputs[0], world.node_tree.nodes["World Output"].inputs["Volume"])
    scene = convert()
    assert len(scene.warnings) == 1 and "volumes are not supported" in scene.warnings[0]


def test_numbers_are_no_part_of_the_graph(world):
    node = feed(world, "ShaderNodeTexGradient")
    before = convert().world
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 3.0
    after = convert().world
    assert before.graph == after.graph and before.values != after.values
    node.gradient_type = "RADIAL"
    assert convert().world.graph != before.graph


def test_colours_that_nodes_hold_are_one_colour(world):
    node = feed(world, "ShaderNodeRGB")
    node.outputs[0].default_value = (0.25, 0.5, 1.0, 1.0)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 2.0
    assert convert().world.color == (0.5, 1.0, 2.0) and convert().world.graph is None


def test_a_missing_file_is_magenta_with_one_line(world):
    image = bpy.data.images.new("gone", 8, 8)
    image.source, image.filepath = "FILE", "//no such file.exr"
    feed(world, "ShaderNodeTexEnvironment", image=image)
    assert len(convert().warnings) == 1 and "'gone'" in convert().warnings[0]


def test_a_node_that_is_not_supported_is_named(world):
    feed(world, "ShaderNodeTexGabor")
    lines = convert().warnings
    assert len(lines) == 1 and "World 'Sky'" in lines[0] and "'Gabor Texture'" in lines[0]


def test_coordinates_of_the_picture_are_named(world):
    node = world.node_tree.nodes.new("ShaderNodeTexCoord")
    world.node_tree.links.new(node.outputs["Window"], world.node_tree.nodes["Background"].inputs["Color"])
    assert "Window coordinates" in convert().warnings[0]


def test_ray_visibility_and_the_suns_settings_are_read(world):
    world.sun_threshold, world.sun_angle = 4.0, 0.25
    if hasattr(world, "cycles_visibility"):
        world.cycles_visibility.camera = world.cycles_visibility.glossy = False
        read = convert().world
        assert (read.seen, read.diffuse, read.glossy) == (False, True, False)
    assert (convert().world.sun_threshold, convert().world.sun_angle) == (4.0, 0.25)
