"""Final renders against path-traced references: the figures that the documentation states, printed and held."""

import time
from pathlib import Path

import bpy
import numpy as np
import pytest

from rebound.benchmarks.pictures import diffuse, read_passes
from rebound.benchmarks.score import energy, relative_squared_error
from rebound.tests.support.engine_build import render


@pytest.fixture
def render_shared(registered, shared_dir, tmp_path):
    """Render a shared scene with Rebound; gives its passes and those of its reference."""

    def run(name: str, reference: str, **settings):
        bpy.ops.wm.open_mainfile(filepath=str(shared_dir / "scenes" / "basic" / f"{name}.blend"))
        scene = bpy.context.scene
        scene.render.engine = "REBOUND"
        scene.render.use_compositing = scene.render.use_sequencer = False
        for key, value in settings.items():
            setattr(scene.rebound, key, value)
        layer = scene.view_layers[0]
        layer.use_pass_diffuse_direct = layer.use_pass_diffuse_indirect = layer.use_pass_diffuse_color = True
        layer.use_pass_glossy_direct = layer.use_pass_glossy_indirect = layer.use_pass_glossy_color = True
        render(scene, tmp_path / f"{name}.exr")
        truth = read_passes(Path(shared_dir) / "references" / f"{name}.{reference}.exr")
        return truth, read_passes(tmp_path / f"{name}.exr")

    return run


def show(what: str, truth, test) -> tuple[float, float]:
    """Print and return energy and relative squared error."""
    figures = energy(truth, test), relative_squared_error(truth, test)
    print(f"\n{what}: energy {figures[0]:.4f}, relmse {figures[1]:.4f}")  # noqa: T201  pytest -s shows the figures
    return figures


def test_cornell_spot_direct_light_matches_the_path_tracer(render_shared):
    truth, test = render_shared("cornell_spot", "one_bounce", samples=16, method="NONE")
    level, error = show("cornell_spot, direct", diffuse(truth, "Direct"), diffuse(test, "Direct"))
    assert 0.98 <= level <= 1.02
    assert error <= 0.01


def test_cornell_spot_all_texels_differ_by_visibility_only(render_shared):
    """Path-traced bounce is occluded, this is not: 14 % too bright, relmse 0.158, as another renderer found too."""
    truth, test = render_shared(
        "cornell_spot",
        "one_bounce",
        method="RSM",
        samples=2,  # no noise to average: two only smooth the edges
        rsm_estimator="ALL_TEXELS",
        rsm_resolution=128,
        rsm_interpolation="QUARTER",
    )
    level, error = show("cornell_spot, all texels", diffuse(truth, "Indirect"), diffuse(test, "Indirect"))
    assert 1.10 <= level <= 1.18
    assert error <= 0.17


# Where the sky and emitters alone give light, all bounces come from the cache: its few points beside an emitter stand
# for a wider place than they should (one bounce 8 % bright), and light is missing (many 17 % dark) below a strip that
# all but touches the ceiling. The sky alone is 4 % dark.
# Scene, reference, bounces; the largest error of the energy and the largest relative squared error of what bounced.
BOUNCES = [
    ("cornell_spot", "one_bounce", "ONE", 0.02, 0.01),
    ("divider", "one_bounce", "ONE", 0.02, 0.01),
    ("sunlit_room", "one_bounce", "ONE", 0.02, 0.05),
    ("offscreen_bounce", "one_bounce", "ONE", 0.02, 0.015),
    ("emissive_sky", "one_bounce", "ONE", 0.12, 0.08),
    ("cornell_spot", "multi_bounce", "MANY", 0.035, 0.015),
    ("divider", "multi_bounce", "MANY", 0.03, 0.015),
    ("sunlit_room", "multi_bounce", "MANY", 0.03, 0.02),
    ("emissive_sky", "multi_bounce", "MANY", 0.2, 0.1),
]


# All but the first take a minute on a busy machine, and tell the same of every version.
ROWS = [BOUNCES[0], *(pytest.param(*row, marks=pytest.mark.slow) for row in BOUNCES[1:])]


@pytest.mark.parametrize(("name", "reference", "bounces", "largest_energy", "largest_error"), ROWS)
def test_virtual_lights_match_the_path_tracer(render_shared, name, reference, bounces, largest_energy, largest_error):
    truth, test = render_shared(name, reference, samples=16, method="VPL", vpl_bounces=bounces)
    level, error = show(f"{name}, {reference}", diffuse(truth, "Indirect"), diffuse(test, "Indirect"))
    assert abs(level - 1) <= largest_energy
    assert error <= largest_error
    if name == "emissive_sky":  # its direct light comes from the pool, too
        level, error = show(f"{name}, direct", diffuse(truth, "Direct"), diffuse(test, "Direct"))
        assert abs(level - 1) <= largest_energy
        assert error <= largest_error


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell_spot", "sunlit_room"])
def test_one_bounce_is_what_a_room_lacks_most(render_shared, name):
    """Why many are the default: what one of them costs in light, beside which all other errors are small."""
    errors = {}
    for bounces in ("ONE", "MANY"):
        start = time.perf_counter()
        truth, test = render_shared(name, "multi_bounce", samples=16, method="VPL", vpl_bounces=bounces)
        what = f"{name}, {bounces}, {time.perf_counter() - start:.1f} s"
        level, errors[bounces] = show(what, diffuse(truth, "Indirect"), diffuse(test, "Indirect"))
        assert level < 0.6 if bounces == "ONE" else level > 0.9
    assert errors["ONE"] > 10 * errors["MANY"]


@pytest.mark.parametrize("name", ["sunlit_room", "divider", pytest.param("many_lights", marks=pytest.mark.slow)])
def test_direct_light_of_other_scenes_matches_the_path_tracer(render_shared, name):
    truth, test = render_shared(name, "one_bounce", samples=8, method="NONE")
    level, error = show(f"{name}, direct", diffuse(truth, "Direct"), diffuse(test, "Direct"))
    assert 0.98 <= level <= 1.02
    assert error <= 0.01


def test_metals_and_plastic_match_the_path_tracer(render_shared):
    truth, test = render_shared("glossy_metals", "one_bounce", samples=16, method="NONE")
    for name in ("Diffuse Color", "Glossy Color", "Glossy Direct"):
        level, error = show(f"glossy_metals, {name}", truth[name], test[name])
        assert 0.99 <= level <= 1.01
        assert error <= 0.01


def isolated(image) -> int:
    """Pixels that are four times as bright as all but three of the 24 around them, and of some brightness at all."""
    gray = np.pad(image.mean(-1), 2, mode="edge")
    around = np.sort(np.lib.stride_tricks.sliding_window_view(gray, (5, 5)).reshape(*image.shape[:2], 25))
    return int((image.mean(-1) > 4.0 * around[..., -4] + 0.05 * image.mean()).sum())


@pytest.mark.slow
def test_metals_under_bounced_light_match_and_have_no_fireflies(render_shared):
    """No clamp stands behind it: there is none."""
    truth, test = render_shared("glossy_metals", "one_bounce", samples=16, method="VPL", vpl_bounces="ONE")
    level, error = show("glossy_metals, Combined", truth["Combined"][..., :3], test["Combined"][..., :3])
    assert 0.97 <= level <= 1.03
    assert error <= 0.02
    bounced = [test[f"{kind} Indirect"] * test[f"{kind} Color"] for kind in ("Diffuse", "Glossy")]
    assert bounced[1].max() > 1.0 and [isolated(light) for light in bounced] == [0, 0]
