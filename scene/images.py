"""Blender image -> Image: scene-linear float32 pixels with straight alpha."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Hashable, Mapping
from typing import Any

import bpy
import numpy as np
from mathutils import Color

from .data import Array, Image

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


class ImageReader:
    """Reads each image of a scene once; ``images`` holds what was read, or reused from the previous scene."""

    def __init__(self, previous: Mapping[Hashable, Image], warn: Callable[[str], None], on_main_thread: OnMainThread):
        self.images: dict[Hashable, Image] = {}
        self._on_main_thread = on_main_thread
        self._previous = previous
        self._warn = warn
        self._done: dict[tuple[int, str], Hashable | None] = {}

    def read(self, image, user=None) -> Hashable | None:
        """Return the key of a bpy image's pixels, or None (and one warning) where there are no pixels.

        ``user`` is the ImageUser of the node that shows it; it knows the frame of an image sequence.
        """
        original = image.original or image
        path = frame_path(original, user)
        visit = (original.session_uid, path)
        if visit not in self._done:
            self._done[visit] = self._read(original, path)
        return self._done[visit]

    def keep(self, key: Hashable, make: Callable[[], Image]) -> Hashable:
        """Have an image that no data-block holds: the previous scene's, or a new one."""
        if key not in self.images:
            self.images[key] = self._previous.get(key) or make()
        return key

    def _read(self, image, path: str) -> Hashable | None:
        key = image_key(image, path)
        found = self._previous.get(key) or self._read_pixels(image, key, path)
        if found is None:
            name = path or image.filepath
            reason = f"the file '{name}' is missing or cannot be read" if name else "it has no pixels"
            self._warn(f"Image '{image.name}': {reason}; magenta is shown instead")
            return None
        for line in found.warnings:
            self._warn(line)
        self.images[key] = found
        return key

    def _read_pixels(self, image, key: Hashable, path: str) -> Image | None:
        if not path:
            return read_image(image, key)
        return self._on_main_thread(lambda: _read_frame(image, key, path))


def frame_path(image, user) -> str:
    """The file of an image sequence's current frame; "" for any other image."""
    if image.source != "SEQUENCE" or user is None:
        return ""
    return bpy.path.abspath(image.filepath_from_user(image_user=user), library=image.library)


def _read_frame(image, key: Hashable, path: str) -> Image | None:
    """Read one frame of a sequence through a temporary data-block: Image.pixels itself knows no frame.

    Only on the main thread, where data-blocks may be made.
    """
    if not os.path.isfile(path):
        return None
    frame = bpy.data.images.load(path)
    try:
        frame.colorspace_settings.name, frame.alpha_mode = image.colorspace_settings.name, image.alpha_mode
        return read_image(frame, key)
    finally:
        bpy.data.images.remove(frame)


def read_image(image, key: Hashable) -> Image | None:
    """Read the pixels of a bpy image, or None where it has none. The file is loaded if it was not yet."""
    width, height = image.size
    if not (image.has_data and width and height and image.channels):
        return None
    warnings = []
    if image.source == "TILED":
        warnings.append(f"Image '{image.name}': only the first UDIM tile is shown")
    if image.source == "MOVIE":
        warnings.append(f"Image '{image.name}': of a movie only the frame that Blender has loaded is shown")
    raw = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(raw)
    raw = raw.reshape(height, width, image.channels)
    to_linear, straighten = _to_linear(image, warnings.append), _straightener(image)

    def linear(pixels: Array) -> Array:
        return straighten(to_linear(_rgba(pixels)))

    step = -(-max(width, height) // MAX_SIZE)
    if step == 1:
        return Image(key, image.name, linear(raw), tuple(warnings))
    warnings.append(f"Image '{image.name}': {width}×{height} is averaged down {step} times to fit {MAX_SIZE} pixels")
    return Image(key, image.name, _averaged(raw, step, linear), tuple(warnings))


def _to_linear(image, warn: Callable[[str], None]) -> Callable[[Array], Array]:
    """The function from stored (H, W, 4) pixels to scene-linear ones, for this image's colour space."""
    name = image.colorspace_settings.name
    # Blender converts float files while it loads them; data and scene_linear are used as they are.
    if image.is_float or image.colorspace_settings.is_data or name in {"scene_linear", ""}:
        return lambda pixels: pixels
    if name == "sRGB":
        matrix = _matrix_of("from_rec709_linear_to_scene_linear")
        return lambda pixels: _apply(matrix, _decode_srgb(pixels))
    method = LINEAR_SPACES.get(name)
    if method and hasattr(Color, method):
        matrix = _matrix_of(method)
        return lambda pixels: _apply(matrix, pixels)
    warn(f"Image '{image.name}': colour space '{name}' is read as sRGB")
    return _decode_srgb


def image_key(image, path: str = "") -> Hashable:
    """The key of a bpy image's pixels, found without reading them (but where they were painted on).

    ``path`` is the file of a sequence's frame.
    """
    state = (
        image.session_uid,
        image.filepath,
        image.source,
        image.colorspace_settings.name,
        image.alpha_mode,
        path,
        _file_time(image, path),
    )
    if image.source == "GENERATED" and not image.is_dirty:
        size = (image.generated_width, image.generated_height)
        return (*state, size, image.use_generated_float, image.generated_type, tuple(image.generated_color))
    if image.is_dirty and image.has_data:
        return (*state, _pixel_hash(image))
    return state


def _file_time(image, path: str) -> int:
    """When the file behind an image was written: a reload after an edit elsewhere is seen by it. 0 without a file."""
    if image.packed_file or not image.filepath:
        return 0
    path = path or bpy.path.abspath(image.filepath, library=image.library)
    return os.stat(path).st_mtime_ns if os.path.isfile(path) else 0


def _pixel_hash(image) -> bytes:
    width, height = image.size
    raw = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(raw)
    return hashlib.blake2b(raw.data, digest_size=16).digest()


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
    out[..., 3] = 1.0
    return out


def _black_where_clear(pixels: Array) -> Array:
    clear = pixels[..., 3] == 0.0
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


def _decode_srgb(pixels: Array) -> Array:
    """IEC 61966-2-1 on the colour channels; a byte image has only 256 values, so a table is exact and fast."""
    values = np.arange(256, dtype=np.float64) / 255.0
    table = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4).astype(np.float32)
    out = pixels.copy()
    out[..., :3] = table[np.rint(np.clip(pixels[..., :3], 0.0, 1.0) * 255.0).astype(np.uint8)]
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
