"""What times a renderer: every call once, by its shader's name; and the figures of moving pictures."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rebound.benchmarks import results, scaling
from rebound.benchmarks.figures import dark_pixels
from rebound.benchmarks.gpu_report import GpuRun
from rebound.benchmarks.moving import (
    SHOWN,
    Effort,
    measure_drag,
    measure_ghost,
    measure_orbit,
    moved_light,
    moved_object,
    orbit,
    orbit_view,  # fmt: skip
)
from rebound.benchmarks.results import Pass
from rebound.benchmarks.studio import Method, Studio, methods, picture, resized
from rebound.benchmarks.timed_device import COMPUTE, RASTER, UPLOAD, QueryClock, TimedDevice, WallClock, median_passes
from rebound.device import Image
from rebound.gpu_shaders import TECHNIQUES
from rebound.scene.snapshot import save_snapshot
from rebound.tests.support.device_contract import compute
from rebound.tests.support.render_scenes import box, light, perspective, quad, scene

ROOT = Path(__file__).resolve().parents[2]
SMALL = {"shadow_resolution": 128, "rsm_resolution": 32, "rsm_gathers": 16}
VIEW = perspective(40, 24)


def room():
    return scene(
        [quad("floor", u=(3, 0, 0), v=(0, 3, 0)), box("block", (-0.5, -0.5, 0), (0.5, 0.5, 1))],
        [light("SPOT", (1, -1, 3))],
    )


METHOD = Method("Shadow maps", {"method": "RSM", **SMALL})


def test_methods_are_the_techniques_the_default_first():
    found = methods()
    assert {m.changed["method"] for m in found} == {technique.id.upper() for technique in TECHNIQUES}
    assert (
        found[0].settings(viewport=False)["method"]
        == METHOD.settings(viewport=False, method=found[0].changed["method"])["method"]
    )
    assert len({m.label for m in methods(estimators=True)}) == len(methods(estimators=True)) >= len(found)


@pytest.mark.parametrize("clock", [WallClock, QueryClock])
def test_timed_device_renders_the_same_and_names_every_pass(headless_device, clock):
    settings = METHOD.settings(viewport=False)
    plain = picture(headless_device, room(), VIEW, settings, 2)
    timed = TimedDevice(headless_device, clock(headless_device))
    assert picture(timed.as_device, room(), VIEW, settings, 2).tobytes() == plain.tobytes()
    passes = {p.name: p for p in timed.passes()}
    assert passes["frame_gbuffer"].calls == 2
    assert any(name.startswith("rsm_gather") for name in passes)
    assert passes["textures"].kind == UPLOAD
    assert {p.kind for p in passes.values()} == {RASTER, UPLOAD}
    assert all(p.milliseconds >= 0 for p in passes.values())
    assert sum(p.milliseconds for p in passes.values()) > 0
    assert timed.passes() == []


def test_timed_device_tells_compute_from_raster(headless_device):
    timed = TimedDevice(headless_device, WallClock(headless_device))
    text = "void main() { imageStore(out_img, ivec2(gl_GlobalInvocationID.xy), vec4(3.0)); }"
    fill = compute("bench_fill", text, images={"out_img": Image("RGBA32F", "FLOAT_2D", "WRITE")})
    texture = timed.as_device.texture((8, 8), "RGBA32F")
    timed.as_device.dispatch(fill, (8, 8, 1), out_img=texture)
    timed.as_device.clear(timed.as_device.target([timed.as_device.texture((8, 8), "RGBA32F")]))
    assert {p.name: (p.kind, p.calls) for p in timed.passes()} == {
        "bench_fill": (COMPUTE, 1.0),
        "clear": (RASTER, 1.0),
    }
    assert (timed.as_device.read(texture) == 3.0).all()


def test_median_pass_of_a_frame_that_lacks_it_counts_as_nothing():
    frames = [[Pass("a", RASTER, 4.0, 1), Pass("maps", RASTER, 90.0, 6)], [Pass("a", RASTER, 2.0, 1)]]
    frames.append([Pass("a", RASTER, 9.0, 1)])
    assert median_passes(frames) == [Pass("a", RASTER, 4.0, 1.0)]


def test_resized_view_keeps_the_field_of_its_longer_side():
    wide = resized(perspective(48, 48), 96, 54)
    assert wide.clip_from_view[0, 0] == pytest.approx(perspective(48, 48).clip_from_view[0, 0])
    assert wide.clip_from_view[1, 1] / wide.clip_from_view[0, 0] == pytest.approx(96 / 54)
    again = resized(wide, 48, 48)
    assert again.clip_from_view == pytest.approx(perspective(48, 48).clip_from_view)


def test_orbit_keeps_its_distance_and_turns_back():
    pivot = np.array([1.0, 2.0, 0.5])
    eyes = [np.linalg.inv(orbit_view(VIEW, pivot, a).view_from_world)[:3, 3] for a in (0, 30, 90)]
    radii = [np.linalg.norm(eye[:2] - pivot[:2]) for eye in eyes]
    assert radii == pytest.approx([radii[0]] * 3)
    assert eyes[0][2] == pytest.approx(eyes[2][2])
    assert np.linalg.norm(eyes[1] - eyes[0]) == pytest.approx(2 * radii[0] * np.sin(np.radians(15)))
    steps = np.abs(np.diff([orbit(i) for i in range(4 * SHOWN)]))
    assert steps == pytest.approx(1.0)
    assert max(orbit(i) for i in range(100)) == SHOWN


def test_first_frame_of_an_orbit_is_the_view_itself():
    assert orbit_view(VIEW, np.ones(3), orbit(0)).view_from_world == pytest.approx(VIEW.view_from_world)


def test_orbit_figures_are_of_the_last_view(headless_device):
    figures, judged = measure_orbit(headless_device, METHOD, room(), VIEW, Effort(10, 16), None)
    values = {figure.name: figure.value or 0.0 for figure in figures}
    assert judged.any() and judged.shape == (24, 40, 3)
    assert 0 < values["a frame of the orbit, median"] < 30
    assert 0 < values[f"relmse after {SHOWN} frames of the orbit"] < 0.5


def test_what_is_dragged_moves_before_every_frame(headless_device, monkeypatch):
    seen = []
    shown = Studio.show
    monkeypatch.setattr(Studio, "show", lambda self, s: (seen.append(s), shown(self, s)))
    light, thing = measure_drag(headless_device, METHOD, room(), VIEW, 3)
    assert light.value and thing.value and "light" in light.name and "object" in thing.name
    places = [float(s.lights[0].world_from_light[0, 3]) for s in seen[:5]]
    assert (np.diff(places) > 0).all() and len({s.lights[0] for s in seen[5:]}) == 1
    blocks = [next(i for i in s.instances if i.key == "block").world_from_object[0, 3] for s in seen[5:]]
    assert (np.diff(blocks) > 0).all()


def test_ghost_of_a_method_without_memory_is_none(headless_device):
    before, after = room(), moved_light(room())
    figures = measure_ghost(headless_device, METHOD, before, after, VIEW, "light", 32)
    assert figures[0].value == figures[1].value == 0.0, "after the jump it renders what a fresh renderer does"
    assert figures[1].against and figures[1].against > 0.0


def test_ghost_of_a_picture_that_stands_still_is_whole(headless_device, monkeypatch):
    """A viewport that never noticed the jump: what it shows is the old picture, and the figure says 1."""
    before, after = room(), moved_light(room())
    shown = Studio.show
    monkeypatch.setattr(Studio, "show", lambda self, s: shown(self, before if self._holds is before else s))
    figures = measure_ghost(headless_device, METHOD, before, after, VIEW, "light", 32)
    assert figures[0].value == pytest.approx(1.0, abs=0.05)
    assert figures[1].value and figures[1].value > 0.8


def test_moved_things_are_what_differs():
    original = room()
    assert moved_light(original).instances == original.instances
    moved = moved_object(original)
    differs = [a.key for a, b in zip(original.instances, moved.instances, strict=True) if a is not b]
    assert differs == ["block"]
    assert moved_object(replace(original, instances=original.instances[:1])) is None


def test_dark_pixels_are_behind_the_wall():
    position = np.zeros((1, 5, 3), np.float32)
    position[0, :, 0] = -0.1, -0.06, 0.5, -1.5, -0.1
    position[0, :, 1] = 0.5, 0.5, 0.5, 0.5, -1.0
    assert dark_pixels(position, 0.125)[0].tolist() == [True, True, False, False, False]
    assert dark_pixels(position, 2.0)[0].tolist() == [True, True, False, True, False]


@pytest.mark.parametrize("axis", scaling.axes(), ids=lambda axis: axis.title)
def test_scaling_scenes_have_what_they_say(axis):
    number = axis.quick[-1]
    made, view = axis.make(number)
    counts = {
        "Lights": len(made.lights),
        "Pixels": view.width * view.height,
        "Triangles": sum(made.meshes[i.mesh].triangle_count for i in made.instances),
        "Instances": len(made.instances),
    }
    assert counts[axis.title] == pytest.approx(number, rel=0.05)
    total = sum(sum(lamp.power) for lamp in made.lights)
    assert total == pytest.approx(3 * scaling.TOTAL_POWER), "more lights must not be more light"


def test_block_of_the_hall_faces_outside():
    block = scaling.hall(instances=1).meshes[("block", 12)]
    corners = block.positions.reshape(-1, 3, 3).astype(np.float64)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((facing * block.normals[::3]).sum(-1) > 0).all()
    assert ((corners.mean(1) - (0, 0, 0.5)) * facing > -1e-9).all()


# --- the script, where there is little else ---------------------------------------------------------------------------


def test_bench_gpu_needs_numpy_and_moderngl_only(tmp_path):
    """As on a machine that was lent for its GPU: no Blender, no Pillow, no link to this folder; from a snapshot."""
    modules = tmp_path / "modules"
    modules.mkdir()
    site = Path(sysconfig.get_paths()["platlib"])
    for name in ("numpy", "numpy.libs", "moderngl", "_moderngl.py", "glcontext"):
        if (site / name).exists():
            (modules / name).symlink_to(site / name)
    save_snapshot(tmp_path / "room.npz", room(), VIEW)
    script = [
        ROOT / "benchmarks" / "bench_gpu.py",
        tmp_path / "room.npz",
        "--frames",
        "2",
        "--out",
        tmp_path / "gpu.json",
    ]
    answer = subprocess.run(
        [Path(sys.base_prefix) / "bin" / f"python{sys.version_info.major}.{sys.version_info.minor}", "-S", *script],
        env={**os.environ, "PYTHONPATH": str(modules)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
    runs = results.read_list(tmp_path / "gpu.json", GpuRun)
    assert [run.method for run in runs] == [method.label for method in methods()]
    assert f"device: {runs[0].device}" in answer.stdout
    for run in runs:
        assert run.size == (40, 24) and 0 < run.frame < run.first
        assert run.total(RASTER) > 0
        assert "frame_gbuffer" in {p.name for p in run.passes}
        assert run.total(RASTER) + run.total(COMPUTE) + run.total(UPLOAD) == pytest.approx(
            sum(p.milliseconds for p in run.passes)
        )
