"""Scenes in the light of a panorama that a test makes up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rebound.scene.data import Image, World
from rebound.scene.node_graph import COLOR, FLOAT, SHADER, VECTOR, Input, Link, Node, NodeGraph, Place, Values

from .vpl_scenes import still


def panorama(image: str, strength=1.0, **fields) -> World:
    """A world whose Background takes an Environment Texture."""
    values = Values()
    texture = Node(
        "ShaderNodeTexEnvironment",
        (Input("Vector", VECTOR, Place("position")),),
        (("Color", COLOR),),
        (("interpolation", "Linear"), ("projection", "EQUIRECTANGULAR"), ("alpha", "DATA")),
        image=0,
    )
    inputs = (Input("Color", COLOR, Link(0, "Color")), Input("Strength", FLOAT, values.add(FLOAT, (strength,))))
    background = Node("ShaderNodeBackground", inputs, (("Background", SHADER),))
    graph = NodeGraph((texture, background), Link(1, "Background"))
    return World(graph=graph, values=tuple(values.array().ravel().tolist()), images=(image,), **fields)


def lit_by(pixels, meshes, key="sky", strength=1.0, albedo=1.0, **fields):
    """A scene in the light of a panorama, (h, w, 3)."""
    image = Image(key, key, np.concatenate([pixels, np.ones_like(pixels[..., :1])], -1).astype(np.float32))
    world = panorama(key, strength, **fields)
    return replace(still(meshes, albedo=albedo, world=world), images={key: image})


def directions_of(height: int):
    """(h, 2h, 3) directions of a panorama's pixels, and (h, 2h) their solid angles."""
    v, u = (np.arange(height) + 0.5) / height, (np.arange(2 * height) + 0.5) / (2 * height)
    turn, up = (0.5 - u) * 2 * np.pi, (v - 0.5) * np.pi
    turn, up = np.meshgrid(turn, up)
    d = np.stack((np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)), -1)
    return d, np.cos(up) * (np.pi / height) ** 2
