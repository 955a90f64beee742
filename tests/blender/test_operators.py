"""Save RSM Buffers: what is in the file, what it is called, and what is said when it cannot be written."""

import sys

import bpy
import numpy as np
import OpenEXR
import pytest

from rebound.session import Session, read_settings
from rebound.tests.support.blender_build import link
from rebound.tests.support.engine_build import rebound_scene

__all__ = ["rebound_scene"]


def add_light(name, kind, **settings):
    """A light above the floor."""
    light = bpy.data.lights.new(name, kind)
    for key, value in settings.items():
        setattr(light, key, value)
    return link(name, light, location=(0.5, 0.5, 3))


def save(path):
    assert bpy.ops.rebound.save_rsm_buffers(filepath=str(path)) == {"FINISHED"}


def read(path):
    """Channels by name, row 0 at the bottom."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: c.pixels[::-1].copy() for part in file.parts for name, c in part.channels.items()}


def buffers(scene):
    """The maps as the renderer gives them."""
    session = Session()
    session.sync(bpy.context.evaluated_depsgraph_get(), for_viewport=True)
    found = session.rsm_buffers(read_settings(scene, viewport=False))
    session.free()
    return found


def test_file_holds_the_buffers_exactly(rebound_scene, tmp_path):
    save(tmp_path / "rsm.exr")
    channels = read(tmp_path / "rsm.exr")
    (spot,) = buffers(rebound_scene)
    for layer, letters in (("depth", "Z"), ("position", "XYZ"), ("normal", "XYZ"), ("flux", "RGB")):
        for index, letter in enumerate(letters):
            np.testing.assert_array_equal(channels.pop(f"Spot.{layer}.{letter}"), spot.layers[layer][..., index])
    assert not channels, "nothing else is in the file"


def test_values_are_those_of_the_scene(rebound_scene, tmp_path):
    save(tmp_path / "rsm.exr")
    channels = read(tmp_path / "rsm.exr")
    floor = (channels["Spot.depth.Z"] > 0) & (np.abs(channels["Spot.position.Z"]) < 1e-3)
    assert floor.sum() > 20
    np.testing.assert_allclose(channels["Spot.depth.Z"][floor], 5, atol=0.01)  # metres down to the floor
    np.testing.assert_allclose(channels["Spot.normal.Z"][floor], 1, atol=1e-3)
    red, green = channels["Spot.flux.R"][floor], channels["Spot.flux.G"][floor]
    np.testing.assert_allclose(red, 8 * green, rtol=0.01)  # the floor's colour
    assert red.max() > 0


def test_every_light_and_face_is_in_the_file(rebound_scene, tmp_path):
    add_light("Lamp.001", "POINT", energy=50)
    add_light("Sun", "SUN", energy=1)
    save(tmp_path / "rsm.exr")
    layers = {name.rsplit(".", 1)[0] for name in read(tmp_path / "rsm.exr")}
    assert {"Spot.flux", "Sun.flux"} <= layers
    faces = {name.split(".")[1] for name in layers if name.startswith("Lamp_001.")}
    assert faces == {"+X", "-X", "+Y", "-Y", "+Z", "-Z"}


def test_blender_reads_the_file(rebound_scene, tmp_path):
    save(tmp_path / "rsm.exr")
    image = bpy.data.images.load(str(tmp_path / "rsm.exr"))
    _ = image.size[:]  # Blender reads the file when it is first asked about it
    assert image.type == "MULTILAYER"


def test_extension_is_added(rebound_scene, tmp_path):
    save(tmp_path / "rsm")
    assert (tmp_path / "rsm.exr").exists()


def test_scene_without_light_says_so(rebound_scene, tmp_path):
    bpy.data.objects.remove(bpy.data.objects["Spot"])
    with pytest.raises(RuntimeError, match="No light in the scene"):
        save(tmp_path / "rsm.exr")
    assert not (tmp_path / "rsm.exr").exists()


def test_missing_openexr_says_what_to_do(rebound_scene, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    with pytest.raises(RuntimeError, match="OpenEXR is missing: install Rebound from its zip"):
        save(tmp_path / "rsm.exr")


def test_folder_that_does_not_exist_says_so(rebound_scene, tmp_path):
    with pytest.raises(RuntimeError, match="Cannot write"):
        save(tmp_path / "nowhere" / "rsm.exr")


def test_operator_changes_no_data(rebound_scene, tmp_path):
    before = {name: len(getattr(bpy.data, name)) for name in ("objects", "images", "meshes", "materials")}
    save(tmp_path / "rsm.exr")
    assert {name: len(getattr(bpy.data, name)) for name in before} == before
