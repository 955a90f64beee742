"""The worker process: lines of JSON, cancelling, files that stay whole; and whether a bake still fits its object."""

import json
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from rebound.bake import haar, sh
from rebound.bake import sphere as sphere_of
from rebound.bake.file import read_bake
from rebound.bake.job import (
    BakeSettings,
    Kind,
    bake_objects,
    glossy_matrices,
    surroundings_fingerprint,
    unfit,
    wavelet_rows,
)
from rebound.bake.transfer import finish
from rebound.scene.data import Material, View
from rebound.scene.snapshot import save_snapshot
from rebound.tests.support.bake_scenes import WHITE_SKY, grid, placed
from rebound.tests.support.render_scenes import place, sphere

TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)
VIEW = View(np.eye(4), np.eye(4), 8, 8)


def scene(cells=4, rings=6):
    return placed(grid("floor", 4.0, cells), sphere("ball", (0, 0, 0.6), 0.5, rings=rings))


def command(folder, baked=None, *more):
    path = folder / "scene.npz"
    if not path.exists():
        save_snapshot(path, baked or scene(), VIEW)
    return [sys.executable, "-m", "rebound.bake.worker", str(path), *more]


def start(words, **how):
    """The package as the tests have it, whatever folder it is in."""
    where = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=where, **how)


def run(words):
    process = start(words)
    out, _ = process.communicate(timeout=120)
    return process.returncode, [json.loads(line) for line in out.splitlines()]


def test_worker_writes_files_and_says_how_far_it_is(tmp_path):
    targets = ["--bake", f"0={tmp_path / 'floor.exr'}", "--bake", f"1={tmp_path / 'ball.exr'}"]
    status, lines = run(command(tmp_path, None, *targets, "--directions", "128", "--bounces", "1"))
    assert status == 0
    assert "rays by" in lines[0]["device"] and lines[1]["progress"] == 0.0
    assert lines[-1]["done"] == [str(tmp_path / "floor.exr"), str(tmp_path / "ball.exr")]
    floor = read_bake(tmp_path / "floor.exr")
    assert floor.about["settings"]["directions"] == 128
    assert unfit(floor.about, scene(), "floor") == ""
    assert floor.arrays["diffuse"].shape == (25, 1, 25)
    assert 0.2 < (floor.arrays["diffuse"][:, 0, 0] * WHITE_SKY).min() < 1.0


@pytest.mark.parametrize("how", ["line", "end"])
def test_cancelled_bake_leaves_the_file_before(tmp_path, how):
    path = tmp_path / "floor.exr"
    path.write_text("before")
    words = command(tmp_path, scene(100, 40), "--bake", f"0={path}", "--directions", "8192", "--bounces", "4", "--ask")
    process = start(words, stdin=subprocess.PIPE)
    assert "device" in json.loads(process.stdout.readline())
    if how == "line":
        process.stdin.write("cancel\n")
        process.stdin.flush()
    else:
        process.stdin.close()
    last = process.stdout.read().splitlines()[-1]
    assert json.loads(last) == {"cancelled": True}
    assert process.wait(60) == 2
    assert path.read_text() == "before"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["floor.exr", "scene.npz"]


def test_terminated_bake_leaves_the_file_before(tmp_path):
    path = tmp_path / "floor.exr"
    path.write_text("before")
    process = start(command(tmp_path, scene(100, 40), "--bake", f"0={path}", "--directions", "8192"))
    process.stdout.readline()
    process.terminate()
    assert process.wait(60) == 2
    assert path.read_text() == "before"
    process.stdout.close()


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        (["--bake", "7={}/a.exr"], "none in row 7"),
        (["--bake", "0={}/nowhere/a.exr", "--directions", "16"], "Cannot write"),
        (["--bake", "0={}/a.exr", "--bands", "12"], "bands is 12: it can be 1 to 11"),
        (["--bake", "0={}/a.exr", "--texels", "24"], "texels is 24"),
    ],
)
def test_failure_is_one_line_with_its_reason(tmp_path, more, reason):
    status, lines = run(command(tmp_path, None, *(word.format(tmp_path) for word in more)))
    assert status == 1
    assert reason in lines[-1]["error"]
    assert not (tmp_path / "a.exr").exists()


def test_file_that_is_no_snapshot_is_refused(tmp_path):
    (tmp_path / "scene.npz").write_text("hello")
    status, lines = run(command(tmp_path, None, "--bake", f"0={tmp_path / 'a.exr'}"))
    assert status == 1
    assert "not a snapshot" in lines[-1]["error"]


def test_numpy_rays_are_no_warning_where_they_were_asked_for(tmp_path):
    words = ["--bake", f"0={tmp_path / 'a.exr'}", "--rays", "numpy", "--directions", "16", "--bounces", "0"]
    status, lines = run(command(tmp_path, None, *words))
    assert status == 0
    assert lines[0]["device"] == "CPU, rays by numpy"
    assert not any("warning" in line for line in lines)


# --- jobs ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", list(Kind))
def test_turned_scene_bakes_the_same(kind):
    """Kept along the object's own axes, so a scene turned as a whole has the same transfer, but for the directions of
    rays: 1,024 of them, 0.02.
    """
    settings = BakeSettings(kind, bands=3, result_bands=3, bounces=1, texels=16, error=0.002)
    meshes = list(scene().meshes.values())
    found = []
    for matrix in (np.eye(4), place((5, 1, 0), TURN)):
        baked = finish(bake_objects(placed(*meshes, matrices=[matrix] * 2), ["floor"], settings))["floor"]
        if kind is Kind.DIFFUSE:
            found.append(baked.arrays["diffuse"].astype(np.float32))
        elif kind is Kind.GLOSSY:
            found.append(glossy_matrices(baked).rows())
        else:
            found.append(wavelet_rows(baked).dense())
    assert found[0].any()
    assert np.abs(found[0] - found[1]).mean() < 0.02 * np.abs(found[0]).max()
    assert np.abs(found[0] - found[1]).max() < 0.2 * np.abs(found[0]).max()


def test_bake_of_one_object_knows_the_others():
    alone, both = placed(grid("floor", 4.0, 4)), scene()
    quick = BakeSettings(directions=128, bounces=0)
    dim = finish(bake_objects(both, ["floor"], quick))["floor"].arrays["diffuse"]
    bright = finish(bake_objects(alone, ["floor"], quick))["floor"].arrays["diffuse"]
    assert dim[..., 0].min() < 0.9 * bright[..., 0].min()


def test_wavelet_rows_and_what_bounced_add_up_to_the_diffuse_bake():
    """Under a sky of two bands. 0.01: texels instead of directions, half floats."""
    sky = np.array([3.0, 0.4, 1.0, -0.3])
    cube = sh.evaluate(sphere_of.cube_directions(32), 2) @ sky
    settings = BakeSettings(Kind.WAVELET, bands=2, bounces=2, directions=4096)
    rows = finish(bake_objects(scene(), ["ball"], settings))["ball"]
    right = (
        finish(bake_objects(scene(), ["ball"], replace(settings, kind=Kind.DIFFUSE)))["ball"].arrays["diffuse"] @ sky
    )
    bounced = rows.arrays["bounced"].astype(np.float64) @ sky
    found = wavelet_rows(rows).dot(haar.forward(cube).reshape(-1))[:, None] + bounced
    assert bounced.max() > 0.05
    assert np.abs(found - right).mean() < 0.01
    assert np.abs(found - right).max() < 0.05


@pytest.mark.parametrize("kind", list(Kind))
def test_objects_baked_together_are_as_baked_alone(kind):
    settings = BakeSettings(kind, bands=3, result_bands=3, directions=64, bounces=1, texels=8)
    both = finish(bake_objects(scene(), ["ball", "floor"], settings))
    alone = finish(bake_objects(scene(), ["ball"], settings))["ball"]
    assert {n: a.tobytes() for n, a in both["ball"].arrays.items()} == {n: a.tobytes() for n, a in alone.arrays.items()}
    assert both["ball"].about == alone.about


def test_missing_object_is_named():
    with pytest.raises(ValueError, match="no object 'lid'"):
        finish(bake_objects(scene(), ["lid"], BakeSettings()))


def test_changed_mesh_colour_or_place_is_told_from_a_rigid_move():
    before = scene()
    about = finish(bake_objects(before, ["floor"], BakeSettings(directions=16, bounces=0)))["floor"].about
    moved = place((5, 1, 2), TURN)
    together = replace(before, instances=tuple(replace(i, world_from_object=moved) for i in before.instances))
    apart = replace(before, instances=(before.instances[0], replace(before.instances[1], world_from_object=moved)))
    assert unfit(about, before, "floor") == ""
    assert unfit(about, together, "floor") == ""
    assert "around the object" in unfit(about, apart, "floor")
    assert "around the object" in unfit(about, replace(before, materials=(Material("Red", (1, 0, 0)),)), "floor")
    assert "the mesh" in unfit(about, scene(cells=5), "floor")
    assert "no longer" in unfit(about, replace(before, instances=()), "floor")
    assert surroundings_fingerprint(before, "floor") != surroundings_fingerprint(before, "ball")
