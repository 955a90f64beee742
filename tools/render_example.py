"""Render examples/cornell_box.blend with Rebound to out/: `.venv/bin/python tools/render_example.py`.

Writes a PNG and a multi-layer EXR, then reads the EXR back: a black or broken picture is a failure, not a result.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from pathlib import Path

import bpy
import numpy as np
import OpenEXR

import rebound

ROOT = Path(__file__).resolve().parent.parent
BLEND = ROOT / "examples" / "cornell_box.blend"
OUT = ROOT / "out"


class ProgressLine(logging.Handler):
    """The engine's log as one line that rewrites itself; into a file or pipe, a line every few seconds."""

    SECONDS_BETWEEN_LINES = 5.0

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self._last = time.monotonic()

    def emit(self, record: logging.LogRecord) -> None:
        """Show one message; warnings and errors keep a line of their own."""
        now = time.monotonic()
        text = f"render: {record.getMessage()}"
        if record.levelno >= logging.WARNING:
            print(f"\r\033[K{text}" if sys.stdout.isatty() else text, flush=True)
        elif sys.stdout.isatty():
            print(f"\r\033[K{text}", end="", flush=True)
        elif now - self._last >= self.SECONDS_BETWEEN_LINES:
            self._last = now
            print(text, flush=True)


def follow_engine() -> None:
    """Show the engine's log through the progress line, in place of the lines it would write itself."""
    logger = logging.getLogger("rebound")
    logger.setLevel(logging.INFO)
    logger.propagate = False
    logger.handlers = [ProgressLine()]


def render() -> float:
    """Render the example; seconds it took."""
    bpy.ops.wm.open_mainfile(filepath=str(BLEND))
    bpy.context.scene.render.engine = "REBOUND"
    start = time.monotonic()
    bpy.ops.render.render()
    return time.monotonic() - start


def save(name: str, file_format: str) -> Path:
    """Save the render result; `file_format` as Blender's image settings name it."""
    scene = bpy.context.scene
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # 5.0 and newer; must be set first
        settings.media_type = "MULTI_LAYER_IMAGE" if file_format == "OPEN_EXR_MULTILAYER" else "IMAGE"
    settings.file_format = file_format
    path = OUT / name
    bpy.data.images["Render Result"].save_render(str(path), scene=scene)
    return path


def fault(exr: Path) -> str:
    """What is wrong with the picture in the file; empty when it is a picture."""
    if not exr.exists():
        return "no file was written"
    with OpenEXR.File(str(exr), separate_channels=True) as file:
        combined = [c.pixels for name, c in file.channels().items() if "Combined" in name and name[-1] in "RGB"]
    if not combined:
        return "the file has no Combined pass"
    if not all(np.isfinite(pixels).all() for pixels in combined):
        return "some pixels are not finite"
    return "" if max(float(pixels.max()) for pixels in combined) > 0.0 else "every pixel is black"


def main() -> int:
    """Render, save, check, say so."""
    OUT.mkdir(exist_ok=True)
    exr, png = OUT / "cornell_box.exr", OUT / "cornell_box.png"
    exr.unlink(missing_ok=True)
    png.unlink(missing_ok=True)
    rebound.register()
    follow_engine()
    print(f"render: {BLEND.relative_to(ROOT)}, Blender {bpy.app.version_string}", flush=True)
    try:
        seconds = render()
        save(png.name, "PNG")
        save(exr.name, "OPEN_EXR_MULTILAYER")
    except RuntimeError as error:  # what Blender's operators raise
        print(f"\nrender: failed: {error}", flush=True)
        return 1
    found = fault(exr)
    if found:
        print(f"\nrender: failed: {found}", flush=True)
        return 1
    import gpu  # noqa: PLC0415  exists only once bpy has started a GPU

    print(f"\nrender: {png.relative_to(ROOT)} and {exr.relative_to(ROOT)}")
    print(f"render: {gpu.platform.renderer_get()} ({gpu.platform.backend_type_get()}), {seconds:.1f} s", flush=True)
    return 0


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    os._exit(status)  # bpy can take minutes to leave
