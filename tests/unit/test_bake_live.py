"""What a bake shows under a light: the quick answers against products written out, and projections of surroundings."""

from dataclasses import replace

import numpy as np
import pytest

from rebound.bake import haar, separable, sh
from rebound.bake.file import Bake
from rebound.bake.job import BakeSettings, Kind, bake_objects, glossy_matrices, unfit, wavelet_rows
from rebound.bake.light import Surroundings
from rebound.bake.live import make_live
from rebound.bake.occlusion import make_caster
from rebound.bake.sphere import cube_directions, cube_solid_angles, texel_of
from rebound.bake.surfaces import frame_of, gather
from rebound.bake.transfer import finish
from rebound.gpu_shaders.frame.environment_map import texel_directions, texel_omegas
from rebound.scene.data import Material, Transfer
from rebound.tests.support.bake_scenes import grid, placed
from rebound.tests.support.brdf_reference import ggx_values, mirrored, phong_values
from rebound.tests.support.render_scenes import place, sphere

TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)


def scene():
    matrices = [np.eye(4), place((0, 0, 0.7), TURN)]
    return placed(
        grid("floor", 3.0, 6), sphere("ball", (0, 0, 0), 0.5, rings=8), albedo=(0.8, 0.5, 0.3), matrices=matrices
    )


def transfer(kind, **settings):
    """The ball's bake."""
    made = BakeSettings(kind=kind, directions=256, bounces=1, rays="numpy", **settings)
    bake = finish(bake_objects(scene(), ["ball"], made))["ball"]
    return Transfer("ball", bake.about, bake.arrays)


def picture(side=64):
    """Surroundings with a bright side and a small lamp."""
    d = texel_directions(side)
    radiance = 0.4 + 0.3 * d[..., 2] + 6.0 * (d @ [0.6, 0.0, 0.8] > 0.97)
    return radiance[..., None] * [1.0, 0.8, 0.5]


def answer(live, light, frame=TURN, bands=11, window=0.0, terms=100000):
    return live.answer(light, frame, bands, window, terms)


def test_diffuse_is_the_product_with_the_turned_light():
    baked, light = transfer(Kind.DIFFUSE), Surroundings(picture())
    found = answer(make_live(baked), light)[:, 0]
    local = sh.rotate(light.harmonics(5), TURN.T)
    right = np.einsum("vcl,cl->vc", baked.arrays["diffuse"].astype(np.float64), local)
    np.testing.assert_allclose(found, right, atol=1e-5)
    fewer = answer(make_live(baked), light, bands=2)[:, 0]
    np.testing.assert_allclose(
        fewer, np.einsum("vcl,cl->vc", baked.arrays["diffuse"][..., :4], local[:, :4]), atol=1e-5
    )


@pytest.mark.parametrize("error", [0.0, 0.05])
def test_glossy_is_the_matrix_times_the_turned_light(error):
    baked, light = transfer(Kind.GLOSSY, bands=4, result_bands=3, error=error), Surroundings(picture())
    matrices = glossy_matrices(Bake(baked.about, baked.arrays)).rows().reshape(-1, *baked.about["matrix"])
    right = np.einsum("vcrl,cl->vrc", matrices, sh.rotate(light.harmonics(4), TURN.T))
    live = make_live(baked)
    assert live.coefficients == 9
    np.testing.assert_allclose(answer(live, light), right, atol=1e-4)
    none_above = sh.rotate(light.harmonics(2), TURN.T)
    np.testing.assert_allclose(
        answer(live, light, bands=2), np.einsum("vcrl,cl->vrc", matrices[..., :4], none_above), atol=1e-4
    )


def test_wavelets_are_the_sparse_product_and_few_terms_come_near():
    baked, light = transfer(Kind.WAVELET, texels=16, keep=1.0, bands=3), Surroundings(picture())
    rows = wavelet_rows(Bake(baked.about, baked.arrays))
    cube = light.cube(16, TURN)
    right = rows.dot(haar.forward(np.moveaxis(cube, -1, 0)).reshape(3, -1).T)
    local = sh.rotate(light.harmonics(3), TURN.T)
    right += np.einsum("vcl,cl->vc", baked.arrays["bounced"].astype(np.float64), local)
    live = make_live(baked)
    np.testing.assert_allclose(answer(live, light)[:, 0], right, atol=1e-4)
    errors = [np.abs(answer(live, light, terms=n)[:, 0] - right).mean() / right.mean() for n in (8, 64, 512)]
    assert errors[0] > errors[1] > errors[2] and errors[2] < 0.01


def metal_scene(roughness=0.6):
    """A metal ball over a floor that blocks the lower half."""
    materials = (Material("Grey", (0.8, 0.5, 0.3)), Material("Metal", (1, 1, 1), metallic=1.0, roughness=roughness))
    plain = scene()
    floor, ball = plain.instances
    return replace(plain, materials=materials, instances=(floor, replace(ball, materials=(1,))))


@pytest.mark.parametrize(("lobe", "values"), [("GGX", ggx_values), ("PHONG", phong_values)])
def test_glossy_wavelets_are_the_lobe_summed_over_what_is_seen(lobe, values):
    """Against sums over the sky's texels with the lobe as the paper writes it, visibility by rays of their own."""
    size, shown = 16, metal_scene()
    made = BakeSettings(
        kind=Kind.WAVELET_GLOSSY, texels=size, keep=1.0, bounces=0, rays="numpy", lobe=lobe, lobe_terms=48
    )
    bake = finish(bake_objects(shown, ["ball"], made))["ball"]
    assert bake.about["roughness"] == 0.6
    live, light = make_live(Transfer("ball", bake.about, bake.arrays)), Surroundings(picture())
    found = answer(live, light)
    factors = separable.factor(separable.LOBES[lobe], 0.6, 48)
    surfaces = gather(shown, frozenset(["ball"]))
    run, caster = surfaces.runs["ball"], make_caster(surfaces.corners, "numpy")
    towards = cube_directions(size).reshape(-1, 3) @ TURN.T
    angles, sky = cube_solid_angles(size).reshape(-1), light.cube(size, TURN).reshape(-1, 3)
    errors, whole = [], []
    for vertex in range(0, run.stop - run.start, 13):
        normal = surfaces.normals[run][vertex]
        up = towards @ normal
        seen = (up > 0) & ~caster.blocked(np.repeat(surfaces.positions[run][vertex : vertex + 1], len(up), 0), towards)
        for cosine in (0.95, 0.6):
            turned, tangent = found[vertex, -2:] @ TURN.T
            np.testing.assert_allclose(turned, normal, atol=1e-6)
            axes = np.stack([tangent, np.cross(normal, tangent), normal])
            view = mirrored(cosine) * [-1, 1, 1]
            shown_light = factors.of_view(view[None])[0] @ found[vertex, 1:-2]
            shares = values(towards @ axes.T, 0.6, cosine) * angles
            errors.append(shown_light - (shares * seen) @ sky / shares.sum())
            whole.append((shares * seen) @ sky / shares.sum())
    # Of the lobes, 48 terms leave 5 and 9 % out; the sky has a small lamp.
    assert np.abs(errors).mean() < 0.07 * np.mean(whole)


def test_bounces_of_glossy_wavelets_are_seen_in_the_lobe():
    """Nearly a furnace: what the floor takes of the white sky it gives back, but for the part under the ball."""
    shown = metal_scene()
    shown = replace(shown, materials=tuple(replace(m, base_color=(1.0, 1.0, 1.0)) for m in shown.materials))
    answers = []
    for bounces in (0, 2):
        made = BakeSettings(kind=Kind.WAVELET_GLOSSY, texels=16, keep=1.0, bounces=bounces, error=1e-3, bands=3)
        bake = finish(bake_objects(shown, ["ball"], made))["ball"]
        found = answer(make_live(Transfer("ball", bake.about, bake.arrays)), Surroundings(np.ones(3)))
        factors = separable.factor(separable.ggx, 0.6, 24)
        answers.append((found[:, 0], factors.of_view(np.array([[0.3, 0.2, 0.933]]))[0] @ found[:, 1:-2]))
    (dark, mirrored_dark), (white, mirrored_white) = answers
    assert dark.min() < 0.4 and mirrored_dark.min() < 0.4
    assert white.mean() > 0.9 and mirrored_white.mean() > 0.9
    assert white.max() < 1.05 and mirrored_white.max() < 1.1


def test_lobe_leaves_out_ten_times_the_energy():
    """Rows of the matt side keep 0.999, those of the lobe together 0.99."""
    found = {}
    for keep in (1.0, 0.999):
        made = BakeSettings(kind=Kind.WAVELET_GLOSSY, texels=16, keep=keep, bounces=0, rays="numpy", lobe_terms=8)
        bake = finish(bake_objects(metal_scene(), ["ball"], made))["ball"]
        found[keep] = [(wavelet_rows(bake, prefix).dense() ** 2).sum() for prefix in ("", "lobe_")]
    kept = np.divide(found[0.999], found[1.0])
    assert 0.999 <= kept[0] < 0.9999 and 0.99 <= kept[1] < 0.993, kept


def test_bake_is_unfit_for_another_roughness():
    shown = metal_scene()
    made = BakeSettings(kind=Kind.WAVELET_GLOSSY, texels=4, bounces=0, directions=16, lobe_terms=4, rays="numpy")
    bake = finish(bake_objects(shown, ["ball"], made))["ball"]
    assert unfit(bake.about, shown, "ball") == ""
    assert "roughness" in unfit(bake.about, metal_scene(0.5), "ball")


def test_black_surroundings_give_black():
    for kind in Kind:
        live = make_live(transfer(kind, texels=8, lobe_terms=8))
        found = answer(live, Surroundings(np.zeros(3)))
        assert not (found[:, :-2] if kind is Kind.WAVELET_GLOSSY else found).any()


# --- surroundings ----------------------------------------------------------------------------------------------------


def test_one_colour_is_a_constant_map():
    color = np.array([0.2, 0.5, 1.0])
    one, many = Surroundings(color), Surroundings(np.broadcast_to(color, (16, 16, 3)))
    np.testing.assert_allclose(one.harmonics(5), many.harmonics(5), atol=2e-3)
    np.testing.assert_allclose(one.cube(8, TURN), many.cube(8, TURN), atol=1e-12)


@pytest.mark.parametrize("side", [32, 512])
def test_maps_of_any_size_keep_their_light(side):
    image = picture(side)
    directions, weights = texel_directions(side).reshape(-1, 3), texel_omegas(side).reshape(-1)
    right = sh.project(image.reshape(-1, 3), directions, weights, 4)
    np.testing.assert_allclose(Surroundings(image).harmonics(4), right, atol=0.01 * right.max())
    cube = Surroundings(image).cube(16, TURN)
    assert (cube * cube_solid_angles(16)[..., None]).sum() == pytest.approx(
        (image.reshape(-1, 3) * weights[:, None]).sum(), rel=0.02
    )


def test_window_takes_rings_away_and_no_light():
    light = Surroundings(picture())
    plain, smooth = light.harmonics(6), light.harmonics(6, 0.5)
    np.testing.assert_array_equal(plain[:, 0], smooth[:, 0])
    around = sh.evaluate(_directions(4000), 6)
    assert (around @ smooth[0]).min() > (around @ plain[0]).min()
    np.testing.assert_array_equal(light.harmonics(6, 0.0), plain)


def _directions(count):
    found = np.random.default_rng(2).normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def test_texel_of_a_direction_is_the_one_that_looks_there():
    np.testing.assert_array_equal(texel_of(cube_directions(8).reshape(-1, 3), 8), np.arange(6 * 64))


def test_frame_of_the_ball_is_its_turn():
    np.testing.assert_allclose(frame_of(scene().instances[1].world_from_object), TURN, atol=1e-12)


@pytest.mark.parametrize("kind", list(Kind))
def test_coefficients_are_those_of_the_transfer(kind):
    """Each number of it, the mean of the colours; beyond the last there is nothing."""
    baked = transfer(kind, bands=3, result_bands=2, texels=8, error=0.0)
    live, bake = make_live(baked), Bake(baked.about, baked.arrays)
    if kind is Kind.DIFFUSE:
        rows = baked.arrays["diffuse"].astype(np.float64).mean(axis=1)[:, None]
    elif kind is Kind.GLOSSY:
        rows = glossy_matrices(bake).rows().reshape(-1, *baked.about["matrix"]).mean(axis=1)
    else:
        rows = wavelet_rows(bake).dense()[:, None]
        if kind is Kind.WAVELET_GLOSSY:
            rows = np.concatenate([rows, wavelet_rows(bake, "lobe_").dense().reshape(len(rows), -1, rows.shape[2])], 1)
    for result, term in ((0, 0), (0, 5), (2, 7)):
        right = rows[:, min(result, rows.shape[1] - 1), term]
        np.testing.assert_allclose(live.coefficient(term, result), right, atol=1e-5)
    assert not live.coefficient(24575, 0).any()
    if kind in {Kind.GLOSSY, Kind.WAVELET_GLOSSY}:
        assert not live.coefficient(0, 120).any()


def test_finest_cube_map_has_the_sharpest_shadow():
    """6 x 64² texels: beside a wall a small sun is gone or whole, and a white sky is what is left of it."""
    wall = grid("wall", 4.0, 4)
    upright = place((0.5, 0, 0), np.array([[0, 0, -1.0], [0, 1, 0], [1, 0, 0]]))
    beside = placed(grid("floor", 4.0, 8), wall, matrices=[np.eye(4), upright])
    made = BakeSettings(kind=Kind.WAVELET, texels=64, bounces=0, keep=0.9999)
    bake = finish(bake_objects(beside, ["floor"], made))["floor"]
    live = make_live(Transfer("floor", bake.about, bake.arrays))
    surfaces = gather(beside, frozenset(["floor"]))
    x, y, _ = surfaces.positions[surfaces.runs["floor"]].T
    d = texel_directions(256)
    sun = Surroundings(np.repeat((d @ [0.8, 0.0, 0.6] > np.cos(0.02))[..., None], 3, axis=2).astype(float))
    lit = answer(live, sun, np.eye(3), terms=128)[:, 0, 0]
    assert lit[(x < 0.4) & (abs(y) < 1.9)].max() < 0.02 * lit[x > 0.6].min(), "behind the wall's sides it is seen"
    assert lit[x > 0.6].min() == pytest.approx(lit[x > 0.6].max(), rel=1e-3)
    white = answer(live, Surroundings(np.ones(3)), np.eye(3))[:, 0, 0]
    assert white[x > 0.6].max() < 0.95 and white.max() <= 1.001
