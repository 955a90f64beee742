"""Generated material functions on a GPU: what they make of a table of values and of images."""

import numpy as np
import pytest

from rebound.gpu_shaders.materials import generate
from rebound.scene.node_graph import (
    COLOR,
    FLOAT,
    SHADER,
    TABLE_SIZE,
    VECTOR,
    Input,
    Link,
    Node,
    NodeGraph,
    Place,
    Values,
)
from rebound.tests.support.material_programs import material_program

NORMAL = Input("Normal", VECTOR, Place("normal"))


@pytest.fixture
def run(headless_device):
    """What one field of a graph's surface is."""

    def evaluate(graph, values, shown="diffuse", start=0, **images):
        texels = values.array()
        table = np.zeros((2, 1024, 4), np.float32)
        table.reshape(-1, 4)[start : start + len(texels)] = texels
        sent = {"value_tx": headless_device.texture((1024, 2), "RGBA32F", table)}
        for name, pixels in images.items():
            sent[name] = headless_device.texture(pixels.shape[1::-1], "RGBA32F", pixels.astype(np.float32))
        result = headless_device.texture((1, 1), "RGBA32F")
        program = material_program(generate(graph), shown)
        headless_device.fullscreen(program, headless_device.target([result]), pc_values=start, **sent)
        return headless_device.read(result)[0, 0, :3]

    return evaluate


def diffuse(values, rgb) -> Node:
    inputs = (Input("Color", COLOR, values.add(COLOR, rgb)), Input("Roughness", FLOAT, values.add(FLOAT, (0,))), NORMAL)
    return Node("ShaderNodeBsdfDiffuse", inputs, (("BSDF", SHADER),))


def emission(values, color) -> Node:
    inputs = (Input("Color", COLOR, color), Input("Strength", FLOAT, values.add(FLOAT, (2.0,))))
    return Node("ShaderNodeEmission", inputs, (("Emission", SHADER),))


@pytest.mark.parametrize("start", [0, 1, 1023])
def test_mixed_shaders_are_weighted_sums_of_their_values(run, start):
    values = Values()
    nodes = (diffuse(values, (0.2, 0.4, 0.8)), emission(values, values.add(COLOR, (1, 2, 3))))
    factor = Input("Fac", FLOAT, values.add(FLOAT, (0.25,)))
    mixed = Node(
        "ShaderNodeMixShader",
        (factor, Input("Shader", SHADER, Link(0, "BSDF")), Input("Shader_001", SHADER, Link(1, "Emission"))),
        (("Shader", SHADER),),
    )
    graph = NodeGraph((*nodes, mixed), Link(2, "Shader"))
    np.testing.assert_allclose(run(graph, values, start=start), [0.15, 0.3, 0.6], atol=1e-6)
    np.testing.assert_allclose(run(graph, values, "emission", start), [0.5, 1.0, 1.5], atol=1e-6)


def test_a_ramp_is_read_from_its_table(run):
    values = Values()
    factor = Input("Fac", FLOAT, values.add(FLOAT, (0.3,)))
    rows = np.linspace(0, 1, TABLE_SIZE)[:, None] * [1, 2, 3, 0]
    ramp = Node("ShaderNodeValToRGB", (factor,), (("Color", COLOR), ("Alpha", FLOAT)), (("extended", True),),
                table=values.add_table(rows))  # fmt: skip
    graph = NodeGraph((ramp, emission(values, Link(0, "Color"))), Link(1, "Emission"))
    np.testing.assert_allclose(run(graph, values, "emission"), [0.6, 1.2, 1.8], atol=1e-5)


def test_an_image_is_looked_up_by_its_sampler(run):
    values = Values()
    options = (("projection", "FLAT"), ("interpolation", "Linear"), ("extension", "REPEAT"), ("alpha", "TIMES"))
    outputs = (("Color", COLOR), ("Alpha", FLOAT))
    image = Node("ShaderNodeTexImage", (Input("Vector", VECTOR, Place("uv")),), outputs, options, image=0)
    graph = NodeGraph((image, emission(values, Link(0, "Color"))), Link(1, "Emission"))
    pixels = np.zeros((2, 2, 4))
    pixels[0, 0], pixels[1, 1] = (1, 0, 0, 1), (0, 1, 0, 0.5)
    np.testing.assert_allclose(run(graph, values, "emission", image_0_tx=pixels), [0.5, 0.25, 0], atol=1e-6)


def test_a_principled_surface_shares_light_among_its_parts(run):
    values = Values()
    given = {
        "Base Color": (0.8, 0.4, 0.2), "Specular Tint": (1, 1, 1), "Emission Color": (1, 1, 1), "Sheen Tint": (1, 1, 1),
        "Metallic": (0.25,), "Roughness": (0.3,), "IOR": (1.5,), "Specular IOR Level": (0.5,), "Alpha": (0.5,),
        "Transmission Weight": (0.5,), "Emission Strength": (3.0,), "Sheen Weight": (0.0,), "Coat Weight": (1.0,),
        "Coat IOR": (1.5,), "Coat Roughness": (0.1,),
    }  # fmt: skip
    inputs = [
        Input(name, COLOR if len(v) > 1 else FLOAT, values.add(COLOR if len(v) > 1 else FLOAT, v))
        for name, v in given.items()
    ]
    graph = NodeGraph((Node("ShaderNodeBsdfPrincipled", (*inputs, NORMAL), (("BSDF", SHADER),)),), Link(0, "BSDF"))
    base = np.array(given["Base Color"])
    np.testing.assert_allclose(run(graph, values, "diffuse"), 0.5 * 0.75 * 0.5 * base, atol=1e-6)
    np.testing.assert_allclose(run(graph, values, "transmission"), 0.5 * 0.75 * 0.5 * base, atol=1e-6)
    np.testing.assert_allclose(run(graph, values, "specular"), 0.5 * (0.75 * 0.04 + 0.25 * base), atol=1e-6)
    np.testing.assert_allclose(run(graph, values, "transparent"), 0.5, atol=1e-6)
    np.testing.assert_allclose(run(graph, values, "emission"), 1.5, atol=1e-6)
