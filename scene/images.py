"""Blender images of a scene -> Image, each read once: files, sequences, UDIM tiles, painted and generated ones."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Hashable, Mapping
from dataclasses import replace
from pathlib import Path

import bpy
import gpu
import numpy as np

from .data import Image
from .pixels import OnMainThread, read_image, reduced

MAX_SHEET = 8192  # pixels along a side of a square that all tiles of an image could fill; more are averaged down


class ImageReader:
    """Reads each image of a scene once; ``images`` holds what was read, or reused from the previous scene."""

    def __init__(self, previous: Mapping[Hashable, Image], warn: Callable[[str], None], on_main_thread: OnMainThread):
        self.images: dict[Hashable, Image] = {}
        self._on_main_thread = on_main_thread
        self._previous = previous
        self._warn = warn
        self._done: dict[tuple[int, str, int], Hashable | None] = {}

    def read(self, image, user=None) -> Hashable | None:
        """Return the key of a bpy image's pixels, or None (and one warning) where there are no pixels.

        ``user`` is the ImageUser of the node that shows it; it knows the frame of an image sequence or movie.
        """
        original = image.original or image
        path, frame = frame_of(original, user)
        visit = (original.session_uid, path, frame)
        if visit not in self._done:
            self._done[visit] = self._read(original, path, frame)
        return self._done[visit]

    def keep(self, key: Hashable, make: Callable[[], Image]) -> Hashable:
        """Have an image that no data-block holds: the previous scene's, or a new one."""
        if key not in self.images:
            self.images[key] = self._previous.get(key) or make()
        return key

    def _read(self, image, path: str, frame: int) -> Hashable | None:
        key = image_key(image, path, frame)
        found = self._previous.get(key) or self._read_pixels(image, key, path, frame)
        if found is None:
            name = path or image.filepath
            reason = f"the file '{name}' is missing or cannot be read" if name else "it has no pixels"
            self._warn(f"Image '{image.name}': {reason}; magenta is shown instead")
            return None
        for line in found.warnings:
            self._warn(line)
        self.images[key] = found
        return key

    def _read_pixels(self, image, key: Hashable, path: str, frame: int) -> Image | None:
        if image.source == "TILED":
            return self._on_main_thread(lambda: _read_tiles(image, key))
        if not path:
            return read_image(image, key, self._on_main_thread)
        return self._on_main_thread(lambda: _read_file(path, image, key, frame))


def frame_of(image, user) -> tuple[str, int]:
    """The file of an image sequence's current frame, or a movie and its frame; "" for any other image."""
    if user is None or image.source not in {"SEQUENCE", "MOVIE"}:
        return "", 0
    if image.source == "MOVIE":
        return bpy.path.abspath(image.filepath, library=image.library), user.frame_current
    return bpy.path.abspath(image.filepath_from_user(image_user=user), library=image.library), 0


def _read_file(path: str, image, key: Hashable, frame: int = 0) -> Image | None:
    """Read a frame or a tile through a temporary data-block: Image.pixels itself knows neither.

    Of a movie it knows the frame that was sent to the GPU last.

    Only on the main thread, where data-blocks may be made.
    """
    if not os.path.isfile(path):
        return None
    loaded = bpy.data.images.load(path)
    try:
        if image.colorspace_settings.name:  # none until it was loaded itself: then that of its kind of file
            loaded.colorspace_settings.name = image.colorspace_settings.name
        loaded.alpha_mode = image.alpha_mode
        if loaded.source == "MOVIE" and _has_gpu():
            loaded.gl_load(frame=frame)
        return read_image(loaded, key, lambda call: call())
    finally:
        bpy.data.images.remove(loaded)


def _has_gpu() -> bool:
    """Without one, Blender ends when an image is to be sent to it."""
    try:
        return gpu.platform.backend_type_get() not in {"NONE", "UNKNOWN"}
    except SystemError:
        return False


def _read_tiles(image, key: Hashable) -> Image | None:
    """All UDIM tiles of an image, side by side; None where there is not one. Only on the main thread."""
    numbers = sorted(tile.number for tile in image.tiles)
    with tempfile.TemporaryDirectory(prefix="rebound-tiles-") as folder:
        pattern = _tile_pattern(image)
        if image.is_dirty or image.packed_files or not pattern:  # no files that hold what is seen
            pattern = str(Path(folder) / f"tile.<UDIM>.{'exr' if image.is_float else 'png'}")
            image.save(filepath=pattern, save_copy=True)
        parts = {number: _read_file(tile_path(pattern, number), image, key) for number in numbers}
    missing = [str(number) for number, part in parts.items() if part is None]
    lines = [f"Image '{image.name}': tile {', '.join(missing)} is missing; magenta is shown instead"] if missing else []
    found = {number: part for number, part in parts.items() if part is not None}
    if not found:
        return None
    lines += dict.fromkeys(line for part in found.values() for line in part.warnings)
    return replace(_side_by_side(found), name=image.name, warnings=tuple(lines))


def _tile_pattern(image) -> str:
    """The path of an image's tiles, "" where it has none."""
    return bpy.path.abspath(image.filepath, library=image.library) if image.filepath else ""


def tile_path(pattern: str, number: int) -> str:
    """The file of a tile by its UDIM number: Blender knows two ways to write it."""
    across, up = (number - 1001) % 10, (number - 1001) // 10
    return pattern.replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{across + 1}_v{up + 1}")


def _side_by_side(parts: Mapping[int, Image]) -> Image:
    """One image with all tiles in rows, the highest first."""
    area = sum(part.pixels.shape[0] * part.pixels.shape[1] for part in parts.values())
    step = int(np.ceil(np.sqrt(area) / MAX_SHEET))
    alike = len({(part.pixels.dtype, part.is_srgb) for part in parts.values()}) == 1
    parts = {number: reduced(part, step) for number, part in parts.items()}
    stored = {number: part.pixels if alike else part.linear() for number, part in parts.items()}
    widest = max(pixels.shape[1] for pixels in stored.values())
    wide = max(widest, int(np.ceil(np.sqrt(sum(p.shape[0] * p.shape[1] for p in stored.values())))))
    places, x, y, high = {}, 0, 0, 0
    for number in sorted(stored, key=lambda number: -stored[number].shape[0]):
        height, width = stored[number].shape[:2]
        if x + width > wide:
            x, y, high = 0, y + high, 0
        places[number] = (x, y, width, height)
        x, high = x + width, max(high, height)
    sheet = np.zeros((y + high, max(x + w for x, _, w, _ in places.values()), 4), next(iter(stored.values())).dtype)
    for number, (x, y, width, height) in places.items():
        sheet[y : y + height, x : x + width] = stored[number]
    first = next(iter(parts.values()))
    tiles = tuple((number, *places[number]) for number in sorted(places))
    return replace(first, pixels=sheet, is_srgb=first.is_srgb and alike, tiles=tiles)


def image_key(image, path: str = "", frame: int = 0) -> Hashable:
    """The key of a bpy image's pixels, found without reading them (but where they were painted on).

    ``path`` is the file of a sequence's frame, or of a movie, of which it is ``frame``.
    """
    state = (
        image.session_uid,
        image.filepath,
        image.source,
        image.colorspace_settings.name,
        image.alpha_mode,
        path,
        frame,
        _file_time(image, path),
    )
    if image.source == "TILED":
        pattern, numbers = _tile_pattern(image), [tile.number for tile in image.tiles]
        state = (*state, *((number, _written(tile_path(pattern, number))) for number in numbers))
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
    return _written(path or bpy.path.abspath(image.filepath, library=image.library))


def _written(path: str) -> int:
    return os.stat(path).st_mtime_ns if os.path.isfile(path) else 0


def _pixel_hash(image) -> bytes:
    width, height = image.size
    raw = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(raw)
    return hashlib.blake2b(raw.data, digest_size=16).digest()
