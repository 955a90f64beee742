"""Images of several files: tiles, sequences, movies."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import bpy
import numpy as np
import pytest

from rebound.main_thread import MainThread
from rebound.scene import images
from rebound.scene.convert import convert_scene
from rebound.tests.support.blender_build import convert, link
from rebound.tests.support.image_build import RAMP, image_of, material_of, painted, pixels_of, textured

pytestmark = pytest.mark.usefixtures("clean_scene")


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
