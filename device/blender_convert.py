"""What Blender cannot upload or read back itself, done by a draw: integers and volumes."""

from typing import TYPE_CHECKING

import numpy as np

from .interface import Texture
from .shader import Shader

if TYPE_CHECKING:
    from .blender import BlenderDevice


def upload_values(texture: Texture, data: np.ndarray, *, encodes_srgb: bool) -> np.ndarray:
    """The flat float32 array that makes Blender store ``data``: it takes nothing but floats.

    encodes_srgb: the backend takes the values of an SRGB8_A8 texture for linear ones (Vulkan in Blender 4.5).
    """
    if not texture.info.is_8_bit:
        return data.ravel()
    # Some drivers round, some truncate: aim between a byte and the next half.
    values = np.minimum(data + np.float32(0.25), 255.0) / np.float32(255.0)
    if encodes_srgb and texture.format == "SRGB8_A8":
        rgb = values[..., :3]
        values[..., :3] = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return np.ascontiguousarray(values, np.float32).ravel()


def upload_integers(device: "BlenderDevice", texture: Texture, data: np.ndarray) -> None:
    """Fill an integer texture (h, w, 1): the bits travel in a float texture."""
    bits = device.texture(texture.size, "R32F", data.view(np.float32))
    kind, function = ("UINT", "floatBitsToUint") if texture.info.scalar == "UINT" else ("INT", "floatBitsToInt")
    shader = _pass(
        f"device_upload_{kind.lower()}",
        "FLOAT_2D",
        kind,
        f"{function}(texelFetch(source_tx, ivec2(gl_FragCoord.xy), 0).x)",
    )
    target = device.target([texture])
    device.fullscreen(shader, target, source_tx=bits)
    device.free(target)


def read(device: "BlenderDevice", texture: Texture) -> np.ndarray:
    """All texels as numpy, whatever the version can read."""
    info, shape = texture.info, texture.shape
    if len(shape) == 3 and info.scalar != "INT":
        return read_direct(texture, info.dtype).reshape(shape)
    # Signed integers read back as garbage, volumes as their first slice: copy slice by slice.
    bits = info.scalar != "FLOAT"
    slices = shape[0] if len(shape) == 4 else 1
    copy = device.texture(texture.size[:2], "R32UI" if bits else "RGBA32F")
    target = device.target([copy])
    shader = _slice_shader(texture.kind, bits)
    values = np.empty((slices, shape[-3], shape[-2], info.channels), info.dtype)
    for index in range(slices):
        device.fullscreen(shader, target, source_tx=texture, pc_slice=index)
        read_slice = read_direct(copy, np.uint32 if bits else np.float32).reshape(*shape[-3:-1], -1)
        read_slice = read_slice[..., : info.channels]
        values[index] = np.rint(read_slice * 255.0) if info.is_8_bit else read_slice.view(info.dtype)
    device.free(target)
    device.free(copy)
    return values.reshape(shape)


def read_direct(texture: Texture, dtype: type) -> np.ndarray:
    """GPUTexture.read as a flat array. The buffer is made flat first: its strides are wrong before Blender 5.2."""
    buffer = texture.handle.read()
    buffer.dimensions = int(np.prod(buffer.dimensions))
    values = np.asarray(buffer)
    if values.dtype != dtype:
        raise TypeError(f"{texture} was read as {values.dtype}, expected {np.dtype(dtype)}")
    return values.copy()


def _slice_shader(kind: str, bits: bool) -> Shader:
    at = "ivec2(gl_FragCoord.xy)" if kind.endswith("_2D") else "ivec3(gl_FragCoord.xy, pc_slice)"
    fetch = f"texelFetch(source_tx, {at}, 0)"
    return _pass(
        f"device_read_{kind.lower()}",
        kind,
        "UINT" if bits else "VEC4",
        f"uint({fetch}.x)" if bits else fetch,
        {"pc_slice": "INT"},
    )


def _pass(name: str, sampler: str, output: str, expression: str, constants: dict[str, str] | None = None) -> Shader:
    path = f"device/{name}_frag.glsl"
    return Shader(
        name,
        fragment=path,
        samplers={"source_tx": sampler},
        outputs={"out_value": output},
        constants=constants or {},
        files={path: f"void main()\n{{\n  out_value = {expression};\n}}\n"},
    )
