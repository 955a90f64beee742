"""Direct specular light of every kind of light, against the lobe's formula integrated over the emitter in numpy."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rebound.scene.data import Material
from rebound.settings import Settings
from rebound.tests.support.bxdf_reference import albedo, compensation, specular
from rebound.tests.support.render_scenes import Studio, light, ortho, perspective, quad, scene

SIZE, EXTENT = 8, 1.6
EYE = np.array([0.6, -0.8, 1.2])
PLANE = [quad("plane", u=(4, 0, 0), v=(0, 4, 0))]
F0 = (0.9, 0.5, 0.1)
ABOVE = {"position": (-0.5, 0.6, 1.1), "target": (0.0, 0.0, 0.0)}
LIGHTS = {
    "point": dict(kind="POINT", **ABOVE),
    "point_disc": dict(kind="POINT", radius=0.3, **ABOVE),
    "point_sphere": dict(kind="POINT", radius=0.3, soft_falloff=False, **ABOVE),
    "spot": dict(kind="SPOT", radius=0.2, spot_angle=math.radians(120), **ABOVE),
    "sun": dict(kind="SUN", power=3.0, angle=math.radians(30), **ABOVE),
    "area": dict(kind="AREA", area_shape="RECTANGLE", area_size=(0.3, 0.9), **ABOVE),
    "area_disk": dict(kind="AREA", area_shape="DISK", area_size=(0.8, 0.8), **ABOVE),
}


@pytest.fixture(scope="module")
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


def metal(roughness):
    return (Material("Metal", F0, metallic=1.0, roughness=roughness),)


def emitter_points(lamp, points, count=4096):
    """(n, count, 3) unit directions to points of the emitter, and (n, count) what each gives a unit cosine: W/m²."""
    rng = np.random.default_rng(5)
    u = rng.random((count, 2))
    disc = np.sqrt(u[:, :1]) * np.stack((np.cos(2 * np.pi * u[:, 1]), np.sin(2 * np.pi * u[:, 1])), 1)
    axes, center = lamp.world_from_light[:3, :3], lamp.world_from_light[:3, 3]
    power = lamp.power[0]
    kind = lamp.kind.name
    if kind == "SUN":
        low = math.cos(0.5 * lamp.angle)
        cosine, angle = 1 - u[:, 0] * (1 - low), 2 * np.pi * u[:, 1]
        sine = np.sqrt(1 - cosine**2)
        d = np.stack((sine * np.cos(angle), sine * np.sin(angle), cosine), 1) @ axes.T
        # Its mean over the cone gives a surface that faces it the whole power.
        return np.broadcast_to(d, (len(points), count, 3)), np.full((len(points), count), power * 2 / (1 + low))
    if kind == "AREA":
        place = 0.5 * (disc if lamp.area_shape.name == "DISK" else 2 * u - 1) * lamp.area_size
        to = center + place @ axes[:, :2].T - points[:, None]
        squared = (to**2).sum(-1)
        d = to / np.sqrt(squared)[..., None]
        return d, power / np.pi * np.maximum(d @ axes[:, 2], 0) / squared
    to = center - points
    distance = np.linalg.norm(to, axis=1)
    axis = to / distance[:, None]
    side = np.cross(axis, (0.0, 0.0, 1.0))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(axis, side)
    aside = lamp.radius * (disc[:, :1] * side[:, None] + disc[:, 1:] * other[:, None])
    if lamp.soft_falloff or not lamp.radius:
        to = axis[:, None] * distance[:, None, None] + aside
        squared = (to**2).sum(-1)
        d = to / np.sqrt(squared)[..., None]
        return d, power / (4 * np.pi) * np.einsum("nk,nck->nc", axis, d) / squared
    sine = aside / distance[:, None, None]
    cosine = np.sqrt(1 - (sine**2).sum(-1))
    return axis[:, None] * cosine[..., None] + sine, power / (4 * np.pi) / distance[:, None] ** 2 / cosine


def expected_radiance(lamp, points, eye_directions, roughness):
    d, strength = emitter_points(lamp, points)
    n, count = strength.shape
    v = np.repeat(eye_directions, count, 0)
    flat = d.reshape(-1, 3)
    f = specular(v, np.where(flat[:, 2:] > 1e-6, flat, (0, 0, 1)), np.array(F0), np.full(len(v), roughness))
    light_of = strength.reshape(-1) * np.maximum(flat[:, 2], 0)
    mean = (f * light_of[:, None]).reshape(n, count, 3).mean(1)
    return mean * compensation(eye_directions[:, 2], np.array(F0), np.full(n, roughness))


@pytest.mark.parametrize("mode", ["SAMPLED", "FILTERED"])
@pytest.mark.parametrize("name", LIGHTS)
def test_plane_mirrors_what_the_lobe_says(studio, name, mode):
    lamp, view = light(**LIGHTS[name]), ortho(SIZE, SIZE, EXTENT, EYE, (0, 0, 0))
    shown = scene(PLANE, [lamp], materials=metal(0.5), filter_width=1e-3)
    passes = ["glossy_direct", "glossy_color", "position", "diffuse_color"]
    found = studio.render(shown, view, 128, passes, method="NONE", soft_shadows=mode)
    points = found["position"].reshape(-1, 3)
    toward = np.broadcast_to(EYE / np.linalg.norm(EYE), points.shape)
    expected = expected_radiance(lamp, points, toward, 0.5).reshape(SIZE, SIZE, 3)
    radiance = found["glossy_direct"] * found["glossy_color"]
    assert not found["diffuse_color"].any()
    # Both have the noise of their emitter points; in the first samples the lobe is wider on purpose.
    assert radiance.sum() == pytest.approx(expected.sum(), rel=0.03)
    np.testing.assert_allclose(radiance, expected, rtol=0.12, atol=0.02 * expected.max())


def test_colour_pass_is_the_albedo_and_the_layer_takes_it_from_the_diffuse_part(studio):
    layer = Material("Plastic", (0.8, 0.4, 0.2), specular=(0.04, 0.04, 0.04), roughness=0.3)
    view = ortho(4, 4, 1.0, (1.5, 0, 0.6), (0, 0, 0))
    found = studio.render(scene(PLANE, [], materials=[layer]), view, 1, ["glossy_color", "diffuse_color"])
    cosine = 0.6 / math.hypot(1.5, 0.6)
    expected = albedo(cosine, np.full(3, 0.04), 0.3)
    np.testing.assert_allclose(found["glossy_color"][0, 0], expected, atol=0.008)
    np.testing.assert_allclose(found["diffuse_color"][0, 0], np.array([0.8, 0.4, 0.2]) * (1 - expected), atol=0.008)


def test_specular_factor_scales_the_mirrored_light_alone(studio):
    lamp, view = light("POINT", (0.3, 0, 1)), ortho(4, 4, 1.0)
    both = [replace(lamp, specular_factor=0.25), replace(lamp, diffuse_factor=0.0)]
    half = (Material("Half", F0, metallic=0.5, roughness=0.6),)
    passes = ["glossy_direct", "diffuse_direct"]
    whole, quarter, mirrored = (
        studio.render(scene(PLANE, [shown], materials=half), view, 1, passes) for shown in (lamp, *both)
    )
    np.testing.assert_allclose(quarter["glossy_direct"], 0.25 * whole["glossy_direct"], rtol=1e-5)
    np.testing.assert_array_equal(quarter["diffuse_direct"], whole["diffuse_direct"])
    np.testing.assert_allclose(mirrored["glossy_direct"], whole["glossy_direct"], rtol=1e-5)
    assert not mirrored["diffuse_direct"].any()


def test_smooth_metal_under_a_point_light_stays_finite(studio):
    view = perspective(33, 33, 40, (0, -2, 2), (0, 0, 0))
    shown = scene(PLANE, [light("POINT", (0, 2, 2), power=1e4)], materials=metal(0.0))
    found = studio.render(shown, view, 4, ["combined"], method="NONE")["combined"]
    assert np.isfinite(found).all() and found[..., 0].max() > 0


def test_scene_that_loses_its_lobe_loses_its_mirrored_light(studio):
    view, lamps = ortho(4, 4, 1.0), [light("POINT")]
    studio.show(scene(PLANE, lamps, materials=metal(0.5)))
    frame = studio.renderer.begin(view)
    try:
        for shown in (metal(0.5), (Material("Grey", (0.5, 0.5, 0.5)),)):
            studio.show(scene(PLANE, lamps, materials=shown))
            studio.renderer.restart(frame)
            for _ in studio.renderer.sample(frame, studio.gpu_scene, view, Settings.defaults(method="NONE")):
                pass
        assert not studio.renderer.read(frame, "glossy_direct").any()
        assert not studio.device.read(frame.light.glossy_direct.colors[0]).any()
    finally:
        studio.renderer.free_frame(frame)
