"""Blender world -> World: one colour where it is that, else its node graph."""

from __future__ import annotations

from collections.abc import Callable

from .data import World
from .images import ImageReader
from .node_graph import Link, ReadGraph
from .node_reader import read_graph
from .nodes import RGB, Socket, active_output, constant, find_input, mean, node_tree, source
from .sky_reader import SkyReader

# Outputs of a Texture Coordinate node that know the picture, which light does not.
OF_THE_PICTURE = {"Window": "the picture's middle", "Camera": "a camera that looks down"}


def read_world(world, images: ImageReader, warn: Callable[[str], None]) -> World:
    """Read a bpy world (None: black). What cannot be read of it is named in one warning."""
    if world is None:
        return World()
    tree = node_tree(world)
    if tree is None:
        return World(_finite(world.color), **_settings(world))
    output = active_output(tree)
    volume = find_input(output, "Volume") if output else None
    if volume is not None and volume.socket.is_linked:
        warn(f"World '{world.name}': volumes are not supported, its air is clear")
    surface = find_input(output, "Surface") if output else None
    if surface is None or not surface.socket.is_linked:
        return World()
    color = _one_color(surface)
    if color is not None:
        return World(color, **_settings(world))
    skies = SkyReader(images)
    read = read_graph(world, images.read, skies.read, images.images.get)
    problems = [*read.unsupported, *_of_the_picture(read)]
    if problems:
        warn(f"World '{world.name}': {'; '.join(problems)}")
    if read.filled.graph.surface is None:
        return World()
    filled = read.filled
    values = tuple(filled.table.ravel().tolist())
    return World(graph=filled.graph, values=values, images=filled.images, **_settings(world))


def _one_color(surface: Socket) -> RGB | None:
    """Colour times strength of a Background or Emission node that nothing is linked to."""
    found = source(surface)
    if not found.socket.is_output or found.node.mute:
        return None
    if found.node.bl_idname not in {"ShaderNodeBackground", "ShaderNodeEmission"}:
        return None
    color, strength = (found.input(name) for name in ("Color", "Strength"))
    rgb, factor = color and constant(color), strength and constant(strength)
    if rgb is None or factor is None:
        return None
    red, green, blue = (max(c * mean(factor), 0.0) for c in rgb)
    return red, green, blue


def _settings(world) -> dict:
    """What of a world is the same whatever its colour: ray visibility, and EEVEE's settings of its sun."""
    rays = getattr(world, "cycles_visibility", None)  # Cycles' own, not there where that is disabled
    return {
        "seen": bool(rays is None or rays.camera),
        "diffuse": bool(rays is None or rays.diffuse),
        "glossy": bool(rays is None or rays.glossy),
        "sun_threshold": float(world.sun_threshold),
        "sun_angle": float(world.sun_angle),
    }


def _of_the_picture(read: ReadGraph) -> list[str]:
    """A clause for each coordinate that is another one in every picture."""
    links = {
        given.source for node in read.filled.graph.nodes for given in node.inputs if isinstance(given.source, Link)
    }
    used = {link.output for link in links if read.filled.graph.nodes[link.node].kind == "ShaderNodeTexCoord"}
    return [
        f"its {name} coordinates light the scene as those of {how}"
        for name, how in OF_THE_PICTURE.items()
        if name in used
    ]


def _finite(rgb) -> RGB:
    red, green, blue = (max(float(c), 0.0) for c in rgb)
    return red, green, blue
