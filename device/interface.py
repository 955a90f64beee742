# SPDX-License-Identifier: GPL-3.0-or-later
"""What a device can do: the same few methods on Blender's gpu module and on a standalone OpenGL context.

A backend (blender.py, headless.py) supplies the underscored methods at the end of ``Device``; names, shapes and formats
are checked here, once for both.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .formats import FORMATS, Format, check_data
from .shader import Shader

Viewport = tuple[int, int, int, int]


class DeviceError(RuntimeError):
    """There is no usable GPU, or it refuses what every supported one can do. The message is one line for the user."""


class Texture:
    """A texture on the device: ``size`` (w, h) or (w, h, d), ``format``, ``layers`` (0: not an array)."""

    def __init__(
        self, size: tuple[int, ...], format: str, layers: int = 0, filter: str = "NEAREST", repeat: bool = False
    ):
        self.size, self.format, self.layers = size, format, layers
        self.filter, self.repeat = filter, repeat
        self.info: Format = FORMATS[format]
        dimension = "3D" if len(size) == 3 else "2D_ARRAY" if layers else "2D"
        #: What a sampler or an image must be declared as.
        self.kind = f"{self.info.scalar}_{dimension}"
        #: The backend's own object; None once freed.
        self.handle: Any = None

    @property
    def shape(self) -> tuple[int, ...]:
        """The numpy shape of its contents: (h, w, c), (d, h, w, c) or (layers, h, w, c)."""
        outer = (self.layers,) if self.layers else ()
        return (*outer, *reversed(self.size), self.info.channels)

    def __repr__(self) -> str:
        return f"Texture({self.size}, {self.format!r}{f', layers={self.layers}' if self.layers else ''})"


class Target:
    """Textures to draw into. It keeps them alive (a framebuffer does not)."""

    def __init__(self, colors: tuple[Texture, ...], depth: Texture | None):
        self.colors, self.depth = colors, depth
        first = colors[0] if colors else depth
        assert first is not None
        self.size: tuple[int, int] = (first.size[0], first.size[1])
        self.handle: Any = None


class Vertices:
    """Corner arrays of triangles, not indexed: three vertices a triangle."""

    def __init__(self, count: int, layout: Mapping[str, tuple[str, int]]):
        self.count = count
        #: name: ("F" float32, "I" int32 or "U" uint32, components)
        self.layout = dict(layout)
        self.handle: Any = None
        #: Whatever the backend makes of it for a shader, by shader.
        self.cache: dict = {}


@dataclass(frozen=True)
class DrawState:
    """Fixed-function state of a draw. ``depth_write`` needs a depth test; use "ALWAYS" to write without testing.

    blend: "ADDITIVE" is dst + src in all four channels, "ALPHA_PREMULT" is src + dst * (1 - src.a).
    cull: the faces left out; counter-clockwise is the front.
    """

    depth_test: str = "NONE"
    depth_write: bool = False
    blend: str = "NONE"
    cull: str = "NONE"

    def __post_init__(self):
        for what, value, allowed in (
            (
                "depth_test",
                self.depth_test,
                ("NONE", "LESS", "LESS_EQUAL", "EQUAL", "GREATER", "GREATER_EQUAL", "ALWAYS"),
            ),
            ("blend", self.blend, ("NONE", "ADDITIVE", "ALPHA_PREMULT")),
            ("cull", self.cull, ("NONE", "BACK", "FRONT")),
        ):
            if value not in allowed:
                raise ValueError(f"DrawState: {what} {value!r} is none of {', '.join(allowed)}")
        if self.depth_write and self.depth_test == "NONE":
            raise ValueError('DrawState: depth_write without a depth test writes nothing; use depth_test="ALWAYS"')


class Program:
    """A compiled shader: ``setters`` take the value of each declared resource by name."""

    def __init__(self, shader: Shader, handle: Any):
        self.shader, self.handle = shader, handle
        self.setters: dict[str, Callable[[Any], None]] = {}

    def set(self, values: Mapping[str, Any]) -> None:
        """Set resources. Raises TypeError or ValueError naming shader and resource."""
        name = ""
        try:
            for name, value in values.items():
                self.setters[name](value)
        except (TypeError, ValueError, AttributeError, OverflowError) as error:
            kind = ValueError if isinstance(error, ValueError | OverflowError) else TypeError
            raise kind(f"Shader {self.shader.name}, {name!r}: {error}") from error

    def check_names(self, given: Mapping[str, Any], wanted: Sequence[str]) -> None:
        """Raise TypeError unless exactly the wanted names are given."""
        missing = [n for n in wanted if n not in given]
        unknown = [n for n in given if n not in wanted]
        if missing or unknown:
            parts = [
                f"{what} {', '.join(names)}" for what, names in (("missing", missing), ("unknown", unknown)) if names
            ]
            raise TypeError(f"Shader {self.shader.name}: {'; '.join(parts)}")


class Drawing:
    """Many draws with one shader into one target: what ``Device.drawing`` gives.

    Calling it sets only the resources that were not given to ``drawing``; the first call fixes nothing and the check
    of names is one set comparison, so a draw costs a few microseconds.
    """

    def __init__(self, device: "Device", shader: Shader, target: Target | None, state: DrawState, viewport: Viewport | None,
                 shared: Mapping[str, Any]):  # fmt: skip
        self._device, self._target, self._state, self._viewport = device, target, state, viewport
        self._program = program = device._program(shader)
        if shader.compute:
            raise TypeError(f"Shader {shader.name}: a compute shader cannot draw")
        unknown = [n for n in shared if n not in program.setters]
        if unknown:
            raise TypeError(f"Shader {shader.name}: unknown {', '.join(unknown)}")
        if target is not None:
            _check_target(shader, target, state, shared)
        self._shared = shared
        self._rest = {n: None for n in program.setters if n not in shared}.keys()

    def __enter__(self) -> "Drawing":
        self._device._check_idle(self._program.shader)
        self._device._begin(self._program, self._target, self._state, self._viewport)
        self._device._busy = self._program.shader
        try:
            self._program.set(self._shared)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_error: object) -> None:
        self._device._busy = None
        self._device._end(self._program, self._target)

    def __call__(self, vertices: Vertices | None = None, first: int = 0, count: int | None = None, instances: int = 1,
                 **resources: Any) -> None:  # fmt: skip
        """Draw ``count`` vertices (all that follow ``first``) ``instances`` times; gl_InstanceID counts from 0.

        ``vertices`` None: no attributes, ``count`` corners (3 unless given) known by gl_VertexID alone.
        """
        program = self._program
        if resources.keys() != self._rest:
            program.check_names(resources, tuple(self._rest))
        program.set(resources)
        if vertices is None:
            if program.shader.inputs:
                raise TypeError(f"Shader {program.shader.name}: needs vertices with {', '.join(program.shader.inputs)}")
            count = 3 if count is None else count
        else:
            if program not in vertices.cache:
                _check_inputs(program.shader, vertices)
            count = vertices.count - first if count is None else count
            if first < 0 or count < 0 or first + count > vertices.count:
                raise ValueError(
                    f"Shader {program.shader.name}: corners {first}..{first + count} of {vertices.count} do not exist"
                )
        if count and instances:
            self._device._draw(program, vertices, first, count, instances)


def _check_inputs(shader: Shader, vertices: Vertices) -> None:
    for name, type_name in shader.inputs.items():
        if name not in vertices.layout:
            raise TypeError(
                f"Shader {shader.name}: the vertices have no {name}; they have {', '.join(vertices.layout)}"
            )
        scalar, components = vertices.layout[name]
        wanted = ("F" if type_name[0] in "FV" else type_name[0], int(type_name[-1]) if type_name[-1].isdigit() else 1)
        if (scalar, components) != wanted:
            raise TypeError(
                f"Shader {shader.name}: input {name} is {type_name}, its array is {scalar}32 x {components}"
            )


def _check_target(shader: Shader, target: Target, state: DrawState, resources: Mapping[str, Any]) -> None:
    if len(shader.outputs) > len(target.colors):
        raise TypeError(
            f"Shader {shader.name}: {len(shader.outputs)} outputs, the target has {len(target.colors)} colours"
        )
    for (name, type_name), texture in zip(shader.outputs.items(), target.colors, strict=False):
        scalar = {"I": "INT", "U": "UINT"}.get(type_name[0], "FLOAT")
        if texture.info.scalar != scalar:
            raise TypeError(f"Shader {shader.name}: output {name} is {type_name}, its texture is {texture.format}")
    if state.depth_test != "NONE" and target.depth is None:
        raise TypeError(f"Shader {shader.name}: a depth test needs a target with depth")
    written = (*target.colors, target.depth) if state.depth_write else target.colors
    for name in shader.samplers:
        # Reading what is being written is undefined everywhere and looks right on some.
        if name in resources and any(resources[name] is texture for texture in written):
            raise TypeError(f"Shader {shader.name}: {name} is part of the target that it draws into")


class Device(ABC):
    """A GPU. Everything is made by it and belongs to it; use it on one thread."""

    #: For logs and the interface, e.g. "OpenGL llvmpipe (LLVM 15)".
    name: str = ""
    is_software: bool = False
    max_texture_size: int = 16384
    _busy: Shader | None = None

    # --- resources ---------------------------------------------------------------------------------------------------

    def texture(self, size: Sequence[int], format: str, data: np.ndarray | None = None, *, layers: int = 0,
                filter: str = "NEAREST", repeat: bool = False) -> Texture:  # fmt: skip
        """A texture of (w, h) or (w, h, d) texels, or an array of ``layers``; zero unless ``data`` is given.

        data: (h, w, c), (d, h, w, c) or (layers, h, w, c), row 0 at the bottom; float32 (also float16), for 8-bit formats
        uint8 or floats in [0, 1], for R32UI uint32, for R32I int32. A depth texture starts at 0 as well: clear it.
        filter, repeat: what GLSL's ``texture()`` does; texelFetch ignores both. Blender below 5.2 has no such setting: floats
        are filtered LINEAR and clamped there, so read NEAREST textures by texelFetch; ``repeat`` raises DeviceError.
        Raises ValueError for a size, format, shape or dtype that does not fit.
        """
        size = tuple(int(n) for n in size)
        if format not in FORMATS:
            raise ValueError(f"texture format {format!r} is none of {', '.join(FORMATS)}")
        limit = 2048 if len(size) == 3 else self.max_texture_size
        if len(size) not in (2, 3) or min(size) < 1 or max(size) > limit or not 0 <= layers <= 2048:
            raise ValueError(f"texture size {size} (layers {layers}) is not possible; at most {limit} texels a side")
        if filter not in ("NEAREST", "LINEAR"):
            raise ValueError(f"texture filter {filter!r} is neither NEAREST nor LINEAR")
        texture = Texture(size, format, layers, filter, repeat)
        self._create_texture(texture, None if data is None else check_data(texture, data))
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
        arrays = {name: _corner_array(name, array) for name, array in attributes.items()}
        counts = {len(a) for a in arrays.values()}
        if len(counts) != 1:
            raise ValueError(f"vertex attributes of unequal length: { {n: len(a) for n, a in arrays.items()} }")
        layout = {n: (a.dtype.kind.upper(), a.shape[1]) for n, a in arrays.items()}
        vertices = Vertices(counts.pop(), layout)
        if vertices.count:
            self._create_vertices(vertices, arrays)
        return vertices

    # --- work --------------------------------------------------------------------------------------------------------

    def draw(self, shader: Shader, vertices: Vertices | None, target: Target, *, state: DrawState = DrawState(),
             viewport: Viewport | None = None, first: int = 0, count: int | None = None, instances: int = 1,
             **resources: Any) -> None:  # fmt: skip
        """One draw. ``resources`` are the names that the shader declares, all of them: samplers and images take a Texture,
        uniforms the array of Struct.pack(..., for_uniform=True), constants numbers or arrays (a MAT4 as (4, 4), row by row).

        viewport: x, y, w, h in texels from the bottom left; the whole target by default. What was bound before is bound
        again afterwards. Raises TypeError or ValueError naming the shader, ShaderError if it does not compile.
        """
        program = self._program(shader)
        program.check_names(resources, tuple(program.setters))
        with Drawing(self, shader, target, state, viewport, resources) as drawing:
            drawing(vertices, first, count, instances)

    def fullscreen(self, shader: Shader, target: Target, *, state: DrawState = DrawState(),
                   viewport: Viewport | None = None, **resources: Any) -> None:  # fmt: skip
        """Draw a shader without vertex stage over the whole viewport."""
        self.draw(shader, None, target, state=state, viewport=viewport, **resources)

    def drawing(self, shader: Shader, target: Target, *, state: DrawState = DrawState(), viewport: Viewport | None = None,
                **shared: Any) -> Drawing:  # fmt: skip
        """For many draws: ``with device.drawing(shader, target, frame=bytes) as draw: draw(vertices, pc_object=7)``.

        What is given here is bound once; each draw gives the rest. Nothing else may use the device meanwhile.
        """
        return Drawing(self, shader, target, state, viewport, shared)

    def dispatch(self, shader: Shader, groups: Sequence[int], **resources: Any) -> None:
        """Run a compute shader over ``groups`` (x, y, z) work groups; resources as for ``draw``."""
        if not shader.compute:
            raise TypeError(f"Shader {shader.name}: not a compute shader")
        x, y, z = (int(n) for n in (*groups, 1, 1)[:3])
        if not all(0 <= n <= 65535 for n in (x, y, z)):
            raise ValueError(f"Shader {shader.name}: {tuple(groups)} work groups; at most 65535 a side")
        self._check_idle(shader)
        program = self._program(shader)
        program.check_names(resources, tuple(program.setters))
        if x and y and z:
            self._dispatch(program, (x, y, z), resources)

    def clear(self, target: Target, color: Sequence = (0.0, 0.0, 0.0, 0.0), depth: float = 1.0, *,
              viewport: Viewport | None = None) -> None:  # fmt: skip
        """Fill all textures of a target, or the ``viewport`` of them. ``color``: RGBA, or a list of one RGBA a slot."""
        colors = [tuple(c) for c in color] if len(color) and np.ndim(color[0]) else [tuple(color)] * len(target.colors)
        if len(colors) != len(target.colors) or any(len(c) != 4 for c in colors):
            raise ValueError(f"clear: expected RGBA, or one a slot for {len(target.colors)} slots; got {color}")
        self._check_idle(None)
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
        """The contents, (h, w, c), (d, h, w, c) or (layers, h, w, c), row 0 at the bottom: float32, or the format's integers.

        Waits for the GPU. Raises DeviceError if that fails.
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
    def _draw(self, program: Program, vertices: Vertices | None, first: int, count: int, instances: int) -> None: ...
    @abstractmethod
    def _dispatch(self, program: Program, groups: tuple[int, int, int], resources: Mapping[str, Any]) -> None: ...
    @abstractmethod
    def _clear(self, target: Target, colors: Sequence[Sequence[float]], depth: float) -> None: ...
    @abstractmethod
    def _read(self, texture: Texture) -> np.ndarray: ...


def _corner_array(name: str, array: np.ndarray) -> np.ndarray:
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


def clear_shader(scalars: tuple[str, ...], has_depth: bool) -> Shader:
    """A shader that fills a viewport: no version's own clear can be trusted to respect a tile."""
    types = {"FLOAT": "VEC4", "INT": "INT", "UINT": "UINT"}
    values = {"FLOAT": "{}", "INT": "int({}.x)", "UINT": "uint({}.x)"}
    lines = [f"  out_{slot} = {values[s].format(f'pc_color_{slot}')};" for slot, s in enumerate(scalars)]
    lines += ["  gl_FragDepth = pc_depth;"] if has_depth else []
    constants = {f"pc_color_{slot}": "VEC4" for slot in range(len(scalars))} | (
        {"pc_depth": "FLOAT"} if has_depth else {}
    )
    text = "void main()\n{\n" + "\n".join(lines) + "\n}\n"
    return Shader(
        "_".join(("device_clear", *(s.lower() for s in scalars), *(["depth"] if has_depth else []))),
        fragment="device/clear_frag.glsl",
        files={"device/clear_frag.glsl": text},
        outputs={f"out_{slot}": types[s] for slot, s in enumerate(scalars)},
        constants=constants,
        depth_write=has_depth,
    )
