"""The bounce of lights and objects, from Blender's properties to the picture: instances, drivers, what is read anew."""

import bpy
import numpy as np
import pytest

from rebound.benchmarks.pictures import read_passes
from rebound.scene.changes import Changes
from rebound.scene.data import Visibility
from rebound.tests.support.blender_build import CUBE, collection, convert, link, mesh
from rebound.tests.support.engine_build import rebound_scene, render

__all__ = ["rebound_scene"]

METHODS = {"VPL": {"method": "VPL"}, "RSM": {"method": "RSM", "rsm_estimator": "ALL_TEXELS"}}


def the_light():
    (found,) = [light for light in convert().lights if light.name == "Spot"]
    return found


def flags():
    """Whether each instance receives indirect light, by its key."""
    return [Visibility.NO_INDIRECT not in instance.visibility for instance in convert().instances]


def test_light_without_changes_bounces_physically(rebound_scene):
    assert (the_light().bounce, the_light().map_scale) == (1.0, 1.0)


def test_light_settings_are_read(rebound_scene):
    own = bpy.data.lights["Spot"].rebound
    own.bounce_strength, own.map_size = 2.5, "HALF"
    assert (the_light().bounce, the_light().map_scale) == (2.5, 0.5)
    own.use_bounce = False
    assert the_light().bounce == 0.0


def test_every_map_size_is_a_power_of_two(rebound_scene):
    own = bpy.data.lights["Spot"].rebound
    found = []
    for item in own.bl_rna.properties["map_size"].enum_items:
        own.map_size = item.identifier
        found.append(the_light().map_scale)
    assert found == [0.125, 0.25, 0.5, 1.0, 2.0, 4.0]


def test_lights_of_a_collection_have_it_in_every_instance(rebound_scene):
    lamp = bpy.data.lights.new("Lamp", "POINT")
    lamp.rebound.bounce_strength = 3.0
    made = collection("Lamps", lamp)
    for x in (0, 2):
        link(f"Empty {x}", None, location=(x, 0, 3), instance_type="COLLECTION", instance_collection=made)
    assert [light.bounce for light in convert().lights if light.name == "Lamp"] == [3.0, 3.0]


def test_object_receives_by_its_own_setting(rebound_scene):
    assert flags() == [True, True]
    bpy.data.objects["Box"].rebound.receive_bounce = False
    assert sorted(flags()) == [False, True]


def test_instances_need_their_instancers_leave(rebound_scene):
    made = collection("Things", mesh("Thing", CUBE))
    first, second = (
        link(f"Empty {x}", None, location=(x, 0, 3), instance_type="COLLECTION", instance_collection=made)
        for x in (0, 2)
    )
    assert flags().count(False) == 0
    first.rebound.receive_bounce = False
    assert flags().count(False) == 1
    made.objects[0].rebound.receive_bounce = False
    assert flags().count(False) == 2
    first.rebound.receive_bounce = second.rebound.receive_bounce = True
    assert flags().count(False) == 2


def test_animation_and_drivers_reach_the_scene(rebound_scene):
    own, box = bpy.data.lights["Spot"].rebound, bpy.data.objects["Box"]
    own.driver_add("bounce_strength").driver.expression = "frame"
    for frame, received in ((1, True), (5, False)):
        box.rebound.receive_bounce = received
        box.rebound.keyframe_insert("receive_bounce", frame=frame)
    rebound_scene.frame_set(5)
    assert the_light().bounce == 5.0 and flags().count(False) == 1
    rebound_scene.frame_set(1)
    assert the_light().bounce == 1.0 and flags().count(False) == 0


def test_strength_of_a_light_reads_no_mesh_anew(rebound_scene):
    before = convert()
    bpy.data.lights["Spot"].rebound.bounce_strength = 2.0
    after = convert(previous=before)
    changes = Changes.between(before, after)
    assert len(changes.lights) == 1
    assert not (changes.geometry or changes.materials or changes.images or len(changes.moved_bounds))


def test_file_without_rebound_is_read_as_new(clean_scene):
    """The converters do not need the extension to be enabled."""
    link("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    link("Thing", mesh("Thing", CUBE))
    scene = convert()
    assert scene.lights[0].bounce == 1.0 and Visibility.NO_INDIRECT not in scene.instances[0].visibility


def indirect(scene, path, **settings):
    """(h, w, 3) Diffuse Indirect, and which object each pixel shows by its colour: red is the floor."""
    layer = scene.view_layers[0]
    layer.use_pass_diffuse_indirect = layer.use_pass_diffuse_color = True
    for name, value in settings.items():
        setattr(scene.rebound, name, value)
    render(scene, path)
    found = read_passes(path)
    return found["Diffuse Indirect"], found["Diffuse Color"][..., 1] > 0.5


@pytest.mark.parametrize("method", METHODS)
def test_controls_reach_the_picture(rebound_scene, tmp_path, method):
    own, box = bpy.data.lights["Spot"].rebound, bpy.data.objects["Box"]
    rebound_scene.world = None  # its light would bounce as well
    plain, white = indirect(rebound_scene, tmp_path / "plain.exr", **METHODS[method])
    assert plain[white].any() and plain[~white].any()
    own.bounce_strength = 2.0
    double, _ = indirect(rebound_scene, tmp_path / "double.exr")
    np.testing.assert_allclose(double, 2 * plain, rtol=1e-3, atol=1e-5)
    own.bounce_strength, box.rebound.receive_bounce = 1.0, False
    apart, _ = indirect(rebound_scene, tmp_path / "apart.exr")
    assert not apart[white].any()
    assert apart[~white].mean() == pytest.approx(plain[~white].mean(), rel=0.1)
    own.use_bounce = False
    none, _ = indirect(rebound_scene, tmp_path / "none.exr")
    assert not none.any()
