"""Values of a draw turned into what a GPU takes, the same way for every backend."""

import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from .interface import Texture
from .shader import CONSTANT_TYPES, Image, Shader
from .structs import Struct


def texture_handle(kind: str) -> Callable[[Any], Any]:
    """A function from Texture to its handle. Another kind, which would crash Blender on Vulkan, raises TypeError."""

    def handle(texture: Any) -> Any:
        if not isinstance(texture, Texture) or texture.kind != kind:
            raise TypeError(f"expected a {kind} texture, got {texture!r}")
        if texture.handle is None:
            raise ValueError(f"{texture!r} was freed")
        return texture.handle

    return handle


def image_handle(image: Image) -> Callable[[Any], Any]:
    """The same for an image, whose format must match as well."""
    of_kind = texture_handle(image.type.removesuffix("_ATOMIC"))

    def handle(texture: Any) -> Any:
        found = of_kind(texture)
        if texture.format != image.format:
            raise TypeError(f"expected format {image.format}, got {texture!r}")
        return found

    return handle


def array_constant(type_name: str) -> Callable[[Any], np.ndarray]:
    """A function from a vector or matrix to a contiguous array. A MAT4 comes row by row and leaves column by column."""
    components = CONSTANT_TYPES[type_name][0]
    if type_name == "MAT4":
        return _matrix
    dtype = np.int32 if type_name[0] == "I" else np.float32

    def vector(value: Any) -> np.ndarray:
        array = np.ascontiguousarray(value, dtype)
        if array.shape != (components,):
            raise ValueError(f"expected {components} numbers, got {value!r}")
        return array

    return vector


def _matrix(value: Any) -> np.ndarray:
    array = np.asarray(value, np.float32)
    if array.shape != (4, 4):
        raise ValueError(f"expected a 4x4 matrix, got {value!r}")
    return np.ascontiguousarray(array.T)


def int_constant(value: Any) -> int:
    """An integer that 32 bits hold. Raises TypeError for a float, OverflowError for a larger one."""
    number = int(value) if isinstance(value, np.bool_) else operator.index(value)
    if not -(2**31) <= number < 2**31:
        raise OverflowError(f"{number} does not fit an INT")
    return number


def uniform_bytes(struct: Struct) -> Callable[[Any], bytes]:
    """A function from the array of Struct.pack(..., for_uniform=True), or its bytes, to bytes of the block's size."""

    def to_bytes(value: Any) -> bytes:
        data = value if isinstance(value, bytes) else np.ascontiguousarray(value).tobytes()
        if len(data) != struct.size:
            raise ValueError(f"expected {struct.size} bytes of Struct {struct.name}, got {len(data)}")
        return data

    return to_bytes


def touches_images(shader: Shader) -> bool:
    """Whether it stores to images."""
    return any(image.access != "READ" for image in shader.images.values())
