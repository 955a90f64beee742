"""Images arrive scene-linear, whatever they are made of; missing ones are magenta."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import bpy
import numpy as np
import pytest

from rebound.main_thread import MainThread
from rebound.scene import images
from rebound.scene import pixels as pixels_module
from rebound.scene.changes import Changes
from rebound.scene.convert import convert_scene
from rebound.tests.support.blender_build import convert, link, material, mesh

pytestmark = pytest.mark.usefixtures("clean_scene")


def textured(image, socket="Base Color"):
    """A quad with an image on it; returns the Image Texture node."""
    made = material("Painted", (0.2, 0.3, 0.4))
    tree = made.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs["Color"], tree.nodes["Principled BSDF"].inputs[socket])
    data = mesh()
    data.uv_layers.new(name="UVMap")
    data.materials.append(made)
    link("Quad", data)
    return node


def painted(name="Image", float_buffer=False, size=(2, 2), pixels=None, space=None):
    image = bpy.data.images.new(name, *size, alpha=True, float_buffer=float_buffer)
    if space:
        image.colorspace_settings.name = space
    if pixels is not None:
        image.pixels.foreach_set(np.asarray(pixels, np.float32).ravel())
        image.update()
    return image


def material_of(scene):
    return scene.materials[scene.instances[0].materials[0]]


def pixels_of(scene):
    """Scene-linear pixels of the one image there is."""
    found = image_of(scene).linear()
    assert found.dtype == np.float32 and found.shape[2] == 4
    return found


def image_of(scene):
    return scene.images[material_of(scene).base_color_texture.image]


RAMP = np.array([[[0, 0.2, 0.4, 1], [0.6, 0.8, 1, 0.4]], [[1, 0, 0, 1], [0, 1, 0, 1]]])


def test_byte_srgb_is_decoded():
    textured(painted(pixels=RAMP))
    stored = np.rint(RAMP * 255) / 255
    linear = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)
    expected = np.concatenate((linear[..., :3], stored[..., 3:]), axis=-1)
    scene = convert()
    np.testing.assert_allclose(pixels_of(scene), expected, atol=2e-6)
    assert scene.warnings == ()


def test_byte_data_is_taken_as_it_is():
    textured(painted(pixels=RAMP, space="Non-Color"))
    np.testing.assert_allclose(pixels_of(convert()), RAMP, atol=1e-6)


def test_float_image_is_taken_as_it_is():
    textured(painted(pixels=RAMP * (4, 4, 4, 1), float_buffer=True))
    np.testing.assert_allclose(pixels_of(convert()), RAMP * (4, 4, 4, 1), atol=1e-6)


@pytest.mark.parametrize("float_buffer", [False, True])
@pytest.mark.parametrize(
    ("mode", "space", "is_black"),
    [
        ("STRAIGHT", "sRGB", True),
        ("STRAIGHT", "Non-Color", False),
        ("CHANNEL_PACKED", "sRGB", False),
        ("NONE", "sRGB", False),
    ],
)
def test_color_where_alpha_is_zero_is_black_as_in_cycles(float_buffer, mode, space, is_black):
    pixels = [[[1, 1, 1, 0], [1, 1, 1, 0.5]]]
    image = painted(pixels=pixels, size=(2, 1), float_buffer=float_buffer, space=space)
    image.alpha_mode = mode
    image.pixels.foreach_set(np.array(pixels, np.float32).ravel())
    textured(image)
    np.testing.assert_allclose(pixels_of(convert())[0, :, 0], (0 if is_black else 1, 1), atol=1e-5)


def test_linear_spaces_are_converted():
    textured(painted(pixels=RAMP, space="Linear Rec.709"))
    np.testing.assert_allclose(pixels_of(convert()), np.rint(RAMP * 255) / 255, atol=1e-4)


def test_other_spaces_are_blenders_to_convert(tmp_path):
    """A byte image is read as Blender itself reads a float file of the same numbers."""
    textured(painted(pixels=RAMP, space="Filmic sRGB"))
    scene = convert()
    found, stored = pixels_of(scene), np.rint(RAMP * 255) / 255
    assert scene.warnings == () and len(bpy.data.images) == 1
    np.testing.assert_allclose(found[..., 3], stored[..., 3], atol=1e-6)
    assert (np.diff(found[0, 0, :3]) > 0).all() and not np.allclose(found[..., :3], stored[..., :3], atol=0.05)
    assert found[1, 0, 0] > 5  # what Filmic shows as white is brighter than that


def test_saved_file_and_packed_file_are_read_alike(tmp_path):
    image = painted(pixels=RAMP)
    image.file_format, image.filepath_raw = "PNG", str(tmp_path / "ramp.png")
    image.save()
    loaded = bpy.data.images.load(str(tmp_path / "ramp.png"))
    loaded.pack()
    textured(image)
    first = pixels_of(convert())
    bpy.data.objects["Quad"].data.materials[0].node_tree.nodes["Image Texture"].image = loaded
    np.testing.assert_allclose(pixels_of(convert()), first, atol=1e-6)


def test_premultiplied_exr_is_straightened(tmp_path):
    exr = pytest.importorskip("OpenEXR")
    channels = {name: np.full((2, 2), 0.5 if name == "A" else 0.25, np.float32) for name in "RGBA"}
    header = {"compression": exr.ZIP_COMPRESSION, "type": exr.scanlineimage}
    with exr.File(header, channels) as file:
        file.write(str(tmp_path / "half.exr"))
    loaded = bpy.data.images.load(str(tmp_path / "half.exr"))
    textured(loaded)
    np.testing.assert_allclose(pixels_of(convert())[0, 0], (0.5, 0.5, 0.5, 0.5), atol=1e-4)
    loaded.alpha_mode = "NONE"
    np.testing.assert_allclose(pixels_of(convert())[0, 0], (0.25, 0.25, 0.25, 1), atol=1e-4)


def test_missing_file_is_magenta_and_named():
    image = bpy.data.images.new("Lost", 1, 1)
    image.source, image.filepath = "FILE", "//nowhere/brick.png"
    textured(image)
    scene = convert()
    assert material_of(scene).base_color == (1, 0, 1) and material_of(scene).base_color_texture is None
    assert scene.images == {}
    assert len(scene.warnings) == 1 and "'Lost'" in scene.warnings[0] and "brick.png" in scene.warnings[0]


def test_file_that_is_no_image_is_magenta_and_named(tmp_path):
    (tmp_path / "broken.png").write_bytes(b"not a picture")
    textured(bpy.data.images.load(str(tmp_path / "broken.png")))
    scene = convert()
    assert material_of(scene).base_color == (1, 0, 1) and "broken.png" in scene.warnings[0]


def test_texture_node_without_an_image_is_magenta_with_one_line():
    node = textured(None)
    scene = convert()
    assert material_of(scene).base_color == (1, 0, 1)
    assert len(scene.warnings) == 1 and f"node '{node.name}' has no image" in scene.warnings[0]


def test_emission_texture_is_multiplied_by_the_strength():
    node = textured(painted(pixels=RAMP), socket="Emission Color")
    node.id_data.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 5
    found = material_of(convert())
    pixels = next(iter(convert().images.values())).linear().mean((0, 1))
    np.testing.assert_allclose(found.emission, 5 * pixels[:3] * pixels[3], rtol=1e-5)
    assert found.graph is not None
    assert found.base_color_texture is None


def test_texture_settings_are_read():
    node = textured(painted(pixels=RAMP))
    node.extension, node.interpolation = "EXTEND", "Closest"
    uv = node.id_data.nodes.new("ShaderNodeUVMap")
    uv.uv_map = "Second"
    node.id_data.links.new(uv.outputs[0], node.inputs["Vector"])
    texture = material_of(convert()).base_color_texture
    assert (texture.uv_map, texture.repeat, texture.closest) == ("Second", False, True)


@pytest.mark.parametrize("output", ["UV", "Generated"])
def test_only_an_image_by_a_uv_map_is_the_base_colours_texture(output):
    node = textured(painted(pixels=RAMP))
    coordinates = node.id_data.nodes.new("ShaderNodeTexCoord")
    node.id_data.links.new(coordinates.outputs[output], node.inputs["Vector"])
    scene = convert()
    assert (material_of(scene).base_color_texture is not None) == (output == "UV") and scene.warnings == ()


def test_large_image_is_averaged_down(monkeypatch):
    monkeypatch.setattr(pixels_module, "MAX_SIZE", 4)
    pixels = np.zeros((8, 12, 4))
    pixels[..., 3] = 1
    pixels[:, 6:, 0] = 2
    textured(painted(size=(12, 8), pixels=pixels, float_buffer=True))
    scene = convert()
    found = pixels_of(scene)
    assert found.shape == (2, 4, 4)
    np.testing.assert_allclose(found[..., 0], [[0, 0, 2, 2]] * 2)
    assert len(scene.warnings) == 1 and "'Image'" in scene.warnings[0]
    assert convert(previous=scene).warnings == scene.warnings


def test_averaging_keeps_a_narrow_image():
    raw = np.ones((1, 9, 4), np.float32)
    assert pixels_module._averaged(raw, 3, lambda raw: raw).shape == (1, 3, 4)


def test_unchanged_image_is_the_same_object_and_a_painted_one_is_not():
    image = painted(pixels=RAMP)
    textured(image)
    first = convert()
    second = convert(previous=first)
    assert not Changes.between(first, second).any
    assert image_of(second) is image_of(first)
    image.pixels[0] = 0.5
    image.update()
    changes = Changes.between(second, convert(previous=second))
    assert len(changes.images_added) == len(changes.images_removed) == 1
    assert len(changes.moved_bounds) == 2  # what wears it looks different now


def test_color_space_change_makes_a_new_image():
    image = painted(pixels=RAMP)
    textured(image)
    first = convert()
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(RAMP.astype(np.float32).ravel())
    assert convert(previous=first).images.keys() != first.images.keys()


def test_image_on_two_materials_is_read_once():
    image = painted(pixels=RAMP)
    textured(image)
    textured(image)
    assert len(convert().images) == 1


def tiled(tmp_path, sizes, space="Non-Color", pattern="tile.<UDIM>.png"):
    """An image of files, one for each UDIM number with its size and value."""
    for number, (size, value) in sizes.items():
        tile = painted(str(number), size=size, pixels=np.full((size[1], size[0], 4), value), space="Non-Color")
        tile.file_format, tile.filepath_raw = "PNG", images.tile_path(str(tmp_path / pattern), number)
        tile.save()
        bpy.data.images.remove(tile)
    first = min(sizes)
    image = bpy.data.images.load(images.tile_path(str(tmp_path / pattern), first))
    image.colorspace_settings.name, image.source = space, "TILED"
    image.filepath = str(tmp_path / pattern)
    image.tiles[0].number = first
    for number in sizes.keys() - {first}:
        image.tiles.new(number)
    return image


TILES = {1001: ((4, 2), 0.2), 1002: ((2, 6), 0.4), 1012: ((2, 2), 0.6)}


def at(image, u, v):
    return float(image.nearest(np.array([[u, v]]), repeat=True)[0, 0])


@pytest.mark.parametrize("pattern", ["tile.<UDIM>.png", "tile_<UVTILE>.png"])
def test_tiles_lie_side_by_side(tmp_path, pattern):
    textured(tiled(tmp_path, TILES, pattern=pattern))
    scene = convert()
    found = image_of(scene)
    assert scene.warnings == () and len(bpy.data.images) == 1
    assert {number: (w, h) for number, _, _, w, h in found.tiles} == {n: size for n, (size, _) in TILES.items()}
    for u, v, value in ((0.1, 0.9, 0.2), (1.5, 0.5, 0.4), (1.9, 1.1, 0.6)):
        assert at(found, u, v) == pytest.approx(value, abs=0.01)
    for u, v in ((0.5, 1.5), (2.5, 0.5), (-1.5, 0.5), (10.5, 0.1)):
        np.testing.assert_array_equal(found.nearest(np.array([[u, v]]), repeat=True)[0], (1, 0, 1, 1))


def test_missing_tile_is_named(tmp_path):
    image = tiled(tmp_path, TILES)
    (tmp_path / "tile.1002.png").unlink()
    textured(image)
    scene = convert()
    assert [tile[0] for tile in image_of(scene).tiles] == [1001, 1012]
    assert len(scene.warnings) == 1 and "tile 1002 is missing" in scene.warnings[0]


def test_rewritten_tile_makes_a_new_image(tmp_path):
    textured(tiled(tmp_path, TILES))
    first = convert()
    assert convert(previous=first).images.keys() == first.images.keys()
    (tmp_path / "tile.1012.png").write_bytes((tmp_path / "tile.1001.png").read_bytes())
    second = convert(previous=first)
    assert at(image_of(second), 1.5, 1.5) == pytest.approx(0.2, abs=0.01)


def test_packed_tiles_are_read(tmp_path):
    image = tiled(tmp_path, TILES)
    image.pack()
    for number in TILES:
        (tmp_path / f"tile.{number}.png").unlink()
    textured(image)
    scene = convert()
    assert scene.warnings == () and at(image_of(scene), 1.5, 1.5) == pytest.approx(0.6, abs=0.01)
    assert image.packed_files and image.filepath == str(tmp_path / "tile.<UDIM>.png")


def test_too_many_texels_of_tiles_are_averaged_down(tmp_path, monkeypatch):
    monkeypatch.setattr(images, "MAX_SHEET", 3)
    textured(tiled(tmp_path, {1001: ((4, 4), 0.2), 1002: ((4, 4), 0.8)}))
    found = image_of(convert())
    assert found.pixels.shape[0] * found.pixels.shape[1] <= 16
    assert at(found, 0.5, 0.5) == pytest.approx(0.2, abs=0.01) and at(found, 1.5, 0.5) == pytest.approx(0.8, abs=0.01)


def test_bytes_stay_bytes():
    textured(painted(pixels=RAMP))
    found = image_of(convert())
    assert found.pixels.dtype == np.uint8 and found.is_srgb
    bpy.data.images["Image"].colorspace_settings.name = "Non-Color"
    bpy.data.images["Image"].pixels.foreach_set(RAMP.astype(np.float32).ravel())
    found = image_of(convert())
    assert found.pixels.dtype == np.uint8 and not found.is_srgb


def sequence(tmp_path):
    for frame in (1, 2, 3):
        picture = painted(str(frame), pixels=np.full((2, 2, 4), frame / 4), space="Non-Color")
        picture.file_format, picture.filepath_raw = "PNG", str(tmp_path / f"clip{frame:04}.png")
        picture.save()
        bpy.data.images.remove(picture)
    image = bpy.data.images.load(str(tmp_path / "clip0001.png"))
    image.colorspace_settings.name, image.source = "Non-Color", "SEQUENCE"
    node = textured(image)
    node.image_user.frame_duration, node.image_user.use_auto_refresh = 3, True
    return image


def test_sequence_shows_the_frame_of_the_scene(tmp_path):
    sequence(tmp_path)
    previous = None
    for frame in (1, 2, 3):
        bpy.context.scene.frame_set(frame)
        scene = convert(previous=previous)
        assert pixels_of(scene)[0, 0, 0] == pytest.approx(frame / 4, abs=0.01)
        assert scene.warnings == () and len(bpy.data.images) == 1
        previous = scene


@pytest.mark.slow
def test_movie_shows_the_frame_of_the_scene(tmp_path, clean_scene):
    movie(clean_scene, tmp_path)
    image = bpy.data.images.load(str(next(tmp_path.glob("*.mp4"))))
    node = textured(image)
    node.image_user.frame_duration, node.image_user.use_auto_refresh = 6, True
    reds, previous = [], None
    for frame in (6, 1, 3):
        bpy.context.scene.frame_set(frame)
        scene = convert(previous=previous)
        reds.append(float(pixels_of(scene)[0, 0, 0]))
        assert scene.warnings == () and len(bpy.data.images) <= 2  # with Blender's Render Result
        previous = scene
    assert reds[1] < reds[2] < reds[0]


def movie(scene, folder):
    """A movie of six frames that turns from black to red."""
    render = scene.render
    render.engine, scene.cycles.samples = "CYCLES", 1
    render.resolution_x = render.resolution_y = 64
    scene.frame_start, scene.frame_end = 1, 6
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "VIDEO"
    render.image_settings.file_format, render.ffmpeg.format = "FFMPEG", "MPEG4"
    render.ffmpeg.codec, render.filepath = "H264", str(folder / "movie")
    scene.camera = link("Camera", bpy.data.cameras.new("Camera"))
    scene.world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0, 0):
        scene.world.use_nodes = True
    color = scene.world.node_tree.nodes["Background"].inputs["Color"]
    for frame in (1, 6):
        color.default_value = ((frame - 1) / 5, 0, 0, 1)
        color.keyframe_insert("default_value", frame=frame)
    bpy.ops.render.render(animation=True)


def test_missing_frame_of_a_sequence_is_magenta(tmp_path):
    sequence(tmp_path)
    (tmp_path / "clip0002.png").unlink()
    bpy.context.scene.frame_set(2)
    scene = convert()
    assert material_of(scene).base_color == (1, 0, 1)
    assert len(scene.warnings) == 1 and "clip0002.png" in scene.warnings[0]


def test_frame_of_a_sequence_is_loaded_on_the_main_thread(tmp_path, monkeypatch):
    """F12 in a window converts the scene in a thread of its own, where no data-block may be made."""
    sequence(tmp_path)
    bpy.context.scene.frame_set(2)
    depsgraph, main_thread, loaded_on = bpy.context.evaluated_depsgraph_get(), MainThread(), []
    read_file = images._read_file
    monkeypatch.setattr(
        images, "_read_file", lambda *args: (loaded_on.append(threading.current_thread()), read_file(*args))[1]
    )

    def render_thread():
        return convert_scene(
            depsgraph, for_viewport=False, on_main_thread=lambda call: main_thread.run(call, lambda: False)
        )

    with ThreadPoolExecutor(1) as pool:
        converted = pool.submit(render_thread)
        while not converted.done():
            main_thread.tick()
            time.sleep(0.001)
    scene = converted.result()
    assert loaded_on == [threading.main_thread()]
    assert pixels_of(scene)[0, 0, 0] == pytest.approx(0.5, abs=0.01)
    assert scene.warnings == () and len(bpy.data.images) == 1
