"""Images arrive scene-linear, whatever they are made of; missing ones are magenta."""

import bpy
import numpy as np
import pytest

from rebound.scene import pixels as pixels_module
from rebound.scene.changes import Changes
from rebound.tests.support.blender_build import convert
from rebound.tests.support.image_build import RAMP, image_of, material_of, painted, pixels_of, textured

pytestmark = pytest.mark.usefixtures("clean_scene")


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
