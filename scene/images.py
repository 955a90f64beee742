"""Blender image -> Image: scene-linear float32 pixels with straight alpha."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Mapping

import numpy as np
from mathutils import Color

from .data import Array, Image

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

    def __init__(self, previous: Mapping[Hashable, Image], warn: Callable[[str], None]):
        self.images: dict[Hashable, Image] = {}
        self._previous = previous
        self._warn = warn
        self._done: dict[tuple[int, int], Hashable | None] = {}

    def read(self, image, frame: int = 0) -> Hashable | None:
        """Return the key of a bpy image's pixels, or None (and one warning) where there are no pixels.

        ``frame`` only matters for image sequences and movies.
        """
        original = image.original or image
        visit = (original.session_uid, frame)
        if visit not in self._done:
            self._done[visit] = self._read(original, frame)
        return self._done[visit]

    def _read(self, image, frame: int) -> Hashable | None:
        key = image_key(image, frame)
        if key not in self._previous:
            width, height = image.size  # loads the file
            if not (image.has_data and width and height and image.channels):
                self._warn(f"Image '{image.name}': {_missing(image)}; magenta is shown instead")
                return None
            self.images[key] = Image(key, image.name, self._pixels(image, width, height))
        else:
            self.images[key] = self._previous[key]
        if image.source == "TILED":
            self._warn(f"Image '{image.name}': only the first UDIM tile is shown")
        if image.source in {"SEQUENCE", "MOVIE"}:
            self._warn(f"Image '{image.name}': of an animated image only the frame that Blender has loaded is shown")
        return key

    def _pixels(self, image, width: int, height: int) -> Array:
        raw = np.empty(width * height * image.channels, np.float32)
        image.pixels.foreach_get(raw)
        raw = raw.reshape(height, width, image.channels)
        step = -(-max(width, height) // MAX_SIZE)
        linear = self._to_linear(image)
        if step == 1:
            return linear(_rgba(raw))
        self._warn(f"Image '{image.name}': {width}×{height} is averaged down {step} times to fit {MAX_SIZE} pixels")
        return _averaged(raw, step, linear)

    def _to_linear(self, image) -> Callable[[Array], Array]:
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
        self._warn(f"Image '{image.name}': colour space '{name}' is read as sRGB")
        return _decode_srgb


def image_key(image, frame: int) -> Hashable:
    """The key of a bpy image's pixels, found without reading them (but where they were painted on)."""
    state = (
        image.session_uid,
        image.filepath,
        image.source,
        image.colorspace_settings.name,
        image.alpha_mode,
    )
    if image.source == "GENERATED" and not image.is_dirty:
        size = (image.generated_width, image.generated_height)
        return (*state, size, image.generated_type, tuple(image.generated_color))
    if image.source in {"SEQUENCE", "MOVIE"}:
        return (*state, frame)
    if image.is_dirty and image.has_data:
        return (*state, _pixel_hash(image))
    return state


def _pixel_hash(image) -> bytes:
    width, height = image.size
    raw = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(raw)
    return hashlib.blake2b(raw.data, digest_size=16).digest()


def _missing(image) -> str:
    return f"the file '{image.filepath}' is missing or cannot be read" if image.filepath else "it has no pixels"


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
        strip = linear(_rgba(raw[row * down : (row + 1) * down, : width * across]))
        out[row] = strip.reshape(down, width, across, 4).mean(axis=(0, 2))
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
