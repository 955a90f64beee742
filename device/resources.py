"""What a device makes and is told: textures, targets, vertices, the state of a draw."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .formats import FORMATS, Format

Viewport = tuple[int, int, int, int]


class DeviceError(RuntimeError):
    """There is no usable GPU, or it refuses what every supported one can do. The message is one line for the user."""


class Texture:
    """A texture on the device: ``size`` (w, h) or (w, h, d), ``format``."""

    def __init__(self, size: tuple[int, ...], format: str):
        self.size, self.format = size, format
        self.info: Format = FORMATS[format]
        #: What a sampler or an image must be declared as.
        self.kind = f"{self.info.scalar}_{len(size)}D"
        #: The backend's own object; None once freed.
        self.handle: Any = None

    @property
    def shape(self) -> tuple[int, ...]:
        """The numpy shape of its contents: (h, w, c) or (d, h, w, c)."""
        return (*reversed(self.size), self.info.channels)

    @property
    def bytes(self) -> int:
        """GPU memory, as far as the format tells."""
        return math.prod(self.shape[:-1]) * self.info.bytes

    def __repr__(self) -> str:
        return f"Texture({self.size}, {self.format!r})"


class Target:
    """Textures to draw into. It keeps them alive (a framebuffer does not)."""

    def __init__(self, colors: tuple[Texture, ...], depth: Texture | None):
        self.colors, self.depth = colors, depth
        first = colors[0] if colors else depth
        assert first is not None
        self.size: tuple[int, int] = (first.size[0], first.size[1])
        self.handle: Any = None

    @property
    def is_freed(self) -> bool:
        """Whether it or a texture of it was freed."""
        depth_freed = self.depth is not None and self.depth.handle is None
        return self.handle is None or depth_freed or any(t.handle is None for t in self.colors)


class Vertices:
    """Corner arrays of triangles, not indexed: three vertices a triangle."""

    def __init__(self, count: int, layout: Mapping[str, tuple[str, int]]):
        self.count = count
        #: name: ("F" float32, "I" int32 or "U" uint32, components)
        self.layout = dict(layout)
        self.handle: Any = None
        #: Whatever the backend makes of it for a shader, by shader.
        self.cache: dict = {}
        #: GPU memory: every component takes four bytes.
        self.bytes = count * sum(4 * components for _, components in layout.values())


def paired_corners(count: int) -> np.ndarray:
    """(triangles, 3) uint32 numbers of the corners to draw of pairs of triangles: at least ``count``, a power of two's
    pairs. The second triangle of each pair begins with the first's first and third corner.
    """
    pairs = 1 << max(-(-count // 6) - 1, 0).bit_length()
    first = 6 * np.arange(pairs, dtype=np.uint32)[:, None]
    return (first + np.array([0, 1, 2, 0, 2, 5], np.uint32)).reshape(-1, 3)


@dataclass(frozen=True)
class DrawState:
    """Fixed-function state of a draw. ``depth_write`` needs a depth test; use "ALWAYS" to write without testing.

    blend: "ADDITIVE" is dst + src in all four channels, "MULTIPLY" dst * src, "ALPHA_PREMULT" src + dst * (1 - src.a).
    """

    depth_test: str = "NONE"
    depth_write: bool = False
    blend: str = "NONE"

    def __post_init__(self):
        for what, value, allowed in (
            (
                "depth_test",
                self.depth_test,
                ("NONE", "LESS", "LESS_EQUAL", "EQUAL", "GREATER", "GREATER_EQUAL", "ALWAYS"),
            ),
            ("blend", self.blend, ("NONE", "ADDITIVE", "MULTIPLY", "ALPHA_PREMULT")),
        ):
            if value not in allowed:
                raise ValueError(f"DrawState: {what} {value!r} is none of {', '.join(allowed)}")
        if self.depth_write and self.depth_test == "NONE":
            raise ValueError('DrawState: depth_write without a depth test writes nothing; use depth_test="ALWAYS"')


def corner_array(name: str, array: np.ndarray) -> np.ndarray:
    array = np.asarray(array)
    if array.dtype.kind not in "fiu" or array.ndim not in (1, 2):
        raise ValueError(
            f"vertex attribute {name}: (n, k) floats or integers expected, got {array.dtype} {array.shape}"
        )
    # Blender's attr_fill takes the bytes as they are: a wrong dtype or order would be garbage, silently.
    kind = {"f": np.float32, "i": np.int32, "u": np.uint32}[array.dtype.kind]
    array = np.ascontiguousarray(
        array.reshape(len(array), -1) if array.size else array.reshape(0, 1 if array.ndim == 1 else array.shape[1]),
        kind,
    )
    if array.shape[1] > 4:
        raise ValueError(f"vertex attribute {name}: {array.shape[1]} components; at most 4")
    return array
