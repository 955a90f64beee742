"""Direct light of every kind of light on a plane, against the numpy integrator that was itself compared with Cycles."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rebound.scene.data import LightKind
from rebound.tests.support.light_reference import irradiance
from rebound.tests.support.render_scenes import Studio, light, ortho, pixel_centers, quad, scene

SIZE, EXTENT = 16, 3.0
TILTED = {"position": (0.7, -0.4, 1.6), "target": (0.0, 0.1, 0.0)}
SUN = {"kind": "SUN", "power": 3.0, **TILTED}
DEGREES = math.pi / 180
LIGHTS = {
    "point": dict(kind="POINT"),
    "point_disc": dict(kind="POINT", radius=0.5),
    "point_sphere": dict(kind="POINT", radius=0.5, soft_falloff=False),
    "point_scaled": dict(kind="POINT", radius=0.3, scale=(2, 3, 0.5)),
    "spot_hard": dict(kind="SPOT", spot_angle=60 * DEGREES),
    "spot_blend": dict(kind="SPOT", spot_angle=80 * DEGREES, spot_blend=0.7, **TILTED),
    "spot_disc": dict(kind="SPOT", spot_angle=70 * DEGREES, spot_blend=0.5, radius=0.4),
    "spot_sphere": dict(kind="SPOT", spot_angle=70 * DEGREES, spot_blend=0.5, radius=0.4, soft_falloff=False, **TILTED),
    "spot_scaled": dict(kind="SPOT", spot_angle=60 * DEGREES, spot_blend=1.0, radius=0.1, scale=(2, 0.7, 1.3)),
    "spot_widest": dict(kind="SPOT", spot_angle=160 * DEGREES, spot_blend=0.3),
    "sun": SUN,
    "sun_20": dict(SUN, angle=20 * DEGREES),
    "sun_90_low": dict(SUN, angle=90 * DEGREES, position=(3, 0, 1.0), target=(0, 0, 0)),
    "area_square": dict(kind="AREA", area_size=(0.8, 0.8)),
    "area_rectangle": dict(kind="AREA", area_shape="RECTANGLE", area_size=(0.4, 1.6), **TILTED),
    "area_cut": dict(kind="AREA", area_size=(1.0, 1.0), position=(1.2, 0, 0.1), target=(0, 0, 0.1)),
    "area_disk": dict(kind="AREA", area_shape="DISK", area_size=(1.2, 1.2), **TILTED),
    "area_ellipse": dict(kind="AREA", area_shape="ELLIPSE", area_size=(0.5, 2.0)),
    "area_scaled": dict(kind="AREA", area_shape="ELLIPSE", area_size=(0.4, 0.8), scale=(2, 0.5, 3)),
    "area_spread": dict(kind="AREA", area_size=(0.8, 0.8), spread=90),
    "area_spread_disk": dict(kind="AREA", area_shape="DISK", area_size=(1.5, 1.5), spread=40),
}


def make(fields):
    fields = dict(fields)
    if "spread" in fields:
        fields["area_spread"] = fields.pop("spread") * DEGREES
    return light(**fields)


@pytest.fixture(scope="module")
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


def cells(picture, size=4):
    """Means of size x size pixels."""
    height, width, channels = picture.shape
    return picture.reshape(height // size, size, width // size, size, channels).mean((1, 3))


def plane_picture(studio, lights, mode, samples=64, size=SIZE):
    view = ortho(size, size, EXTENT)
    # The smallest filter puts every sample at its pixel's centre, where the reference is taken.
    picture = scene([quad("plane", u=(3, 0, 0), v=(0, 3, 0))], lights, filter_width=1e-3)
    found = studio.render(picture, view, samples, ["diffuse_direct"], method="NONE", soft_shadows=mode)
    return found["diffuse_direct"], pixel_centers(view).reshape(-1, 3)


@pytest.mark.parametrize("mode", ["SAMPLED", "FILTERED"])
@pytest.mark.parametrize("name", LIGHTS)
def test_plane_is_lit_as_the_reference_says(studio, name, mode):
    lamp = make(LIGHTS[name])
    edges = lamp.kind is LightKind.SPOT or lamp.area_spread < 3.0 or name == "area_cut"
    found, points = plane_picture(studio, [lamp], mode, 128 if edges else 64)
    normals = np.broadcast_to((0.0, 0.0, 1.0), points.shape)
    expected = irradiance(lamp, points, normals, 1024).reshape(found.shape) / math.pi
    # 128 samples leave noise where the edge of a cone or of slats crosses a pixel: there 2.5 % of the brightest, and
    # 1 % of the level, as does a horizon that cuts a wide sun or area; elsewhere 1.5 % of each pixel.
    assert found.sum() == pytest.approx(expected.sum(), rel=0.01)
    if (
        mode == "FILTERED"
    ):  # has an emitter point of its own in every pixel: the noise is the pixels', not the picture's
        found, expected = cells(found), cells(expected)
    np.testing.assert_allclose(found, expected, rtol=0.015, atol=(0.025 if edges else 0.002) * expected.max())


@pytest.mark.parametrize("name", ["area_square", "area_rectangle", "area_cut"])
def test_one_sample_of_a_filtered_rectangle_has_no_noise(studio, name):
    """Its horizon cuts the last: half of it is below the plane."""
    lamp = make(LIGHTS[name])
    found, points = plane_picture(studio, [lamp], "FILTERED", 1)
    normals = np.broadcast_to((0.0, 0.0, 1.0), points.shape)
    expected = irradiance(lamp, points, normals, 10_000).reshape(found.shape) / math.pi
    np.testing.assert_allclose(found, expected, rtol=0.002, atol=0.001 * expected.max())


@pytest.mark.parametrize("mode", ["SAMPLED", "FILTERED"])
@pytest.mark.parametrize("name", ["spot_blend", "area_disk", "sun_20"])
def test_lights_of_a_fraction_of_the_power_add_up_to_one(studio, name, mode):
    one = make(LIGHTS[name])
    count = 20  # more than one pass of lights
    parts = [replace(one, key=f"part {i}", power=tuple(p / count for p in one.power)) for i in range(count)]
    samples = {"SAMPLED": 16, "FILTERED": 4}[mode]
    whole, _ = plane_picture(studio, [one], mode, 16 * samples, 8)
    sum_of_parts, _ = plane_picture(studio, parts, mode, samples, 8)
    # Each part has emitter points of its own, so the noise of both pictures is left: about 0.3 %.
    np.testing.assert_allclose(cells(sum_of_parts), cells(whole), rtol=0.01, atol=0.005 * whole.max())


def test_colour_of_a_light_and_its_diffuse_factor_arrive(studio):
    lamp = light("POINT", power=(10.0, 20.0, 40.0), diffuse_factor=0.5)
    found, points = plane_picture(studio, [lamp], "SAMPLED", 1, 4)
    expected = irradiance(lamp, points, np.broadcast_to((0.0, 0.0, 1.0), points.shape)) / math.pi
    # float32 and a 16 bit reflectance, by which the pass is divided again.
    np.testing.assert_allclose(found.reshape(-1, 3), expected, rtol=2e-4)
