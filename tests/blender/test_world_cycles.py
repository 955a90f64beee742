"""Scenes in the light of panoramas and skies beside Cycles: a plane, a white ball and one of metal."""

import math
from pathlib import Path

import bpy
import pytest

from rebound.benchmarks.pictures import read_passes
from rebound.benchmarks.score import energy, relative_squared_error
from rebound.tests.support.blender_build import link, material
from rebound.tests.support.engine_build import render

WIDTH, HEIGHT, SAMPLES = 128, 72, 64
# Errors of the energy. A ball's rim mirrors the horizon, and loses rays that start below its flat triangles.
LARGEST = {"Diffuse Direct": 0.03, "Glossy Direct": 0.08}
PANORAMAS = Path(bpy.utils.resource_path("LOCAL")) / "datafiles" / "studiolights" / "world"


def ball(name, made, location):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, location=location)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(made)


@pytest.fixture
def lit(registered):
    """A scene without a lamp; gives its world's nodes and the Background among them."""
    white, metal = material("White", (0.8, 0.8, 0.8)), material("Metal", (0.9, 0.9, 0.9))
    for made, metallic in ((white, 0.0), (metal, 1.0)):
        shader = made.node_tree.nodes["Principled BSDF"]
        shader.inputs["Metallic"].default_value, shader.inputs["Roughness"].default_value = metallic, 0.35
        shader.inputs["Specular IOR Level"].default_value = 0.0
    bpy.ops.mesh.primitive_plane_add(size=8)
    bpy.context.object.data.materials.append(white)
    ball("Dull", white, (-1.2, 0, 1))
    ball("Bright", metal, (1.2, 0, 1))
    scene = registered
    scene.camera = link("Camera", bpy.data.cameras.new("Camera"), location=(0, -7, 2.6), rotation_euler=(1.33, 0, 0))
    scene.camera.data.lens = 35
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    scene.render.use_compositing = scene.render.use_sequencer = False
    layer = scene.view_layers[0]
    for kind in ("diffuse", "glossy"):
        for part in ("direct", "indirect", "color"):
            setattr(layer, f"use_pass_{kind}_{part}", True)
    layer.use_pass_environment = True
    world = scene.world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    return world.node_tree, world.node_tree.nodes["Background"]


def both(tmp_path):
    """Passes of Cycles and of Rebound."""
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", SAMPLES
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.sample_clamp_indirect = scene.cycles.blur_glossy = 0
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = 4
    render(scene, tmp_path / "cycles.exr")
    scene.render.engine, scene.rebound.samples = "REBOUND", 16
    scene.rebound.vpl_scale = "FULL"  # of so small a picture every fourth pixel is too few
    render(scene, tmp_path / "rebound.exr")
    return (read_passes(tmp_path / f"{name}.exr") for name in ("cycles", "rebound"))


def score(what, truth, test, name):
    """Print and return energy and relative squared error of a pass."""
    figures = energy(truth[name], test[name]), relative_squared_error(truth[name], test[name])
    print(f"\n{what}, {name}: energy {figures[0]:.4f}, relmse {figures[1]:.4f}")  # noqa: T201  pytest -s shows them
    return figures


def panorama(nodes, background, name, turn=0.0):
    texture, mapping = nodes.nodes.new("ShaderNodeTexEnvironment"), nodes.nodes.new("ShaderNodeMapping")
    place = nodes.nodes.new("ShaderNodeTexCoord")
    texture.image = bpy.data.images.load(str(PANORAMAS / name))
    mapping.inputs["Rotation"].default_value = (0, 0, turn)
    for out, into in ((place.outputs["Generated"], mapping.inputs["Vector"]), (mapping.outputs[0], texture.inputs[0]),
                      (texture.outputs[0], background.inputs["Color"])):  # fmt: skip
        nodes.links.new(out, into)


@pytest.mark.parametrize("name, turn, strength", [("sunset.exr", 0.0, 1.0), ("courtyard.exr", 2.0, 0.5)])
def test_a_panorama_lights_as_in_cycles(lit, tmp_path, name, turn, strength):
    nodes, background = lit
    panorama(nodes, background, name, turn)
    background.inputs["Strength"].default_value = strength
    truth, test = both(tmp_path)
    for part, largest in LARGEST.items():
        level, error = score(name, truth, test, part)
        assert abs(level - 1) < largest and error < 0.03
    level, error = score(name, truth, test, "Environment")
    assert abs(level - 1) < 0.01 and error < 0.01


def test_a_sky_and_its_sun_light_as_in_cycles(lit, tmp_path):
    nodes, background = lit
    sky = nodes.nodes.new("ShaderNodeTexSky")
    sky.sun_elevation, sky.sun_rotation = math.radians(35), math.radians(30)
    nodes.links.new(sky.outputs[0], background.inputs["Color"])
    background.inputs["Strength"].default_value = 0.1
    truth, test = both(tmp_path)
    for part, largest in LARGEST.items():
        level, error = score(sky.sky_type, truth, test, part)
        assert abs(level - 1) < largest and error < 0.03


def test_rays_that_do_not_see_the_world(lit, tmp_path):
    """The camera's background is black, mirrors are black, and the plane is lit."""
    _, background = lit
    world = bpy.context.scene.world
    if not hasattr(world, "cycles_visibility"):
        pytest.skip("Cycles is not there")
    background.inputs["Color"].default_value = (0.5, 0.5, 0.5, 1.0)
    world.cycles_visibility.camera = world.cycles_visibility.glossy = False
    truth, test = both(tmp_path)
    assert test["Environment"].max() == truth["Environment"].max() == 0.0
    assert test["Glossy Direct"].max() == truth["Glossy Direct"].max() == 0.0
    level, error = score("visibility", truth, test, "Diffuse Direct")
    assert abs(level - 1) < 0.03 and error < 0.02
