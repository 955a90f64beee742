"""The world's map, suns, harmonics and background, against integrals in numpy."""

from dataclasses import replace

import numpy as np
import pytest

from rebound.gpu_shaders.frame.environment_map import harmonics, pyramid, texel_directions, texel_omegas, without_suns
from rebound.scene.data import Material
from rebound.tests.support.panorama_scenes import directions_of, lit_by
from rebound.tests.support.render_scenes import Studio, box, ortho, perspective, quad, sphere
from rebound.tests.support.vpl_scenes import VPL


@pytest.fixture
def studio(headless_device):
    made = Studio(headless_device)
    yield made
    made.free()


def test_solid_angles_of_texels_are_those_of_their_corners():
    d, omega = texel_directions(64), texel_omegas(64)
    assert omega.sum() == pytest.approx(4 * np.pi)
    np.testing.assert_allclose((d * omega[..., None]).sum((0, 1)), 0, atol=1e-9)
    np.testing.assert_allclose(np.einsum("ijk,ijl,ij->kl", d, d, omega), np.eye(3) * 4 * np.pi / 3, atol=2e-3)


def test_harmonics_give_the_irradiance_of_smooth_light():
    d, omega = texel_directions(64), texel_omegas(64)
    light = np.stack([2 + d[..., 0], 1 + d[..., 2] ** 2, 3 - d[..., 1] * d[..., 2]], -1).astype(np.float32)
    factors = harmonics(light)
    normals = np.random.default_rng(3).normal(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    x, y, z = normals.T
    basis = np.stack((np.ones_like(x), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y), 1)
    cosine = np.maximum(np.einsum("nk,ijk->nij", normals, d), 0)
    truth = np.einsum("nij,ijc,ij->nc", cosine, light, omega) / np.pi
    np.testing.assert_allclose(basis @ factors, truth, rtol=4e-3)


def test_every_level_of_the_pyramid_sends_the_same_light():
    light = np.random.default_rng(1).random((32, 32, 3)).astype(np.float32)
    picture = pyramid(light)
    assert picture.shape == (32, 48, 4)
    mean = (light * texel_omegas(32)[..., None]).sum((0, 1)) / (4 * np.pi)
    np.testing.assert_allclose(picture[31 - 1, 32, :3], mean, rtol=1e-5)  # side 1 stands above sides 16, 8, 4 and 2
    level, omega = picture[:16, 32:48, :3], texel_omegas(32).reshape(16, 2, 16, 2).sum((1, 3))
    np.testing.assert_allclose((level * omega[..., None]).sum((0, 1)) / (4 * np.pi), mean, rtol=1e-5)


def sunny(side=128, radius=2.0, sun=4000.0, sky=1.0, at=(0.3, 0.5, 0.8)):
    at = np.asarray(at) / np.linalg.norm(at)
    inside = texel_directions(side) @ at > np.cos(np.radians(radius))
    return np.where(inside[..., None], np.float32([sun, 0.9 * sun, 0.7 * sun]), np.float32(sky)).astype(np.float32), at


def test_a_sun_and_what_is_left_give_the_light_of_the_whole():
    light, at = sunny(512)
    left, suns = without_suns(light, 10.0, 0.0)
    omega = texel_omegas(512)[..., None]
    assert len(suns) == 1 and left.mean(-1).max() <= 10.0 + 1e-3
    before, after = ((m * omega).sum((0, 1)) for m in (light, left))
    np.testing.assert_allclose(after + suns[0].irradiance, before, rtol=1e-4)
    assert np.degrees(np.arccos(np.dot(suns[0].direction, at))) < 0.3
    assert np.degrees(suns[0].angle) == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize("radius, sun, threshold", [(20.0, 400.0, 10.0), (2.0, 4000.0, 0.0), (2.0, 9.0, 10.0)])
def test_windows_weak_spots_and_a_threshold_of_zero_are_no_suns(radius, sun, threshold):
    light, _ = sunny(radius=radius, sun=sun)
    left, suns = without_suns(light, threshold, 0.0)
    assert suns == () and np.array_equal(left, light)


def test_the_camera_sees_the_panorama(studio):
    pixels = np.zeros((8, 16, 3))
    pixels[..., 0], pixels[4:, :, 1], pixels[:, 8:, 2] = 1.0, 2.0, 3.0
    shown = lit_by(pixels, [quad("floor", (0, 0, -100))], strength=2.0)
    view = perspective(16, 16, 40.0, position=(0, 0, 0), target=(1, 0, 0.6))
    found = studio.render(shown, view, 1, ("combined", "environment"))
    np.testing.assert_allclose(found["combined"][8, 3], [2, 4, 0, 1], atol=1e-3)  # up, to the left of +Y: u below 1/2
    np.testing.assert_allclose(found["environment"][8, 12, :3], [2, 4, 6], atol=1e-3)
    unseen = lit_by(pixels, [quad("floor", (0, 0, -100))], seen=False)
    assert studio.render(unseen, view, 1)["combined"][..., :3].max() == 0


def test_a_closed_white_object_vanishes_in_a_furnace(studio):
    pixels = np.full((16, 32, 3), 0.7)
    shown = lit_by(pixels, [sphere("ball", rings=24)])
    view = ortho(24, 24, 1.6)
    found = studio.render(shown, view, 32, ("combined",), **{**VPL, "vpl_bounces": "MANY"})["combined"][..., :3]
    assert found.mean() == pytest.approx(0.7, rel=0.01)


def test_a_plane_takes_the_irradiance_of_the_panorama(studio):
    d, omega = directions_of(64)
    pixels = 0.2 + np.maximum(d[..., 2:], 0) * [1.0, 2.0, 3.0] + 20.0 * (d @ [0.6, 0.0, 0.8] > 0.995)[..., None]
    shown = lit_by(pixels, [quad("floor")], sun_threshold=0.0)
    truth = (pixels * (np.maximum(d[..., 2], 0) * omega)[..., None]).sum((0, 1)) / np.pi
    found = studio.render(shown, ortho(16, 16, 1.0), 32, ("diffuse_direct",), **VPL)["diffuse_direct"]
    np.testing.assert_allclose(found.mean((0, 1))[:3], truth, rtol=0.02)


def test_a_sun_of_the_panorama_casts_a_shadow(studio):
    d, omega = directions_of(128)
    pixels = 0.1 + 3000.0 * (d @ [0.6, 0.0, 0.8] > np.cos(np.radians(1.5)))[..., None] * np.ones(3)
    shown = lit_by(pixels, [quad("floor"), quad("roof", (0.6, 0, 0.8), (0.2, 0, 0), (0, 0.2, 0))])
    view = ortho(32, 32, 1.8, position=(0, 0, 0.7), target=(0, 0, 0))
    found = studio.render(shown, view, 8, ("diffuse_direct",), **VPL)["diffuse_direct"][..., 0]
    assert len(studio.gpu_scene.environment.suns) == 1
    sun = (3000.0 * (d @ [0.6, 0.0, 0.8] > np.cos(np.radians(1.5))) * omega).sum() * 0.8 / np.pi
    assert found[16, 16] < 0.1 * sun < sun < found[16, 2] < 1.2 * sun


def test_nothing_is_drawn_again_for_a_world_that_stays(studio):
    pixels = np.full((16, 32, 3), 0.5)
    shown = lit_by(pixels, [quad("floor")])
    studio.render(shown, ortho(8, 8, 1.0), 1, **VPL)
    environment = studio.gpu_scene.environment
    before = environment.drawn, environment.revision
    studio.render(lit_by(pixels, [quad("floor")], albedo=0.5), ortho(8, 8, 1.0), 1, **VPL)
    assert (environment.drawn, environment.revision) == before
    studio.render(lit_by(pixels, [quad("floor")], strength=2.0), ortho(8, 8, 1.0), 1, **VPL)
    assert (environment.drawn, environment.revision) == (before[0] + 1, before[1] + 1)
    studio.render(lit_by(pixels, [quad("floor")], strength=2.0, seen=False), ortho(8, 8, 1.0), 1, **VPL)
    assert environment.drawn == before[0] + 1


RSM = {"method": "RSM"}


def test_a_method_without_a_sky_of_its_own_takes_the_irradiance_of_harmonics(studio):
    d, omega = directions_of(64)
    pixels = 0.2 + np.maximum(d[..., 2:], 0) * [1.0, 2.0, 3.0] + np.maximum(d[..., :1], 0)
    truth = (pixels * (np.maximum(d[..., 2], 0) * omega)[..., None]).sum((0, 1)) / np.pi
    found = studio.render(lit_by(pixels, [quad("floor")]), ortho(16, 16, 1.0), 4, ("diffuse_direct",), **RSM)
    np.testing.assert_allclose(found["diffuse_direct"].mean((0, 1))[:3], truth, rtol=0.01)
    hidden = lit_by(pixels, [box("room", (-1, -1, -1), (1, 1, 1), inward=True)])
    found = studio.render(hidden, ortho(16, 16, 1.0, position=(0, 0, 0.9)), 4, ("diffuse_direct",), **RSM)
    assert found["diffuse_direct"].max() == 0.0


@pytest.mark.parametrize("settings", [VPL, RSM], ids=["vpl", "rsm"])
def test_a_mirror_shows_the_panorama(studio, settings):
    pixels = np.zeros((64, 128, 3))
    pixels[32:, :64], pixels[32:, 64:] = [1.0, 2.0, 0.5], [0.5, 1.0, 3.0]  # towards +Y, towards -Y
    mirror = Material("mirror", (1.0, 1.0, 1.0), metallic=1.0, roughness=0.1)
    shown = replace(lit_by(pixels, [quad("floor")]), materials=(mirror,))
    for y, color in ((-4.0, [1.0, 2.0, 0.5]), (4.0, [0.5, 1.0, 3.0])):
        view = perspective(16, 16, 10.0, position=(0, y, 2), target=(0, 0, 0))
        found = studio.render(shown, view, 8, ("glossy_direct",), **settings)["glossy_direct"]
        np.testing.assert_allclose(found.mean((0, 1))[:3], color, rtol=0.03)
        unseen = studio.render(
            replace(shown, world=replace(shown.world, glossy=False)), view, 2, ("glossy_direct",), **settings
        )
        assert unseen["glossy_direct"].max() == 0.0
