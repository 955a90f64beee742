"""Scenes as they are read from real files come back from a snapshot bit by bit."""

import os
from pathlib import Path

import bpy
import numpy as np
import pytest

from rebound.scene.cameras import active_camera, camera_view
from rebound.scene.convert import convert_scene
from rebound.scene.data import View
from rebound.scene.snapshot import load_snapshot, save_snapshot
from rebound.tests.support.snapshots import assert_same

# A minute, and the same on every backend.
pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
SHARED = Path(os.environ.get("REBOUND_SHARED", ROOT.parent / "shared")) / "scenes"
# Seconds to minutes to read; no different in kind.
LARGE = {"race_track", "kitchen", "wooden_staircase", "material_batch", "living_room", "classroom"}
FILES = [ROOT / "examples" / "cornell_box.blend", *sorted(SHARED.rglob("*.blend"))]
PLAIN_VIEW = View(np.eye(4), np.eye(4), 320, 180)  # of a file without a camera


def _parameter(path):
    return pytest.param(path, id=path.stem, marks=[pytest.mark.slow] if path.stem in LARGE else [])


@pytest.mark.parametrize("file", [_parameter(path) for path in FILES])
def test_scene_of_a_file_comes_back_bit_by_bit(clean_scene, tmp_path, file):
    bpy.ops.wm.open_mainfile(filepath=str(file))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    scene = convert_scene(depsgraph, for_viewport=False)
    has_camera = bpy.context.scene.camera is not None
    view = camera_view(active_camera(depsgraph), depsgraph, width=320, height=180) if has_camera else PLAIN_VIEW
    save_snapshot(tmp_path / "scene.npz", scene, view)
    loaded_scene, loaded_view = load_snapshot(tmp_path / "scene.npz")
    assert_same(scene, loaded_scene)
    assert_same(view, loaded_view)
