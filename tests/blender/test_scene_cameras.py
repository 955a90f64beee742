"""The view through a camera puts every point on the pixel where Blender puts it."""

import math
import random

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

from rebound.scene import cameras
from rebound.scene.convert import convert_scene
from rebound.scene.errors import SceneError
from rebound.tests.support.blender_build import link, mesh, shader_material
from rebound.tests.support.probe_engine import probe_engine

pytestmark = pytest.mark.usefixtures("clean_scene")

POINTS = np.random.default_rng(5).uniform(-2, 2, (40, 3))


def camera(**settings):
    data = bpy.data.cameras.new("Camera")
    obj = link("Camera", data, location=(1, -9, 2), rotation_euler=(1.4, 0.1, 0.2))
    bpy.context.scene.camera = obj
    for name, value in settings.items():
        setattr(obj if hasattr(obj, name) and name == "scale" else data, name, value)
    return obj


def resolution(width, height, aspect_x=1.0, aspect_y=1.0, percent=100):
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, percent
    render.pixel_aspect_x, render.pixel_aspect_y = aspect_x, aspect_y
    return render


def render_size(render):
    """Full size of a final render in pixels, without its border."""
    percent = render.resolution_percentage
    return max(render.resolution_x * percent // 100, 1), max(render.resolution_y * percent // 100, 1)


def current_view(border=None):
    depsgraph = bpy.context.evaluated_depsgraph_get()
    width, height = render_size(depsgraph.scene_eval.render)
    return cameras.camera_view(cameras.active_camera(depsgraph), depsgraph, width=width, height=height, border=border)


def pixels_of(view, points=POINTS):
    """Pixel coordinates (0, 0 = lower left corner) of world points."""
    clip = np.c_[points, np.ones(len(points))] @ (view.clip_from_view @ view.view_from_world).T
    return (clip[:, :2] / clip[:, 3:] * 0.5 + 0.5) * (view.width, view.height)


def blenders_pixels():
    """The same by Blender's own function, which knows no pixel aspect."""
    scene = bpy.context.scene
    width, height = render_size(scene.render)
    frame = [world_to_camera_view(scene, scene.camera, Vector(point)) for point in POINTS]
    return np.array([(co.x * width, co.y * height) for co in frame])


@pytest.mark.parametrize("size", [(320, 180), (180, 320), (200, 200)])
@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"lens": 20.0, "shift_x": 0.2, "shift_y": -0.15},
        {"sensor_fit": "VERTICAL", "sensor_height": 20.0},
        {"sensor_fit": "HORIZONTAL", "sensor_width": 50.0, "shift_x": -0.3},
        {"type": "ORTHO", "ortho_scale": 7.0},
        {"type": "ORTHO", "ortho_scale": 5.0, "shift_y": 0.4, "sensor_fit": "VERTICAL"},
        {"scale": (2.0, 0.5, 3.0)},
    ],
    ids=str,
)
def test_points_fall_on_blenders_pixels(settings, size):
    resolution(*size)
    camera(**settings)
    view = current_view()
    assert (view.width, view.height) == size
    assert view.is_perspective == (settings.get("type") != "ORTHO")
    np.testing.assert_allclose(pixels_of(view), blenders_pixels(), atol=0.01)


def test_view_is_rigid_for_a_scaled_camera():
    camera(scale=(2.0, 3.0, 4.0))
    rotation = current_view().view_from_world[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)


def test_pixel_aspect_squeezes_the_narrow_side():
    resolution(200, 100)
    camera()
    square = pixels_of(current_view())
    resolution(200, 100, aspect_x=1.0, aspect_y=2.0)
    tall = pixels_of(current_view())
    # 200×100 pixels, each twice as high as wide: the picture is a square, the sensor fits its width either way.
    np.testing.assert_allclose(tall[:, 0], square[:, 0], atol=0.01)
    np.testing.assert_allclose(tall[:, 1] - 50, (square[:, 1] - 50) / 2, atol=0.01)


def test_border_window_shows_the_same_pixels():
    resolution(320, 180)
    camera()
    full, part = current_view(), current_view(border=(40, 30, 140, 99))
    assert (part.width, part.height) == (100, 69)
    np.testing.assert_allclose(pixels_of(part), pixels_of(full) - (40, 30), atol=1e-6)


def borders():
    generator = random.Random(3)
    for _ in range(40):
        x, y = sorted(generator.sample(range(101), 2)), sorted(generator.sample(range(101), 2))
        yield x[0] / 100, y[0] / 100, x[1] / 100, y[1] / 100
    yield 0.0, 0.0, 1.0, 1.0
    yield 0.3, 0.3, 0.3, 0.8
    yield 0.1, 0.7, 0.10001, 0.9
    for _ in range(40):
        x, y = sorted((generator.random(), generator.random())), sorted((generator.random(), generator.random()))
        yield x[0], y[0], x[1], y[1]


@pytest.mark.parametrize("crop", [False, True])
def test_border_has_the_size_of_blenders_result(crop):
    render = resolution(317, 181)
    camera()
    render.use_border, render.use_crop_to_border = True, crop

    def sizes(engine, depsgraph):
        settings = depsgraph.scene_eval.render
        border = cameras.border_pixels(settings, *render_size(settings))
        result = engine.begin_result(0, 0, engine.resolution_x, engine.resolution_y)
        found = result.resolution_x, result.resolution_y
        engine.end_result(result)
        view = cameras.camera_view(
            cameras.active_camera(depsgraph, engine), depsgraph, engine, width=317, height=181, border=border
        )
        return found, (view.width, view.height)

    with probe_engine(sizes) as measure:
        for sides in borders():
            render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y = sides
            try:
                blenders, ours = measure()
            except RuntimeError as error:
                assert "too small" in str(error)  # Blender refuses a border of no pixels before it asks an engine
                assert cameras.border_pixels(render, 317, 181) is None
                continue
            assert ours == blenders, sides


def test_engine_camera_matrix_gives_the_same_view():
    resolution(64, 32)
    camera(scale=(2.0, 2.0, 2.0))

    def views(engine, depsgraph):
        eye = cameras.active_camera(depsgraph, engine)
        return [cameras.camera_view(eye, depsgraph, e, width=64, height=32) for e in (engine, None)]

    with probe_engine(views) as measure:
        with_engine, without = measure()
    np.testing.assert_allclose(with_engine.view_from_world, without.view_from_world, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("crop", [False, True])
def test_border_agrees_with_cycles(crop, tmp_path):
    """A floor that emits its own position, rendered by Cycles with a border, projects back onto its own pixels."""
    render = resolution(96, 64, aspect_x=1.0, aspect_y=1.5)
    camera(shift_x=0.1, lens=30.0)
    link("Floor", mesh(), scale=(30, 30, 1)).data.materials.append(position_material())
    scene = bpy.context.scene
    render.engine, scene.cycles.samples, scene.cycles.pixel_filter_type = "CYCLES", 1, "BOX"
    scene.cycles.use_denoising = False
    render.use_border, render.use_crop_to_border = True, crop
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.21, 0.83, 0.05, 0.47
    positions = rendered(scene, tmp_path / "position.exr")
    border = cameras.border_pixels(render, 96, 64)
    if not crop:
        positions = positions[border[1] : border[3], border[0] : border[2]]
    view = current_view(border)
    assert positions.shape == (view.height, view.width, 3)
    hit = positions.any(axis=-1)
    assert hit.mean() > 0.5
    middle = np.stack(np.meshgrid(np.arange(view.width) + 0.5, np.arange(view.height) + 0.5), axis=-1)
    error = pixels_of(view, positions[hit] - OFFSET) - middle[hit]
    assert np.abs(error).max() < 0.6  # a sample may lie anywhere within its pixel
    assert np.abs(error.mean(axis=0)).max() < 0.1


OFFSET = 100.0  # light cannot be negative


def position_material():
    made, shader = shader_material("Position", "ShaderNodeEmission")
    nodes, links = made.node_tree.nodes, made.node_tree.links
    geometry, add = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeVectorMath")
    add.inputs[1].default_value = (OFFSET,) * 3
    links.new(geometry.outputs["Position"], add.inputs[0])
    links.new(add.outputs[0], shader.inputs["Color"])
    return made


def rendered(scene, path):
    """(H, W, 3) of a render, row 0 at the bottom, through an EXR."""
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath, scene.render.use_file_extension = str(path), False
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], -1)[..., :3].astype(np.float64)


def test_no_camera_is_an_error_that_names_the_scene():
    bpy.context.scene.name = "Empty room"
    with pytest.raises(SceneError, match="'Empty room' has no camera"):
        cameras.active_camera(bpy.context.evaluated_depsgraph_get())


def test_camera_that_is_no_camera_is_an_error():
    bpy.context.scene.camera = link("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    with pytest.raises(SceneError, match="'Lamp'"):
        cameras.active_camera(bpy.context.evaluated_depsgraph_get())


@pytest.mark.parametrize(
    ("name", "value"), [("location", (math.nan, 0, 0)), ("location", (math.inf, 0, 0)), ("scale", (0, 0, 0))]
)
def test_camera_with_a_broken_transform_is_an_error(name, value):
    setattr(camera(), name, value)
    with pytest.raises(SceneError, match="'Camera'"):
        current_view()


def test_panoramic_camera_is_shown_in_perspective_with_a_warning():
    camera(type="PANO")
    assert current_view().is_perspective
    depsgraph = bpy.context.evaluated_depsgraph_get()
    assert any("'Camera'" in line for line in convert_scene(depsgraph, for_viewport=False).warnings)
    assert not convert_scene(depsgraph, for_viewport=True).warnings


def test_depth_of_field_and_motion_blur_are_named_in_a_final_render():
    camera().data.dof.use_dof = True
    bpy.context.scene.render.use_motion_blur = True
    depsgraph = bpy.context.evaluated_depsgraph_get()
    lines = convert_scene(depsgraph, for_viewport=False).warnings
    assert len(lines) == 2 and "'Camera': depth of field" in lines[0] and "Motion blur" in lines[1]
    assert not convert_scene(depsgraph, for_viewport=True).warnings


class Region:
    width, height = 200, 100


class RegionData:
    """A region that looks at the world through Blender's camera frame, twice as wide as it."""

    view_perspective = "PERSP"
    view_matrix = np.eye(4)
    window_matrix = np.diag((1, 2, 3, 1))


class Space:
    use_local_camera, camera = False, None
    use_render_border = False
    render_border_min_x, render_border_max_x, render_border_min_y, render_border_max_y = 0.25, 0.5, 0.1, 0.9


def test_region_view_takes_the_viewports_matrices():
    class Narrow:
        width, height = 0, 30

    view = cameras.region_view(Narrow, RegionData)
    assert (view.width, view.height) == (1, 30)
    np.testing.assert_array_equal(view.clip_from_view, RegionData.window_matrix)


def test_region_border_is_the_viewports_own_and_off_by_default():
    assert cameras.region_border(Region, RegionData, Space, bpy.context.scene) is None

    class Bordered(Space):
        use_render_border = True

    border = cameras.region_border(Region, RegionData, Bordered, bpy.context.scene)
    assert border == (50, 10, 100, 90)
    whole, part = (pixels_of(cameras.region_view(Region, RegionData, given)) for given in (None, border))
    np.testing.assert_allclose(part, whole - np.array((50, 10)), atol=1e-9)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_region_border_through_a_camera_is_a_part_of_its_frame(kind):
    seen = camera(type=kind, scale=(2, 2, 2), shift_x=0.1, ortho_scale=5.0)
    scene = bpy.context.scene
    resolution(300, 100)
    scene.render.use_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.0, 0.5
    scene.render.border_min_y, scene.render.border_max_y = 0.0, 1.0

    class Through(RegionData):
        """The frame of 3 : 1 fills the region's width, 200 pixels, and two thirds of its height."""

        view_perspective = "CAMERA"
        window_matrix = np.diag((1, 2 / 3, 1, 1)) @ np.array(
            seen.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=300, y=100)
        )

    border = cameras.region_border(Region, Through, Space, scene)
    assert border is not None
    np.testing.assert_allclose(border, (0, 17, 100, 83), atol=1)


def test_region_border_outside_of_the_region_keeps_one_pixel():
    class Outside(Space):
        use_render_border = True
        render_border_min_x, render_border_max_x = 1.0, 1.0

    assert cameras.region_border(Region, RegionData, Outside, bpy.context.scene) == (199, 10, 200, 90)


def test_region_border_through_what_is_no_camera_is_none():
    class Through(RegionData):
        view_perspective = "CAMERA"

    bpy.context.scene.camera = link("Empty", None)
    bpy.context.scene.render.use_border = True
    assert cameras.region_border(Region, Through, Space, bpy.context.scene) is None
