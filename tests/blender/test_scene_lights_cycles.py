"""Every light against Cycles: the direct radiance of a white plane, by the formulas and as Rebound renders it."""

import math

import bpy
import numpy as np
import pytest

from rebound.benchmarks.pictures import diffuse, read_passes
from rebound.scene.convert import convert_scene
from rebound.tests.support import engine_build
from rebound.tests.support.blender_build import link, mesh, shader_material
from rebound.tests.support.light_reference import irradiance

pytestmark = pytest.mark.slow

SIZE = 48  # pixels of the square picture
CELL = 6  # pixels of the cells that are compared: averages out Cycles' noise
EXTENT = 4.0  # metres of the plane that are seen
SAMPLES = 256

POINT, SUN = {"type": "POINT"}, {"type": "SUN", "energy": 3}
SPOT = {"type": "SPOT", "shadow_soft_size": 0.0, "spot_size": math.radians(70), "spot_blend": 0.5}
SQUARE, DISK = {"type": "AREA", "shape": "SQUARE"}, {"type": "AREA", "shape": "DISK"}
RECTANGLE, ELLIPSE = {"type": "AREA", "shape": "RECTANGLE"}, {"type": "AREA", "shape": "ELLIPSE"}

CASES = {
    "point": POINT | {"shadow_soft_size": 0.0},
    "point_soft_falloff": POINT | {"shadow_soft_size": 0.5, "use_soft_falloff": True},
    "point_sphere": POINT | {"shadow_soft_size": 0.5, "use_soft_falloff": False},
    "point_scaled": POINT | {"shadow_soft_size": 0.3, "scale": (2, 3, 0.5)},
    "point_absolute": POINT | {"shadow_soft_size": 0.3, "normalize": False, "energy": 30},
    "point_absolute_no_size": POINT | {"shadow_soft_size": 0.0, "normalize": False, "energy": 30},
    "point_exposure": POINT | {"shadow_soft_size": 0.0, "exposure": 1.5, "color": (1, 0.5, 0.25)},
    "point_temperature": POINT | {"shadow_soft_size": 0.0, "use_temperature": True, "temperature": 3000},
    "point_nodes": POINT | {"shadow_soft_size": 0.0, "nodes": (2.5, (1, 0.5, 0.25, 1))},
    "point_no_diffuse": POINT | {"shadow_soft_size": 0.0, "visible_diffuse": False},
    "spot_hard": SPOT | {"spot_blend": 0.0},
    "spot_blend": SPOT | {"spot_blend": 0.7},
    "spot_wide": SPOT | {"spot_size": math.radians(150), "spot_blend": 1.0},
    "spot_soft_falloff": SPOT | {"shadow_soft_size": 0.4, "use_soft_falloff": True},
    "spot_sphere": SPOT | {"shadow_soft_size": 0.4, "use_soft_falloff": False},
    "spot_scaled": SPOT | {"shadow_soft_size": 0.1, "spot_blend": 1.0, "scale": (2, 0.7, 1.3)},
    "spot_scaled_sphere": SPOT | {"shadow_soft_size": 0.3, "use_soft_falloff": False, "scale": (2, 0.7, 1.3)},
    "spot_tilted": SPOT | {"rotation": (0.6, 0.2, 0)},
    "sun": SUN | {"angle": 0.0, "rotation": (0.7, 0, 0)},
    "sun_wide": SUN | {"angle": math.radians(60), "rotation": (0.5, 0.3, 0)},
    "sun_low": SUN | {"angle": math.radians(90), "rotation": (1.3, 0.0, 0)},
    "sun_scaled": SUN | {"angle": math.radians(30), "rotation": (0.5, 0, 0), "scale": (2, 1, 3)},
    "sun_absolute": SUN | {"angle": math.radians(60), "normalize": False},
    "area_square": SQUARE | {"size": 0.8},
    "area_rectangle": RECTANGLE | {"size": 0.4, "size_y": 1.6, "rotation": (0.3, 0.5, 0.7)},
    "area_disk": DISK | {"size": 1.2, "rotation": (0.3, 0, 0)},
    "area_ellipse": ELLIPSE | {"size": 0.5, "size_y": 2.0, "rotation": (0, 0.4, 0.3)},
    "area_scaled": RECTANGLE | {"size": 0.4, "size_y": 0.8, "scale": (2, 0.5, 3)},
    "area_mirrored": RECTANGLE | {"size": 0.4, "size_y": 1.6, "scale": (-1, 1, 1), "rotation": (0.3, 0, 0.7)},
    "area_disk_scaled": DISK | {"size": 0.8, "scale": (2, 0.5, 1)},
    "area_half_below": RECTANGLE | {"size_y": 2.0, "rotation": (math.pi / 2, 0, 0), "location": (0.2, -2.5, 0.4)},
    "area_spread": SQUARE | {"size": 0.8, "spread": math.radians(90)},
    "area_spread_disk": DISK | {"size": 1.5, "spread": math.radians(40)},
    "area_absolute": RECTANGLE | {"size": 0.5, "size_y": 1.5, "normalize": False, "energy": 20, "scale": (1, 2, 1)},
    "area_absolute_disk": DISK | {"size": 0.5, "normalize": False, "energy": 20, "scale": (1, 2, 1)},
}
PLACE = {"location": (0.3, -0.2, 1.5), "rotation": (0, 0, 0), "scale": (1, 1, 1), "visible_diffuse": True}


def build(case):
    """A white plane, one light and a camera that looks straight down."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    plane = mesh("Plane")
    plane.materials.append(shader_material("White", "ShaderNodeBsdfDiffuse", Color=(1, 1, 1, 1))[0])
    link("Plane", plane, scale=(5, 5, 1))
    settings = {"energy": 100} | case
    place = {name: settings.pop(name, default) for name, default in PLACE.items()}
    place["rotation_euler"] = place.pop("rotation")
    light = bpy.data.lights.new("Light", settings.pop("type"))
    nodes = settings.pop("nodes", None)
    for name, value in settings.items():
        setattr(light, name, value)
    if nodes:
        emission = emission_node(light)
        emission.inputs["Strength"].default_value, emission.inputs["Color"].default_value = nodes
    link("Light", light, visible_camera=False, **place)
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", EXTENT
    scene.camera = link("Camera", camera, location=(0, 0, 20))
    return scene


def emission_node(light):
    if bpy.app.version < (5, 2, 0):
        light.use_nodes = True
    return light.node_tree.nodes["Emission"]


def render_cycles(scene, path):
    """(SIZE, SIZE, 3) radiance of one direct bounce, row 0 at the bottom."""
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = SIZE
    cycles.device, cycles.samples, cycles.use_denoising = "CPU", SAMPLES, False
    cycles.use_adaptive_sampling, cycles.max_bounces = False, 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.pixel_filter_type = "BOX"
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    render.filepath, render.use_file_extension = str(path), False
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.empty(SIZE * SIZE * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(SIZE, SIZE, -1)[..., :3].astype(np.float64)


def expected(light):
    """The reference at 2×2 points a pixel, in the shape of the picture."""
    line = ((np.arange(2 * SIZE) + 0.5) / (2 * SIZE) - 0.5) * EXTENT
    x, y = np.meshgrid(line, line)
    points = np.stack((x, y, np.zeros_like(x)), axis=-1).reshape(-1, 3)
    values = irradiance(light, points, np.broadcast_to((0.0, 0.0, 1.0), points.shape), samples=400) / np.pi
    return values.reshape(SIZE, 2, SIZE, 2, 3).mean(axis=(1, 3))


def cells(picture):
    count = SIZE // CELL
    return picture.reshape(count, CELL, count, CELL, 3).mean(axis=(1, 3))


@pytest.mark.parametrize("name", CASES)
def test_light_matches_cycles(name, tmp_path):
    scene = build(CASES[name])
    lights = convert_scene(bpy.context.evaluated_depsgraph_get(), for_viewport=False).lights
    cycles = cells(render_cycles(scene, tmp_path / "cycles.exr"))
    if not cycles.any():
        assert all(light.diffuse_factor == 0.0 for light in lights)
        return
    ours = cells(expected(lights[0]))
    error = np.abs(ours - cycles)
    # Measured: 0.0013 over the picture and 0.004 of the brightest cell, 0.007 where a hard cone's edge crosses it.
    assert ours.sum() == pytest.approx(cycles.sum(), rel=0.005)
    assert error.max() <= 0.01 * cycles.max()


# One light of every kind and shape; the spot's cone ends inside the picture.
RENDERED = ("point", "spot_blend", "sun", "area_square", "area_rectangle", "area_disk", "area_ellipse")
REBOUND_SAMPLES = 64


def render_rebound(scene, path):
    """(SIZE, SIZE, 3) radiance of direct diffuse light, row 0 at the bottom."""
    scene.render.engine = "REBOUND"
    scene.rebound.method, scene.rebound.samples = "NONE", REBOUND_SAMPLES
    layer = scene.view_layers[0]
    layer.use_pass_diffuse_direct = layer.use_pass_diffuse_color = True
    engine_build.render(scene, path)
    return diffuse(read_passes(path), "Direct")[::-1].astype(np.float64)


@pytest.mark.parametrize("name", RENDERED)
def test_rendered_light_matches_cycles(registered, name, tmp_path):
    scene = build(CASES[name])
    cycles = cells(render_cycles(scene, tmp_path / "cycles.exr"))
    ours = cells(render_rebound(scene, tmp_path / "rebound.exr"))
    total, error = ours.sum() / cycles.sum(), np.abs(ours - cycles).max() / cycles.max()
    lit = cycles > 0.1 * cycles.max()
    relative = (np.abs(ours - cycles)[lit] / cycles[lit]).max()
    print(f"\n{name}: sum {total:.4f}, largest error {error:.4f} of the brightest cell,"  # noqa: T201  for pytest -s
          f" {relative:.4f} of its own cell where that is lit")  # fmt: skip
    assert total == pytest.approx(1.0, abs=0.01)
    assert error <= 0.02 and relative <= 0.02
