"""What a device can do: the same few methods on Blender's gpu module and on a standalone OpenGL context.

A backend (blender.py, headless.py) supplies the underscored methods at the end of ``Device``; names, shapes and formats
are checked here and in drawing.py, once for both.
"""

import weakref
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .clear import clear_shader
from .drawing import Drawing, Program
from .formats import FORMATS, check_data
from .resources import DeviceError, DrawState, Target, Texture, Vertices, Viewport, corner_array
from .shader import Shader

__all__ = ["Device", "DeviceError", "DrawState", "Drawing", "Program", "Target", "Texture", "Vertices", "Viewport"]

_DEFAULT_STATE = DrawState()
_MAX_VOLUME_SIZE = 2048
_MAX_GROUPS = 65535


class Device(ABC):
    """A GPU. Everything is made by it and belongs to it; use it on one thread."""

    #: For logs and the interface, e.g. "OpenGL llvmpipe (LLVM 15)".
    name: str = ""
    is_software: bool = False
    max_texture_size: int = 16384
    _busy: Shader | None = None

    def __init__(self) -> None:
        self._made: weakref.WeakSet[Texture | Vertices] = weakref.WeakSet()

    @property
    def allocated_bytes(self) -> int:
        """GPU memory of the textures and vertices that were made here and not freed."""
        return sum(resource.bytes for resource in self._made if resource.handle is not None)

    # --- resources ---------------------------------------------------------------------------------------------------

    def texture(self, size: Sequence[int], format: str, data: np.ndarray | None = None) -> Texture:
        """A texture of (w, h) or (w, h, d) texels; zero unless ``data`` is given.

        data: (h, w, c) or (d, h, w, c), row 0 at the bottom; float32 (also float16), for 8-bit formats uint8 or floats
        in [0, 1], for R32UI uint32, for R32I int32. A depth texture starts at 0 too: clear it.
        Read by texelFetch: GLSL's ``texture()`` filters floats in Blender below 5.2, and takes the nearest elsewhere.
        Raises ValueError for a size, format, shape or dtype that does not fit.
        """
        size = tuple(int(n) for n in size)
        if format not in FORMATS:
            raise ValueError(f"texture format {format!r} is none of {', '.join(FORMATS)}")
        limit = _MAX_VOLUME_SIZE if len(size) == 3 else self.max_texture_size
        if len(size) not in (2, 3) or min(size) < 1 or max(size) > limit:
            raise ValueError(f"texture size {size} is not possible; at most {limit} texels a side")
        texture = Texture(size, format)
        self._create_texture(texture, None if data is None else check_data(texture, data))
        self._made.add(texture)
        return texture

    def target(self, colors: Sequence[Texture] = (), depth: Texture | None = None) -> Target:
        """Up to 6 colour textures of one size, in output slot order, and a depth texture to draw into."""
        colors = tuple(colors)
        attached = (*colors, depth) if depth is not None else colors
        if not attached or len(colors) > 6:
            raise ValueError(f"a target takes 1 to 6 colours or a depth, not {len(colors)}")
        for texture in attached:
            if len(texture.shape) != 3 or texture.size != attached[0].size:
                raise ValueError(f"a target's textures must be 2D and of one size: {attached}")
            if (texture is depth) != texture.info.is_depth:
                raise ValueError(f"{texture} is in the wrong place of a target")
        target = Target(colors, depth)
        self._create_target(target)
        return target

    def vertices(self, attributes: Mapping[str, np.ndarray]) -> Vertices:
        """Corner arrays by the names of ``Shader.inputs``: (n, k) or (n,), float32, int32 or uint32; n may be 0.

        float64 and int64 arrays are converted. Raises ValueError for unequal lengths or other dtypes.
        """
        arrays = {name: corner_array(name, array) for name, array in attributes.items()}
        counts = {len(a) for a in arrays.values()}
        if len(counts) != 1:
            raise ValueError(f"vertex attributes of unequal length: { {n: len(a) for n, a in arrays.items()} }")
        layout = {n: (a.dtype.kind.upper(), a.shape[1]) for n, a in arrays.items()}
        vertices = Vertices(counts.pop(), layout)
        if vertices.count:
            self._create_vertices(vertices, arrays)
        self._made.add(vertices)
        return vertices

    # --- work --------------------------------------------------------------------------------------------------------

    def draw(self, shader: Shader, vertices: Vertices | None, target: Target, *, state: DrawState = _DEFAULT_STATE,
             viewport: Viewport | None = None, count: int | None = None, instances: int = 1,
             **resources: Any) -> None:  # fmt: skip
        """One draw. ``resources`` are all the names that the shader declares: samplers and images take a Texture,
        uniforms the array of Struct.pack(..., for_uniform=True), constants numbers or arrays (a MAT4 (4, 4) by rows).

        viewport: x, y, w, h in texels from the bottom left; the whole target by default. What was bound before is bound
        again afterwards. Raises TypeError or ValueError naming the shader, ShaderError if it does not compile.
        """
        program = self._program(shader)
        program.check_names(resources, tuple(program.setters))
        with Drawing(self, shader, target, state, viewport, resources) as drawing:
            drawing(vertices, count, instances)

    def fullscreen(self, shader: Shader, target: Target, *, state: DrawState = _DEFAULT_STATE,
                   viewport: Viewport | None = None, **resources: Any) -> None:  # fmt: skip
        """Draw a shader without vertex stage over the whole viewport."""
        self.draw(shader, None, target, state=state, viewport=viewport, **resources)

    def drawing(self, shader: Shader, target: Target, *, state: DrawState = _DEFAULT_STATE,
                viewport: Viewport | None = None, **shared: Any) -> Drawing:  # fmt: skip
        """For many draws: ``with device.drawing(shader, target, frame=bytes) as draw: draw(vertices, pc_object=7)``.

        What is given here is bound once; each draw gives the rest. Nothing else may use the device meanwhile.
        """
        return Drawing(self, shader, target, state, viewport, shared)

    def dispatch(self, shader: Shader, groups: Sequence[int], **resources: Any) -> None:
        """Run a compute shader over ``groups`` (x, y, z) work groups; resources as for ``draw``."""
        if not shader.compute:
            raise TypeError(f"Shader {shader.name}: not a compute shader")
        x, y, z = (int(n) for n in (*groups, 1, 1)[:3])
        if not all(0 <= n <= _MAX_GROUPS for n in (x, y, z)):
            raise ValueError(f"Shader {shader.name}: {tuple(groups)} work groups; at most {_MAX_GROUPS} a side")
        self._check_idle(shader)
        program = self._program(shader)
        program.check_names(resources, tuple(program.setters))
        if x and y and z:
            self._dispatch(program, (x, y, z), resources)

    def prepare(self, shader: Shader) -> None:
        """Compile a shader ahead of its first use. Raises ShaderError."""
        self._check_idle(shader)
        self._program(shader)

    def clear(self, target: Target, color: Sequence = (0.0, 0.0, 0.0, 0.0), depth: float = 1.0, *,
              viewport: Viewport | None = None) -> None:  # fmt: skip
        """Fill all textures of a target, or the ``viewport`` of them. ``color``: RGBA, or a list of one RGBA a slot."""
        colors = [tuple(c) for c in color] if len(color) and np.ndim(color[0]) else [tuple(color)] * len(target.colors)
        if len(colors) != len(target.colors) or any(len(c) != 4 for c in colors):
            raise ValueError(f"clear: expected RGBA, or one a slot for {len(target.colors)} slots; got {color}")
        self._check_idle(None)
        if target.is_freed:
            raise ValueError("clear: the target or a texture of it was freed")
        if viewport is None:
            self._clear(target, colors, depth)
            return
        shader = clear_shader(tuple(t.info.scalar for t in target.colors), target.depth is not None)
        state = DrawState(depth_test="ALWAYS", depth_write=True) if target.depth is not None else DrawState()
        values: dict[str, Any] = {f"pc_color_{slot}": c for slot, c in enumerate(colors)}
        if target.depth is not None:
            values["pc_depth"] = depth
        self.fullscreen(shader, target, state=state, viewport=viewport, **values)

    def read(self, texture: Texture) -> np.ndarray:
        """The contents, shaped ``texture.shape``, row 0 at the bottom: float32, or the integers that the format holds.

        A new array. Waits for the GPU.
        """
        self._check_idle(None)
        if texture.handle is None:
            raise ValueError(f"{texture} was freed")
        return self._read(texture)

    # --- the rest is for backends ------------------------------------------------------------------------------------

    def _check_idle(self, shader: Shader | None) -> None:
        if self._busy is not None:
            what = f"Shader {shader.name}" if shader else "the device"
            raise RuntimeError(f"{what}: used inside drawing() of {self._busy.name}")

    @abstractmethod
    def finish(self) -> None:
        """Wait until the GPU has done everything."""

    @abstractmethod
    def close(self) -> None:
        """Give back what the device itself holds, on its thread. It cannot be used afterwards; twice does nothing."""

    @abstractmethod
    def free(self, resource: Texture | Target | Vertices | None) -> None:
        """Give a resource's memory back now. A target's textures stay. Calling it twice, or with None, does nothing."""

    @abstractmethod
    def _program(self, shader: Shader) -> Program: ...
    @abstractmethod
    def _create_texture(self, texture: Texture, data: np.ndarray | None) -> None: ...
    @abstractmethod
    def _create_target(self, target: Target) -> None: ...
    @abstractmethod
    def _create_vertices(self, vertices: Vertices, arrays: Mapping[str, np.ndarray]) -> None: ...
    @abstractmethod
    def _begin(self, program: Program, target: Target | None, state: DrawState, viewport: Viewport | None) -> None: ...
    @abstractmethod
    def _end(self, program: Program, target: Target | None) -> None: ...
    @abstractmethod
    def _draw(self, program: Program, vertices: Vertices | None, count: int, instances: int, paired: bool) -> None: ...
    @abstractmethod
    def _dispatch(self, program: Program, groups: tuple[int, int, int], resources: Mapping[str, Any]) -> None: ...
    @abstractmethod
    def _clear(self, target: Target, colors: Sequence[Sequence[float]], depth: float) -> None: ...
    @abstractmethod
    def _read(self, texture: Texture) -> np.ndarray: ...
