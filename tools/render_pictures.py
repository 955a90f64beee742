"""Render the pictures of README and docs: `.venv/bin/python tools/render_pictures.py SCENES [NAME ...]`.

SCENES is the folder of the shared test scenes; the example scene of the repository needs none of it. Pictures of other
people's scenes are credited where they are shown.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import bpy
import numpy as np
from PIL import Image

import rebound

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"

# name: (scene file, settings of scene.rebound, size, exposure to add)
PICTURES = {
    "cornell_box": ("", {"samples": 128}, (512, 512), 0.0),
    "cornell_box_direct": ("", {"method": "NONE"}, (512, 512), 0.0),
    "sunlit_room": ("basic/sunlit_room", {"samples": 128}, (480, 480), 1.0),
    "sunlit_room_direct": ("basic/sunlit_room", {"method": "NONE"}, (480, 480), 1.0),
    "many_lights": ("basic/many_lights", {}, (640, 360), 0.0),
    "classroom": ("classroom/classroom", {"samples": 128}, (640, 360), 1.0),
    "kitchen": ("kitchen/kitchen", {}, (640, 360), 0.0),
    "wooden_staircase": ("wooden_staircase/wooden_staircase", {"soft_shadows": "FILTERED"}, (360, 640), 0.0),
}


def render(scenes: Path, name: str) -> None:
    """Render one picture as PNG."""
    path, settings, size, exposure = PICTURES[name]
    blend = scenes / f"{path}.blend" if path else ROOT / "examples" / "cornell_box.blend"
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    scene.render.engine = "REBOUND"
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.view_settings.exposure += exposure
    for key, value in settings.items():
        setattr(scene.rebound, key, value)
    if hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "IMAGE"
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    path = IMAGES / f"{name}.png"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    _strip(path)


def _strip(path: Path) -> None:
    """Blender writes the file's place on this machine into a picture; keep the pixels only."""
    with Image.open(path) as picture:
        pixels = Image.fromarray(np.asarray(picture))
    pixels.save(path, optimize=True)


def main(arguments: list[str]) -> None:
    """Render the named pictures, all of them by default."""
    if not arguments:
        sys.exit(__doc__)
    rebound.register()
    for name in arguments[1:] or PICTURES:
        render(Path(arguments[0]).resolve(), name)


if __name__ == "__main__":
    main(sys.argv[1:])
    sys.stdout.flush()
    os._exit(0)  # Blender's own exit can take minutes
