"""What an artist changes of the bounce: each light's strength, exclusion and map, and which objects receive it."""

from dataclasses import replace

import numpy as np
import pytest

from rebound.gpu_shaders import TECHNIQUES
from rebound.scene.data import Material, Visibility, World
from rebound.tests.support.render_scenes import EVERYTHING, Studio, box, light, ortho, quad
from rebound.tests.support.vpl_scenes import VPL, power_on_walls, still

METHODS = [technique.id.upper() for technique in TECHNIQUES]
KEY = light("SPOT", (-1.2, 0, 2), (-0.3, 0, 0), 100.0, "key")
FILL = light("POINT", (1.2, 0.5, 1), power=20.0, key="fill")
WALL = quad("wall", (0, 1.5, 0.8), (2, 0, 0), (0, 0, 0.8))
MESHES = [quad("floor", u=(2, 0, 0), v=(0, 2, 0)), box("block", (-0.4, -0.4, 0), (0.4, 0.4, 0.8)), WALL]
VIEW = ortho(24, 24, 4, (0, 0, 10))
PASSES = ("diffuse_indirect", "diffuse_direct", "glossy_indirect", "position")
RSM = {"rsm_estimator": "ALL_TEXELS"}


@pytest.fixture
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


def shot(studio, lamps, method, samples=4, **fields):
    """Passes of the block on the floor, from above."""
    settings = {**VPL, **RSM, "method": method}
    return studio.render(still(MESHES, lamps, (0.8, 0.5, 0.3), **fields), VIEW, samples, PASSES, **settings)


@pytest.mark.parametrize("method", METHODS)
def test_strength_multiplies_the_bounce_and_nothing_else(studio, method):
    plain = shot(studio, [KEY], method)
    double = shot(studio, [replace(KEY, bounce=2.0)], method)
    assert plain["diffuse_indirect"].mean() > 0
    np.testing.assert_allclose(double["diffuse_indirect"], 2 * plain["diffuse_indirect"], rtol=1e-4, atol=1e-6)
    np.testing.assert_array_equal(double["diffuse_direct"], plain["diffuse_direct"])


@pytest.mark.parametrize("method", METHODS)
def test_strength_of_one_light_leaves_the_others(studio, method):
    """Light adds up: both, the one twice, is the sum of its parts, but for noise."""
    samples = 64 if method == "VPL" else 1
    key, fill = (shot(studio, [lamp], method, samples)["diffuse_indirect"].mean() for lamp in (KEY, FILL))
    both = shot(studio, [replace(KEY, bounce=2.0), FILL], method, samples)["diffuse_indirect"].mean()
    assert both == pytest.approx(2 * key + fill, rel=0.02)


@pytest.mark.parametrize("strength", [0.5, 2.0])
def test_furnace_receives_as_much_more(studio, strength):
    """A closed room's walls receive what one bounce gives: power times albedo, times the strength."""
    lamp = light("POINT", (0, 0, 0), power=100.0, bounce=strength)
    assert power_on_walls(studio, lamp, 0.5, 1) == pytest.approx(100 * 0.5 * strength, rel=0.03)


@pytest.mark.parametrize("method", METHODS)
def test_excluded_light_gives_no_bounce_and_draws_no_map(studio, method):
    alone = shot(studio, [replace(KEY, bounce=0.0)], method)
    assert not alone["diffuse_indirect"].any()
    assert alone["diffuse_direct"].any()
    assert studio.renderer.statistics()["light_maps"] == 0
    one = shot(studio, [FILL], method)
    other = shot(studio, [replace(KEY, bounce=0.0), FILL], method)
    assert other["diffuse_indirect"].mean() == pytest.approx(one["diffuse_indirect"].mean(), rel=1e-4)


@pytest.mark.parametrize("estimator", ["DISC_EXACT", "DISC_PUBLISHED"])
def test_discs_ask_the_lights_that_bounce_and_no_others(studio, estimator, monkeypatch):
    asked = []
    fullscreen = studio.device.fullscreen

    def counted(shader, target, **given):
        asked.extend(range(given.get("pc_first_light", 0), given.get("pc_last_light", 0)))
        fullscreen(shader, target, **given)

    monkeypatch.setattr(studio.device, "fullscreen", counted)
    settings = {"method": "RSM", "rsm_estimator": estimator}
    lamps = [replace(KEY, bounce=0.0), FILL]
    found, alone = (studio.render(still(MESHES, some), VIEW, 1, PASSES, **settings) for some in (lamps, lamps[1:]))
    assert asked == [0, 0]  # rows of the table of lights, which has no others
    np.testing.assert_array_equal(found["diffuse_indirect"], alone["diffuse_indirect"])


@pytest.mark.parametrize("method", METHODS)
def test_object_that_receives_none_has_none_and_others_all(studio, method):
    """The floor and the wall around the block lose nothing."""
    apart = {"visibility": {"block": EVERYTHING | Visibility.NO_INDIRECT}}
    shiny = Material("block", (0.8,) * 3, specular=(0.04,) * 3)
    look = {"materials": (Material("floor", (0.5,) * 3), shiny, Material("wall"))}
    before, after = (shot(studio, [KEY, FILL], method, 16, **look, **more) for more in ({}, apart))
    block = np.isclose(before["position"][..., 2], 0.8)
    assert block.any() and not block.all()
    for name in ("diffuse_indirect", "glossy_indirect"):
        assert not after[name][block].any()
    assert before["diffuse_indirect"][block].any()
    assert after["diffuse_direct"][block].any(), "its lamps still light it"
    floor = before["diffuse_indirect"][~block]
    assert after["diffuse_indirect"][~block].mean() == pytest.approx(floor.mean(), rel=0.05)


def test_object_that_receives_none_shows_no_sky_and_no_emitter(studio):
    """With and without reuse, which keeps their light in other passes."""
    apart = {"visibility": {"floor": EVERYTHING | Visibility.NO_INDIRECT}}
    shown = still([MESHES[0]], [], 0.5, world=World((1.0, 1.0, 1.0)), **apart)
    for reuse in (False, True):
        found = studio.render(shown, VIEW, 2, ("combined", "environment"), **VPL, vpl_reuse=reuse)
        assert not found["combined"][8:16, 8:16, :3].any()


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_map_size_is_as_good_as_another_resolution(studio, scale):
    def texels(lamps, resolution):
        settings = {"method": "RSM", **RSM, "rsm_resolution": resolution}
        return studio.render(still(MESHES, lamps), VIEW, 1, PASSES, **settings)["diffuse_indirect"]

    fill = texels([FILL], 64)
    wanted = texels([KEY], int(64 * scale)) + fill
    np.testing.assert_allclose(texels([replace(KEY, map_scale=scale), FILL], 64), wanted, rtol=1e-4, atol=1e-7)


def test_map_size_keeps_the_level_of_virtual_lights(studio):
    found = [shot(studio, [replace(KEY, map_scale=s), FILL], "VPL", 32)["diffuse_indirect"].mean() for s in (0.5, 1, 2)]
    # The block's edges fall on other texels: as much as another resolution changes.
    assert found == pytest.approx([found[1]] * 3, rel=0.06)


@pytest.mark.parametrize("estimator", ["DISC_EXACT", "DISC_PUBLISHED"])
def test_map_size_keeps_the_level_of_the_discs(studio, estimator):
    def mean(lamp):
        settings = {"method": "RSM", "rsm_estimator": estimator, "rsm_gathers": 512, "rsm_resolution": 128}
        return studio.render(still(MESHES, [lamp, FILL]), VIEW, 4, PASSES, **settings)["diffuse_indirect"].mean()

    assert mean(replace(KEY, map_scale=0.5)) == pytest.approx(mean(KEY), rel=0.05)


def test_map_size_is_a_factor_of_the_resolution(studio):
    lamps = [replace(KEY, map_scale=2.0), replace(FILL, map_scale=0.5)]
    shot(studio, lamps, "RSM", 1)
    maps = studio.renderer._techniques["rsm"].maps
    widths = {tile.owner: maps.viewport(tile)[2] for tile in maps.tiles}
    assert widths == {"key": 128, "fill": 32}  # of 64 texels
    shot(studio, [replace(KEY, map_scale=0.5)], "RSM", 1)
    assert [maps.viewport(tile)[2] for tile in maps.tiles] == [32]


@pytest.mark.parametrize("method", METHODS)
def test_strength_redraws_its_own_maps_only(studio, method):
    def work(lamps, **fields):
        studio.gpu_scene.uploads.clear()
        before = studio.renderer.statistics()
        shot(studio, lamps, method, 1, **fields)
        after = studio.renderer.statistics()
        drawn = [int(after[name] - before.get(name, 0)) for name in ("light_maps_drawn", "shadow_maps_drawn")]
        return (*drawn, dict(+studio.gpu_scene.uploads))

    work([KEY, FILL])
    assert work([replace(KEY, bounce=1.5), FILL]) == (1, 0, {})
    assert work([replace(KEY, bounce=0.0), FILL]) == (0, 0, {})
    assert work([KEY, FILL]) == (1, 0, {})
    apart = {"visibility": {"block": EVERYTHING | Visibility.NO_INDIRECT}}
    drawn, shadows, uploads = work([KEY, FILL], **apart)
    assert (shadows, uploads) == (0, {"instances": 1})  # a table of matrices, no mesh
    hidden = {"visibility": {"block": EVERYTHING & ~Visibility.CAMERA | Visibility.NO_INDIRECT}}
    assert work([KEY, FILL], **hidden) == (0, 0, {"instances": 1})
