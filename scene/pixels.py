"""The pixels of a bpy image -> Image: bytes as they are stored where that is exact, else scene-linear float32.

Bytes take a quarter of the memory, and are filtered as Cycles filters them: stored, and decoded after that.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Hashable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Color

from .data import SRGB_BYTES, Array, Image, encode_srgb

OnMainThread = Callable[[Callable[[], object]], Any]  # runs a call where data-blocks may be made; gives its result

MAX_SIZE = 4096  # pixels along the longer side; larger images are averaged down, so that one of them fits the GPU

# Linear colour spaces by what their Color method is called; the methods differ from Blender version to version.
LINEAR_SPACES: Mapping[str, str] = {
    "Linear Rec.709": "from_rec709_linear_to_scene_linear",
    "Linear": "from_rec709_linear_to_scene_linear",
    "Linear Rec.2020": "from_rec2020_linear_to_scene_linear",
    "ACEScg": "from_acescg_to_scene_linear",
    "ACES2065-1": "from_aces_to_scene_linear",
    "Linear CIE-XYZ D65": "from_xyz_d65_to_scene_linear",
}


def read_image(image, key: Hashable, on_main_thread: OnMainThread) -> Image | None:
    """Read the pixels of a bpy image, or None where it has none. The file is loaded if it was not yet."""
    width, height = image.size
    if not (image.has_data and width and height and image.channels):
        return None
    warnings: list[str] = []
    raw = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(raw)
    raw = _rgba(raw.reshape(height, width, image.channels))
    step = -(-max(width, height) // MAX_SIZE)
    if step > 1:
        warnings.append(
            f"Image '{image.name}': {width}×{height} is averaged down {step} times to fit {MAX_SIZE} pixels"
        )
    straighten = _straightener(image)
    is_srgb = image.colorspace_settings.name == "sRGB"
    if not image.is_float and (_is_plain(image) or (is_srgb and _is_rec709())):
        stored = np.rint(np.clip(raw, 0.0, 1.0) * 255.0).astype(np.uint8)
        del raw
        return reduced(Image(key, image.name, straighten(stored), tuple(warnings), is_srgb), step)
    to_linear = _to_linear(image, on_main_thread)

    def linear(pixels: Array) -> Array:
        return straighten(to_linear(pixels))

    return Image(key, image.name, _averaged(raw, step, linear) if step > 1 else linear(raw), tuple(warnings))


def reduced(image: Image, step: int) -> Image:
    """The image with the averages of its step×step blocks, in linear light."""
    if step < 2:
        return image
    pixels = _averaged(image.pixels, step, image.linear)
    if image.pixels.dtype == np.uint8:
        if image.is_srgb:
            pixels[..., :3] = encode_srgb(pixels[..., :3])
        pixels = np.rint(np.clip(pixels, 0.0, 1.0) * 255.0).astype(np.uint8)
    return replace(image, pixels=pixels)


def _is_plain(image) -> bool:
    """Whether its numbers are used as they are."""
    name = image.colorspace_settings.name
    return image.colorspace_settings.is_data or name in {"scene_linear", ""}


def _is_rec709() -> bool:
    """Whether Blender works in the colours of sRGB."""
    return np.allclose(_matrix_of("from_rec709_linear_to_scene_linear"), np.eye(3), atol=1e-4)


def _to_linear(image, on_main_thread: OnMainThread) -> Callable[[Array], Array]:
    """The function from stored (H, W, 4) pixels to scene-linear ones, for this image's colour space."""
    name = image.colorspace_settings.name
    if image.is_float or _is_plain(image):  # Blender converts float files while it loads them
        return lambda pixels: pixels
    if name == "sRGB":
        matrix = _matrix_of("from_rec709_linear_to_scene_linear")
        return lambda pixels: _apply(matrix, _decoded(pixels))
    method = LINEAR_SPACES.get(name)
    if method and hasattr(Color, method):
        matrix = _matrix_of(method)
        return lambda pixels: _apply(matrix, pixels)
    return lambda pixels: on_main_thread(lambda: _converted(pixels, name))


def _converted(pixels: Array, space: str) -> Array:
    """Scene-linear pixels of (H, W, 4) in any of Blender's colour spaces, by Blender's own conversion.

    It converts float files as it loads them, so they are written to one. Only where data-blocks may be made.
    """
    height, width = pixels.shape[:2]
    with tempfile.TemporaryDirectory(prefix="rebound-image-") as folder:
        path = str(Path(folder) / "stored.exr")
        stored = bpy.data.images.new("Rebound", width, height, alpha=True, float_buffer=True)
        try:
            stored.colorspace_settings.name, stored.alpha_mode = "Non-Color", "CHANNEL_PACKED"
            stored.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
            stored.file_format, stored.filepath_raw = "OPEN_EXR", path
            stored.save()
        finally:
            bpy.data.images.remove(stored)
        loaded = bpy.data.images.load(path)
        try:
            loaded.colorspace_settings.name, loaded.alpha_mode = space, "CHANNEL_PACKED"
            found = np.empty(height * width * 4, np.float32)
            loaded.pixels.foreach_get(found)
        finally:
            bpy.data.images.remove(loaded)
    found = found.reshape(height, width, 4)
    found[..., 3] = pixels[..., 3]
    return found


def _rgba(raw: Array) -> Array:
    """Any number of stored channels to four: grey is spread, a missing alpha is 1."""
    height, width, channels = raw.shape
    if channels == 4:
        return raw
    pixels = np.ones((height, width, 4), np.float32)
    if channels < 3:
        pixels[..., :3] = raw[..., :1]
        if channels == 2:
            pixels[..., 3] = raw[..., 1]
    else:
        pixels[..., :3] = raw[..., :3]
    return pixels


def _averaged(raw: Array, step: int, linear: Callable[[Array], Array]) -> Array:
    """Averages step×step blocks in linear light, a strip of rows at a time to bound the memory; cuts off the rest."""
    height, width = raw.shape[0] // step, raw.shape[1] // step
    width, height = max(width, 1), max(height, 1)
    across, down = min(step, raw.shape[1]), min(step, raw.shape[0])
    out = np.empty((height, width, 4), np.float32)
    for row in range(height):
        strip = linear(raw[row * down : (row + 1) * down, : width * across])
        out[row] = strip.reshape(down, width, across, 4).mean(axis=(0, 2))
    return out


def _straightener(image) -> Callable[[Array], Array]:
    """The function to straight alpha: byte images have it; float files keep their colours multiplied by alpha.

    As in Cycles, which keeps all but data and packed channels multiplied, no colour is left where alpha is 0.
    """
    if image.alpha_mode == "NONE":
        return _opaque
    if image.is_float and image.alpha_mode == "PREMUL":
        return _divided_by_alpha
    if image.alpha_mode == "STRAIGHT" and not image.colorspace_settings.is_data:
        return _black_where_clear
    return lambda pixels: pixels


def _opaque(pixels: Array) -> Array:
    out = pixels.copy()
    out[..., 3] = 255 if pixels.dtype == np.uint8 else 1.0
    return out


def _black_where_clear(pixels: Array) -> Array:
    clear = pixels[..., 3] == 0
    if not clear.any():
        return pixels
    out = pixels.copy()
    out[clear, :3] = 0.0
    return out


def _divided_by_alpha(pixels: Array) -> Array:
    alpha = pixels[..., 3:]
    if (alpha == 1.0).all():
        return pixels
    out = pixels.copy()
    np.divide(pixels[..., :3], alpha, out=out[..., :3], where=alpha > 0.0)
    return out


def _decoded(pixels: Array) -> Array:
    """Decoded sRGB; a byte image has only 256 values, so a table is exact and fast."""
    out = pixels.copy()
    out[..., :3] = SRGB_BYTES[np.rint(np.clip(pixels[..., :3], 0.0, 1.0) * 255.0).astype(np.uint8)]
    return out


def _matrix_of(method: str) -> Array:
    """The (3, 3) matrix behind one of mathutils.Color's conversions to Blender's working space."""
    return np.array([tuple(getattr(Color(axis), method)()) for axis in np.eye(3)], np.float32).T


def _apply(matrix: Array, pixels: Array) -> Array:
    if np.allclose(matrix, np.eye(3), atol=1e-4):
        return pixels
    out = pixels.copy()
    out[..., :3] = pixels[..., :3] @ matrix.T
    return out
