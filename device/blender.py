"""Blender's device: the gpu module of Blender 4.5 to 5.2, on OpenGL and Vulkan (Metal: by its rules, untried).

What the versions do differently stays in this file. It needs a GPU context: inside a RenderEngine callback, an operator
or a draw handler in the interface, or after gpu.init() (5.2) in background.
"""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import bpy
import gpu as _gpu
import numpy as np

from . import binding, blender_convert
from .blender_log import PROBE, failed_stage, probed_line, run_captured, trace
from .interface import Device, DeviceError, DrawState, Program, Target, Texture, Vertices, Viewport
from .resources import paired_corners
from .shader import Shader, ShaderError, Source

_logger = logging.getLogger("rebound")  # by name: as an extension the package is bl_ext.….rebound

# Untyped: the stubs spell out one version's literals, and ours are checked in Shader, Texture and DrawState.
gpu: Any = _gpu

_FORMATS = {"DEPTH32F": "DEPTH_COMPONENT32F"}
_IS_4_5 = bpy.app.version < (5, 0, 0)
_HAS_SAMPLER_STATE = bpy.app.version >= (5, 2, 0)
_BLEND = {name: name for name in ("NONE", "MULTIPLY", "ALPHA_PREMULT")} | {"ADDITIVE": "ADDITIVE_PREMULT"}

# Programs live until the extension is disabled: a shader that is freed while bound makes the next draw on OpenGL use
# the old program, and engine objects die on threads without a GPU context.
_PROGRAMS: dict[Shader, Program] = {}


def unbind() -> None:
    """Bind no shader, because ours are freed after this: to be called when the extension is disabled."""
    if _PROGRAMS:
        gpu.shader.unbind()


class BlenderDevice(Device):
    """The GPU of this Blender. Raises DeviceError where it has none (yet)."""

    def __init__(self):
        super().__init__()
        try:
            backend = gpu.platform.backend_type_get()
            renderer = gpu.platform.renderer_get()
            self.is_software = gpu.platform.device_type_get() == "SOFTWARE"
            self.max_texture_size = min(16384, gpu.capabilities.max_texture_size_get())
        except (SystemError, RuntimeError, AttributeError) as error:
            raise DeviceError(f"Blender has no GPU context here: {error}") from error
        if backend in ("NONE", "UNKNOWN"):
            raise DeviceError("Blender runs without a GPU")
        self._backend = backend
        self.name = f"{ {'OPENGL': 'OpenGL', 'VULKAN': 'Vulkan', 'METAL': 'Metal'}.get(backend, backend) } {renderer}"
        # Blender wants a vertex buffer even where a shader has no attributes.
        self._attributeless: Any = _batch([gpu.types.GPUVertBuf(gpu.types.GPUVertFormat(), len=3)])
        self._paired: tuple[int, Any] | None = None  # corners, and the batch of so many
        self._pixel: Texture | None = None
        self._bound: Any = None
        self._context = 0
        self._cleared = False

    def finish(self) -> None:
        """Wait for the GPU: reading any texture waits for all that was queued."""
        if self._pixel is None:
            self._pixel = self.texture((1, 1), "RGBA8")
        self._pixel.handle.read()
        self._cleared = False

    def close(self) -> None:
        """Drop the device's own buffers. Programs stay: they are Blender's for as long as the extension is enabled."""
        self._attributeless = self._paired = None
        self.free(self._pixel)
        self._pixel = None

    def context_may_differ(self) -> None:
        """Say so before work in a timer of Blender's: it runs in the context of whichever window was drawn last.

        On OpenGL all contexts share textures, programs and vertices, but a framebuffer can be bound in its own only.
        """
        self._context += 1

    def draw_to_current(self, shader: Shader, **resources: Any) -> None:
        """Draw a full-screen shader into what is bound now (a viewport in view_draw), within its viewport."""
        program = self._program(shader)
        program.check_names(resources, tuple(program.setters))
        self._check_idle(shader)
        try:
            self._begin(program, None, DrawState(), None)
            program.set(resources)
            self._draw(program, None, 3, 1, paired=False)
        finally:
            self._end(program, None)

    # --- resources ---------------------------------------------------------------------------------------------------

    def _create_texture(self, texture: Texture, data: np.ndarray | None) -> None:
        options: dict[str, Any] = {"format": _FORMATS.get(texture.format, texture.format)}
        is_integer = texture.info.scalar != "FLOAT"
        if data is not None and not is_integer:
            values = blender_convert.upload_values(texture, data, encodes_srgb=_IS_4_5 and self._backend == "VULKAN")
            options["data"] = gpu.types.Buffer("FLOAT", values.size, values)
        try:
            texture.handle = gpu.types.GPUTexture(texture.size, **options)
        except (RuntimeError, MemoryError) as error:
            raise DeviceError(f"The GPU refuses {texture}: {error}") from error
        if _HAS_SAMPLER_STATE and not is_integer and not texture.info.is_depth:
            texture.handle.filter_mode(False)
            texture.handle.extend_mode("EXTEND")
        if data is None:  # Vulkan leaves garbage in it
            self._fill(texture, (0.0, 0.0, 0.0, 0.0))
        elif is_integer:
            blender_convert.upload_integers(self, texture, data)

    def _fill(self, texture: Texture, color: Sequence[float]) -> None:
        info = texture.info
        self._cleared = True
        if info.is_depth:
            # GPUTexture.clear of a depth texture crashes Blender on Vulkan up to 5.0.
            framebuffer = gpu.types.GPUFrameBuffer(depth_slot=texture.handle)
            with _bound(framebuffer):
                framebuffer.clear(depth=color[0])
            return
        cast = float if info.scalar == "FLOAT" else int
        texture.handle.clear(format=info.scalar, value=tuple(cast(c) for c in color[: info.channels]))

    def _create_target(self, target: Target) -> None:
        target.handle = self._context, self._framebuffer(target)

    def _framebuffer(self, target: Target) -> Any:
        slots: dict[str, Any] = {}
        if target.colors:
            slots["color_slots"] = tuple(t.handle for t in target.colors)
        if target.depth is not None:
            slots["depth_slot"] = target.depth.handle
        return gpu.types.GPUFrameBuffer(**slots)

    def _create_vertices(self, vertices: Vertices, arrays: Mapping[str, np.ndarray]) -> None:
        buffers = []
        for name, array in arrays.items():
            # One buffer an attribute fills 10 times quicker than interleaved ones.
            layout = gpu.types.GPUVertFormat()
            scalar, components = vertices.layout[name]
            layout.attr_add(
                id=name, comp_type=f"{scalar}32", len=components, fetch_mode="FLOAT" if scalar == "F" else "INT"
            )
            buffer = gpu.types.GPUVertBuf(layout, len=vertices.count)
            buffer.attr_fill(name, array)
            buffers.append(buffer)
        vertices.handle = buffers
        vertices.cache[None] = _batch(buffers)

    def free(self, resource: Texture | Target | Vertices | None) -> None:
        """Drop the references: Blender frees a resource with its last one."""
        if resource is None:
            return
        resource.handle = None
        if isinstance(resource, Vertices):
            resource.cache.clear()

    # --- programs ----------------------------------------------------------------------------------------------------

    def _program(self, shader: Shader) -> Program:
        program = _PROGRAMS.get(shader)
        if program is None:
            program = _PROGRAMS[shader] = self._compile(shader)
        return program

    def _compile(self, shader: Shader) -> Program:
        sources = {stage: shader.assemble(stage) for stage in shader.stages}
        handle, error, log = self._create(shader, {stage: source.text for stage, source in sources.items()})
        if error is not None:
            raise ShaderError(shader.name, *self._trace(shader, sources, log or str(error)))
        if log:
            _logger.debug("Shader %s: %s", shader.name, log.strip())
        program = Program(shader, handle)
        program.setters |= {n: _sampler_setter(handle, n, kind) for n, kind in shader.samplers.items()}
        program.setters |= {n: _image_setter(handle, n, image) for n, image in shader.images.items()}
        program.setters |= {n: _uniform_setter(handle, n, struct) for n, struct in shader.uniforms.items()}
        program.setters |= {n: _constant_setter(handle, n, type_name) for n, type_name in shader.constants.items()}
        return program

    def _create(self, shader: Shader, texts: Mapping[str, str]) -> tuple[Any, Exception | None, str]:
        if _IS_4_5 and self._backend == "OPENGL":
            # Without it 4.5 takes its own line numbers for another source's, and prints none.
            texts = {stage: "#line 1 0\n" + text for stage, text in texts.items()}
        return run_captured(lambda: gpu.shader.create_from_info(_create_info(shader, texts, self._backend)))

    def _trace(self, shader: Shader, sources: Mapping[str, Source], log: str) -> tuple[str, str]:
        """(stage, message with file:line) of a failed compilation."""
        probed = None
        if _IS_4_5:
            failed = failed_stage(log, shader.stages)
            probe = {s: (PROBE if s == failed else "") + source.text for s, source in sources.items()}
            probed = probed_line(self._create(shader, probe)[2])
        return trace(log, sources, probed)

    # --- work --------------------------------------------------------------------------------------------------------

    def _begin(self, program: Program, target: Target | None, state: DrawState, viewport: Viewport | None) -> None:
        if target is not None:
            if target.handle[0] != self._context:
                self._create_target(target)
            bound = _bound(target.handle[1])
            bound.__enter__()
            self._bound = bound
            # On OpenGL a framebuffer keeps its viewport from bind to bind, on Vulkan it does not.
            gpu.state.viewport_set(*(viewport or (0, 0, *target.size)))
        _set_state(state)
        program.handle.bind()

    def _end(self, program: Program, target: Target | None) -> None:
        bound, self._bound = self._bound, None  # None too where _begin failed before it was bound
        try:
            _set_state(DrawState())
        finally:
            if bound is not None:
                bound.__exit__(None, None, None)
        if self._backend == "OPENGL" and binding.touches_images(program.shader):
            self._barrier()

    def _draw(self, program: Program, vertices: Vertices | None, count: int, instances: int, paired: bool) -> None:
        if paired:
            self._paired_batch(count).draw_range(program.handle, elem_start=0, elem_count=count)
            return
        batch = self._attributeless if vertices is None else vertices.cache.get(None)
        if batch is None:
            raise ValueError(f"Shader {program.shader.name}: the vertices were freed")
        if vertices is not None:
            vertices.cache[program] = True  # its inputs were checked
        if instances == 1:
            batch.draw_range(program.handle, elem_start=0, elem_count=count)
            return
        if vertices is None:
            batch = _batch([gpu.types.GPUVertBuf(gpu.types.GPUVertFormat(), len=count)])
        batch.draw_instanced(program.handle, instance_start=0, instance_count=instances)

    def _paired_batch(self, count: int) -> Any:
        if self._paired is None or self._paired[0] < count:
            corners = paired_corners(count)
            nothing = gpu.types.GPUVertBuf(gpu.types.GPUVertFormat(), len=corners.size)
            indices = gpu.types.GPUIndexBuf(type="TRIS", seq=corners)
            self._paired = corners.size, gpu.types.GPUBatch(type="TRIS", buf=nothing, elem=indices)
        return self._paired[1]

    def _dispatch(self, program: Program, groups: tuple[int, int, int], resources: Mapping[str, Any]) -> None:
        if self._cleared and self.is_software:
            # llvmpipe: a dispatch right after a clear can read what was there before. Anything in between helps.
            self.finish()
        program.handle.bind()
        program.set(resources)
        gpu.compute.dispatch(program.handle, *groups)

    def _barrier(self) -> None:
        """Make images stored by a draw visible: on OpenGL only a dispatch issues the memory barrier."""
        program = self._program(_NOTHING)
        program.handle.bind()
        gpu.compute.dispatch(program.handle, 1, 1, 1)

    def _clear(self, target: Target, colors: Sequence[Sequence[float]], depth: float) -> None:
        for texture, color in zip(target.colors, colors, strict=True):
            self._fill(texture, color)
        if target.depth is not None:
            self._fill(target.depth, (depth,))

    def _read(self, texture: Texture) -> np.ndarray:
        return blender_convert.read(self, texture)


_NOTHING = Shader("device_barrier", compute="device/barrier_comp.glsl", local_size=(1, 1, 1),
                  files={"device/barrier_comp.glsl": "void main() {}\n"})  # fmt: skip


@contextmanager
def _bound(framebuffer: Any) -> Iterator[None]:
    """Bind a framebuffer; afterwards the one before is bound again, with its viewport (which Vulkan forgets)."""
    viewport = gpu.state.viewport_get()
    try:
        with framebuffer.bind():
            yield
    finally:
        gpu.state.viewport_set(*viewport)


def _set_state(state: DrawState) -> None:
    gpu.state.depth_test_set(state.depth_test)
    gpu.state.depth_mask_set(state.depth_write)
    gpu.state.blend_set(_BLEND[state.blend])
    gpu.state.face_culling_set("NONE")
    gpu.state.color_mask_set(True, True, True, True)


def _batch(buffers: Sequence[Any]) -> Any:
    batch = gpu.types.GPUBatch(type="TRIS", buf=buffers[0])
    for buffer in buffers[1:]:
        batch.vertbuf_add(buffer)
    return batch


def _create_info(shader: Shader, texts: Mapping[str, str], backend: str) -> Any:
    info = gpu.types.GPUShaderCreateInfo()
    # Blender 5.2 strips the bare word from sources.
    info.define("SHARED", "shared")
    for name, value in shader.defines:
        info.define(name, value)
    if shader.all_structs:
        vec3 = "packed_float3" if backend == "METAL" else "vec3"
        info.typedef_source("\n".join(struct.glsl_struct(vec3) for struct in shader.all_structs) + "\n")
    for slot, (name, type_name) in enumerate(shader.samplers.items()):
        info.sampler(slot, type_name, name)
    for slot, (name, image) in enumerate(shader.images.items()):
        info.image(slot, image.format, image.type, name, qualifiers=set(image.access.split("_")))
    for slot, (name, struct) in enumerate(shader.uniforms.items()):
        info.uniform_buf(slot, struct.name, name)
    for name, type_name in shader.constants.items():
        info.push_constant(type_name, name)
    if shader.compute:
        info.local_group_size(*shader.local_size)
        info.compute_source(texts["compute"])
    else:
        _add_stages(info, shader, texts)
    return info


def _add_stages(info: Any, shader: Shader, texts: Mapping[str, str]) -> None:
    for slot, (name, type_name) in enumerate(shader.inputs.items()):
        info.vertex_in(slot, type_name, name)
    if shader.all_varyings:
        interface = gpu.types.GPUStageInterfaceInfo(f"{shader.name}_interface")
        for name, (how, type_name) in shader.all_varyings.items():
            getattr(interface, how)(type_name, name)
        info.vertex_out(interface)
    for slot, (name, type_name) in enumerate(shader.outputs.items()):
        info.fragment_out(slot, type_name, name)
    if shader.depth_write:
        info.depth_write("ANY")
    info.vertex_source(texts["vertex"])
    info.fragment_source(texts["fragment"])


def _sampler_setter(handle: Any, name: str, kind: str) -> Callable[[Any], None]:
    texture_handle, bind = binding.texture_handle(kind), handle.uniform_sampler
    return lambda texture: bind(name, texture_handle(texture))


def _image_setter(handle: Any, name: str, image: Any) -> Callable[[Any], None]:
    image_handle, bind = binding.image_handle(image), handle.image
    return lambda texture: bind(name, image_handle(texture))


def _uniform_setter(handle: Any, name: str, struct: Any) -> Callable[[Any], None]:
    to_bytes, last = binding.uniform_bytes(struct), b""
    buffer: Any = None

    def set_uniform(value: Any) -> None:
        nonlocal buffer, last
        data = to_bytes(value)
        if buffer is None:
            buffer = gpu.types.GPUUniformBuf(data)
        elif data != last:
            buffer.update(data)
        last = data
        handle.uniform_block(name, buffer)

    return set_uniform


def _constant_setter(handle: Any, name: str, type_name: str) -> Callable[[Any], None]:
    """Setter of a push constant. What OpenGL's compiler dropped is refused by Blender: only its value is checked."""
    try:
        location = handle.uniform_from_name(name)
    except ValueError:
        location = -1
    if type_name in ("FLOAT", "INT"):
        number, set_value = (
            (float, handle.uniform_float) if type_name == "FLOAT" else (binding.int_constant, handle.uniform_int)
        )

        def set_number(value: Any) -> None:
            value = number(value)
            if location >= 0:
                set_value(name, value)

        return set_number
    to_array = binding.array_constant(type_name)
    set_vector = handle.uniform_vector_int if type_name[0] == "I" else handle.uniform_vector_float

    def set_array(value: Any) -> None:
        array = to_array(value)
        if location >= 0:
            set_vector(location, array, array.size, 1)

    return set_array
