"""Lights are read with their nodes, instances and switches; test_scene_lights_cycles.py checks the units."""

import math

import bpy
import numpy as np
import pytest

from rebound.scene.data import AreaShape, LightKind
from rebound.tests.support.blender_build import convert, link

pytestmark = pytest.mark.usefixtures("clean_scene")


def lamp(kind, nodes=False, **settings):
    data = bpy.data.lights.new("Lamp", kind)
    data.energy = 10
    for name, value in settings.items():
        setattr(data, name, value)
    if nodes and bpy.app.version < (5, 2, 0):
        data.use_nodes = True
    return link("Lamp", data)


def only_light():
    scene = convert()
    assert len(scene.lights) == 1
    return scene.lights[0], scene.warnings


def test_spot_settings_are_read():
    lamp(
        "SPOT",
        shadow_soft_size=0.3,
        spot_size=1.2,
        spot_blend=0.4,
        use_shadow=False,
        color=(1, 0.5, 0),
        diffuse_factor=0.5,
    )
    light, _ = only_light()
    assert light.kind is LightKind.SPOT and light.name == "Lamp"
    assert light.power == pytest.approx((10, 5, 0))
    assert (light.radius, light.spot_angle, light.spot_blend) == pytest.approx((0.3, 1.2, 0.4))
    assert not light.casts_shadow and light.diffuse_factor == 0.5


@pytest.mark.parametrize(
    ("shape", "size"),
    [("SQUARE", (2, 2)), ("RECTANGLE", (2, 3)), ("DISK", (2, 2)), ("ELLIPSE", (2, 3))],
)
def test_area_shapes_are_read(shape, size):
    lamp("AREA", shape=shape, size=2, size_y=3, spread=1)
    light, _ = only_light()
    assert light.area_shape is AreaShape(shape) and light.area_size == size and light.area_spread == pytest.approx(1)


def test_laser_spread_is_widened():
    lamp("AREA", spread=0)
    assert only_light()[0].area_spread == pytest.approx(math.radians(1))


def test_scale_stays_in_the_matrix():
    lamp("AREA", size=2).scale = (2, 3, 4)
    light, _ = only_light()
    assert light.area_size == (2, 2)
    np.testing.assert_allclose(np.linalg.norm(light.world_from_light[:3, :3], axis=0), (2, 3, 4))


def test_exposure_and_temperature_multiply():
    data = lamp("POINT", exposure=2.0, use_temperature=True, temperature=3000).data
    assert only_light()[0].power == pytest.approx([40 * c for c in data.temperature_color])


def test_emission_node_multiplies():
    tree = lamp("POINT", nodes=True).data.node_tree
    emission = tree.nodes["Emission"]
    emission.inputs["Strength"].default_value = 3
    emission.inputs["Color"].default_value = (1, 0.5, 0, 1)
    light, warnings = only_light()
    assert light.power == pytest.approx((30, 15, 0)) and warnings == ()


def test_unread_light_node_is_named():
    tree = lamp("POINT", nodes=True).data.node_tree
    falloff = tree.nodes.new("ShaderNodeLightFalloff")
    tree.links.new(falloff.outputs["Linear"], tree.nodes["Emission"].inputs["Strength"])
    light, warnings = only_light()
    assert any(light.power)
    assert len(warnings) == 1 and "'Lamp'" in warnings[0] and "'Light Falloff'" in warnings[0]


@pytest.mark.parametrize("settings", [{"energy": 0}, {"color": (0, 0, 0)}])
def test_dark_light_is_dropped(settings):
    lamp("POINT", **settings)
    scene = convert()
    assert scene.lights == () and scene.warnings == ()


def test_light_of_zero_area_is_dropped():
    lamp("AREA").scale = (0, 1, 1)
    assert convert().lights == ()


def test_negative_light_is_dropped_and_named():
    lamp("POINT", energy=-5)
    scene = convert()
    assert scene.lights == () and "'Lamp'" in scene.warnings[0]


@pytest.mark.parametrize("value", [math.nan, math.inf])
@pytest.mark.parametrize(
    ("kind", "name", "called"),
    [
        ("POINT", "shadow_soft_size", "radius"),
        ("POINT", "diffuse_factor", "diffuse factor"),
        ("POINT", "specular_factor", "specular factor"),
        ("POINT", "energy", "power"),
        ("POINT", "exposure", "exposure"),
        ("SPOT", "shadow_soft_size", "radius"),
        ("SPOT", "spot_size", "spot size"),
        ("SPOT", "spot_blend", "spot blend"),
        ("SUN", "angle", "angle"),
        ("AREA", "size", "size"),
        ("AREA", "size_y", "size Y"),
        ("AREA", "spread", "spread"),
    ],
)
@pytest.mark.parametrize("normalize", [True, False])
def test_light_with_a_parameter_that_is_not_finite_is_dropped_and_named(kind, name, called, value, normalize):
    data = lamp(kind, normalize=normalize).data
    if kind == "AREA":
        data.shape = "RECTANGLE"
    setattr(data, name, value)
    scene = convert()
    if 0 < getattr(data, name) < 1e18:  # Blender has put it into its own limits
        assert len(scene.lights) == 1 and scene.warnings == ()
    else:
        assert scene.lights == () and len(scene.warnings) == 1
        assert f"'Lamp': its {called} is not finite" in scene.warnings[0]


@pytest.mark.filterwarnings("error")
def test_power_stays_in_single_precision():
    lamp("POINT", energy=3e38, exposure=10.0)
    light, warnings = only_light()
    assert light.power == (np.finfo(np.float32).max,) * 3 and warnings == ()
    assert np.isfinite(np.array(light.power, np.float32)).all()


def test_temperature_that_is_not_a_number_gives_no_such_power():
    lamp("POINT", use_temperature=True, temperature=math.nan)
    assert all(np.isfinite(light.power).all() for light in convert().lights)


def test_ray_visibility_switches_diffuse_light():
    lamp("POINT").visible_diffuse = False
    assert only_light()[0].diffuse_factor == 0


def test_specular_factor_and_its_ray_visibility_are_read():
    shown = lamp("POINT", specular_factor=0.25)
    assert only_light()[0].specular_factor == 0.25
    shown.visible_glossy = False
    light, _ = only_light()
    assert (light.diffuse_factor, light.specular_factor) == (1.0, 0.0)


def test_hidden_light_is_dropped():
    lamp("POINT").hide_viewport = True
    assert convert().lights == ()


def test_portal_is_no_light():
    data = lamp("AREA").data
    data.cycles.is_portal = True
    assert convert().lights == ()


def test_light_with_a_transform_that_is_not_finite_is_left_out():
    lamp("POINT").location.x = math.nan
    scene = convert()
    assert scene.lights == () and "'Lamp'" in scene.warnings[0]
