"""Build examples/cornell_box.blend: `.venv-4.5/bin/python examples/build_cornell_box.py` (every version opens 4.5).

Published geometry, reflectances and camera (cornell_box_data.py); in place of the area luminaire a spot light, because
a reflective shadow map sees what a spot light sees. One published millimetre is 0.01 m here: ten times the real box.
"""

from __future__ import annotations

import math
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import bpy
import numpy as np
from cornell_box_data import (
    CAMERA_FILM,
    CAMERA_FOCAL_LENGTH,
    CAMERA_POSITION,
    LUMINAIRE,
    REFLECTANCES,
    SURFACES,
)

METRES = 0.01
FILE = Path(__file__).resolve().parent / "cornell_box.blend"

SPOT_BELOW_CEILING = 50.0  # mm: its radius fits above it, so the ceiling cuts nothing off
SPOT_RADIUS = 40.0  # mm
SPOT_CONE = math.radians(140.0)
SPOT_BLEND = 0.4
SPOT_WATTS = 1200.0  # well exposed under AgX at exposure 0

# CIE standard illuminant D65 at 400, 410 ... 700 nm (CIE 15).
# fmt: off
D65 = (
    82.75, 91.49, 93.43, 86.68, 104.86, 117.01, 117.81, 114.86, 115.92, 108.81, 109.35, 107.80, 104.79, 107.69, 104.41,
    104.05, 100.00, 96.33, 95.79, 88.69, 90.01, 89.60, 87.70, 83.29, 83.70, 80.03, 80.21, 82.28, 78.28, 69.72, 71.61,
)
# fmt: on
LINEAR_SRGB_FROM_XYZ = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]  # IEC 61966-2-1
)


def observer_xyz(nanometres: np.ndarray) -> np.ndarray:
    """CIE 1931 colour matching functions, (3, n): the multi-lobe fit of Wyman, Sloan and Shirley, JCGT 2(2), 2013."""

    def lobe(scale: float, mean: float, below: float, above: float) -> np.ndarray:
        return scale * np.exp(-0.5 * ((nanometres - mean) * np.where(nanometres < mean, below, above)) ** 2)

    x = lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) + lobe(-0.065, 501.1, 0.0490, 0.0382)
    y = lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322)
    z = lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725)
    return np.stack([x, y, z])


def linear_srgb(reflectance: tuple[float, ...]) -> np.ndarray:
    """A measured spectrum as linear sRGB under D65, relative to a perfect white, which so comes out as (1, 1, 1).

    The renderers' usual RGB for this box has the luminaire's yellow mixed in; ours is the surface alone.
    """
    nanometres = np.arange(400.0, 701.0, 4.0)
    light = np.interp(nanometres, np.arange(400.0, 701.0, 10.0), D65)
    weights = LINEAR_SRGB_FROM_XYZ @ (observer_xyz(nanometres) * light)
    return (weights @ np.array(reflectance)) / weights.sum(axis=1)


def blender_point(published: tuple[float, float, float]) -> tuple[float, float, float]:
    """Y up to Z up by a rotation: the camera looks along +Y, and X grows to the right of the picture."""
    x, y, z = published
    return (-x * METRES, z * METRES, y * METRES)


def add_material(name: str) -> bpy.types.Material:
    """A Diffuse BSDF of one published reflectance."""
    rgb = linear_srgb(REFLECTANCES[name])
    print(f"{name}: linear sRGB {rgb.round(4).tolist()}")
    material = bpy.data.materials.new(f"Cornell {name}")
    material.use_nodes = True
    material.diffuse_color = (*rgb, 1.0)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (*rgb, 1.0)
    output = nodes.new("ShaderNodeOutputMaterial")
    output.location.x = 250.0
    links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    return material


def add_surface(name: str, material: bpy.types.Material) -> None:
    """One mesh object with the published faces; each face keeps its own corners, as published."""
    faces = SURFACES[name][1]
    points = [blender_point(corner) for face in faces for corner in face]
    corners = [[4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3] for i in range(len(faces))]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], corners)
    mesh.materials.append(material)
    bpy.context.collection.objects.link(bpy.data.objects.new(name, mesh))


def add_spot() -> None:
    """A soft spot light straight down from the middle of the published luminaire."""
    middle = tuple(float(np.mean(axis)) for axis in zip(*LUMINAIRE, strict=True))
    light = bpy.data.lights.new("Spot", "SPOT")
    light.energy = SPOT_WATTS
    light.spot_size = SPOT_CONE
    light.spot_blend = SPOT_BLEND
    light.shadow_soft_size = SPOT_RADIUS * METRES
    spot = bpy.data.objects.new("Spot", light)
    spot.location = blender_point((middle[0], middle[1] - SPOT_BELOW_CEILING, middle[2]))
    bpy.context.collection.objects.link(spot)


def add_camera() -> None:
    """The published camera."""
    camera = bpy.data.cameras.new("Camera")
    camera.sensor_width = CAMERA_FILM * 1000.0
    camera.lens = CAMERA_FOCAL_LENGTH * 1000.0
    holder = bpy.data.objects.new("Camera", camera)
    holder.location = blender_point(CAMERA_POSITION)
    holder.rotation_euler = (math.pi / 2, 0.0, 0.0)
    bpy.context.collection.objects.link(holder)
    bpy.context.scene.camera = holder


def set_scene() -> None:
    """Picture size, a black world, and what Cycles needs to be a fair comparison."""
    scene = bpy.context.scene
    scene.name = "Cornell box"
    scene.world = bpy.data.worlds.new("Black")
    scene.world.color = (0.0, 0.0, 0.0)
    scene.render.resolution_x = scene.render.resolution_y = 512
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "AgX"
    scene.cycles.samples = 256


def main() -> None:
    """Build and save."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    materials = {name: add_material(name) for name in REFLECTANCES}
    for name, (reflectance, _) in SURFACES.items():
        add_surface(name, materials[reflectance])
    add_spot()
    add_camera()
    set_scene()
    bpy.context.preferences.filepaths.save_version = 0
    bpy.ops.wm.save_as_mainfile(filepath=str(FILE), compress=True)
    print(f"wrote {FILE.name}, {FILE.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # bpy can take minutes to leave
