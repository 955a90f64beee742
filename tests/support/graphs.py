"""Materials of node graphs, made without Blender."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rebound.scene.data import Image, Material
from rebound.scene.node_graph import (
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
    Values,
)
from rebound.scene.node_look import look_of

NORMAL = Input("Normal", VECTOR, Place("normal"))


def graph_material(name: str, filled: FilledGraph, images: Mapping[str, Image] | None = None) -> Material:
    """A material that is drawn by a graph, with its look on the whole."""
    means = [(images or {})[str(key)].pixels.mean((0, 1)) for key in filled.images]
    look = look_of(filled, lambda place: np.asarray(means[place], np.float64))
    colors = {part: tuple(getattr(look, part).tolist()) for part in ("emission", "specular")}
    return Material(
        name,
        tuple(look.base.tolist()),
        **colors,
        metallic=look.metallic,
        roughness=look.roughness,
        passing=look.passing,
        graph=filled,
    )


def image_material(
    name: str, image: Image, emission: float = 0.0, *, uv_map="", repeat=True, closest=False
) -> Material:
    """A diffuse surface with an image, which also emits so many times that."""
    values = Values()
    zero, strength = values.add(FLOAT, (0.0,)), values.add(FLOAT, (emission,))
    options = {"projection": "FLAT", "alpha": "DATA", "extension": "REPEAT" if repeat else "EXTEND"}
    options["interpolation"] = "Closest" if closest else "Linear"
    nodes = (
        Node("ShaderNodeUVMap", (), (("UV", VECTOR),), (("uv_map", uv_map),)),
        Node(
            "ShaderNodeTexImage",
            (Input("Vector", VECTOR, Link(0, "UV")),),
            (("Color", COLOR), ("Alpha", FLOAT)),
            tuple(options.items()),
            image=0,
        ),
        Node(
            "ShaderNodeBsdfDiffuse",
            (Input("Color", COLOR, Link(1, "Color")), Input("Roughness", FLOAT, zero), NORMAL),
            (("BSDF", SHADER),),
        ),
        Node(
            "ShaderNodeEmission",
            (Input("Color", COLOR, Link(1, "Color")), Input("Strength", FLOAT, strength)),
            (("Emission", SHADER),),
        ),
        Node(
            "ShaderNodeAddShader",
            (Input("Shader", SHADER, Link(2, "BSDF")), Input("Shader_001", SHADER, Link(3, "Emission"))),
            (("Shader", SHADER),),
        ),
    )
    filled = FilledGraph(NodeGraph(nodes, Link(4, "Shader")), values.array().tobytes(), (image.key,))
    return graph_material(name, filled, {str(image.key): image})


def pane(name: str, rgb) -> Material:
    """What lets light pass, coloured."""
    values = Values()
    color = Input("Color", COLOR, values.add(COLOR, rgb))
    nodes = (Node("ShaderNodeBsdfTransparent", (color,), (("BSDF", SHADER),)),)
    return graph_material(name, FilledGraph(NodeGraph(nodes, Link(0, "BSDF")), values.array().tobytes()))
