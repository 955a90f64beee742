"""Bounced light does not pass walls, however thin; and many lights are one pool: same light, same work."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from rebound.scene.data import World
from rebound.tests.support.render_scenes import Studio, box, light, ortho, quad
from rebound.tests.support.vpl_scenes import GREY, VPL, emitter, gathered, room, still

LAMP = light("POINT", (-0.5, 0.2, 0.1))
DOWN = ortho(64, 16, 0.5, (0, 0, 0.9), (0, 0, -1))  # the floor, 2 m wide, both chambers
VOXEL = 2.0 / VPL["vpl_voxels"]
WALLS = {
    "10 cm": box("wall", (-0.05, -1, -1), (0.05, 1, 1)),
    "2 cm": box("wall", (-0.01, -1, -1), (0.01, 1, 1)),
    "a voxel": box("wall", (-VOXEL / 2, -1, -1), (VOXEL / 2, 1, 1)),
    "no thickness": quad("wall", (0.003, 0, 0), (0, 1, 0), (0, 0, 1)),
    "no thickness, aslant": quad("wall", (0, 0, 0), (0.03, 1, 0), (0, 0, 1)),
}


@pytest.fixture
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


def leak(studio, shown, samples=16, name="diffuse_indirect", **settings) -> float:
    """Light on the dark chamber's floor, two voxels from the wall and beyond, in parts of that of the lit one's."""
    found, points = gathered(studio, shown, DOWN, samples, name, **settings)
    from_wall = points[..., 0] - 0.03 * (points[..., 1] if "aslant" in str(shown.instances[-1].key) else 0.0)
    dark, lit = found[from_wall > 0.05 + 2 * VOXEL], found[from_wall < -0.05 - 2 * VOXEL]
    assert len(dark) > 300 and lit.mean() > 0
    return dark.mean() / lit.mean()


@pytest.mark.parametrize("bounces", ["ONE", "MANY"])
@pytest.mark.parametrize("name", WALLS)
def test_no_bounce_passes_a_wall(studio, name, bounces):
    shown = still([room(), WALLS[name]], [LAMP], 0.7)
    assert leak(studio, shown, 8, vpl_bounces=bounces) < 1e-3


def test_bounce_passes_a_wall_with_occlusion_off(studio):
    shown = still([room(), WALLS["2 cm"]], [LAMP], 0.7)
    assert leak(studio, shown, vpl_occlusion="NONE") > 0.1


def test_light_of_an_emitter_passes_no_wall(studio):
    lamp = quad("lamp", (-0.5, 0, 0.5), (0.2, 0, 0), (0, -0.2, 0))
    shown = still([room(), lamp, WALLS["2 cm"]], materials=[GREY, emitter(5.0), GREY])
    for bounces in ("ONE", "MANY"):
        assert leak(studio, shown, 8, "diffuse_direct", vpl_bounces=bounces) < 1e-3
        assert leak(studio, shown, 8, "diffuse_indirect", vpl_bounces=bounces) < 1e-3


def test_closed_room_is_dark_under_the_brightest_sky(studio):
    outer = box("outer", (-1.05, -1.05, -1.05), (1.05, 1.05, 1.05))
    shown = still([room(), outer], world=World((1.0, 1.0, 1.0)))
    for bounces in ("ONE", "MANY"):
        for name in ("diffuse_direct", "diffuse_indirect"):
            found, _ = gathered(studio, shown, DOWN, 8, name, vpl_bounces=bounces)
            assert found.mean() < 1e-3


def test_upsampling_lets_no_light_round_an_edge(studio):
    """Coarse pixels on both sides of a wall; a picture with both chambers' floors in it."""
    shown = still([room(), WALLS["no thickness"]], [LAMP], 0.7)
    for scale in ("HALF", "QUARTER", "EIGHTH"):
        found, points = gathered(studio, shown, DOWN, 8, vpl_scale=scale)
        reach = {"HALF": 2, "QUARTER": 4, "EIGHTH": 8}[scale] * 2.0 / 64
        far = points[..., 0] > reach + 2 * VOXEL
        assert found[far].mean() < 1e-3 * found[points[..., 0] < 0].mean()


# --- many lights -----------------------------------------------------------------------------------------------------

MANY = 64
BLOCK = box("block", (-0.4, -0.4, -1), (0.4, 0.4, -0.2))
SPOT = light("SPOT", (-0.3, -0.2, 0.8), (0.2, 0.1, -1), spot_angle=1.0, spot_blend=0.3)
PARTS = [
    replace(SPOT, key=f"part {i}", name=f"part {i}", power=tuple(p / MANY for p in SPOT.power)) for i in range(MANY)
]
VIEW = ortho(16, 16, 1.9, (0, 0, 0.9), (0, 0, -1))


def split(lamps):
    return still([room(), BLOCK], lamps, 0.7)


def test_light_split_into_many_bounces_as_one(studio):
    one, _ = gathered(studio, split([SPOT]), VIEW, 64)
    many, _ = gathered(studio, split(PARTS), VIEW, 64)
    assert many.mean() == pytest.approx(one.mean(), rel=0.02)  # noise of each mean: about 0.6 %
    # Rays ask one of the lights, which all show the same: each answers for a 64th, and the pool for the rest.
    difference = np.sqrt(np.mean((many - one) ** 2)) / one.mean()
    halves = [gathered(studio, split([SPOT]), VIEW, 64, seed=seed)[0] for seed in (1, 2)]
    noise = np.sqrt(np.mean((halves[0] - halves[1]) ** 2)) / one.mean()
    assert difference < 2.0 * noise


def test_moving_one_of_many_lights_redraws_its_map_alone(headless_device):
    studio = Studio(headless_device)
    gathered(studio, split(PARTS), VIEW, 1)
    before = studio.renderer.statistics()["light_maps_drawn"]
    matrix = PARTS[7].world_from_light.copy()
    matrix[0, 3] += 0.05
    gathered(studio, split([*PARTS[:7], replace(PARTS[7], world_from_light=matrix), *PARTS[8:]]), VIEW, 2)
    after = studio.renderer.statistics()
    assert after["light_maps"] == MANY and after["light_maps_drawn"] - before == 1
    studio.free()


def passes_of_a_sample(studio, shown, monkeypatch, **settings):
    """How often each of the technique's full-screen passes ran, and the size of every one."""
    gathered(studio, shown, VIEW, 1, **settings)  # maps, voxels and the cache's beginning
    passes = Counter()
    original = studio.device.fullscreen

    def counting(shader, target, viewport=None, **given):
        passes[shader.name, tuple(viewport or target.size)[-2:]] += shader.name.startswith("vpl")
        original(shader, target, viewport=viewport, **given)

    monkeypatch.setattr(studio.device, "fullscreen", counting)
    gathered(studio, shown, VIEW, 1, **settings)
    monkeypatch.undo()
    return +passes


@pytest.mark.parametrize("bounces", ["ONE", "MANY"])
def test_work_of_a_sample_knows_no_lights(headless_device, monkeypatch, bounces):
    found = []
    for lamps in ([SPOT], PARTS):
        studio = Studio(headless_device)
        found.append(passes_of_a_sample(studio, split(lamps), monkeypatch, vpl_bounces=bounces))
        studio.free()
    assert found[0] == found[1]
    names = [name for name, _ in found[0]]
    assert "vpl_pool" in names and any("vpl_gather" in name for name in names)
    assert "vpl_block_strength" not in names  # strengths are summed only after a map changed


def test_power_in_one_of_many_lights_is_found(studio):
    """63 dim ones and a bright one: half of the pool, at least, is where the light is."""
    lamps = [replace(p, power=(1e-4,) * 3) for p in PARTS[:-1]] + [replace(PARTS[-1], power=SPOT.power)]
    one, _ = gathered(studio, split([SPOT]), VIEW, 96)
    found, _ = gathered(studio, split(lamps), VIEW, 96)
    assert found.mean() == pytest.approx(one.mean(), rel=0.03)  # noise of each mean: about 1 %
