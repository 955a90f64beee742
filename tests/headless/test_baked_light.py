"""Baked objects in the picture: closed forms, nothing lit twice, and what is worked out again after an edit."""

from dataclasses import replace

import numpy as np
import pytest

from rebound.bake import separable, sh
from rebound.bake.job import BakeSettings, Kind
from rebound.bake.light import Surroundings
from rebound.bake.live import make_live
from rebound.bake.matrices import open_matrices
from rebound.bake.refine import tree, walk
from rebound.bake.sphere import quadrature
from rebound.bake.surfaces import mesh_vertices
from rebound.bake.view_table import LOBES, least_roughness
from rebound.scene.data import Material, Visibility, World
from rebound.tests.support.bake_scenes import grid
from rebound.tests.support.baked_scenes import baked
from rebound.tests.support.brdf_reference import ggx_values, phong_values
from rebound.tests.support.glsl_functions import evaluate
from rebound.tests.support.panorama_scenes import directions_of, lit_by
from rebound.tests.support.render_scenes import EVERYTHING, Studio, light, ortho, perspective, place, scene, sphere

SKY = World((1.0, 0.8, 0.5))
VIEW = perspective(48, 36, 50, (0, -3.2, 1.6), (0, 0, 0.5))
QUICK = BakeSettings(directions=512, bounces=2)


@pytest.fixture(scope="module")
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


def ball_on_floor(**fields):
    return scene([grid("floor", 4.0, 24), sphere("ball", (0, 0, 0.6), 0.5)], world=SKY, **fields)


BAKED = baked(ball_on_floor(), QUICK)


def picture(studio, shown, samples=4, view=VIEW, **changed):
    return studio.render(shown, view, samples, **{"method": "NONE", **changed})["combined"][..., :3]


@pytest.mark.parametrize("kind", list(Kind))
def test_ball_alone_under_a_white_sky_is_its_own_colour(studio, kind):
    """Within half a percent: what compression and 16 bits are allowed."""
    alone = scene([sphere("ball", (0, 0, 0), 0.5, rings=24)], albedo=0.8, world=World((1.0, 1.0, 1.0)))
    shown = baked(alone, replace(QUICK, kind=kind, error=0.002, keep=0.9999))
    found = studio.render(shown, ortho(24, 24, 1.2), 1, ("diffuse_direct", "diffuse_color"), method="NONE")
    on_it = found["diffuse_color"][..., 0] > 0.79
    assert on_it.sum() > 300
    np.testing.assert_allclose(found["diffuse_direct"][on_it], 1.0, atol=0.005)


def surface(studio, shown=BAKED):
    """(h, w) bool: pixels that show nothing but surface."""
    return studio.render(shown, VIEW, 4, ("diffuse_color",), method="NONE")["diffuse_color"][..., 0] > 0.79


def unbaked(shown, *keys):
    """The scene with these objects' bakes taken off, by default all."""
    keep = [i if keys and i.key not in keys else replace(i, transfer=None) for i in shown.instances]
    return replace(shown, instances=tuple(keep))


def test_baked_light_is_the_live_light(studio):
    """The sky by rays and by the cache, noisy and a little blurred, against the bake."""
    live = picture(studio, unbaked(BAKED), 32, method="VPL", vpl_bounces="MANY")
    found, where = picture(studio, BAKED), surface(studio)
    assert found[where].mean() == pytest.approx(live[where].mean(), rel=0.02)
    assert np.abs(found - live)[where].mean() / live[where].mean() < 0.06


@pytest.mark.parametrize("method", ["VPL", "RSM"])
def test_no_technique_lights_baked_objects_twice(studio, method):
    """Virtual lights have patches of the sky, and the cache its bounces: the bake has all of that already."""
    found = picture(studio, BAKED, 2, method=method, vpl_bounces="MANY")
    np.testing.assert_allclose(found, picture(studio, BAKED, 2), atol=1e-5)


@pytest.mark.parametrize("bounces", [0, 2])
def test_objects_without_a_bake_keep_their_live_light(studio, bounces):
    """The ball is baked, the floor is not: each has the light that it has where both are alike. A bake of shadows alone
    leaves the sky's bounces to the cache.
    """
    shown = unbaked(baked(ball_on_floor(), replace(QUICK, bounces=bounces)), "floor")
    live = picture(studio, unbaked(BAKED), 32, method="VPL", vpl_bounces="MANY")
    found, where = picture(studio, shown, 32, method="VPL", vpl_bounces="MANY"), surface(studio)
    assert found[where].mean() == pytest.approx(live[where].mean(), rel=0.02)
    ball = where & (studio.render(BAKED, VIEW, 1, ("position",))["position"][..., 2] > 0.2)
    assert found[ball].mean() == pytest.approx(live[ball].mean(), rel=0.03)


def test_lamps_and_their_bounce_add_on_top(studio):
    lamp = light("SPOT", (1.0, -1.0, 3.0), (0, 0, 0), 200.0)
    dark, lit = (replace(BAKED, world=world, lights=(lamp,)) for world in (World(), SKY))
    settings = {"method": "VPL", "vpl_bounces": "ONE"}
    lamps = picture(studio, dark, 4, **settings)
    both = picture(studio, lit, 4, **settings)
    where, sky = surface(studio), picture(studio, BAKED)
    # A few of the pool's entries stand for the sky, so that the lamp's bounce has another noise.
    assert (both - lamps)[where].mean() == pytest.approx(sky[where].mean(), rel=2e-3)
    np.testing.assert_allclose((both - lamps)[where], sky[where], atol=0.06)


def test_mirror_of_a_white_sky_is_white(studio):
    """A rough metal ball, alone: all that it reflects is sky."""
    metal = Material("Metal", (1.0, 1.0, 1.0), metallic=1.0, roughness=0.6)
    alone = scene([sphere("ball", (0, 0, 0), 0.5, rings=24)], materials=[metal], world=World((1.0, 1.0, 1.0)))
    shown = baked(alone, replace(QUICK, kind=Kind.GLOSSY, bands=6, result_bands=6, error=0.002))
    view = ortho(32, 32, 1.2)
    found = studio.render(shown, view, 1, ("glossy_direct", "glossy_color"), method="NONE")
    middle = np.hypot(*(np.mgrid[:32, :32] - 15.5)) < 10
    # Beside the rim the lobe is cut by the horizon, which six bands blur: to 0.9.
    np.testing.assert_allclose(found["glossy_direct"][middle], 1.0, atol=0.06)
    assert found["glossy_direct"][middle].mean() == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize(("lobe", "values"), [("GGX", ggx_values), ("PHONG", phong_values)])
@pytest.mark.parametrize(("roughness", "widen"), [(0.35, False), (0.35, True), (0.6, True)])
def test_mirrored_light_is_the_lobe_summed_over_what_arrives(studio, lobe, values, roughness, widen):
    """A metal ball under a white sky, pixel by pixel: six bands of the open half space, through the lobe.

    Widened where they hold none so narrow.
    """
    metal = Material("Metal", (1.0, 1.0, 1.0), metallic=1.0, roughness=roughness)
    alone = scene([sphere("ball", (0, 0, 0), 0.5, rings=48)], materials=[metal], world=World((1.0, 1.0, 1.0)))
    shown = baked(alone, replace(QUICK, kind=Kind.GLOSSY, bands=6, result_bands=6, error=0.001, bounces=0))
    changed = {"method": "NONE", "transfer_lobe": lobe, "transfer_widen": widen}
    found = studio.render(shown, ortho(32, 32, 1.2), 1, ("glossy_direct",), **changed)
    shown_as = max(roughness, least_roughness(LOBES[lobe], 6)) if widen else roughness
    towards, areas = quadrature(200)
    arrives = sh.evaluate(towards, 6) @ open_matrices(np.array([[0.0, 0.0, 1.0]]), 6, 6)[0][:, 0] * np.sqrt(4 * np.pi)
    for pixel in range(17, 28):
        cosine = np.sqrt(1.0 - (((pixel + 0.5) / 32 * 1.2 - 0.6) / 0.5) ** 2 - (0.5 / 32 * 1.2 / 0.5) ** 2)
        shares = values(towards, shown_as, cosine) * areas
        assert found["glossy_direct"][16, pixel, 0] == pytest.approx(shares @ arrives / shares.sum(), abs=0.01), pixel


@pytest.mark.parametrize("used", [4, 6])
def test_smooth_metal_beside_bright_light_has_no_dark_rings(studio, used):
    """Under an even sky with a lamp of 15 degrees in it, a mirror reflects 1 where it does not reflect the lamp."""
    towards, _ = directions_of(64)
    lamp = towards @ np.array([0.6, 0.0, 0.8]) > np.cos(np.radians(15))
    pixels = np.where(lamp, 40.0, 1.0)[..., None] * np.ones(3)
    metal = Material("Metal", (1.0, 1.0, 1.0), metallic=1.0, roughness=0.3)
    alone = lit_by(pixels, [sphere("ball", (0, 0, 0), 0.5, rings=32)], sun_threshold=0.0)
    alone = replace(alone, materials=(metal,))
    shown = baked(alone, replace(QUICK, kind=Kind.GLOSSY, bands=6, result_bands=6, error=0.002, bounces=0))
    least = {}
    for widen in (False, True):
        changed = {"method": "NONE", "transfer_widen": widen, "transfer_bands": used}
        found = studio.render(shown, ortho(32, 32, 1.2), 1, ("glossy_direct",), **changed)["glossy_direct"][..., 0]
        least[widen] = found[np.hypot(*(np.mgrid[:32, :32] - 15.5)) < 11].min()
    assert least[False] == 0.0
    assert least[True] > 0.5


@pytest.mark.parametrize("lobe", ["GGX", "PHONG"])
def test_glossy_wavelets_are_seen_as_their_factors_say(studio, lobe):
    """A metal ball under a sky with a bright side, pixel by pixel: the twin of the shader, mixed over the triangles."""
    metal = Material("Metal", (1.0, 1.0, 1.0), metallic=1.0, roughness=0.6)
    alone = scene([sphere("ball", (0, 0, 0), 0.5, rings=48)], materials=[metal], world=World((1.0, 0.5, 0.25)))
    made = BakeSettings(kind=Kind.WAVELET_GLOSSY, texels=16, keep=0.9999, bounces=0, lobe=lobe, directions=16)
    shown = baked(alone, made)
    found = studio.render(shown, ortho(32, 32, 1.2), 1, ("glossy_direct",), method="NONE", transfer_terms=6144)
    live = make_live(next(iter(shown.transfers.values())))
    numbers = live.answer(Surroundings(np.array(alone.world.color)), np.eye(3), 5, 0.0, 6144)
    factors = separable.factor(separable.LOBES[lobe], 0.6, 24)
    for pixel in range(8, 24):
        x = (pixel + 0.5) / 32 * 1.2 - 0.6
        normal = np.array([x, 0.5 / 32 * -1.2, 0.0]) / 0.5
        normal[2] = np.sqrt(1.0 - normal @ normal)
        vertex = numbers[np.argmax(numbers[:, -2] @ normal)]
        view = np.array([[vertex[-1, 2], np.cross(vertex[-2], vertex[-1])[2], vertex[-2, 2]]])
        right = factors.of_view(view)[0] @ vertex[1:-2]
        np.testing.assert_allclose(found["glossy_direct"][16, pixel], right, rtol=0.02, atol=0.005)
    assert found["glossy_direct"][12:20, 12:20, 0].mean() == pytest.approx(1.0, abs=0.02)


def test_objects_that_take_no_indirect_light_take_no_baked_one(studio):
    alone = {"ball": EVERYTHING | Visibility.NO_INDIRECT, "floor": EVERYTHING | Visibility.NO_INDIRECT}
    instances = tuple(replace(i, visibility=alone[i.key]) for i in BAKED.instances)
    assert picture(studio, replace(BAKED, instances=instances))[surface(studio)].max() == 0.0
    assert picture(studio, BAKED, transfer_use=False)[surface(studio)].max() == 0.0


# --- points inside triangles ------------------------------------------------------------------------------------------

DETAIL = replace(QUICK, directions=1024, bounces=0, points=512, detail=0.03)
FROM_ABOVE = ortho(40, 40, 3.6)


def ball_on_square(cells=1, **fields):
    return scene([grid("floor", 4.0, cells), sphere("ball", (0.3, 0.2, 0.9), 0.4)], world=SKY, **fields)


@pytest.mark.parametrize("kind", list(Kind))
def test_pixels_mix_the_points_around_them(studio, kind):
    """From above, pixel by pixel: the twin of the shader's way down the cuts."""
    shiny = [Material("Shiny", (0.8, 0.8, 0.8), specular=(0.04, 0.04, 0.04), roughness=0.6)] * 2
    shown = ball_on_square(**({"materials": shiny} if "GLOSSY" in kind.value else {}))
    shown = baked(shown, replace(DETAIL, kind=kind, texels=16, bands=4, result_bands=3, points=128), ["floor"])
    found = studio.render(shown, FROM_ABOVE, 1, ("diffuse_direct", "position"), method="NONE", transfer_terms=6144)
    mesh, (transfer,) = shown.meshes[shown.instances[0].mesh], shown.transfers.values()
    live = make_live(transfer)
    numbers = live.answer(Surroundings(np.array(SKY.color)), np.eye(3), 5, 0.0, 6144)
    cosine = sh.evaluate(np.array([[0.0, 0.0, 1.0]]), 3)[0] * np.repeat([1.0, 2 / 3, 1 / 4], [1, 3, 5])
    light = np.einsum("ric,i->rc", numbers, cosine) if kind is Kind.GLOSSY else numbers[:, 0]
    seen = np.abs(found["position"][..., 2]) < 1e-4
    seen &= found["diffuse_direct"][..., 0] > 0  # a pixel of the ball's rim has no whole floor
    places = found["position"][seen][:, :2].astype(np.float64)
    at, weights = within(mesh.positions, places)
    rows = mesh_vertices(mesh)[1].reshape(-1, 3)
    _, of, parts = walk(tree(live.splits, len(rows)), at, rows[at], weights)
    right = (parts[:, :, None] * light[of]).sum(axis=1)
    assert seen.sum() > 1000 and right[:, 0].min() < 0.9 * right[:, 0].max()
    np.testing.assert_allclose(found["diffuse_direct"][seen], right, atol=2e-3)


def within(corners, places):
    """Which triangle of a floor each place (n, 2) is in, and the weights of its corners."""
    triangles = corners.reshape(-1, 3, 3).astype(np.float64)[..., :2]
    every = np.stack(
        [
            np.linalg.solve(np.vstack([t.T, np.ones(3)]), np.vstack([places.T, np.ones(len(places))])).T
            for t in triangles
        ]
    )
    at = every.min(axis=2).argmax(axis=0)
    return at, every[at, np.arange(len(places))].clip(0.0)


def test_square_with_points_is_the_picture_of_a_fine_mesh(studio):
    """Means of squared differences over the squares: without points 6e-3."""
    fine = picture(studio, baked(ball_on_square(64), replace(DETAIL, points=0)))
    errors = {}
    for points in (0, 512):
        found = picture(studio, baked(ball_on_square(), replace(DETAIL, points=points)))
        errors[points] = np.mean((found - fine) ** 2 / (fine**2 + 0.01))
    assert errors[512] < 1e-4 and errors[0] > 30 * errors[512], errors


def test_cuts_are_given_back_and_seen_by_the_view_of_a_coefficient(studio):
    plain, cut = (baked(ball_on_square(), replace(DETAIL, points=points)) for points in (0, 128))
    picture(studio, plain, 1)
    before = studio.renderer.statistics()["gpu_bytes"]
    shown = picture(studio, cut, 1, FROM_ABOVE, show="TRANSFER", show_term=0)
    floor = shown[2:-2, 2:-2, 0]
    assert floor.min() < 0.87, "the shadow is in the first coefficient"
    picture(studio, cut, 1)
    assert studio.renderer.statistics()["gpu_bytes"] > before
    picture(studio, plain, 1)
    assert studio.renderer.statistics()["gpu_bytes"] == before


# --- what is worked out again -----------------------------------------------------------------------------------------


def updates(studio, shown, view=VIEW, **changed):
    before = studio.renderer.statistics()["baked_updates"]
    studio.gpu_scene.uploads.clear()
    picture(studio, shown, 1, view, **changed)
    return studio.renderer.statistics()["baked_updates"] - before, dict(studio.gpu_scene.uploads)


def test_only_another_light_or_turn_is_worked_out_again(studio):
    updates(studio, BAKED)
    assert updates(studio, BAKED) == (0, {})
    assert updates(studio, BAKED, perspective(48, 36, 50, (2, -3.2, 1.6), (0, 0, 0.5))) == (0, {})
    assert updates(studio, replace(BAKED, world=World((0.1, 0.2, 0.9)))) == (2, {})
    assert updates(studio, BAKED)[0] == 2
    assert updates(studio, BAKED, transfer_bands=3)[0] == 2
    moved = {i.key: i.world_from_object + 0.5 * np.eye(4, k=3) for i in BAKED.instances}
    away = replace(BAKED, instances=tuple(replace(i, world_from_object=moved[i.key]) for i in BAKED.instances))
    assert updates(studio, away, transfer_bands=3)[0] == 0, "without a turn the light is the same"


def test_turned_objects_have_the_light_of_the_world(studio):
    """All turned together under a constant sky, and seen from the turned place: the same picture."""
    turn = place((0.3, 0.2, 0.1), np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0])
    turn[:3, 0] *= np.linalg.det(turn[:3, :3])
    instances = tuple(replace(i, world_from_object=turn @ i.world_from_object) for i in BAKED.instances)
    view = replace(VIEW, view_from_world=VIEW.view_from_world @ np.linalg.inv(turn))
    np.testing.assert_allclose(
        picture(studio, replace(BAKED, instances=instances), 1, view), picture(studio, BAKED, 1), atol=0.02
    )


def test_harmonics_of_the_shader_are_those_of_the_bake(headless_device):
    directions = np.random.default_rng(4).normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    wanted = sh.evaluate(directions, 6)
    path, numbers = "test/sh_at_lib.glsl", ", ".join(f"y[n + {i}]" for i in range(4))
    text = "vec4 at(vec3 d, int n)\n{\n  float y[SH_MOST];\n  sh_evaluate(d, y);\n"
    library = {path: f'#include "lib/sh_lib.glsl"\n{text}  return vec4({numbers});\n}}\n'}
    for first in range(0, 36, 4):
        found = evaluate(headless_device, [path], f"at(d.xyz, {first})", {"d": directions}, files=library)
        np.testing.assert_allclose(found, wanted[:, first : first + 4], atol=2e-6)


# --- one coefficient --------------------------------------------------------------------------------------------------


def test_view_of_a_coefficient_is_red_above_zero_and_blue_below(studio):
    """Coefficient 3 grows along x: what faces that way is red, its other side blue; without a bake there is grey."""
    alone = baked(scene([sphere("ball", (0, 0, 0), 0.5, rings=24)], world=SKY), QUICK)
    view, settings = ortho(32, 32, 1.2), {"show": "TRANSFER", "show_term": 3}
    found = picture(studio, alone, 2, view, **settings)
    across = found[16, 4:28]
    assert across[-1, 0] > 0.7 and across[-1, 2] == 0
    assert across[0, 2] > 0.7 and across[0, 0] == 0
    assert (np.diff(across[:, 0] - across[:, 2]) > 0).all()
    np.testing.assert_allclose(found[0, 0], 0.05, atol=1e-3)
    np.testing.assert_allclose(picture(studio, unbaked(alone), 2, view, **settings), 0.05, atol=1e-3)
    assert (picture(studio, alone, 2, view, show="TRANSFER", show_term=0)[10:22, 10:22, 0] > 0.95).all()


def test_view_of_a_coefficient_leaves_no_trace(studio):
    before = picture(studio, BAKED)
    memory = studio.renderer.statistics()["gpu_bytes"]
    for term in (0, 4):
        picture(studio, BAKED, show="TRANSFER", show_term=term)
    np.testing.assert_array_equal(picture(studio, BAKED), before)
    assert studio.renderer.statistics()["gpu_bytes"] == memory
