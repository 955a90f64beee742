"""A small scene for the tests of the render engine, and a render of it into numpy arrays."""

from __future__ import annotations

import bpy
import numpy as np
import OpenEXR
import pytest

from rebound.tests.support.blender_build import CUBE, QUAD, link, material, mesh

WIDTH, HEIGHT = 48, 32


@pytest.fixture
def rebound_scene(registered):
    """A small lit scene with its camera, set to render with Rebound: one sample, 48 x 32 pixels."""
    fill_scene(registered)
    return registered


def fill_scene(scene) -> None:
    """A red floor, a white box, a spot light, a camera that sees both, a grey world."""
    scene.render.engine = "REBOUND"
    scene.rebound.samples = 1
    scene.rebound.shadow_resolution = 128
    scene.rebound.rsm_resolution = 32
    scene.rebound.vpl_resolution = scene.rebound.viewport_vpl_resolution = 64
    scene.rebound.vpl_voxels = scene.rebound.viewport_vpl_voxels = 64
    scene.rebound.vpl_pool = scene.rebound.viewport_vpl_pool = 512
    scene.rebound.vpl_bounces = scene.rebound.viewport_vpl_bounces = "ONE"
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    floor = link("Floor", mesh("Floor", QUAD), scale=(4, 4, 4))
    floor.data.materials.append(material("Red", (0.8, 0.1, 0.1)))
    link("Box", mesh("Box", CUBE), location=(0, 0, 0.7), scale=(0.7, 0.7, 0.7))
    spot = bpy.data.lights.new("Spot", "SPOT")
    spot.energy, spot.spot_size = 500, 1.4
    link("Spot", spot, location=(1, 0, 5))
    scene.camera = link("Camera", bpy.data.cameras.new("Camera"), location=(0, -6, 4), rotation_euler=(1, 0, 0))
    scene.world = bpy.data.worlds.new("World")


def render(scene, path) -> dict[str, np.ndarray]:
    """Render one frame into a multi-layer EXR; its channels by name, row 0 at the top."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # since 5.0, and to be set first
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth = "32"
    scene.render.filepath = str(path)
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    return channels(path)


def channels(path) -> dict[str, np.ndarray]:
    """The channels of an EXR file by name, row 0 at the top."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels.copy() for part in file.parts for name, channel in part.channels.items()}


def picture(found: dict[str, np.ndarray], layer: str = "ViewLayer") -> np.ndarray:
    """The combined picture of ``render``: (h, w, 4)."""
    return np.stack([found[f"{layer}.Combined.{c}"] for c in "RGBA"], axis=-1)
