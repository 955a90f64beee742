"""Walking Blender's shader node trees: links through reroutes, muted nodes and groups, and constant folding.

Knows nothing of what a shader means; ``materials`` and ``lights`` ask it for constants.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import bpy

RGB = tuple[float, float, float]
MAX_STEPS = 1000  # reroutes and group borders along one link; more than any real graph, and the end of a cyclic one


@dataclass(frozen=True)
class Socket:
    """A socket and the group nodes that were entered to reach it, outermost first."""

    socket: object
    groups: tuple = ()

    @property
    def node(self):
        return self.socket.node

    def input(self, name: str) -> Socket | None:
        """The enabled input of this socket's node called ``name``."""
        return find_input(self.node, name, self.groups)


def find_input(node, name: str, groups: tuple = ()) -> Socket | None:
    for socket in node.inputs:
        if name in (socket.name, socket.identifier) and socket.enabled:
            return Socket(socket, groups)
    return None


def node_tree(owner):
    """The node tree that decides the look of a material, world or light, or None where none does."""
    # Blender 5.0 always uses the nodes of materials and worlds, 5.2 those of lights too, and warns if asked.
    always = (5, 2, 0) if isinstance(owner, bpy.types.Light) else (5, 0, 0)
    if bpy.app.version >= always or owner.use_nodes:
        return owner.node_tree
    return None


def active_output(tree):
    """The output node that Blender would take; several targets may each have one."""
    for target in ("ALL", "CYCLES", "EEVEE"):
        node = tree.get_output_node(target)
        if node is not None:
            return node
    return None


def source(socket: Socket) -> Socket:
    """Follow a link back to the output that really makes the value, or the unlinked input that holds its constant."""
    for _ in range(MAX_STEPS):
        back = step_back(socket)
        if back is None:
            return socket
        socket = back
    return socket


def step_back(at: Socket) -> Socket | None:
    """One step back from an input along its link, or from an output into what it stands for; None at the end."""
    if not at.socket.is_output:
        for link in at.socket.links:
            if link.is_valid and not link.is_muted:
                return Socket(link.from_socket, at.groups)
        return None
    node = at.node
    if node.mute:
        return _muted_source(at)
    if node.bl_idname == "NodeReroute":
        return Socket(node.inputs[0], at.groups)
    if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
        return _into_group(at)
    if node.bl_idname == "NodeGroupInput" and at.groups:
        *outer, group = at.groups
        return _by_identifier(group.inputs, at.socket, tuple(outer))
    return None


def _muted_source(at: Socket) -> Socket | None:
    """The input that a muted node passes on to an output."""
    for link in at.node.internal_links:
        if link.to_socket == at.socket:
            return Socket(link.from_socket, at.groups)
    return None


def _into_group(at: Socket) -> Socket | None:
    for node in at.node.node_tree.nodes:
        if node.bl_idname == "NodeGroupOutput" and node.is_active_output:
            return _by_identifier(node.inputs, at.socket, (*at.groups, at.node))
    return None


def _by_identifier(sockets, wanted, groups: tuple) -> Socket | None:
    return next((Socket(s, groups) for s in sockets if s.identifier == wanted.identifier), None)


def default_rgb(socket) -> RGB:
    """A socket's own constant as RGB; black where it has none (shader sockets)."""
    value = getattr(socket, "default_value", 0.0)
    if isinstance(value, (int, float)):
        value = (value,) * 3
    if isinstance(value, str) or not hasattr(value, "__len__") or len(value) < 3:
        return (0.0, 0.0, 0.0)
    red, green, blue = (float(v) if math.isfinite(v) else 0.0 for v in value[:3])
    return red, green, blue


def constant(socket: Socket) -> RGB | None:
    """The value of an input as RGB if it is a plain constant, else None."""
    found = source(socket)
    if not found.socket.is_output:
        return default_rgb(found.socket)
    if found.node.mute:
        return None
    if found.node.bl_idname in {"ShaderNodeRGB", "ShaderNodeValue"}:
        return default_rgb(found.socket)
    return None


def mean(rgb: RGB) -> float:
    """A colour used as a number, by Blender's implicit conversion (Rec. 709 luminance)."""
    if rgb[0] == rgb[1] == rgb[2]:
        return rgb[0]
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]


def strength_and_color(node_socket: Socket, owner: str, fallback: str, warn: Callable[[str], None]) -> RGB:
    """Colour × strength of an Emission or Background node; a linked input falls back to its own constant."""
    values = []
    for name in ("Color", "Strength"):
        socket = node_socket.input(name)
        value = constant(socket)
        if value is None:
            value = default_rgb(socket.socket)
            warn(f"{owner}: node '{source(socket).node.name}' is not read yet; {fallback}")
        values.append(value)
    color, strength = values
    return tuple(c * mean(strength) for c in color)
