"""Reading node trees: groups, reroutes, muted nodes and links, circles, what is missing, and what is not supported."""

import shutil
import subprocess
from dataclasses import replace

import bpy
import numpy as np
import pytest

from rebound.gpu_shaders.materials import generate
from rebound.gpu_shaders.materials.node_code import _CODE as NODE_CODE
from rebound.scene.node_graph import Link, Place, Slot
from rebound.scene.node_reader import read_graph
from rebound.tests.support.material_programs import material_program
from rebound.tests.support.node_sheet import by_identifier, emit, new_material

COLOR = (0.2, 0.4, 0.6, 1)


@pytest.fixture
def tree(clean_scene):
    return new_material("Tested").node_tree


def read(images=None):
    return read_graph(bpy.data.materials["Tested"], lambda image, user: (images or {}).get(image.name))


def add(tree, kind, **inputs):
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        by_identifier(node.inputs, name).default_value = value
    return node


def shown(found):
    """The values of the emission's colour, which no node makes."""
    emission = found.filled.graph.nodes[found.filled.graph.surface.node]
    assert emission.kind == "ShaderNodeEmission"
    source = emission.inputs[0].source
    assert isinstance(source, Slot)
    return found.filled.table.ravel()[source.index : source.index + 3]


def test_default_material_is_a_principled_surface(clean_scene):
    made = bpy.data.materials.new("Tested")
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    found = read()
    assert [node.kind for node in found.filled.graph.nodes] == ["ShaderNodeBsdfPrincipled"]
    given = {entry.name: entry.source for entry in found.filled.graph.nodes[0].inputs}
    assert isinstance(given["Base Color"], Slot) and given["Normal"] == Place("normal")
    np.testing.assert_allclose(found.filled.table.ravel()[given["Base Color"].index :][:3], 0.8, atol=1e-6)
    assert not found.unsupported
    assert "surface_principled" in generate(found.filled.graph).text


def test_a_number_changes_values_and_not_the_graph(tree):
    node = add(tree, "ShaderNodeTexNoise", Scale=3.0)
    emit(tree, node.outputs[0])
    before = read()
    by_identifier(node.inputs, "Scale").default_value = 5.0
    after = read()
    assert before.filled.graph == after.filled.graph and not np.array_equal(before.filled.values, after.filled.values)
    node.noise_dimensions = "2D"
    assert read().filled.graph != after.filled.graph


def test_reroutes_and_muted_nodes_are_passed_through(tree):
    rgb, reroute, muted = (
        tree.nodes.new("ShaderNodeRGB"),
        tree.nodes.new("NodeReroute"),
        tree.nodes.new("ShaderNodeInvert"),
    )
    rgb.outputs[0].default_value = COLOR
    muted.mute = True
    tree.links.new(rgb.outputs[0], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], by_identifier(muted.inputs, "Color"))
    emit(tree, muted.outputs[0])
    np.testing.assert_allclose(shown(read()), COLOR[:3], atol=1e-6)


def test_a_muted_link_leaves_the_sockets_own_value(tree):
    noise = add(tree, "ShaderNodeTexNoise")
    emit(tree, noise.outputs[0])
    emission = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeEmission")
    emission.inputs[0].default_value = COLOR
    emission.inputs[0].links[0].is_muted = True
    np.testing.assert_allclose(shown(read()), COLOR[:3], atol=1e-6)


def group_of(kind="ShaderNodeInvert"):
    """A node group with a colour in and out, one node between."""
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("In", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
    start, end, node = (group.nodes.new(k) for k in ("NodeGroupInput", "NodeGroupOutput", kind))
    group.links.new(start.outputs[0], by_identifier(node.inputs, "Color"))
    group.links.new(node.outputs[0], end.inputs[0])
    return group


def test_a_group_used_twice_is_read_with_both_inputs(tree):
    outer = bpy.data.node_groups.new("Outer", "ShaderNodeTree")
    outer.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
    first, second = outer.nodes.new("ShaderNodeGroup"), outer.nodes.new("ShaderNodeGroup")
    first.node_tree = second.node_tree = group_of()
    first.inputs[0].default_value = COLOR
    outer.links.new(first.outputs[0], second.inputs[0])
    outer.links.new(second.outputs[0], outer.nodes.new("NodeGroupOutput").inputs[0])
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = outer
    emit(tree, node.outputs[0])
    found = read()
    assert [n.kind for n in found.filled.graph.nodes] == ["ShaderNodeInvert"] * 2 + ["ShaderNodeEmission"]
    source = next(entry.source for entry in found.filled.graph.nodes[0].inputs if entry.name == "Color")
    np.testing.assert_allclose(found.filled.table.ravel()[source.index :][:3], COLOR[:3], atol=1e-6)
    assert Link(0, "Color") in [entry.source for entry in found.filled.graph.nodes[1].inputs]


def test_a_groups_number_makes_a_colour_grey(tree):
    group = bpy.data.node_groups.new("Number", "ShaderNodeTree")
    group.interface.new_socket("In", in_out="INPUT", socket_type="NodeSocketFloat")
    group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
    start, end, node = (group.nodes.new(k) for k in ("NodeGroupInput", "NodeGroupOutput", "ShaderNodeInvert"))
    group.links.new(start.outputs[0], by_identifier(node.inputs, "Color"))
    group.links.new(node.outputs[0], end.inputs[0])
    outer, noise = tree.nodes.new("ShaderNodeGroup"), add(tree, "ShaderNodeTexNoise")
    outer.node_tree = group
    tree.links.new(by_identifier(noise.outputs, "Color"), outer.inputs[0])
    emit(tree, outer.outputs[0])
    assert "float n1_value = color_gray(n0_color);" in generate(read().filled.graph).text


def test_unsupported_nodes_are_named_and_replaced(tree):
    moved, waves = tree.nodes.new("ShaderNodeDisplacement"), tree.nodes.new("ShaderNodeWavelength")
    moved.name, waves.name = "Moved", "Waves"
    tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Position"], moved.inputs["Normal"])
    mix = add(tree, "ShaderNodeMixRGB", Fac=0.3)
    tree.links.new(moved.outputs["Displacement"], by_identifier(mix.inputs, "Color1"))
    tree.links.new(waves.outputs["Color"], by_identifier(mix.inputs, "Fac"))
    emit(tree, mix.outputs[0])
    found = read()
    assert found.unsupported == (
        "node 'Waves' is not supported, the socket's own value is shown",
        "node 'Moved' is not supported, its input 'Normal' is passed on",
    )
    mixed = next(n for n in found.filled.graph.nodes if n.kind == "ShaderNodeMixRGB")
    given = {entry.name: entry.source for entry in mixed.inputs}
    assert isinstance(given["Color1"], Link) and found.filled.table.ravel()[given["Fac"].index] == pytest.approx(0.3)


def test_an_output_that_is_not_supported_is_named(tree, monkeypatch):
    place, mix = tree.nodes.new("ShaderNodeTexCoord"), add(tree, "ShaderNodeMixRGB", Fac=0.3)
    place.name = "Place"
    whole = NODE_CODE["ShaderNodeTexCoord"]
    monkeypatch.setitem(NODE_CODE, "ShaderNodeTexCoord", replace(whole, outputs={"UV": whole.outputs["UV"]}))
    tree.links.new(place.outputs["Camera"], by_identifier(mix.inputs, "Fac"))
    tree.links.new(place.outputs["UV"], by_identifier(mix.inputs, "Color1"))
    emit(tree, mix.outputs[0])
    found = read()
    assert found.unsupported == ("node 'Place' does not give 'Camera', the socket's own value is shown",)
    assert "point.uv" in generate(found.filled.graph).text


def test_coordinates_of_another_object_are_named(tree):
    place, mix = tree.nodes.new("ShaderNodeTexCoord"), add(tree, "ShaderNodeMixRGB", Fac=0.3)
    place.name, place.object = "Place", bpy.data.objects.new("Target", None)
    tree.links.new(place.outputs["Generated"], by_identifier(mix.inputs, "Color2"))
    emit(tree, mix.outputs[0])
    assert read().unsupported == ()
    tree.links.new(place.outputs["Object"], by_identifier(mix.inputs, "Color1"))
    assert read().unsupported == ("node 'Place' takes coordinates of the object itself, not of 'Target'",)


def test_an_unsupported_shader_is_diffuse_of_its_colour(tree):
    hair, output = add(tree, "ShaderNodeBsdfHair", Color=COLOR), tree.nodes.new("ShaderNodeOutputMaterial")
    hair.name = "Hair"
    tree.links.new(hair.outputs[0], output.inputs["Surface"])
    found = read()
    assert [n.kind for n in found.filled.graph.nodes] == ["ShaderNodeBsdfDiffuse"]
    assert found.unsupported == ("node 'Hair' is not supported, it is shown as diffuse",)


@pytest.mark.parametrize(
    ("kind", "socket", "text"),
    [
        ("ShaderNodeAmbientOcclusion", "AO", "= 1.0;"),
        ("ShaderNodeBevel", "Normal", "= point.normal;"),
        ("ShaderNodeWireframe", "Fac", "= 0.0;"),
        ("ShaderNodeNewGeometry", "Pointiness", "= 0.5;"),
        ("ShaderNodeNewGeometry", "Random Per Island", "= point.object_random;"),
        ("ShaderNodeHairInfo", "Random", "= point.object_random;"),
        ("ShaderNodeParticleInfo", "Size", "= 0.0;"),
        ("ShaderNodeTangent", "Tangent", "vector_around_z"),
        ("ShaderNodeLightFalloff", "Linear", "length(point.camera_position)"),
        ("ShaderNodeNormal", "Dot", "dot(vector_normalize("),
    ],
)
def test_what_a_surface_is_not_told_is_the_plainest_case(tree, kind, socket, text):
    emit(tree, tree.nodes.new(kind).outputs[socket])
    found = read()
    assert found.unsupported == () and text in generate(found.filled.graph).text


def test_a_normal_node_keeps_its_direction_in_its_output(tree):
    node = tree.nodes.new("ShaderNodeNormal")
    node.outputs["Normal"].default_value = (0.6, 0.0, 0.8)
    emit(tree, node.outputs["Normal"])
    found = read().filled
    given = {entry.name: entry.source for entry in found.graph.nodes[0].inputs}
    np.testing.assert_allclose(found.table.ravel()[given["direction"].index :][:3], (0.6, 0.0, 0.8), atol=1e-6)


@pytest.mark.parametrize(
    "kind", ["BsdfTranslucent", "BsdfToon", "BsdfSheen", "EeveeSpecular", "BsdfDiffuse", "BsdfMetallic"]
)
def test_shaders_are_supported(tree, kind):
    shader, output = tree.nodes.new(f"ShaderNode{kind}"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    found = read()
    assert found.unsupported == () and found.filled.graph.nodes[-1].kind == f"ShaderNode{kind}"


def test_a_volume_alone_has_no_surface(tree):
    volume, output = tree.nodes.new("ShaderNodeVolumePrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    found = read()
    assert [node.kind for node in found.filled.graph.nodes] == ["ShaderNodeBsdfTransparent"]
    assert found.unsupported == ("node 'Principled Volume' is a volume, nothing is drawn",)


def test_a_circle_of_links_ends(tree):
    first, second = add(tree, "ShaderNodeInvert"), add(tree, "ShaderNodeInvert")
    tree.links.new(first.outputs[0], by_identifier(second.inputs, "Color"))
    tree.links.new(second.outputs[0], by_identifier(first.inputs, "Color"))
    emit(tree, second.outputs[0])
    assert "surface_emission" in generate(read().filled.graph).text


def test_a_very_deep_tree_is_read(tree):
    socket = add(tree, "ShaderNodeTexNoise").outputs["Color"]
    for _ in range(500):
        node = add(tree, "ShaderNodeInvert")
        tree.links.new(socket, by_identifier(node.inputs, "Color"))
        socket = node.outputs[0]
    emit(tree, socket)
    found = read()
    assert len(found.filled.graph.nodes) == 502 and not found.unsupported


@pytest.mark.parametrize("kind", ["ShaderNodeRGB", "ShaderNodeTexNoise"])
def test_a_colour_as_a_surface_is_emitted(tree, kind):
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(tree.nodes.new(kind).outputs["Color"], output.inputs["Surface"])
    assert "return surface_emission(n0_color, 1.0, point.normal);" in generate(read().filled.graph).text


def test_nothing_linked_to_the_output_is_black(tree):
    tree.nodes.new("ShaderNodeOutputMaterial")
    assert read().filled.graph.surface is None
    tree.nodes.clear()
    assert read().filled.graph.surface is None


@pytest.mark.parametrize("file", ["sample_materials", "templates"])
def test_real_materials_are_read_and_generated(clean_scene, shared_dir, tmp_path, file):
    """Materials that artists made: each gives a shader that compiles."""
    with bpy.data.libraries.load(str(shared_dir / "scenes/nodes" / f"{file}.blend")) as (there, here):
        here.materials = there.materials
    found = [read_graph(material, lambda image, user: image.name) for material in bpy.data.materials]
    assert sum(one.filled.graph.surface is not None for one in found) > len(found) / 2
    files = []
    for one in {one.filled.graph: one for one in found}.values():
        files.append(tmp_path / f"{len(files)}.frag")
        files[-1].write_text(material_program(generate(one.filled.graph)).standalone_sources()["frag"])
    assert files
    if shutil.which("glslangValidator"):
        answer = subprocess.run(["glslangValidator", *files], capture_output=True, text=True, check=False)
        assert answer.returncode == 0, answer.stdout
