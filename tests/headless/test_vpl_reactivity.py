"""What virtual point lights draw and build again after an edit: only what the edit touches."""

from dataclasses import replace

import numpy as np
import pytest

from rebound.gpu_shaders.vpl.gather import COARSE_HISTORY
from rebound.scene.data import Material, World
from rebound.settings import Settings
from rebound.tests.support.render_scenes import QUICK, Studio, box, light, ortho, place, quad, scene
from rebound.tests.support.vpl_scenes import VPL, emitter, gathered, room, still

LAMPS = [light("SPOT", (x, -0.8, 2), (x, 0, 0), key=f"lamp {x}") for x in (0, 5, 10)]
MESHES = [quad("floor", (5, 0, 0), (7, 0, 0), (0, 6, 0)), box("block", (-0.2, -0.2, 0), (0.2, 0.2, 0.4)),
          quad("panel", (0, 1.4, 1), (0.2, 0, 0), (0, 0, 0.2))]  # fmt: skip
VIEW = ortho(8, 8, 2, (5, 0, 10), (5, 0, 0))


def picture(lamps=LAMPS, block_at=5.0, block=(0.1, 0.2, 0.3), radiance=0.0, sky=0.0):
    """A floor, three lamps over it, a block under one of them, a panel that may shine."""
    materials = [Material("floor"), Material("block", block), emitter(radiance)]
    matrices = {"block": place((block_at, 0, 0))}
    return scene(MESHES, lamps, materials=materials, matrices=matrices, world=World((sky,) * 3))


@pytest.fixture
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


def work(studio, shown, view=VIEW, **settings):
    """(tiles drawn, voxels built, revisions of the atlas) by a sample of this scene."""

    def counts():
        technique = studio.renderer._techniques.get("vpl")
        if technique is None:
            return np.zeros(3, int)
        return np.array([technique.sources.drawn, technique.voxels.built, technique.sources.revision])

    before = counts()
    gathered(studio, shown, view, 1, **settings)
    drawn, built, revisions = counts() - before
    return drawn, built, revisions > 0


def test_orbit_and_next_sample_draw_and_build_nothing(studio):
    lit = picture(radiance=1.0, sky=0.5)
    drawn, built, _ = work(studio, lit, vpl_bounces="MANY")
    assert (drawn, built) == (len(LAMPS) + 3, 1)  # emitters, sky and cache
    for angle in (0.0, 0.5, 1.0):
        turned = ortho(8, 8, 10, (5 + 10 * np.sin(angle), 0, 10 * np.cos(angle)), (5, 0, 0))
        assert work(studio, lit, turned, vpl_bounces="MANY") == (0, 0, False)
        assert work(studio, lit, turned, vpl_bounces="MANY", seed=3) == (0, 0, False)


def test_moved_light_draws_its_map_and_builds_no_voxels(studio):
    work(studio, picture())
    matrix = LAMPS[1].world_from_light.copy()
    matrix[0, 3] += 0.1
    moved = [LAMPS[0], replace(LAMPS[1], world_from_light=matrix), LAMPS[2]]
    assert work(studio, picture(moved)) == (1, 0, True)
    dimmed = [replace(moved[0], power=(1.0, 1.0, 1.0)), *moved[1:]]
    assert work(studio, picture(dimmed)) == (1, 0, True)
    assert work(studio, picture(dimmed[:2]))[:2] == (0, 0)


def test_recoloured_object_draws_maps_that_see_it_and_builds_no_voxels(studio):
    work(studio, picture())
    assert work(studio, picture(block=(0.9, 0.2, 0.3))) == (1, 0, True)


def test_moved_object_builds_voxels_once(studio):
    work(studio, picture())
    assert work(studio, picture(block_at=5.2)) == (1, 1, True)
    assert work(studio, picture(block_at=5.2)) == (0, 0, False)
    assert work(studio, picture(block_at=10))[:2] == (2, 1)  # where it was, where it is


def test_sky_and_emitters_come_and_go_without_voxels(studio):
    work(studio, picture(sky=0.5, radiance=1.0))
    assert work(studio, picture(sky=0.7, radiance=1.0))[1] == 0
    assert work(studio, picture(sky=0.7, radiance=2.0))[1] == 0
    assert work(studio, picture())[1] == 0
    found, _ = gathered(studio, picture(lamps=[]), VIEW, 1, "diffuse_direct")
    assert not found.any()


def test_edited_scene_equals_one_shown_anew(studio, headless_device):
    """One bounce keeps nothing of what was; the maps' places in the atlas do not matter but to the noise."""
    last = picture(LAMPS[1:], 9.5, (1.0, 0.0, 0.0), sky=0.2)
    for shown in (picture(), picture(LAMPS[:2], 2.0), picture(sky=0.5, radiance=3.0), last):
        work(studio, shown)
    view, names = ortho(48, 8, 2, (5, 0, 10), (5, 0, 0)), ("diffuse_indirect", "diffuse_direct")
    kept = studio.render(last, view, 8, names, **VPL)
    fresh = Studio(headless_device)
    anew = fresh.render(last, view, 8, names, **VPL)
    fresh.free()
    for name in names:
        assert anew[name].mean() > 0
        assert kept[name].mean() == pytest.approx(anew[name].mean(), rel=0.02)


def test_cache_follows_a_light_that_went_out(studio):
    lit = picture()
    gathered(studio, lit, VIEW, 4, vpl_bounces="MANY")
    one, _ = gathered(studio, picture(LAMPS[:1]), VIEW, 8, vpl_bounces="MANY")
    fresh = Studio(studio.device)
    anew, _ = gathered(fresh, picture(LAMPS[:1]), VIEW, 8, vpl_bounces="MANY")
    fresh.free()
    # What went out is forgotten, but for what the first few samples still had in them.
    assert one.mean() == pytest.approx(anew.mean(), rel=0.05)
    dark, _ = gathered(studio, picture([]), VIEW, 1, vpl_bounces="MANY")
    assert not dark.any()


def test_still_viewport_keeps_nothing_of_a_far_brighter_light(studio):
    """As a viewport does: one frame, restarted by an edit, until it has its samples and is not provisional."""
    view = ortho(8, 8, 0.5, (0.5, 0, 0.9), (0.5, 0, -1))
    settings = Settings.defaults(**{**QUICK, **VPL, "vpl_bounces": "MANY", "vpl_reuse": True, "vpl_cache_rows": 4})
    frame = studio.renderer.begin(view, ("combined",))

    def mean(power):
        studio.show(still([room()], [light("POINT", (-0.5, 0.2, 0.1), power=power)], 0.5))
        studio.renderer.restart(frame)
        while frame.samples < 16 or frame.provisional:
            for _ in studio.renderer.sample(frame, studio.gpu_scene, view, settings):
                pass
        return studio.renderer.read(frame, "combined")[..., :3].mean()

    bright, dim = mean(300.0), mean(1.0)
    studio.renderer.free_frame(frame)
    # Of the old light 0.02 % are left in the cache: 6 % of the new. The means of before would be seven times the new.
    assert dim * 300 == pytest.approx(bright, rel=0.1)


def test_floor_that_is_glossy_again_knows_nothing_of_what_it_reflected_before(studio):
    settings = Settings.defaults(**{**QUICK, **VPL, "vpl_reuse": True})
    frame = studio.renderer.begin(VIEW, ("glossy_direct",))

    def reflected(metallic, sky):
        shown = picture([], sky=sky)
        floor = Material("floor", metallic=metallic, roughness=0.5)
        studio.show(replace(shown, materials=(floor, *shown.materials[1:])))
        studio.renderer.restart(frame)
        for _ in studio.renderer.sample(frame, studio.gpu_scene, VIEW, settings):
            pass
        return studio.renderer.read(frame, "glossy_direct").mean()

    bright, dull, dim = reflected(1.0, 100.0), reflected(0.0, 1.0), reflected(1.0, 1.0)
    studio.renderer.free_frame(frame)
    assert dull == 0.0
    assert 100.0 * dim == pytest.approx(bright, rel=0.1)


def test_picture_without_lights_is_waited_for_once(studio):
    """The only lamp moves and is deleted while the picture still settles."""
    settings = Settings.defaults(**{**QUICK, **VPL, "vpl_reuse": True})
    frame = studio.renderer.begin(VIEW, ("combined",))
    for lamps in (LAMPS[:1], LAMPS[1:2], []):
        studio.show(picture(lamps))
        studio.renderer.restart(frame)
        for _ in studio.renderer.sample(frame, studio.gpu_scene, VIEW, settings):
            pass
    assert not frame.provisional
    studio.renderer.free_frame(frame)


def test_moving_view_gathers_coarsely_and_sharpens_at_rest(studio):
    """A picture in haste is not summed with those that follow, yet they know what it found."""
    frame = studio.renderer.begin(VIEW, ("combined",))
    studio.show(picture())

    def sample(at, restart, **changed):
        """(gathering pixels, whether the picture is in haste, its samples, what its means stand for) after one."""
        if restart:
            studio.renderer.restart(frame)
        view = ortho(8, 8, 2, (5 + at, 0, 10), (5 + at, 0, 0))
        settings = Settings.defaults(**{**QUICK, **VPL, "vpl_reuse": True, **changed})
        for _ in studio.renderer.sample(frame, studio.gpu_scene, view, settings):
            pass
        memory = studio.renderer._techniques["vpl"].gathering._memory
        means = studio.device.read(memory.new["history"])[..., 3]
        return memory.size, frame.provisional, frame.samples, float(means.mean())

    assert sample(0.0, restart=False)[:3] == ((8, 8), False, 1)
    for step in range(1, 8):
        assert sample(0.01 * step, restart=True)[:3] == ((4, 4), True, 1)
    size, in_haste, samples, known = sample(0.07, restart=False)
    assert (size, in_haste, samples) == ((8, 8), False, 1)
    assert 2.0 < known <= 1.0 + COARSE_HISTORY
    assert sample(0.07, restart=False)[:3] == ((8, 8), False, 2)
    studio.show(picture(block_at=5.1))
    assert sample(0.07, restart=True)[:2] == ((4, 4), True)
    assert sample(0.1, restart=True, vpl_coarser_in_motion=False)[:2] == ((8, 8), False)
    assert sample(0.2, restart=True, vpl_coarser_in_motion=False)[:2] == ((8, 8), False)
    assert sample(0.3, restart=True, vpl_scale="EIGHTH")[0] == (1, 1)
    studio.renderer.free_frame(frame)


def test_cache_gathers_in_all_rows_whatever_their_number_at_once(studio):
    gathered(studio, picture(), VIEW, 12, vpl_bounces="MANY", vpl_reuse=True, vpl_cache_rows=48)
    sums = studio.device.read(studio.renderer._techniques["vpl"].cache._sums[0][0])[..., 3]
    rounds = sums.max(axis=1)
    assert rounds.min() > 0.5 * rounds.max()


def test_cache_forgets_when_its_points_are_others(studio):
    """A wall comes into a lit room, with few updates of the cache a sample."""
    lamp = light("POINT", (-0.5, 0.2, 0.1))
    wall = box("wall", (-0.05, -1, -1), (0.05, 1, 1))
    view = ortho(8, 8, 0.5, (0.5, 0, 0.9), (0.5, 0, -1))
    gathered(studio, still([room()], [lamp], 0.7), view, 4, vpl_bounces="MANY")
    dark, _ = gathered(studio, still([room(), wall], [lamp], 0.7), view, 8, vpl_bounces="MANY", vpl_cache_rows=4)
    assert dark.mean() < 1e-3


def test_resolution_of_voxels_and_maps_may_change_between_samples(studio):
    for changed in ({"vpl_voxels": 64}, {"vpl_resolution": 96}, {"vpl_pool": 70}):
        found, _ = gathered(studio, picture(radiance=1.0), VIEW, 1, **{**VPL, "vpl_bounces": "MANY", **changed})
        assert np.isfinite(found).all() and found.any()
