"""Those of the node cases that show images."""

from __future__ import annotations

import itertools
import tempfile
from pathlib import Path

import bpy
import numpy as np

from .node_sheet import NodeCase


def _image(alpha=False):
    def setup(node):
        name = f"Image {alpha}"
        image = bpy.data.images.get(name) or bpy.data.images.new(name, 5, 3, alpha=alpha, float_buffer=not alpha)
        image.colorspace_settings.name = "Non-Color"
        pixels = np.random.default_rng(3).random((15, 4)).astype(np.float32)
        if not alpha:
            pixels[:, 3] = 1.0
        image.pixels.foreach_set(pixels.ravel())
        image.update()
        node.image = image

    return setup


def _saved(name, pixels, size):
    """The path of a PNG file with these numbers (n, 4)."""
    made = bpy.data.images.new(name, *size, alpha=True)
    made.colorspace_settings.name, made.alpha_mode = "Non-Color", "CHANNEL_PACKED"
    made.pixels.foreach_set(pixels.astype(np.float32).ravel())
    made.file_format, made.filepath_raw = "PNG", str(Path(tempfile.mkdtemp(prefix="rebound-cases-")) / f"{name}.png")
    made.save()
    path = made.filepath_raw
    bpy.data.images.remove(made)
    return path


def _file(space, alpha="STRAIGHT"):
    """A byte image in a colour space, of strong contrasts."""

    def setup(node):
        name = f"{space} {alpha}"
        image = bpy.data.images.get(f"{name}.png")
        if image is None:
            pixels = np.random.default_rng(5).random((15, 4))
            pixels[::2, :3] = pixels[::2, :3].round()
            if alpha == "NONE":
                pixels[:, 3] = 1.0
            image = bpy.data.images.load(_saved(name, pixels, (5, 3)))
            image.colorspace_settings.name, image.alpha_mode = space, alpha
        node.image = image

    return setup


def _tiles(node):
    """An image of three tiles of different sizes."""
    image = bpy.data.images.get("Tiles")
    if image is None:
        rng = np.random.default_rng(7)
        folder = Path(tempfile.mkdtemp(prefix="rebound-cases-"))
        for number, size in ((1001, (5, 3)), (1002, (2, 4)), (1011, (3, 3))):
            pixels = rng.random((size[0] * size[1], 4))
            pixels[:, 3] = 1.0
            Path(_saved(str(number), pixels, size)).rename(folder / f"tile.{number}.png")
        image = bpy.data.images.load(str(folder / "tile.1001.png"))
        image.name, image.source, image.filepath = "Tiles", "TILED", str(folder / "tile.<UDIM>.png")
        image.colorspace_settings.name = "sRGB"
        for number in (1002, 1011):
            image.tiles.new(number)
    node.image = image


def image_file_cases():
    """Images as files have them, that the scene's own reader reads."""
    places = {"low": -0.3, "high": 1.3}
    # Others than sRGB and linear ones are converted by way of a file of half floats.
    for space, tolerance in (("sRGB", 1e-5), ("Non-Color", 1e-5), ("Linear Rec.2020", 2e-3), ("Filmic Log", 3e-3)):
        setup = _file(space, "NONE")
        yield NodeCase("ShaderNodeTexImage", "Color", {"Vector": "a"}, setup=setup, tolerance=tolerance, **places)
    # Cycles rounds colours times alpha to bytes.
    for alpha in ("STRAIGHT", "CHANNEL_PACKED", "NONE"):
        for output in ("Color", "Alpha") if alpha != "NONE" else ("Color",):
            setup, tolerance = _file("sRGB", alpha), 6e-3 if alpha == "STRAIGHT" else 1e-5
            yield NodeCase("ShaderNodeTexImage", output, {"Vector": "a"}, setup=setup, tolerance=tolerance, **places)
    for filtering, extension in itertools.product(("Linear", "Closest"), ("REPEAT", "EXTEND", "CLIP")):
        options = {"interpolation": filtering, "extension": extension}
        yield NodeCase("ShaderNodeTexImage", "Color", {"Vector": "a"}, options, setup=_tiles, low=-0.8, high=2.8)
    yield NodeCase(
        "ShaderNodeTexEnvironment", "Color", {"Vector": "a"}, setup=_file("sRGB", "NONE"), low=-1.0, high=1.0
    )


def image_cases():
    range_of_places = {"low": -1.3, "high": 2.3}
    for filtering, extension in itertools.product(
        ("Linear", "Closest", "Cubic"), ("REPEAT", "EXTEND", "CLIP", "MIRROR")
    ):
        yield NodeCase(
            "ShaderNodeTexImage",
            "Color",
            {"Vector": "a"},
            {"interpolation": filtering, "extension": extension},
            setup=_image(),
            **range_of_places,
        )
    for projection in ("BOX", "SPHERE", "TUBE"):
        yield NodeCase("ShaderNodeTexImage", "Color", {"Vector": "a"}, {"projection": projection}, setup=_image())
    for output in ("Color", "Alpha"):
        yield NodeCase("ShaderNodeTexImage", output, {"Vector": "a"}, setup=_image(alpha=True), **range_of_places)
    # One side, two and three of a box, from both ends of its axes.
    for tilt in (
        (0.9, 0.1, 0.3),
        (-0.9, 0.1, 0.3),
        (0.1, 0.9, 0.3),
        (0.1, -0.9, 0.3),
        (0.6, 0.5, 0.2),
        (-0.5, 0.4, 0.45),
    ):
        for blend in (0.0, 0.3, 1.0):
            properties = {"projection": "BOX", "projection_blend": blend}
            yield NodeCase("ShaderNodeTexImage", "Color", {"Vector": "a"}, properties, setup=_image(), tilt=tilt)
    for projection in ("EQUIRECTANGULAR", "MIRROR_BALL"):
        yield NodeCase("ShaderNodeTexEnvironment", "Color", {"Vector": "a"}, {"projection": projection}, setup=_image())
