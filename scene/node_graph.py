"""A material's node graph without Blender: what the shader is generated from.

A graph holds no numbers: they stand in a table of values beside it, so two graphs that differ in numbers only are equal
and share one shader. A node's sockets go by Blender's identifiers, the same in every version.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

TEXEL = 4  # floats
TABLE_SIZE = 257  # texels of a Color Ramp or a curve, as Cycles samples them

FLOAT, VECTOR, COLOR, SHADER = "FLOAT", "VECTOR", "COLOR", "SHADER"
SIZES = {FLOAT: 1, VECTOR: 3, COLOR: 3}


@dataclass(frozen=True)
class Slot:
    """Where a constant stands among a material's values: its first float, and its type. None crosses a texel's end."""

    index: int
    type: str


@dataclass(frozen=True)
class Link:
    """An output of another node: its index in the graph, always a smaller one, and the output's identifier."""

    node: int
    output: str


@dataclass(frozen=True)
class Place:
    """What an input takes that nothing is linked to: a field of the generated shader's point ("generated", "uv")."""

    name: str


Option = str | int | float | bool


@dataclass(frozen=True)
class Input:
    name: str
    type: str  # FLOAT, VECTOR, COLOR or SHADER
    source: Slot | Link | Place | None  # None: a shader that is not there


@dataclass(frozen=True)
class Node:
    """One node: its kind is Blender's type name, its options the properties that choose code and not numbers."""

    kind: str
    inputs: tuple[Input, ...] = ()
    outputs: tuple[tuple[str, str], ...] = ()  # identifier and type
    options: tuple[tuple[str, Option], ...] = ()
    table: int = -1  # first texel of its TABLE_SIZE rows among the values
    image: int = -1  # its image's place among the material's

    def option(self, name: str) -> Option:
        return dict(self.options)[name]


@dataclass(frozen=True)
class NodeGraph:
    """Nodes in the order in which they can be evaluated, and the one whose shader is the surface (None: black)."""

    nodes: tuple[Node, ...] = ()
    surface: Link | None = None


@dataclass(frozen=True)
class FilledGraph:
    """A graph with its numbers and images: all that a surface is drawn by."""

    graph: NodeGraph
    values: bytes = b""  # (texels, 4) float32
    images: tuple[Hashable, ...] = ()  # keys of Scene.images, by Node.image

    @property
    def table(self) -> np.ndarray:
        """The values, (texels, 4) float32."""
        return np.frombuffer(self.values, np.float32).reshape(-1, TEXEL)


@dataclass(frozen=True)
class ReadGraph:
    """What was read of a node tree, and what could not be."""

    filled: FilledGraph
    unsupported: tuple[str, ...] = ()  # one clause for each node, naming it and what is shown instead


class Values:
    """Gathers the values of one material."""

    def __init__(self):
        self._floats: list[float] = []
        self._open: list[int] = []  # floats left over at the ends of texels

    def add(self, type: str, numbers: Sequence[float]) -> Slot:
        """The slot of one number or one vector; single numbers fill what vectors leave over."""
        if len(numbers) == 1 and self._open:
            index = self._open.pop(0)
            self._floats[index] = numbers[0]
            return Slot(index, type)
        index = len(self._floats)
        self._floats += [*numbers, *[0.0] * (TEXEL - len(numbers))]
        self._open += range(index + len(numbers), index + TEXEL)
        return Slot(index, type)

    def add_table(self, rows: np.ndarray) -> int:
        """The first texel of (n, 4) rows."""
        start = len(self._floats) // TEXEL
        self._floats += np.asarray(rows, np.float64).ravel().tolist()
        return start

    def array(self) -> np.ndarray:
        """(texels, 4) float32."""
        return np.array(self._floats, np.float32).reshape(-1, TEXEL)
