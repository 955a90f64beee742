"""Glossy matrices and wavelet rows: against closed forms and against the diffuse transfer of the same scene."""

import numpy as np
import pytest

from rebound.bake import haar, lobes, sh, sphere
from rebound.bake.glossy import glossy
from rebound.bake.matrices import hemisphere, open_matrices, turn_matrices
from rebound.bake.surfaces import frame_of
from rebound.bake.transfer import Sampling, diffuse, finish
from rebound.bake.wavelets import wavelet
from rebound.tests.support import render_scenes
from rebound.tests.support.bake_scenes import WHITE_SKY, bowl, grid, placed, surfaces_of
from rebound.tests.support.render_scenes import place, quad

TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)
SCENE = placed(grid("floor", 4.0, 6), render_scenes.sphere("ball", (0, 0, 0.6), 0.5, rings=6), albedo=0.7)


def all_rows(surfaces):
    return np.arange(len(surfaces.positions))


def glossy_of(scene, result=4, **sampling):
    surfaces, caster = surfaces_of(scene)
    return surfaces, finish(glossy(surfaces, caster, Sampling(**sampling), result, all_rows(surfaces)))


def test_hemisphere_lobe_is_the_step_over_the_horizon():
    found = hemisphere(9) * lobes.band_scales(9)
    assert np.allclose(found[:4], 2 * np.pi * np.array([1, 0.5, 0, -0.125]), atol=1e-12)
    assert np.allclose(found[[2, 4, 6, 8]], 0, atol=1e-12)


def test_open_vertex_takes_the_product_with_its_hemisphere():
    """Brute force over 20,000 directions, a step of which on the horizon is 1 / 100 of a radian."""
    normal = np.array([0.6, 0.0, 0.8])
    directions = sphere.spread(20000)
    above = (directions @ normal > 0) * (4 * np.pi / len(directions))
    brute = np.einsum("d,di,dj->ij", above, sh.evaluate(directions, 3), sh.evaluate(directions, 5))
    assert np.abs(open_matrices(normal[None], 5, 3)[0] - brute).max() < 5e-3


def test_cosine_of_what_arrives_is_the_diffuse_transfer():
    """The diffuse vector is the glossy matrix seen through the cosine: both ways agree to the bands left out."""
    surfaces, matrices = glossy_of(SCENE, result=7, bands=4, bounces=2)
    _, caster = surfaces_of(SCENE)
    vectors = finish(diffuse(surfaces, caster, Sampling(bands=4, bounces=2)))
    cosines = lobes.turn(lobes.cosine(7) / np.pi, surfaces.normals)
    seen = np.einsum("vo,vcoi->vci", cosines, matrices)
    assert np.abs(seen - vectors).max() < 0.02
    assert np.sqrt(((seen - vectors) ** 2).mean()) < 0.003


def test_shadowed_matrix_is_symmetric_and_dimmer_than_the_open_one():
    surfaces, matrices = glossy_of(SCENE, result=4, bands=4)
    assert np.abs(matrices - np.swapaxes(matrices, -1, -2)).max() < 1e-5
    whole = open_matrices(surfaces.normals, 4, 4)
    assert (np.trace(matrices[:, 0], axis1=1, axis2=2) <= np.trace(whole, axis1=1, axis2=2) + 1e-4).all()


def test_unshadowed_matrices_need_no_rays():
    surfaces, matrices = glossy_of(SCENE, result=3, bands=3, shadows=False)
    assert np.allclose(matrices[:, 0], open_matrices(surfaces.normals, 3, 3), atol=1e-6)


def test_radiance_from_the_bowl_is_what_its_wall_reflects():
    """From the bottom of the bowl the wall sends rho / 2 under a white sky, the sky 1; half of the hemisphere each."""
    surfaces, matrices = glossy_of(placed(bowl("bowl", 16), albedo=0.8), result=2, bands=2, bounces=1)
    bottom = surfaces.positions[:, 2].argmin()
    arriving = matrices[bottom, 0, :, 0] * WHITE_SKY
    # The rim is 45 degrees over the bottom's horizon: sky above it, 2 pi (1 - 1/sqrt 2) steradians, wall below.
    mean = 2 * np.pi * ((1 - np.sqrt(0.5)) + np.sqrt(0.5) * 0.4)
    assert arriving[0] == pytest.approx(np.sqrt(0.25 / np.pi) * mean, rel=0.02)


def test_too_many_bands_are_refused():
    surfaces, caster = surfaces_of(placed(quad("floor")))
    with pytest.raises(ValueError, match="their sum can be 12"):
        finish(glossy(surfaces, caster, Sampling(bands=7), 6, all_rows(surfaces)))


def test_bake_in_turned_axes_is_the_turned_bake():
    """The whole scene turned, and the matrices expressed along the turned axes: the bake of the scene that was not."""
    here = placed(*SCENE.meshes.values(), albedo=0.7)
    there = placed(*SCENE.meshes.values(), albedo=0.7, matrices=[place((0, 0, 0), TURN)] * 2)
    _, plain = glossy_of(here, result=3, bands=3, bounces=1, directions=4096)
    _, turned = glossy_of(there, result=3, bands=3, bounces=1, directions=4096)
    back = turn_matrices(turned, frame_of(place((0, 0, 0), TURN)))
    assert np.abs(back - plain).mean() < 2e-3
    assert np.abs(turned - plain).mean() > 2e-2


@pytest.mark.parametrize("size", [16, 32])
def test_wavelet_rows_agree_with_spherical_harmonics(size):
    """A soft sky of three bands lights both ways alike; 16² texels a face and 99.9 % of each row's energy."""
    surfaces, caster = surfaces_of(SCENE)
    rows = finish(wavelet(surfaces, caster, size, 0.999, np.eye(3), all_rows(surfaces)))[0]
    sky = np.array([2.0, 0.5, 0.7, 0, 0, 0.2, 0.3, 0, 0])
    cube = sh.evaluate(sphere.cube_directions(size), 3) @ sky
    by_texels = rows.dot(haar.forward(cube).reshape(-1))
    by_bands = finish(diffuse(surfaces, caster, Sampling(bands=3, directions=4096)))[:, 0] @ sky
    assert np.abs(by_texels - by_bands).max() < 0.05 * by_bands.max()
    assert np.abs(by_texels - by_bands).mean() < 0.005 * by_bands.max()


def test_wavelet_rows_of_an_open_plane_add_up_to_white_in_any_frame():
    surfaces, caster = surfaces_of(placed(quad("floor")))
    white = haar.forward(np.ones((6, 32, 32))).reshape(-1)
    for frame in (np.eye(3), TURN):
        rows = finish(wavelet(surfaces, caster, 32, 0.9999, frame, all_rows(surfaces)))[0]
        assert np.allclose(rows.dot(white), 1, atol=0.005)


def test_small_sun_throws_a_sharp_shadow_by_wavelets():
    """A sun of one texel overhead: the floor under a ball is dark, a step beside it as bright as without the ball."""
    ball = render_scenes.sphere("ball", (0, 0, 1.0), 0.5, rings=12)
    surfaces, caster = surfaces_of(placed(grid("floor", 3.0, 12), ball))
    rows = finish(wavelet(surfaces, caster, 32, 0.9999, np.eye(3), all_rows(surfaces)))[0]
    sun = np.zeros((6, 32, 32))
    sun[4, 16, 16] = 1.0 / sphere.cube_solid_angles(32)[4, 16, 16]
    lit = rows.dot(haar.forward(sun).reshape(-1))[surfaces.runs["floor"]] * np.pi
    away = np.linalg.norm(surfaces.positions[surfaces.runs["floor"], :2], axis=1)
    assert np.abs(lit[away < 0.3]).max() < 0.1
    assert np.abs(lit[away > 0.7] - 1).max() < 0.1
