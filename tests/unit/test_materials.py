"""The generator of material shaders, on text: equal graphs share one, numbers are no part of it, needs are declared."""

import shutil
import subprocess

import numpy as np
import pytest

from rebound.gpu_shaders.materials import Attribute, generate, is_supported, supported_kinds
from rebound.scene.node_graph import COLOR, FLOAT, SHADER, VECTOR, Input, Link, Node, NodeGraph, Place, Slot, Values
from rebound.tests.support.material_programs import material_program

NORMAL = Input("Normal", VECTOR, Place("normal"))


def diffuse(color) -> Node:
    roughness = Input("Roughness", FLOAT, Slot(3, FLOAT))
    return Node("ShaderNodeBsdfDiffuse", (Input("Color", COLOR, color), roughness, NORMAL), (("BSDF", SHADER),))


def graph(*nodes, output="BSDF") -> NodeGraph:
    return NodeGraph(tuple(nodes), Link(len(nodes) - 1, output))


def test_values_of_numbers_fill_the_texels_of_vectors():
    values = Values()
    slots = [
        values.add(COLOR, (1, 2, 3)),
        values.add(FLOAT, (4,)),
        values.add(FLOAT, (5,)),
        values.add(VECTOR, (6, 7, 8)),
    ]
    assert [slot.index for slot in slots] == [0, 3, 4, 8]
    assert values.add_table(np.full((2, 4), 9.0)) == 3
    assert values.add(FLOAT, (10,)).index == 5
    np.testing.assert_array_equal(
        values.array(), [[1, 2, 3, 4], [5, 10, 0, 0], [6, 7, 8, 0], [9, 9, 9, 9], [9, 9, 9, 9]]
    )


def test_graphs_that_differ_in_numbers_only_share_a_shader():
    one = generate(graph(diffuse(Slot(0, COLOR))))
    assert one == generate(graph(diffuse(Slot(0, COLOR))))
    assert one != generate(graph(diffuse(Slot(4, COLOR))))
    assert one.image_count == 0 and one.attributes == ()


def test_a_graph_without_surface_is_black():
    assert "return surface_black(point.normal);" in generate(NodeGraph()).text


def test_links_are_converted_as_blender_converts_them():
    checker = Node("ShaderNodeTexChecker", (
        Input("Vector", VECTOR, Place("generated")), Input("Color1", COLOR, Slot(0, COLOR)),
        Input("Color2", COLOR, Slot(4, COLOR)), Input("Scale", FLOAT, Slot(3, FLOAT)),
    ), (("Color", COLOR), ("Fac", FLOAT)))  # fmt: skip
    gray = Node("ShaderNodeRGBToBW", (Input("Color", COLOR, Link(0, "Fac")),), (("Val", FLOAT),))
    text = generate(graph(checker, gray, diffuse(Link(1, "Val")))).text
    assert "float n1_val = color_gray(vec3(n0_fac));" in text
    assert "surface_diffuse(vec3(n1_val), point.normal)" in text
    assert "n0_color" not in text, "nothing asks for this output"
    assert "vec3 generated;" in text and "vec3 position;" not in text


def test_attributes_are_numbered_and_named():
    first = Node("ShaderNodeUVMap", (), (("UV", VECTOR),), (("uv_map", "Second"),))
    other = Node("ShaderNodeVertexColor", (), (("Color", COLOR), ("Alpha", FLOAT)), (("layer_name", "Paint"),))
    mixed = Node("ShaderNodeMixRGB", (
        Input("Fac", FLOAT, Slot(0, FLOAT)),
        Input("Color1", COLOR, Link(0, "UV")), Input("Color2", COLOR, Link(1, "Color")),
    ), (("Color", COLOR),), (("blend_type", "BURN"), ("use_clamp", False)))  # fmt: skip
    shader = generate(graph(first, other, mixed, diffuse(Link(2, "Color"))))
    assert shader.attributes == (Attribute("uv", "Second"), Attribute("color", "Paint"))
    assert {"uv_0", "color_1", "normal"} == set(shader.needs)
    assert "color_mix_burn" in shader.text


def test_an_unknown_kind_is_not_supported():
    assert not is_supported("ShaderNodeScript")
    assert len(supported_kinds()) > 40
    with pytest.raises(KeyError, match="ShaderNodeScript"):
        generate(graph(Node("ShaderNodeScript", (), (("BSDF", SHADER),))))


@pytest.mark.skipif(
    shutil.which("glslangValidator") is None, reason="glslangValidator is not installed (Debian: glslang-tools)"
)
def test_generated_text_passes_glslang(tmp_path):
    noise = Node("ShaderNodeTexNoise", (
        Input("Vector", VECTOR, Place("generated")), Input("Scale", FLOAT, Slot(0, FLOAT)),
        Input("Detail", FLOAT, Slot(1, FLOAT)), Input("Distortion", FLOAT, Slot(2, FLOAT)),
    ), (("Fac", FLOAT), ("Color", COLOR)),
        (("noise_dimensions", "3D"), ("noise_type", "FBM"), ("normalize", True)))  # fmt: skip
    shader = material_program(generate(graph(noise, diffuse(Link(0, "Color")))))
    file = tmp_path / "material.frag"
    file.write_text(shader.standalone_sources()["frag"])
    answer = subprocess.run(["glslangValidator", file], capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stdout
