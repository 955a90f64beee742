"""What virtual point lights shine on a surface: the sky, emitters, one bounce and many, against integrals."""

import math

import numpy as np
import pytest

from rebound.device import Shader
from rebound.gpu_shaders.vpl import MOST_WARM_UP
from rebound.scene.data import Material, World
from rebound.tests.support.render_scenes import Studio, box, light, ortho, perspective, quad, sphere
from rebound.tests.support.vpl_scenes import (
    BLACK,
    GREY,
    emitter,
    form_factor,
    gathered,
    power_on_walls,
    room,
    seen_part,
    still,
)

SKY = World((1.0, 1.0, 1.0))
FRONT = ortho(16, 16, 0.9, (0, -3, 0.5), (0, 0, 0.5), up=(0, 0, 1))
UPRIGHT = quad("wall", (0, 0, 0.5), (0.5, 0, 0), (0, 0, 0.5))  # faces -y
LAMP = light("POINT", (0.3, -0.2, 0.4))


@pytest.fixture(scope="module")
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


# --- functions -------------------------------------------------------------------------------------------------------


FORM = """
struct Settings { float bound; float lobe; };
const Settings vpl_frame = Settings(BOUND, 0.0);
#include "vpl/vpl_form_lib.glsl"
void main()
{
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 lamp = texelFetch(input_tx, at, 0);
  vec3 facing = texelFetch(input_tx, at + ivec2(0, 1), 0).xyz;
  vec3 P = texelFetch(input_tx, at + ivec2(0, 2), 0).xyz;
  out_value = vec4(vpl_form(lamp.xyz, lamp.w, facing, P, texelFetch(input_tx, at + ivec2(0, 3), 0).xyz));
}
"""


def form(device, bound, lamp, area, facing, at, normal):
    """vpl_form() of n pairs."""
    count, path = len(lamp), "test/form_frag.glsl"
    rows = [np.concatenate((lamp, area), 1), *(np.pad(x, ((0, 0), (0, 1))) for x in (facing, at, normal))]
    sent = device.texture((count, 4), "RGBA32F", np.stack(rows).astype(np.float32))
    shader = Shader(
        f"form_{bound:.0f}",
        fragment=path,
        files={path: FORM.replace("BOUND", f"{bound:.1f}")},
        outputs={"out_value": "VEC4"},
        samplers={"input_tx": "FLOAT_2D"},
    )
    result = device.texture((count, 1), "RGBA32F")
    device.fullscreen(shader, device.target([result]), input_tx=sent)
    return device.read(result)[0, :, 0].astype(np.float64)


@pytest.mark.parametrize("bound", [1.0, 0.0])
def test_form_is_that_of_a_disc_or_of_a_point(headless_device, bound):
    rng = np.random.default_rng(3)
    lamp, at = rng.normal(size=(2, 256, 3))
    at[:3] = lamp[:3] + ((0, 0, 0), (1e-4, 0, 0), (0, 0, 1e-6))
    facing, normal = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in rng.normal(size=(2, 256, 3)))
    area = rng.uniform(1e-4, 1.0, (256, 1))
    found = form(headless_device, bound, lamp, area, facing, at, normal)
    d = lamp - at
    squared = (d * d).sum(1)
    cosines = np.maximum((d * normal).sum(1), 0) * np.maximum(-(d * facing).sum(1), 0)
    expected = cosines / np.maximum(squared * (squared + bound * area[:, 0] / math.pi), 1e-30)
    np.testing.assert_allclose(found[3:], expected[3:], rtol=1e-3, atol=1e-9)
    assert (expected > 0).sum() > 40 and np.isfinite(found).all()
    assert bound == 0 or (found <= math.pi / area[:, 0] * 1.001).all()  # irradiance / pi of at most its radiance


RESERVOIR = """
#include "lib/sampling_lib.glsl"
#include "vpl/vpl_lib.glsl"
void main()
{
  Reservoir r = Reservoir(0, 0.0, 0.0, 0.0);
  float u = (gl_FragCoord.x - 0.5 + 128.0 * (gl_FragCoord.y - 0.5)) / 16384.0;
  float weights[6] = float[6](0.5, 0.0, 2.0, 1.0, 0.25, 0.25);
  for (int i = 0; i < 6; i++) {
    reservoir_offer(r, i + 1, weights[i], 10.0 * weights[i], u);
  }
  out_value = vec4(float(r.id), r.sum, r.target, u);
}
"""


def test_reservoir_keeps_each_in_proportion_and_its_number_random(headless_device):
    path = "test/reservoir_frag.glsl"
    shader = Shader("reservoir", fragment=path, files={path: RESERVOIR}, outputs={"out_value": "VEC4"})
    result = headless_device.texture((128, 128), "RGBA32F")
    headless_device.fullscreen(shader, headless_device.target([result]))
    chosen, total, target, rest = headless_device.read(result).reshape(-1, 4).T.astype(np.float64)
    weights = np.array([0.5, 0, 2, 1, 0.25, 0.25])
    part = np.bincount(chosen.astype(int) - 1, minlength=6) / len(chosen)
    np.testing.assert_allclose(part, weights / 4, atol=1e-3)  # u runs through [0, 1) evenly: no chance in it
    assert (total == 4).all()
    np.testing.assert_array_equal(target, 10 * weights[chosen.astype(int) - 1])
    for index in (1, 3, 4, 5, 6):
        quarters = np.histogram(rest[chosen == index], 4, (0, 1))[0] / (chosen == index).sum()
        np.testing.assert_allclose(quarters, 0.25, atol=0.02)


# --- the sky ---------------------------------------------------------------------------------------------------------

CONVEX = {
    "plane": ([quad("plane")], ortho(16, 16, 1.9)),
    "sphere": ([sphere("sphere", radius=0.7)], ortho(16, 16, 1.2, (0, -3, 1), (0, 0, 0))),
    "box": ([box("box", (-0.5,) * 3, (0.5,) * 3)], ortho(16, 16, 1.2, (-3, -2, 2), (0, 0, 0))),
}


@pytest.mark.parametrize("name", CONVEX)
def test_convex_thing_under_a_uniform_sky_receives_its_radiance(studio, name):
    meshes, view = CONVEX[name]
    shown = still(meshes, world=World((1.0, 1.0, 1.0)))
    # A ray that grazes a box's rim meets its voxels: half a percent.
    found, _ = gathered(studio, shown, view, name="diffuse_direct")
    assert np.nanmean(found) == pytest.approx(1.0, abs=0.01)  # noise of the mean: 0.2 %
    assert not np.nansum(gathered(studio, shown, view, 4, vpl_bounces="MANY")[0]) > 0


def test_black_ground_hides_its_part_of_the_sky(studio):
    ground = quad("ground", (0, -1.25, 0), (1.25, 0, 0), (0, 1.25, 0))
    shown = still([ground, UPRIGHT], materials=[BLACK, GREY], world=SKY)
    found, points = gathered(studio, shown, FRONT, 64, "diffuse_direct")
    expected = 1 - form_factor(points, (0, -1, 0), (0, -1.25, 0), (1.25, 0, 0), (0, 1.25, 0))
    assert expected.mean() < 0.75
    # The ground's rim ends up to half a voxel late, and a ray starts a voxel off its own surface: 1 %.
    assert found.mean() == pytest.approx(expected.mean(), rel=0.02)
    rows = found.mean(1) / expected.mean(1)
    assert np.abs(rows - 1).max() < 0.06  # noise of a row: 1.5 %


@pytest.mark.parametrize("half", [5.0, 500.0])
def test_ground_to_the_horizon_hides_half_of_the_sky(studio, half):
    ground = quad("ground", u=(half, 0, 0), v=(0, half, 0))
    block = box("block", (-0.5, 0, 0), (0.5, 1, 1))
    shown = still([ground, block], materials=[BLACK, GREY], world=SKY)
    found, _ = gathered(studio, shown, FRONT, 16, "diffuse_direct")
    assert found.mean() == pytest.approx(0.5, abs=0.08)  # by its form factor 0.551 at 5 m; noise of the mean 2 %


@pytest.mark.parametrize("half", [5.0, 40.0])
def test_ground_to_the_horizon_bounces_up(studio, half):
    ground = quad("ground", u=(half, 0, 0), v=(0, half, 0))
    block = box("block", (-0.5, 0, 0), (0.5, 1, 1))
    shown = still([ground, block], [light("SUN", (0, 0, 5), power=math.pi)])
    found, points = gathered(studio, shown, FRONT, 32, vpl_resolution=128)
    expected = 0.5 * form_factor(points, (0, -1, 0), (0, -half / 2, 0), (half, 0, 0), (0, half / 2, 0))
    assert found[4:].mean() == pytest.approx(expected[4:].mean(), rel=0.05)


@pytest.mark.parametrize("half", [5.0, 40.0])
def test_ground_to_the_horizon_sends_the_sky_back(studio, half):
    """By the cache: far from all else it has points and cells of its own."""
    ground = quad("ground", u=(half, 0, 0), v=(0, half, 0))
    block = box("block", (-0.5, 0, 0), (0.5, 1, 1))
    shown = still([ground, block], world=SKY)
    found, points = gathered(studio, shown, FRONT, 16)
    expected = 0.5 * form_factor(points, (0, -1, 0), (0, -half / 2, 0), (half, 0, 0), (0, half / 2, 0))
    assert found[4:].mean() == pytest.approx(expected[4:].mean(), rel=0.1)  # the block hides some sky from the ground


# --- emitters --------------------------------------------------------------------------------------------------------

FLOOR = quad("floor")
PANELS = {  # half its side, height, tolerance of the mean
    "small": (0.05, 0.5, 0.02),
    "large": (0.5, 0.5, 0.02),
    "near": (0.5, 0.2, 0.02),
}


@pytest.mark.parametrize("name", PANELS)
def test_emitter_shines_on_a_floor_by_its_form_factor(studio, name):
    side, height, tolerance = PANELS[name]
    lamp = (0, 0, height), (side, 0, 0), (0, -side, 0)
    shown = still([FLOOR, quad("lamp", *lamp)], materials=[GREY, emitter(2.0)])
    found, points = gathered(studio, shown, ortho(16, 16, 1.8, (0, 0, height - 0.01)), 24, "diffuse_direct")
    expected = 2.0 * form_factor(points, (0, 0, 1), *lamp)
    assert found.mean() == pytest.approx(expected.mean(), rel=tolerance)
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.2 * expected.mean()  # noise, and half a voxel at its rim


def test_large_emitter_that_touches_a_wall_is_calm_and_a_little_dark(studio):
    panel = (0, -1, 0), (1, 0, 0), (0, 1, 0)
    shown = still([UPRIGHT, quad("panel", *panel)], materials=[GREY, emitter(1.0)])
    found, points = gathered(studio, shown, FRONT, 32, "diffuse_direct")
    expected = form_factor(points, (0, -1, 0), *panel)
    # Some of a ray's hits lie in a cell whose point is farther than a cell away, and give nothing.
    assert 0.95 * expected.mean() < found.mean() < 1.01 * expected.mean()
    assert np.abs(found / expected - 1).mean() < 0.1
    assert found.max() < 1.0  # of radiance 1 no more can come


# --- bounces ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("albedo", [0.3, 0.9])
def test_light_of_a_closed_room_lands_on_its_walls_once(studio, albedo):
    assert power_on_walls(studio, LAMP, albedo) == pytest.approx(100 * albedo, rel=0.01)


# What is missing: corners, within a voxel of which the cache is not found, about half a percent a bounce at 128 voxels;
# and in bright rooms what the cache has not gathered yet.
@pytest.mark.parametrize(("albedo", "least"), [(0.3, 0.98), (0.7, 0.96), (0.9, 0.9)])
def test_light_of_a_closed_room_goes_on_and_none_is_made(studio, albedo, least):
    lamp = light("POINT", (0, 0, 0))  # all walls are alike
    found = power_on_walls(studio, lamp, albedo, 1, vpl_bounces="MANY") / (100 * albedo / (1 - albedo))
    assert least < found < 1.01


INSIDE = {"nothing": [], "block": [box("block", (-0.4, -0.4, -1), (0.4, 0.4, -0.2))]}


# In a closed place of one radiance everything receives the same from everywhere, whatever stands in it. What is missing
# are rays whose hit finds no point in the index of emitters or of the cache: more of them beside edges.
@pytest.mark.parametrize(("inside", "direct", "many"), [("nothing", 0.95, 0.92), ("block", 0.9, 0.82)])
def test_furnace_is_of_one_brightness(studio, inside, direct, many):
    glowing = Material("glowing", (0.5, 0.5, 0.5), emission=(1.0, 1.0, 1.0))
    meshes = [room(), *INSIDE[inside]]
    shown = still(meshes, materials=[glowing] * len(meshes))
    view = perspective(16, 16, 100, (-0.9, -0.9, 0.9), (0, 0, -0.3))
    for name, least in (("diffuse_direct", direct), ("diffuse_indirect", many)):
        found, _ = gathered(studio, shown, view, 8, name, vpl_bounces="MANY")
        assert least < found.mean() < 1.01, name


def test_white_room_grows_by_a_bounce_a_round_at_most(studio):
    lamp, rounds = light("POINT", (0, 0, 0)), MOST_WARM_UP
    found = power_on_walls(studio, lamp, 1.0, 1, 2, vpl_bounces="MANY")
    assert 0.5 * rounds * 100 < found < (rounds + 3) * 100


# --- against a gather with exact visibility --------------------------------------------------------------------------

PATCH = (0, 0, 0), (0.5, 0, 0), (0, 0.5, 0)
SHIELD = (1, 0, 0.3), (0, 0.3, 0), (0, 0, 0.3)
WALL_VIEW = ortho(16, 16, 1.8, (0, 0, 1.5), (1.5, 0, 1.5), up=(0, 0, 1))


def test_error_against_an_exact_gather_halves_with_four_times_the_samples(studio):
    wall = quad("wall", (1.5, 0, 1.5), (0, 0, 1), (0, 1, 0))
    shown = still([quad("patch", *PATCH), quad("shield", *SHIELD), wall], [light("SUN", (0, 0, 5), power=math.pi)])
    errors = []
    for samples in (4, 16, 64):
        found, points = gathered(studio, shown, WALL_VIEW, samples, vpl_candidates=4)
        expected = 0.5 * seen_part(points, (-1, 0, 0), PATCH, SHIELD)
        errors.append(np.sqrt(np.mean((found - expected) ** 2)))
    assert found.mean() == pytest.approx(expected.mean(), rel=0.015)
    open_view = 0.5 * form_factor(points, (-1, 0, 0), *PATCH)
    assert expected.mean() < 0.9 * open_view.mean()  # the shield matters
    assert errors[1] < 0.65 * errors[0] and errors[2] < 0.65 * errors[1]


# --- wide lights -----------------------------------------------------------------------------------------------------


def test_a_wide_lights_bounce_is_that_of_its_parts(studio):
    """A window as wide as its wall: sent from its centre alone, its bounce is up to 18 % wrong beside it."""
    side, parts = 1.6, 6
    beside = ortho(16, 16, 1.8, (0, 0, 0), (1, 0, 0), up=(0, 0, 1))

    def lamp(x, z, size, power, key):
        return light("AREA", (x, 0.9, z), (x, 0.0, z), power, key, area_size=(size, size))

    def bounce(lights):
        found, _ = gathered(studio, still([room()], lights), beside, 32, vpl_bounces="ONE")
        return found.reshape(4, 4, 4, 4).mean((1, 3))

    steps = side * ((np.arange(parts) + 0.5) / parts - 0.5)
    each = side / parts, 100.0 / parts**2
    wanted = bounce([lamp(x, z, *each, f"{x} {z}") for x in steps for z in steps])
    wide = bounce([lamp(0.0, 0.0, side, 100.0, "wide")])
    np.testing.assert_allclose(wide, wanted, rtol=0.1)
