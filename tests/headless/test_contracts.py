"""What every technique keeps, whatever its settings: same input, same bits; any size; black stays black; cancel."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from rebound.gpu_shaders import TECHNIQUES
from rebound.passes import PASSES
from rebound.renderer import RenderError
from rebound.scene.data import Material, Visibility, World
from rebound.settings import Settings, named_settings
from rebound.tests.support.render_scenes import QUICK, Studio, box, light, ortho, perspective, quad, scene

ALL = [p.key for p in PASSES]
MESHES = [quad("floor", u=(2, 0, 0), v=(0, 2, 0)), box("box", (-0.4, -0.4, 0), (0.3, 0.4, 0.9))]
LAMPS = [
    light("SPOT", (1, -1, 2.5), key="spot", radius=0.1, spot_blend=0.3),
    light("SUN", (1, 2, 3), power=1.0, key="sun", angle=0.1),
    light("POINT", (-1, 0.5, 1), power=10.0, key="point"),
    light("AREA", (-1, -1, 2), power=10.0, key="area", area_size=(0.5, 0.5)),
]
SCENE = scene(MESHES, LAMPS, (0.8, 0.5, 0.2), world=World((0.1, 0.2, 0.3)))
VIEWS = {
    "37 x 3": perspective(37, 3),
    "1 x 1": perspective(1, 1),
    "orthographic": ortho(7, 5, 3, (-3, -4, 5)),
}


def variations():
    """Settings that differ from the defaults in one: every choice, every lower limit, the upper one of a number."""
    yield {}
    for name, setting in named_settings():
        if name == "samples" or name.startswith("show"):  # counted by the caller; views have tests of their own
            continue
        values = [setting.minimum]
        if setting.kind == "ENUM":
            values = [item.key for item in setting.items if item.key != setting.default]
        elif setting.kind == "BOOL":
            values = [not setting.default]
        elif setting.kind == "FLOAT":
            values.append(setting.maximum)
        elif setting.name == "gathers":
            values.append(257)
        for value in values:
            yield {name: int(value) if setting.kind == "INT" else value}


SMALL = {"vpl_resolution": 64, "vpl_voxels": 64, "vpl_pool": 256}
CASES = [{"method": technique.id.upper(), **SMALL, **changed} for technique in TECHNIQUES for changed in variations()]


@pytest.fixture(scope="module")
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


def same(a, b):
    for name in a:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)


@pytest.mark.parametrize("changed", CASES, ids=str)
def test_same_input_gives_the_same_finite_bits_at_any_size(studio, changed):
    first = {name: studio.render(SCENE, view, 2, ALL, **changed) for name, view in VIEWS.items()}
    for name, view in VIEWS.items():
        for key, values in first[name].items():
            assert np.isfinite(values).all(), (name, key)
            assert (values >= 0).all() or key in ("normal", "position"), (name, key)
        same(studio.render(SCENE, view, 2, ALL, **changed), first[name])
    assert first["37 x 3"]["combined"].shape == (3, 37, 4)
    assert first["orthographic"]["diffuse_direct"].max() > 0


def test_new_renderer_gives_the_same_bits(studio, headless_device):
    old = studio.render(SCENE, VIEWS["37 x 3"], 3, ALL)
    fresh = Studio(headless_device)
    same(fresh.render(SCENE, VIEWS["37 x 3"], 3, ALL), old)
    fresh.free()


def test_other_seed_is_other_noise_of_the_same_level(studio):
    view = ortho(24, 24, 3)
    one, two = (studio.render(SCENE, view, 32, ["diffuse_indirect"], seed=s)["diffuse_indirect"] for s in (0, 1))
    assert (one != two).any()
    # All pixels share one pool, so the means have noise, too: about 3 %.
    assert one.mean() == pytest.approx(two.mean(), rel=0.12)


@pytest.mark.parametrize("changed", CASES, ids=str)
def test_black_scene_stays_black(studio, changed):
    black = replace(SCENE, materials=(Material("Black", (0.0, 0.0, 0.0)),), world=World())
    unlit = replace(SCENE, lights=(), world=World())
    for dark in (black, unlit):
        found = studio.render(dark, VIEWS["orthographic"], 1, ALL, **changed)
        assert not found["combined"][..., :3].any()
        assert not found["diffuse_indirect"].any()


@pytest.mark.parametrize(
    "shown", [scene([], LAMPS), scene([], []), scene(MESHES, [])], ids=["lamps", "empty", "meshes"]
)
def test_scene_without_meshes_or_lights_is_drawn(studio, shown):
    found = studio.render(replace(shown, world=World((1.0, 2.0, 3.0))), ortho(4, 4, 9), 1, ALL)
    np.testing.assert_allclose(found["combined"][0, 0], (1, 2, 3, 1))
    np.testing.assert_allclose(found["environment"][0, 0], (1, 2, 3))


def test_method_none_runs_no_technique(headless_device):
    studio = Studio(headless_device)
    lamps_only = replace(SCENE, world=World())  # a world's light comes from the technique
    found = studio.render(lamps_only, VIEWS["orthographic"], 1, ALL, method="NONE")
    assert not found["diffuse_indirect"].any() and found["diffuse_direct"].any()
    assert not [name for name in studio.renderer.statistics() if name.startswith("light_")]
    with_bounce = studio.render(lamps_only, VIEWS["orthographic"], 1, ALL)
    same({"diffuse_direct": with_bounce["diffuse_direct"]}, {"diffuse_direct": found["diffuse_direct"]})
    studio.render(SCENE, VIEWS["orthographic"], 1, method="NONE")
    assert not [name for name in studio.renderer.statistics() if name.startswith("light_")]  # its memory is given back
    studio.free()


@pytest.mark.parametrize("glossy", [False, True])
def test_passes_add_up_to_combined(studio, glossy):
    metal = (Material("Metal", (0.8, 0.5, 0.2), metallic=0.5, specular=(0.04, 0.04, 0.04), roughness=0.3),)
    found = studio.render(replace(SCENE, materials=metal) if glossy else SCENE, VIEWS["37 x 3"], 4, ALL)
    total = found["emission"] + found["environment"]
    for kind in ("diffuse", "glossy"):
        total += (found[f"{kind}_direct"] + found[f"{kind}_indirect"]) * found[f"{kind}_color"]
    assert found["glossy_direct"].any() == glossy
    np.testing.assert_allclose(found["combined"][..., :3], total, rtol=1e-5, atol=1e-6)


def test_transparent_film_and_holdout_leave_holes(studio):
    view = ortho(30, 30, 6, (0, 0, 10))
    opaque = studio.render(SCENE, view, 4, ALL, method="NONE")
    assert (opaque["combined"][..., 3] == 1).all()
    clear = studio.render(replace(SCENE, film_transparent=True), view, 4, ALL, method="NONE")
    assert (clear["combined"][0] == 0).all() and not clear["environment"].any()
    assert (clear["combined"][14, 22] == opaque["combined"][14, 22]).all()  # floor
    edge = clear["combined"][15, :, 3]
    assert ((edge > 0) & (edge < 1)).any()  # averaged where the floor ends

    visibility = {"box": Visibility.HOLDOUT | Visibility.SHADOW | Visibility.BOUNCE}
    holed = scene(MESHES, LAMPS, (0.8, 0.5, 0.2), visibility=visibility, film_transparent=True)
    found = studio.render(holed, view, 4, ALL, method="NONE")
    assert (found["combined"][15, 15] == 0).all()
    same({"combined": found["combined"][14, 21:23]}, {"combined": clear["combined"][14, 21:23]})


def test_camera_does_not_see_what_only_casts_shadows(studio):
    view = ortho(8, 8, 0.4, (0, 0, 10))
    visibility = {"box": Visibility.SHADOW}
    hidden = scene(MESHES, LAMPS, visibility=visibility)
    found = studio.render(hidden, view, 1, ["depth"])
    np.testing.assert_allclose(found["depth"], 10.0, rtol=1e-5)


def test_depth_position_and_normal_are_the_surfaces(studio):
    view = perspective(9, 7, 50, (0, -4, 2), (0, 0, 0))
    found = studio.render(scene(MESHES[:1], [], filter_width=3.0), view, 5, ALL)
    seen = found["depth"][..., 0] < 1e9
    x, y = np.meshgrid((2 * np.arange(9) + 1) / 9 - 1, (2 * np.arange(7) + 1) / 7 - 1)
    ray = np.stack((x / view.clip_from_view[0, 0], y / view.clip_from_view[1, 1], -np.ones_like(x)), -1)
    world = np.linalg.inv(view.view_from_world)
    ray = ray @ world[:3, :3].T
    depth = -world[2, 3] / ray[..., 2]
    np.testing.assert_allclose(found["depth"][seen][:, 0], depth[seen], rtol=1e-4)
    np.testing.assert_allclose(found["position"][seen], (world[:3, 3] + depth[..., None] * ray)[seen], atol=1e-3)
    np.testing.assert_allclose(found["normal"][seen], np.broadcast_to((0, 0, 1), (seen.sum(), 3)), atol=1e-6)
    assert (found["depth"][~seen] == 1e10).all() and not found["normal"][~seen].any()


@pytest.mark.parametrize("changed", [{}, {"soft_shadows": "FILTERED", "rsm_interpolation": "QUARTER"}], ids=str)
def test_cancelled_sample_leaves_whole_samples_and_no_trace(headless_device, changed):
    view, settings = VIEWS["37 x 3"], Settings.defaults(**{**QUICK, **changed})
    whole = Studio(headless_device)
    expected = whole.render(SCENE, view, 3, ALL, **changed)
    first = whole.render(SCENE, view, 1, ALL, **changed)
    whole.free()
    studio = Studio(headless_device)
    studio.show(SCENE)
    frame = studio.renderer.begin(view)
    cancelled = 0
    for samples in range(3):
        pieces_run = 0
        while frame.samples == samples:  # one piece more with every attempt
            pieces_run += 1
            pieces = studio.renderer.sample(frame, studio.gpu_scene, view, settings)
            progress = list(islice(pieces, pieces_run))
            pieces.close()
            cancelled += progress[-1] < 1
            assert progress == sorted(progress) and progress[0] >= 0 and progress[-1] <= 1
        if samples == 0:
            same({name: studio.renderer.read(frame, name) for name in ALL}, first)
    assert cancelled > 10
    same({name: studio.renderer.read(frame, name) for name in ALL}, expected)
    studio.free()


def test_impossible_size_is_one_line(studio):
    for width, height in ((0, 4), (4, 10**6)):
        with pytest.raises(RenderError, match="not possible"):
            studio.renderer.begin(replace(VIEWS["1 x 1"], width=width, height=height))
