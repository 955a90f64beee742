"""What a user can get wrong: a clear line and the rest of the picture, or an error, no picture and a failure status."""

import hashlib
import math
import os
import subprocess
import sys

import bpy
import numpy as np
import pytest

from rebound.tests.support.blender_build import link, material, mesh, shader_material
from rebound.tests.support.engine_build import picture, rebound_scene, render

__all__ = ["rebound_scene"]

NAN, INF = math.nan, math.inf


def assert_fails(scene, path, message):
    """The render raises ``message`` in one line and leaves no file."""
    with pytest.raises(RuntimeError, match=message) as caught:
        render(scene, path)
    lines = [line for line in str(caught.value).splitlines() if line]
    assert len(lines) == 1, lines
    assert not path.exists()


def warning_lines(capfd):
    """Everything Blender printed: it prints an engine's reports in background."""
    out, err = capfd.readouterr()
    return out + err


def test_no_camera_is_an_error(rebound_scene, tmp_path):
    rebound_scene.camera = None
    assert_fails(rebound_scene, tmp_path / "a.exr", "no camera")


def test_camera_that_is_no_camera_is_an_error(rebound_scene, tmp_path):
    rebound_scene.camera = bpy.data.objects["Box"]
    assert_fails(rebound_scene, tmp_path / "a.exr", "camera")


def test_stereo_is_an_error(rebound_scene, tmp_path):
    rebound_scene.render.use_multiview = True
    assert_fails(rebound_scene, tmp_path / "a.exr", "Stereo and multi-view are not rendered yet")


@pytest.mark.parametrize("scale", [(0, 0, 0), (1, 0, 1)])
def test_flat_camera_is_an_error(rebound_scene, tmp_path, scale):
    rebound_scene.camera.scale = scale
    assert_fails(rebound_scene, tmp_path / "a.exr", "Camera 'Camera' has a zero scale")


@pytest.mark.parametrize("value", [NAN, INF])
def test_camera_at_no_place_is_an_error(rebound_scene, tmp_path, value):
    rebound_scene.camera.matrix_world[0][3] = value
    rebound_scene.camera.location.x = value
    assert_fails(rebound_scene, tmp_path / "a.exr", "Camera 'Camera' .* not .* finite")


def test_no_light_warns(rebound_scene, tmp_path, capfd):
    bpy.data.objects.remove(bpy.data.objects["Spot"])
    rebound_scene.world = None
    image = picture(render(rebound_scene, tmp_path / "a.exr"))
    assert not image[..., :3].any()
    assert "The scene has no light" in warning_lines(capfd)


def test_emission_is_shown_and_is_a_light(rebound_scene, tmp_path, capfd):
    bpy.data.objects.remove(bpy.data.objects["Spot"])
    rebound_scene.world = None
    glow, _ = shader_material("Glow", "ShaderNodeEmission", Color=(0, 1, 0, 1), Strength=3.0)
    bpy.data.objects["Box"].data.materials.append(glow)
    image = picture(render(rebound_scene, tmp_path / "a.exr"))
    assert image[..., 1].max() == pytest.approx(3.0, rel=1e-3)
    assert ((image[..., 1] > 0.0) & (image[..., 1] < 2.0)).sum() > 50, "the floor beside the box is lit"
    assert "The scene has no light" not in warning_lines(capfd)


def test_empty_scene_warns_and_shows_the_background(rebound_scene, tmp_path, capfd):
    for name in ("Floor", "Box", "Spot"):
        bpy.data.objects.remove(bpy.data.objects[name])
    image = picture(render(rebound_scene, tmp_path / "a.exr"))
    assert np.ptp(image[..., :3]) == 0.0 and image[..., 3].min() == 1.0
    assert "nothing to draw" in warning_lines(capfd)


def test_scene_without_world_renders(rebound_scene, tmp_path):
    rebound_scene.world = None
    assert picture(render(rebound_scene, tmp_path / "a.exr")).max() > 0.1


BAD_MESHES = {
    "zero area": ([(0, 0, 2), (1, 0, 2), (2, 0, 2), (3, 0, 2)], [(0, 1, 2, 3)]),
    "one point": ([(0, 0, 2)] * 3, [(0, 1, 2)]),
    "nan": ([(NAN, 0, 2), (1, 0, 2), (0, 1, 2)], [(0, 1, 2)]),
    "infinite": ([(INF, 0, 2), (1, 0, 2), (0, -INF, 2)], [(0, 1, 2)]),
    "huge": ([(-3e38, 0, 2), (3e38, 0, 2), (0, 3e38, 2)], [(0, 1, 2)]),
    "no faces": ([(0, 0, 2), (1, 0, 2)], []),
}


@pytest.mark.parametrize("kind", BAD_MESHES)
def test_bad_mesh_leaves_the_rest_of_the_picture(rebound_scene, tmp_path, kind):
    good = picture(render(rebound_scene, tmp_path / "good.exr"))
    link("Bad", mesh("Bad", BAD_MESHES[kind]))
    image = picture(render(rebound_scene, tmp_path / "bad.exr"))
    assert np.isfinite(image).all()
    if kind != "huge":  # a triangle across the world is no mistake: it is there, and may shade all the rest
        np.testing.assert_allclose(image, good, atol=1e-5)


@pytest.mark.parametrize("value", [NAN, INF, -INF])
@pytest.mark.parametrize("name", ["Box", "Spot"])
def test_transform_that_is_not_finite_is_named_and_left_out(rebound_scene, tmp_path, capfd, name, value):
    bpy.data.objects[name].location.x = value
    assert np.isfinite(picture(render(rebound_scene, tmp_path / "a.exr"))).all()
    assert f"Object '{name}': its transform is not finite" in warning_lines(capfd)


@pytest.mark.parametrize("name", ["Box", "Spot"])
def test_zero_scale_is_harmless(rebound_scene, tmp_path, name):
    bpy.data.objects[name].scale = (0, 0, 0)
    assert np.isfinite(picture(render(rebound_scene, tmp_path / "a.exr"))).all()


@pytest.mark.parametrize("energy", [0.0, -5.0, 1e30, 3e38, NAN, INF])
def test_odd_light_power_is_harmless(rebound_scene, tmp_path, energy):
    bpy.data.lights["Spot"].energy = energy
    assert not np.isnan(picture(render(rebound_scene, tmp_path / "a.exr"))).any()


@pytest.mark.parametrize("value", [NAN, INF])
@pytest.mark.parametrize("name", ["shadow_soft_size", "spot_size", "spot_blend", "diffuse_factor", "exposure"])
def test_odd_light_settings_are_harmless(rebound_scene, tmp_path, name, value):
    setattr(bpy.data.lights["Spot"], name, value)
    assert not np.isnan(picture(render(rebound_scene, tmp_path / "a.exr"))).any()


def test_missing_image_is_named(rebound_scene, tmp_path, capfd):
    surface = material("Textured")
    node = surface.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("Gone", 4, 4)
    node.image.source, node.image.filepath = "FILE", str(tmp_path / "gone.png")
    shader = surface.node_tree.nodes["Principled BSDF"]
    surface.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    bpy.data.objects["Box"].data.materials.append(surface)
    image = picture(render(rebound_scene, tmp_path / "a.exr"))
    assert np.isfinite(image).all() and image.max() > 0.1
    assert "Gone" in warning_lines(capfd)


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (16384, 16)])
def test_odd_sizes_render(rebound_scene, tmp_path, size):
    if 16384 in size:
        rebound_scene.rebound.method = "NONE"  # about the size of the textures, not about time
    # Blender takes no fewer than 4 pixels a side, of any percentage.
    rebound_scene.render.resolution_x, rebound_scene.render.resolution_y = size[0] * 4, size[1] * 4
    rebound_scene.render.resolution_percentage = 25
    image = picture(render(rebound_scene, tmp_path / "a.exr"))
    assert image.shape == (size[1], size[0], 4)
    assert image.max() > 0.01


def test_too_large_a_picture_is_an_error(rebound_scene, tmp_path):
    rebound_scene.render.resolution_x, rebound_scene.render.resolution_y = 65536, 4
    assert_fails(rebound_scene, tmp_path / "a.exr", "65536 x 4 pixels is not possible")


def test_render_changes_no_data(rebound_scene, tmp_path):
    blend = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), check_existing=False)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    before, names = hashlib.sha256(blend.read_bytes()).hexdigest(), data_names()
    dirty = bpy.data.is_dirty  # before 5.2 already so when a file was just opened
    assert bpy.ops.render.render() == {"FINISHED"}
    assert bpy.data.is_dirty == dirty
    assert data_names() == names
    assert hashlib.sha256(blend.read_bytes()).hexdigest() == before


def data_names():
    kinds = ("objects", "meshes", "materials", "images", "lights", "cameras", "node_groups", "texts", "collections")
    # Blender itself adds the image "Render Result".
    return {kind: sorted(d.name for d in getattr(bpy.data, kind) if d.name != "Render Result") for kind in kinds}


def run_python(code, **environment):
    """A process with Blender in it; Python's own shutdown runs, unlike Blender's."""
    return subprocess.run(
        [sys.executable, "-c", code], env=os.environ | environment, capture_output=True, text=True, timeout=120
    )


RENDER_IN_PROCESS = """
import os, sys, bpy
import rebound
from rebound import exit_status
from rebound.tests.support.blender_build import CUBE
from rebound.tests.support.engine_build import fill_scene
bpy.ops.wm.read_factory_settings(use_empty=True)
rebound.register()
fill_scene(bpy.context.scene)
{change}
bpy.context.scene.render.filepath = {path!r}
try:
    bpy.ops.render.render(write_still=True)
except RuntimeError as error:
    print("RAISED", error)
sys.stdout.flush()
import atexit
atexit._run_exitfuncs()  # what Python does at its end, without Blender's own, which can take minutes
os._exit(0)
"""

# Where Blender runs the command line's renders, no Python frame lies below the handler.
AS_COMMAND_LINE = "exit_status._driven_by_python = lambda handler: False"


@pytest.mark.parametrize(("driver", "status"), [("", 0), (AS_COMMAND_LINE, 1)])
def test_failed_render_gives_the_command_line_a_failure_status(tmp_path, driver, status):
    change = f"bpy.context.scene.camera = None; {driver}"
    done = run_python(RENDER_IN_PROCESS.format(change=change, path=str(tmp_path / "a.png")))
    assert "no camera" in done.stdout
    assert done.returncode == status, done.stdout + done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="hides the driver as Mesa's loader on Linux allows")
@pytest.mark.parametrize(
    "hidden",
    [
        {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent.json"},
        {"LIBGL_DRIVERS_PATH": "/nonexistent"},
        {"MESA_GL_VERSION_OVERRIDE": "3.0"},
    ],
    ids=["no EGL vendor", "no driver", "OpenGL 3.0"],
)
def test_no_gpu_is_an_error_and_no_crash(tmp_path, hidden, gpu_backend):
    if gpu_backend != "OPENGL":
        pytest.skip("hides OpenGL")
    done = run_python(RENDER_IN_PROCESS.format(change="", path=str(tmp_path / "a.png")), **hidden)
    assert "RAISED Error: Rebound: No usable GPU" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 0
    assert not list(tmp_path.iterdir())
