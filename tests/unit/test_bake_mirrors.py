"""Bounces by way of metals keep their direction: against integrals of lobes, paths traced in a bowl, and furnaces."""

from dataclasses import replace

import numpy as np
import pytest

from rebound.bake import mirrors, sh, sphere
from rebound.bake import transfer as transfer_module
from rebound.bake.glossy import glossy
from rebound.bake.job import BakeSettings, bake_objects, unfit
from rebound.bake.mirrors import Mirrors
from rebound.bake.occlusion import make_caster
from rebound.bake.surfaces import gather
from rebound.bake.transfer import Blocked, Sampling, diffuse, finish, passed_on, reflected
from rebound.scene.data import Material, Visibility
from rebound.tests.support import bxdf_reference as bxdf
from rebound.tests.support.bake_scenes import WHITE_SKY, bowl, grid, placed, surfaces_of
from rebound.tests.support.render_scenes import quad
from rebound.tests.support.render_scenes import sphere as ball

GOLD = (0.9, 0.6, 0.3)
WHITE = np.array([WHITE_SKY, *[0.0] * 24])


def of(material, *meshes):
    """A scene of one material."""
    return replace(placed(*meshes), materials=(material,))


def metal(roughness, colour=(1.0, 1.0, 1.0), metallic=1.0):
    return Material("Metal", colour, metallic=metallic, roughness=roughness)


def coefficients(function, bands=5):
    directions, weights = sphere.quadrature(40)
    return sh.project(function(directions), directions, weights, bands)


def seen_of_floor(material, towards, sky, cells=4):
    """(n, 3) what rays ``towards`` (n, 3) see of a floor under ``sky`` (25,), each where it hits triangle 3."""
    surfaces, caster = surfaces_of(of(material, grid("floor", 2.0, cells)))
    lit = finish(passed_on(surfaces, caster, Sampling()))
    same = np.zeros(len(towards), np.int32)
    third = np.full(len(towards), 0.3, np.float32)
    rays = Blocked(same, np.arange(len(towards), dtype=np.int32), same + 3, third, third)
    return reflected(surfaces, rays, towards, lit) @ sky


def downwards(cosines):
    cosines = np.array(cosines)
    return np.stack([np.sqrt(1 - cosines**2), 0 * cosines, -cosines], axis=-1)


# --- one reflection --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("roughness", [0.2, 0.5, 1.0])
def test_white_sky_in_a_metal_floor_is_what_the_lobe_reflects(roughness):
    """From every side, however coarse the harmonics of a hemisphere are: 0.01, as far as its roughness is rounded."""
    cosines = np.array([1.0, 0.8, 0.4, 0.15])
    found = seen_of_floor(metal(roughness, GOLD), downwards(cosines), WHITE)
    expected = [bxdf.albedo(cosine, np.array(GOLD), roughness) for cosine in cosines]
    np.testing.assert_allclose(found, expected, atol=0.01)


@pytest.mark.parametrize("roughness, error", [(0.3, 0.06), (0.5, 0.03), (0.8, 0.02)])
def test_rough_metal_mirrors_a_bright_half_of_the_sky(roughness, error):
    """Lobe times sky, integrated over the lobe's own samples: the side of the sky that the view is mirrored to."""
    sky = coefficients(lambda d: 1.0 + 3.0 * (d[:, 0] > 0))
    towards = np.array([[s, 0.3, -c] for s in (0.7, 0.3, -0.3, -0.7) for c in (0.5, 1.0)])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    found = seen_of_floor(metal(roughness), towards, sky)[:, 0]
    xi = np.stack(np.meshgrid(*((np.arange(96) + 0.5) / 96,) * 2), -1).reshape(-1, 2)
    expected = []
    for view in -towards:
        out = bxdf.sample_ggx(np.repeat(view[None], len(xi), 0), np.full(len(xi), roughness), xi)
        alpha, up = roughness**2, out[:, 2] > 0
        near = 1 + bxdf.smith(view[2], alpha)
        share = np.where(up, near / (near + bxdf.smith(np.where(up, out[:, 2], 1.0), alpha)), 0.0)
        expected.append(share @ (sh.evaluate(out, 5) @ sky) / share.sum())
    assert np.ptp(expected) > 0.9
    np.testing.assert_allclose(found, expected, atol=error * 4.0)


def test_lobe_of_a_dielectric_is_scattered_and_costs_nothing():
    paint = Material("Paint", (0.5, 0.5, 0.5), specular=(0.04, 0.04, 0.04), roughness=0.2)
    surfaces, caster = surfaces_of(of(paint, grid("floor", 2.0, 2), ball("ball", (0, 0, 1), 0.5, rings=6)))
    assert not surfaces.mirrored.any()
    np.testing.assert_allclose(surfaces.reflectance, 0.5 * 0.96 + 0.04)
    lit = finish(passed_on(surfaces, caster, Sampling(bounces=1, directions=64)))
    assert lit.mirrors is None and lit.matrices is None


def test_what_reflects_nothing_has_no_lobe_either():
    scene = placed(grid("floor", 2.0, 2), visibility=Visibility.SHADOW)
    surfaces = gather(replace(scene, materials=(metal(0.3),)), frozenset())
    assert not surfaces.mirrored.any() and not surfaces.reflectance.any()


# --- many ------------------------------------------------------------------------------------------------------------


def traced_bowl(sky, roughness, colour, bounces, count=60000):
    """(3,) irradiance / pi at the bottom of a metal bowl, by paths that choose GGX's visible normals."""
    random = np.random.default_rng(3)
    place, normal = np.repeat([[0.0, 0.0, -1.0]], count, 0), np.array([0.0, 0.0, 1.0])
    radius, turn = np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    towards = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)], -1)
    weight, total, rough = np.ones((count, 3)), np.zeros(3), np.full(count, roughness)
    for bounce in range(bounces + 1):
        place = place - 2 * (place * towards).sum(1, keepdims=True) * towards
        free = place[:, 2] > 0
        total += (weight[free] * sky(towards[free])[:, None]).sum(0) / count
        place, towards, weight, rough = (a[~free] for a in (place, towards, weight, rough))
        if bounce == bounces:
            break
        normal = -place
        across = np.cross(normal, [0.6, 0.8, 0.0])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        axes = np.stack([across, np.cross(normal, across), normal], axis=1)
        view = np.einsum("nij,nj->ni", axes, -towards)
        out = bxdf.sample_ggx(view, rough, random.random((len(view), 2)))
        half = (view + out) / np.linalg.norm(view + out, axis=1, keepdims=True)
        up, near = out[:, 2] > 1e-6, 1 + bxdf.smith(view[:, 2], roughness**2)
        share = near / (near + bxdf.smith(np.where(up, out[:, 2], 1.0), roughness**2))
        fresnel = colour + (1 - colour) * (1 - (view * half).sum(1)[:, None].clip(0, 1)) ** 5
        steps = np.linspace(0.02, 1, 24)
        table = bxdf.compensation(steps, np.repeat(colour[None], 24, 0), np.full(24, roughness))
        again = np.stack([np.interp(view[:, 2], steps, channel) for channel in table.T], -1)
        weight = np.where(up[:, None], weight * fresnel * share[:, None] * again, 0.0)
        towards = np.einsum("nij,ni->nj", axes, out)
    return total


@pytest.mark.parametrize("roughness, bounces", [(0.4, 1), (0.4, 3), (0.7, 3)])
def test_metal_bowl_is_lit_as_paths_say(roughness, bounces):
    """Under a white sky and a sky that is brighter to one side. 3 %: facets, 24 paths' noise, five bands."""
    surfaces, caster = surfaces_of(of(metal(roughness, GOLD), bowl("bowl", 12)))
    transfer = finish(diffuse(surfaces, caster, Sampling(bounces=bounces)))
    bottom = surfaces.positions[:, 2].argmin()
    for sky in (lambda d: np.ones(len(d)), lambda d: 1.0 + d[:, 2] + 0.5 * d[:, 0] * d[:, 2]):
        expected = traced_bowl(sky, roughness, np.array(GOLD), bounces)
        np.testing.assert_allclose(transfer[bottom] @ coefficients(sky), expected, rtol=0.03)


@pytest.mark.parametrize("roughness", [0.1, 0.5, 1.0])
def test_metal_furnace_tends_to_white_by_matrices_too(roughness):
    surfaces, caster = surfaces_of(of(metal(roughness), grid("floor", 3.0, 4), ball("ball", (0, 0, 0.6), 0.5, rings=6)))
    before = 0.0
    for bounces in (0, 2, 16):
        lit = finish(passed_on(surfaces, caster, Sampling(bounces=bounces, directions=256)))
        white = lit.transfer[..., 0] * WHITE_SKY
        assert white.max() < 1 + 1e-3 and white.mean() > before
        before = white.mean()
    np.testing.assert_allclose(white, 1, atol=0.01)
    above = sh.evaluate(np.array([0.0, 0.0, 1.0]), lit.mirrors.bands)
    np.testing.assert_allclose(lit.matrices[:, 0, 0, 0] * WHITE_SKY * above[0], 0.5, atol=0.005)  # half of all sides


def test_half_metal_makes_no_light():
    """What is scattered and what the lobe reflects are 1 together, and slant views do not go beyond."""
    scene = of(metal(0.3, metallic=0.5), grid("floor", 3.0, 4), ball("ball", (0, 0, 0.6), 0.5, rings=6))
    surfaces, caster = surfaces_of(scene)
    assert (surfaces.mirrored == 0.5).all() and (surfaces.reflectance == 0.5).all()
    white = finish(diffuse(surfaces, caster, Sampling(bounces=16, directions=256)))[..., 0] * WHITE_SKY
    assert white.max() < 1 + 1e-3
    assert white.mean() > 0.98


def test_metal_floor_sends_light_on_the_way_it_was_going():
    """Light from low at +X, and two panels that look down: it comes up to the one that leans to +X. Scattered, to both
    alike.
    """
    panels = [quad(f"panel{x}", (0, 0, 1.5), (0.1, 0, 0.17 * x), (0, -0.2, 0)) for x in (1, -1)]
    sun = sh.evaluate(np.array([0.9, 0.0, 0.436]), 5)

    def bounced(roughness, panel):
        scene = of(metal(roughness), grid("floor", 12.0, 8), panel)
        scene = replace(scene, materials=scene.materials if roughness else (Material("White", (1, 1, 1)),))
        surfaces, caster = surfaces_of(scene)
        both = (finish(diffuse(surfaces, caster, Sampling(bounces=b, directions=1024))) for b in (1, 0))
        more, first = ((t[surfaces.runs[panel.key[0]], 0] @ sun).mean() for t in both)
        return more - first

    scattered, mirrored = ([bounced(roughness, panel) for panel in panels] for roughness in (0.0, 0.4))
    assert scattered[1] == pytest.approx(scattered[0], rel=0.1)
    assert mirrored[0] > 2.0 * scattered[0]
    assert mirrored[1] < 0.7 * scattered[1]


def test_floor_of_two_triangles_mirrors_as_a_fine_one():
    """Cut into pieces with one matrix each, their own views: a fine floor's corners are interpolated."""
    wall = quad("wall", (0, 0, 0.8), (0, 1, 0), (0, 0, 0.5))
    sky = coefficients(lambda d: 1.0 + d[:, 0] + d[:, 2])

    def lit(floor, cuts):
        surfaces = gather(of(metal(0.4), floor, wall), frozenset(), cuts)
        transfer = finish(diffuse(surfaces, make_caster(surfaces.corners), Sampling(bounces=2)))
        return transfer[surfaces.runs["wall"], 0] @ sky

    fine, coarse = lit(grid("floor", 2.0, 12), 0), lit(quad("floor"), 24)
    np.testing.assert_allclose(coarse, fine, rtol=0.02)


def test_glossy_matrices_hold_the_mirrored_image():
    """A wall over a metal floor: from below, ahead, the bright half of the sky arrives; scattered, the floor's mean."""
    floor, wall = grid("floor", 8.0, 8), quad("wall", (0, 0, 1), (0, 0.5, 0), (0, 0, 0.5))
    sky = coefficients(lambda d: 1.0 + 3.0 * (d[:, 0] > 0))
    below = sh.evaluate(np.array([0.66, 0.0, -0.75]), 5)
    for material, expected in ((metal(0.4), 4.0), (Material("White", (1, 1, 1)), 2.5)):
        surfaces, caster = surfaces_of(of(material, floor, wall))
        rows = np.arange(surfaces.runs["wall"].start, surfaces.runs["wall"].stop)
        matrices = finish(glossy(surfaces, caster, Sampling(bounces=1), 5, rows))
        np.testing.assert_allclose((matrices[:, 0] @ sky) @ below, expected, rtol=0.15)


# --- the machinery ---------------------------------------------------------------------------------------------------


def metal_pair(roughness=0.4):
    floor, other = grid("floor", 4.0, 4), ball("ball", (0, 0, 0.6), 0.5, rings=6)
    scene = placed(floor, other)
    instances = (scene.instances[0], replace(scene.instances[1], materials=(1,)))
    return replace(scene, instances=instances, materials=(Material("Grey"), metal(roughness, GOLD)))


def test_rays_that_are_not_kept_and_smaller_pieces_give_the_same(monkeypatch):
    surfaces, caster = surfaces_of(metal_pair())
    kept = finish(diffuse(surfaces, caster, Sampling(bounces=2, directions=256)))
    monkeypatch.setattr(transfer_module, "_KEPT", 2000)
    monkeypatch.setattr(transfer_module, "_PIECE", 4096)
    monkeypatch.setattr(mirrors, "_PIECE", 100)
    again = finish(diffuse(surfaces, caster, Sampling(bounces=2, directions=256)))
    np.testing.assert_allclose(again, kept, atol=1e-5)


def test_matrices_are_of_the_metal_alone_and_stay_in_their_room(monkeypatch, caplog):
    surfaces, _ = surfaces_of(metal_pair())
    whole = Mirrors(surfaces, 5)
    run = surfaces.runs["ball"]
    assert (whole.vertices >= run.start).all() and (whole.vertices < run.stop).all()
    assert whole.bands == 5 and not caplog.records
    monkeypatch.setattr(mirrors, "_ROOM", len(whole.vertices) * 9 * 25 * 3 * 4)
    assert Mirrors(surfaces, 5).bands == 3
    assert "softer" in caplog.text


def test_another_roughness_of_what_stands_around_makes_bounces_unfit():
    now, then = metal_pair(0.4), metal_pair(0.6)
    for bounces in (0, 1):
        settings = BakeSettings(directions=16, bounces=bounces)
        bakes = finish(bake_objects(now, ["floor", "ball"], settings))
        assert not unfit(bakes["floor"].about, now, "floor")
        assert ("how it looks" in unfit(bakes["floor"].about, then, "floor")) == bool(bounces)
        assert not unfit(bakes["ball"].about, then, "ball")  # its own may change
    old = {name: fact for name, fact in bakes["floor"].about.items() if name != "lobes"}
    assert "older Rebound" in unfit(old, now, "floor")
    grey = replace(now, materials=(Material("Grey"),) * 2)
    plain = finish(bake_objects(grey, ["floor"], BakeSettings(directions=16, bounces=1)))["floor"].about
    assert not unfit({n: f for n, f in plain.items() if n != "lobes"}, grey, "floor")
