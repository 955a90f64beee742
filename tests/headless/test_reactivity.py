"""What is uploaded and drawn again after an edit: only what the edit touches."""

from dataclasses import replace

import numpy as np
import pytest

from rebound.scene.data import Material
from rebound.tests.support.render_scenes import Studio, box, light, ortho, place, quad, scene

COUNT, APART = 8, 5.0
VIEW = ortho(8, 8, 10)
LAMPS = [light("SPOT", (i * APART, 0, 2), (i * APART, 0, 0), key=f"lamp {i}", radius=0.1) for i in range(COUNT)]
FLOORS = [quad(f"floor {i}", (i * APART, 0, 0)) for i in range(COUNT)]
BOX = box("box", (-0.2, -0.2, 0), (0.2, 0.2, 0.4))
MATERIALS = [Material(f"floor {i}") for i in range(COUNT)] + [Material("box", (0.1, 0.2, 0.3))]


def picture(lamps=LAMPS, box_at=3, box_color=(0.1, 0.2, 0.3)):
    """A row of floors, each under a lamp of its own, and a box on one of them."""
    materials = MATERIALS[:-1] + [Material("box", box_color)]
    matrices = {"box": place((box_at * APART, 0, 0))}
    return scene([*FLOORS, BOX], lamps, materials=materials, matrices=matrices)


@pytest.fixture
def studio(headless_device):
    """Every map of the scene drawn, nothing counted yet."""
    studio = Studio(headless_device)
    work(studio, picture())
    studio.gpu_scene.uploads.clear()
    yield studio
    studio.free()


def work(studio, shown, view=VIEW, **settings):
    """(maps of bounce drawn, shadow maps drawn, uploads) by a sample of this scene."""
    before = studio.renderer.statistics()
    studio.gpu_scene.uploads.clear()
    studio.render(shown, view, 1, **{"soft_shadows": "FILTERED", **settings})
    after = studio.renderer.statistics()
    drawn = [int(after[name] - before.get(name, 0)) for name in ("light_maps_drawn", "shadow_maps_drawn")]
    return (*drawn, dict(studio.gpu_scene.uploads))


def moved(lamp, x):
    matrix = lamp.world_from_light.copy()
    matrix[0, 3] += x
    return replace(lamp, world_from_light=matrix)


def test_nothing_changes_and_nothing_is_drawn_again(studio):
    assert work(studio, picture()) == (0, 0, {})


def test_new_view_uploads_and_redraws_nothing(studio):
    for angle in (0.5, 1.0, 2.0):
        turned = ortho(8, 8, 10, (10 * np.sin(angle), 0, 10 * np.cos(angle)))
        assert work(studio, picture(), turned) == (0, 0, {})


def test_moved_light_redraws_its_own_maps_only(studio):
    lamps = [*LAMPS[:2], moved(LAMPS[2], 0.1), *LAMPS[3:]]
    assert work(studio, picture(lamps)) == (1, 1, {})


def test_dimmed_light_redraws_its_bounce_but_no_shadow(studio):
    lamps = [replace(LAMPS[0], power=(1.0, 1.0, 1.0)), *LAMPS[1:]]
    assert work(studio, picture(lamps)) == (1, 0, {})


def test_added_and_removed_light_draw_one_map_and_none(studio):
    assert work(studio, picture(LAMPS[:-1])) == (0, 0, {})
    assert work(studio, picture()) == (1, 1, {})
    assert work(studio, picture(LAMPS[::-1])) == (0, 0, {})  # in another order


def test_moved_object_redraws_the_maps_that_see_it(studio):
    assert work(studio, picture(box_at=3.05)) == (1, 1, {"instances": 1})
    assert work(studio, picture(box_at=5)) == (2, 2, {"instances": 1})  # where it was, where it is
    assert work(studio, picture(box_at=5.5)) == (1, 1, {"instances": 1})  # out of the light


def test_recoloured_object_uploads_materials_and_redraws_bounce_that_sees_it(studio):
    assert work(studio, picture(box_color=(0.9, 0.2, 0.3))) == (1, 0, {"materials": 1})


def test_another_sample_or_seed_redraws_nothing(studio):
    for seed in range(3):
        assert work(studio, picture(), seed=seed) == (0, 0, {})


def test_sampled_shadows_redraw_sized_lights_every_sample_and_others_never(studio):
    small = [replace(lamp, radius=0.0) for lamp in LAMPS[1:]]
    work(studio, picture([LAMPS[0], *small]), soft_shadows="SAMPLED")
    before = studio.renderer.statistics()["shadow_maps_drawn"]
    studio.render(picture([LAMPS[0], *small]), VIEW, 3, soft_shadows="SAMPLED")
    # Sample 0 of this picture, and the samples 1 and 2: sample 0 was the last one drawn before it.
    assert studio.renderer.statistics()["shadow_maps_drawn"] - before == 2


def test_map_that_was_kept_equals_one_drawn_anew(studio, headless_device):
    """After a row of edits the picture is the one that a new renderer makes."""
    lamps = [*LAMPS[:2], moved(LAMPS[2], 0.3), *LAMPS[4:]]
    for shown in (picture(box_at=2.1), picture(LAMPS[3:]), picture(lamps, box_at=5.02)):
        work(studio, shown)
    last = picture(lamps, box_at=2.1, box_color=(1, 0, 0))
    view = ortho(80, 8, 4, (15, 0, 10), (15, 0, 0))
    passes = ["combined", "diffuse_indirect"]
    kept = studio.render(last, view, 2, passes, soft_shadows="FILTERED")
    fresh = Studio(headless_device)
    anew = fresh.render(last, view, 2, passes, soft_shadows="FILTERED")
    fresh.free()
    for name in passes:
        np.testing.assert_allclose(kept[name], anew[name], rtol=1e-5, atol=1e-7)  # tiles lie elsewhere in the atlas
