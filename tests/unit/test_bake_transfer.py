"""Diffuse transfer against closed forms: cosine lobe, sphere on a plane, bowl, white furnace."""

from dataclasses import replace

import numpy as np
import pytest

from rebound.bake import lobes, sh
from rebound.bake import transfer as transfer_module
from rebound.bake.occlusion import make_caster
from rebound.bake.surfaces import gather
from rebound.bake.transfer import Progress, Sampling, diffuse, finish
from rebound.scene.data import Material, Visibility
from rebound.tests.support.bake_scenes import WHITE_SKY, bowl, grid, placed, surfaces_of
from rebound.tests.support.render_scenes import box, quad, quad_corners, sphere, triangles


def transfer_of(scene, kind="embree", **sampling):
    surfaces, caster = surfaces_of(scene, kind)
    return surfaces, finish(diffuse(surfaces, caster, Sampling(**sampling)))


def white(transfer):
    """(V, channels) under a white sky."""
    return transfer[..., 0] * WHITE_SKY


def test_sphere_under_a_white_sky_is_white():
    _, transfer = transfer_of(placed(sphere("ball", rings=12)))
    assert np.abs(white(transfer) - 1).max() < 0.005


def test_plane_is_the_cosine_lobe():
    _, transfer = transfer_of(placed(quad("floor")), bounces=2)
    lobe = lobes.turn(lobes.cosine(5) / np.pi, np.array([0.0, 0.0, 1.0]))
    assert np.abs(transfer - lobe).max() < 1e-6


def test_without_shadows_all_is_the_cosine_lobe():
    surfaces, transfer = transfer_of(placed(sphere("ball", rings=6), quad("floor", (0, 0, -1))), shadows=False)
    assert np.abs(transfer[:, 0] - lobes.turn(lobes.cosine(5) / np.pi, surfaces.normals)).max() < 1e-6


def test_sphere_on_a_plane_shadows_it_by_its_form_factor():
    """A sphere of radius r, all of it over the horizon at distance D and height h, takes r² h / D³ of a white sky.

    0.02: what 4,096 directions leave where the sphere is large in the sky; 0.005 on average.
    """
    floor, ball = grid("floor", 6.0, 12), sphere("ball", (0, 0, 1.0), 1.0, rings=32)
    surfaces, transfer = transfer_of(placed(floor, ball), directions=4096)
    run = surfaces.runs["floor"]
    away = np.linalg.norm(surfaces.positions[run] - [0, 0, 1], axis=1)
    clear = away > 1.2  # the one under the contact starts inside the facets
    difference = white(transfer[run])[:, 0] - (1 - 1.0 / away**3)
    assert np.abs(difference[clear]).max() < 0.02
    assert np.sqrt((difference[clear] ** 2).mean()) < 0.005


@pytest.mark.parametrize("albedo", [0.3, 0.8])
@pytest.mark.parametrize("bounces", [0, 1, 3])
def test_bowl_lights_itself_as_spheres_do(albedo, bounces):
    """Any two points of a sphere see each other by the same form factor: half the sky, then half the bowl, and so on.

    1 %: facets instead of a bowl, 1,024 directions.
    """
    surfaces, transfer = transfer_of(placed(bowl("bowl"), albedo=albedo), bounces=bounces)
    deep = surfaces.positions[:, 2] < -0.2  # at the rim, rays start beside the facets
    expected = 0.5 * sum((0.5 * albedo) ** k for k in range(bounces + 1))
    assert np.abs(white(transfer[deep]) - expected).mean() < 0.01 * expected
    assert np.abs(white(transfer[deep]) - expected).max() < 0.03 * expected


def test_white_furnace_tends_to_white():
    """All albedos 1 under a sky of 1: what is blocked comes back by bounces, from below and never beyond."""
    scene = placed(grid("floor", 4.0, 8), sphere("ball", (0, 0, 0.6), 0.5, rings=8), albedo=1.0)
    before = 0.0
    for bounces in (0, 1, 4, 16):
        _, transfer = transfer_of(scene, bounces=bounces, directions=512)
        assert white(transfer).max() < 1 + 1e-4
        assert white(transfer).mean() > before
        before = white(transfer).mean()
    assert np.abs(white(transfer) - 1).max() < 0.005


def test_metal_and_glossy_surfaces_pass_all_of_their_light_on():
    """The furnace again, of white metal, and of white paint below a layer that reflects a twentieth."""
    plain = placed(grid("floor", 4.0, 8), sphere("ball", (0, 0, 0.6), 0.5, rings=8), albedo=1.0)
    whites = Material("Metal", (1, 1, 1), metallic=1.0), Material("Paint", (1, 1, 1), specular=(0.05, 0.05, 0.05))
    for material in whites:
        _, transfer = transfer_of(replace(plain, materials=(material,)), bounces=16, directions=256)
        assert np.abs(white(transfer) - 1).max() < 0.005, material.name
    gold = Material("Gold", (1.0, 0.8, 0.3), metallic=1.0)
    tinted = white(transfer_of(replace(plain, materials=(gold,)), bounces=1, directions=256)[1]).mean(axis=0)
    assert tinted[0] > tinted[1] > tinted[2]


def test_walls_of_two_triangles_reflect_as_fine_ones_do():
    """A tray of four coarse walls around a fine floor. Without cuts the walls only know their corners."""
    sides = [((1, 0), (0, -1)), ((-1, 0), (0, 1)), ((0, 1), (1, 0)), ((0, -1), (-1, 0))]
    coarse = [quad(f"wall{i}", (*at, 0.5), (*along, 0), (0, 0, 0.5)) for i, (at, along) in enumerate(sides)]
    fine = []
    for i, (at, along) in enumerate(sides):
        at, along, up = np.array([*at, 0.5]), np.array([*along, 0.0]), np.array([0, 0, 0.5])
        cells = (np.arange(8) + 0.5) / 4 - 1
        corners = [quad_corners(at + s * along + t * up, along / 8, up / 8) for s in cells for t in cells]
        fine.append(triangles(f"wall{i}", np.concatenate(corners)))
    floor = grid("floor", 2.0, 8)

    def lit(walls, cuts):
        surfaces = gather(placed(floor, *walls, albedo=0.8), frozenset(), cuts)
        transfer = finish(diffuse(surfaces, make_caster(surfaces.corners), Sampling(bounces=2)))
        return white(transfer[surfaces.runs["floor"]])[:, 0]

    right = lit(fine, 0)
    middle = np.abs(right - lit(coarse, 24))
    assert middle.mean() < 0.01
    assert middle.mean() < 0.5 * np.abs(right - lit(coarse, 0)).mean()


def test_coloured_neighbour_tints_and_others_only_when_they_reflect():
    wall = quad("wall", (0, 0, 0.5), (0, 1, 0), (0, 0, 0.5))
    scene = placed(grid("floor", 2.0, 4), wall, albedo=(1.0, 0.2, 0.0))
    surfaces, transfer = transfer_of(scene, bounces=1)
    lit = white(transfer[surfaces.runs["floor"]])
    beside = (np.abs(surfaces.positions[surfaces.runs["floor"], 0] - 0.5) < 0.1).nonzero()[0]
    assert (lit[beside, 0] > lit[beside, 1] + 0.01).all()
    assert (lit[beside, 1] > lit[beside, 2] + 0.002).all()
    _, dull = transfer_of(placed(grid("floor", 2.0, 4), wall, visibility=Visibility.SHADOW), bounces=1)
    assert np.allclose(white(dull[surfaces.runs["floor"]])[:, 0], lit[:, 2], atol=1e-6)


def test_what_casts_no_shadow_blocks_nothing():
    scene = placed(quad("floor"), box("lid", (-2, -2, 1), (2, 2, 2)), visibility=Visibility.CAMERA)
    surfaces, transfer = transfer_of(scene, kind="")
    assert np.allclose(white(transfer[surfaces.runs["floor"]]), 1, atol=1e-6)


def test_shadow_falls_away_from_the_light():
    """Light from +X, and a wall on the +X side: a band-limited sun is dimmed behind the wall only."""
    scene = placed(grid("floor", 4.0, 8), box("wall", (0.9, -2, 0), (1.1, 2, 2)))
    surfaces, transfer = transfer_of(scene)
    sun = sh.evaluate(np.array([0.7, 0.0, 0.714]), 5)
    lit = transfer[surfaces.runs["floor"], 0] @ sun
    x = surfaces.positions[surfaces.runs["floor"], 0]
    # The other side has 2 m of wall behind it, which takes some of the ring of the sun's five bands.
    assert lit[np.abs(x - 0.5) < 0.1].mean() < 0.5 * lit[x < -1.9].mean()


@pytest.mark.parametrize("bounces", [0, 1])
def test_both_casters_find_the_same(bounces):
    scene = placed(grid("floor", 4.0, 4), sphere("ball", (0, 0, 0.6), 0.5, rings=6))
    results = [transfer_of(scene, kind, bounces=bounces, directions=128)[1] for kind in ("embree", "numpy")]
    assert np.abs(results[0] - results[1]).max() < 0.02  # one ray of 128 over an edge
    assert np.abs(results[0] - results[1]).mean() < 1e-4


def test_same_input_gives_the_same_bits():
    scene = placed(grid("floor", 4.0, 4), sphere("ball", (0, 0, 0.6), 0.5, rings=6))
    one, other = (transfer_of(scene, bounces=1, directions=128)[1] for _ in range(2))
    assert one.tobytes() == other.tobytes()


def test_rays_that_are_not_kept_are_traced_again_to_the_same_bits(monkeypatch):
    scene = placed(grid("floor", 4.0, 4), sphere("ball", (0, 0, 0.6), 0.5, rings=6))
    kept = transfer_of(scene, bounces=2, directions=2048)[1]
    monkeypatch.setattr(transfer_module, "_KEPT", 20000)
    assert transfer_of(scene, bounces=2, directions=2048)[1].tobytes() == kept.tobytes()


def test_progress_rises_and_a_closed_bake_stops():
    surfaces, caster = surfaces_of(placed(grid("floor", 4.0, 20), sphere("ball", (0, 0, 0.6), 0.5)))
    bake = diffuse(surfaces, caster, Sampling(bounces=1, directions=2048))
    seen = [next(bake) for _ in range(4)]
    assert all(isinstance(step, Progress) for step in seen)
    assert np.diff([step.part for step in seen]).min() > 0
    bake.close()
    with pytest.raises(StopIteration):
        next(bake)
