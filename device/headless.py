"""The standalone device: moderngl on an OpenGL 4.3 context of its own, with no window and no Blender.

For tests. Never in Blender's own process: Blender's gpu calls would then run in this context. A 24 bit
depth buffer stands in for DEPTH32F (moderngl makes no other).
"""

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import moderngl
import numpy as np

from . import binding
from .interface import Device, DeviceError, DrawState, Program, Target, Texture, Vertices, Viewport
from .resources import paired_corners
from .shader import Shader, ShaderError

_DTYPES = {"RGBA16F": "f2", "RG16F": "f2", "R16F": "f2", "R32UI": "u4", "R32I": "i4"}
_GL_SRGB8_ALPHA8 = 0x8C43
_BLEND_FUNCTIONS = {
    "ADDITIVE": (moderngl.ONE, moderngl.ONE),
    "MULTIPLY": (moderngl.DST_COLOR, moderngl.ZERO),
    "ALPHA_PREMULT": (moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA),
}
_DEPTH_FUNCTIONS = {
    "LESS": "<", "LESS_EQUAL": "<=", "EQUAL": "==", "GREATER": ">", "GREATER_EQUAL": ">=", "ALWAYS": "1",
}  # fmt: skip
_LOG_LINE = re.compile(r"^\s*(?:ERROR: |WARNING: )?\d+[:(](\d+)[):]?\S*\s*:?\s*(.*)$")
_LOG_STAGES = {"vertex_shader": "vertex", "fragment_shader": "fragment", "compute_shader": "compute"}


class HeadlessDevice(Device):
    """A GPU without Blender. Raises DeviceError where no OpenGL 4.3 context can be made."""

    def __init__(self):
        super().__init__()
        options: Any = {"backend": "egl"} if sys.platform == "linux" else {}
        try:
            ctx: Any = moderngl.create_context(standalone=True, require=430, **options)
        except Exception as error:  # moderngl raises bare Exceptions
            raise DeviceError(f"No OpenGL 4.3 context: {error}") from error
        self._ctx = ctx
        ctx.gc_mode = "auto"  # what is dropped is freed, as in Blender
        renderer = ctx.info["GL_RENDERER"]
        self.name = f"OpenGL {renderer} (standalone)"
        self.is_software = bool(re.search("llvmpipe|softpipe|swrast|swiftshader", renderer, re.IGNORECASE))
        self.max_texture_size = min(16384, ctx.info["GL_MAX_TEXTURE_SIZE"])
        self._programs: dict[Shader, Program] = {}
        self._attributeless: dict[Program, Any] = {}
        self._paired: Any = None  # numbers of corners
        self._paired_arrays: dict[Program, Any] = {}
        # Bound between draws: a framebuffer that is freed while it is bound makes every later one an OpenGL error.
        self._idle = ctx.framebuffer([ctx.renderbuffer((1, 1))])

    @property
    def error(self) -> str:
        """OpenGL's error flag, "GL_NO_ERROR" when all is well; reading it resets it. For tests."""
        return self._ctx.error

    def finish(self) -> None:
        self._ctx.finish()

    def close(self) -> None:
        self._programs.clear()
        self._attributeless.clear()
        self._paired_arrays.clear()
        self._paired = None
        self._ctx.release()

    # --- resources ---------------------------------------------------------------------------------------------------

    def _create_texture(self, texture: Texture, data: np.ndarray | None) -> None:
        info, size, format = texture.info, texture.size, texture.format
        if data is None:
            data = np.zeros(texture.shape, info.dtype)
        dtype = _DTYPES.get(format, "f1" if info.is_8_bit else "f4")
        with np.errstate(over="ignore"):  # what a half float cannot hold becomes infinite, as on a GPU
            content = (data.astype(np.float16) if dtype == "f2" else data).tobytes()
        if info.is_depth:
            handle = self._ctx.depth_texture(size, content, alignment=1)
            handle.compare_func = ""  # read plain depths, not comparisons
        elif len(size) == 3:
            handle = self._ctx.texture3d(size, info.channels, content, alignment=1, dtype=dtype)
        else:
            internal = {"internal_format": _GL_SRGB8_ALPHA8} if format == "SRGB8_A8" else {}
            handle = self._ctx.texture(size, info.channels, content, alignment=1, dtype=dtype, **internal)
        handle.filter = (moderngl.NEAREST, moderngl.NEAREST)
        handle.repeat_x = handle.repeat_y = False
        if len(size) == 3:
            handle.repeat_z = False
        texture.handle = handle

    def _create_target(self, target: Target) -> None:
        depth = None if target.depth is None else target.depth.handle
        target.handle = self._ctx.framebuffer([t.handle for t in target.colors], depth)

    def _create_vertices(self, vertices: Vertices, arrays: Mapping[str, np.ndarray]) -> None:
        vertices.handle = {name: self._ctx.buffer(array.tobytes()) for name, array in arrays.items()}

    def free(self, resource: Texture | Target | Vertices | None) -> None:
        if resource is None or resource.handle is None:
            return
        if isinstance(resource, Vertices):
            for vertex_array in resource.cache.values():
                vertex_array.release()
            resource.cache.clear()
            for buffer in resource.handle.values():
                buffer.release()
        else:
            resource.handle.release()
        resource.handle = None

    # --- programs ----------------------------------------------------------------------------------------------------

    def _program(self, shader: Shader) -> Program:
        program = self._programs.get(shader)
        if program is None:
            program = self._programs[shader] = self._compile(shader)
        return program

    def _compile(self, shader: Shader) -> Program:
        sources = {stage: shader.standalone(stage) for stage in shader.stages}
        try:
            if shader.compute:
                handle = self._ctx.compute_shader(sources["compute"].text)
            else:
                handle = self._ctx.program(
                    vertex_shader=sources["vertex"].text, fragment_shader=sources["fragment"].text
                )
        except moderngl.Error as error:
            raise _shader_error(shader, sources, str(error)) from None
        program = Program(shader, handle)
        for slot, (name, kind) in enumerate(shader.samplers.items()):
            program.setters[name] = _sampler_setter(slot, kind)
        for slot, (name, image) in enumerate(shader.images.items()):
            program.setters[name] = _image_setter(slot, image)
        for slot, (name, struct) in enumerate(shader.uniforms.items()):
            program.setters[name] = self._uniform_setter(slot, struct)
        for name, type_name in shader.constants.items():
            program.setters[name] = _constant_setter(handle.get(name, None), type_name)
        return program

    def _uniform_setter(self, slot: int, struct: Any) -> Callable[[Any], None]:
        buffer, to_bytes = self._ctx.buffer(reserve=struct.size), binding.uniform_bytes(struct)

        def set_uniform(value: Any) -> None:
            buffer.write(to_bytes(value))
            buffer.bind_to_uniform_block(slot)

        return set_uniform

    # --- work --------------------------------------------------------------------------------------------------------

    def _begin(self, program: Program, target: Target | None, state: DrawState, viewport: Viewport | None) -> None:
        assert target is not None
        ctx, framebuffer = self._ctx, target.handle
        framebuffer.viewport = viewport or (0, 0, *target.size)
        framebuffer.color_mask = [(True,) * 4] * len(target.colors) if len(target.colors) != 1 else (True,) * 4
        framebuffer.depth_mask = state.depth_write
        framebuffer.use()
        flags = moderngl.NOTHING
        if state.depth_test != "NONE":
            flags |= moderngl.DEPTH_TEST
            ctx.depth_func = _DEPTH_FUNCTIONS[state.depth_test]
        if state.blend != "NONE":
            flags |= moderngl.BLEND
            ctx.blend_func = _BLEND_FUNCTIONS[state.blend]
        ctx.enable_only(flags)

    def _end(self, program: Program, target: Target | None) -> None:
        assert target is not None
        self._ctx.enable_only(moderngl.NOTHING)
        target.handle.depth_mask = True  # a clear respects it
        self._idle.use()
        if binding.touches_images(program.shader):
            self._ctx.memory_barrier()

    def _draw(self, program: Program, vertices: Vertices | None, count: int, instances: int, paired: bool) -> None:
        if paired:
            self._paired_array(program, count).render(moderngl.TRIANGLES, vertices=count)
            return
        cache = self._attributeless if vertices is None else vertices.cache
        vertex_array = cache.get(program)
        if vertex_array is None:
            vertex_array = cache[program] = self._vertex_array(program, vertices)
        vertex_array.render(moderngl.TRIANGLES, vertices=count, instances=instances)

    def _paired_array(self, program: Program, count: int) -> Any:
        if self._paired is None or self._paired.size < 4 * count:
            self._paired = self._ctx.buffer(paired_corners(count).tobytes())
            self._paired_arrays.clear()
        if program not in self._paired_arrays:
            self._paired_arrays[program] = self._ctx.vertex_array(program.handle, [], index_buffer=self._paired)
        return self._paired_arrays[program]

    def _vertex_array(self, program: Program, vertices: Vertices | None) -> Any:
        content = []
        if vertices is not None:
            if vertices.handle is None:
                raise ValueError(f"Shader {program.shader.name}: the vertices were freed")
            for name in program.shader.inputs:
                scalar, components = vertices.layout[name]
                if name in program.handle:  # the compiler drops what is not used
                    content.append((vertices.handle[name], f"{components}{scalar.lower()}4", name))
        return self._ctx.vertex_array(program.handle, content, mode=moderngl.TRIANGLES)

    def _dispatch(self, program: Program, groups: tuple[int, int, int], resources: Mapping[str, Any]) -> None:
        program.set(resources)
        program.handle.run(*groups)
        self._ctx.memory_barrier()

    def _clear(self, target: Target, colors: Sequence[Sequence[float]], depth: float) -> None:
        for texture, color in zip(target.colors, colors, strict=True):
            if texture.info.scalar != "FLOAT":  # glClear is undefined for integers
                texture.handle.write(np.full(texture.shape, color[0], texture.info.dtype).tobytes())
                continue
            framebuffer = self._ctx.framebuffer([texture.handle])
            framebuffer.clear(*color)
            framebuffer.release()
        if target.depth is not None:
            framebuffer = self._ctx.framebuffer([], target.depth.handle)
            framebuffer.clear(depth=depth)
            framebuffer.release()

    def _read(self, texture: Texture) -> np.ndarray:
        content = texture.handle.read(alignment=1)
        dtype = np.float16 if _DTYPES.get(texture.format) == "f2" else texture.info.dtype
        return np.frombuffer(content, dtype).astype(texture.info.dtype).reshape(texture.shape)


def _sampler_setter(slot: int, kind: str) -> Callable[[Any], None]:
    handle = binding.texture_handle(kind)
    return lambda texture: handle(texture).use(slot)


def _image_setter(slot: int, image: Any) -> Callable[[Any], None]:
    handle = binding.image_handle(image)
    read, write = image.access != "WRITE", image.access != "READ"
    return lambda texture: handle(texture).bind_to_image(slot, read=read, write=write)


def _constant_setter(uniform: Any, type_name: str) -> Callable[[Any], None]:
    """Setter of a plain uniform; a constant that the compiler dropped is still checked."""
    if type_name in ("FLOAT", "INT"):
        number = float if type_name == "FLOAT" else binding.int_constant

        def set_number(value: Any) -> None:
            value = number(value)
            if uniform is not None:
                uniform.value = value

        return set_number
    to_array = binding.array_constant(type_name)

    def set_array(value: Any) -> None:
        array = to_array(value)
        if uniform is not None:
            uniform.write(array)

    return set_array


def _shader_error(shader: Shader, sources: Mapping[str, Any], log: str) -> ShaderError:
    """Trace a log of Mesa ("0:12(3): error: x"), NVIDIA ("0(12) : error x") or AMD ("ERROR: 0:12: x") to file:line."""
    stage, lines = shader.stages[-1], []
    for line in log.splitlines():
        stage = _LOG_STAGES.get(line.strip(), stage)
        match = _LOG_LINE.match(line)
        if match:
            lines.append(f"{sources[stage].origin(int(match[1]))}: {match[2]}")
        elif line.strip() and not set(line.strip()) <= {"="} and line.strip() not in _LOG_STAGES:
            lines.append(line.strip())
    return ShaderError(shader.name, stage, "\n".join(lines))
