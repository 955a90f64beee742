"""The list of files beside Cycles is made, as a user makes it: one tiny scene, its pictures, its row."""

import json
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from PIL import Image

from rebound.benchmarks.outcomes import COLOR, LIMITS, Outcome, content
from rebound.tests.support.blender_build import CUBE, link, material, mesh

ROOT = Path(__file__).resolve().parents[2]


def test_a_file_without_camera_and_light_is_rendered_beside_cycles(clean_scene, tmp_path):
    data = mesh("Box", CUBE)
    data.materials.append(material("Red", (0.8, 0.1, 0.1)))
    link("Box", data)
    blend = tmp_path / "box.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    command = [sys.executable, ROOT / "benchmarks" / "compatibility.py", blend, "--out", tmp_path / "out"]
    answer = subprocess.run(
        [*command, "--width", "48", "--samples", "4", "--scenes-dir", tmp_path], capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
    outcome = json.loads((tmp_path / "out" / "outcome-box.json").read_text())
    assert outcome["error"] == "" and outcome["size"] == [48, 27] and outcome["reference"].startswith("Cycles")
    assert outcome["scores"][COLOR]["relmse"] < 0.05 and outcome["scores"][COLOR]["energy"] == pytest.approx(1, abs=0.1)
    pair = np.asarray(Image.open(tmp_path / "out" / "box.png"))
    assert pair.shape == (2 * 27, 2 * 48, 3) and pair[27:, :48].max() > 100, "the box is seen"
    assert "| box | Cycles" in answer.stdout


def test_a_file_that_fails_is_a_row_and_one_over_a_limit_is_not_right():
    near = {name: {"energy": 1.0, "relmse": 0.9 * limit} for name, limit in LIMITS.items()}
    far = near | {COLOR: {"energy": 1.0, "relmse": 0.02}}
    outcomes = [
        Outcome("good", "shared", (8, 8), 1.0, near),
        Outcome("bad", "shared", (8, 8), 1.0, far, ["Material 'A': wrong"]),
        Outcome("broken", error="Traceback\nValueError: no such file"),
    ]
    text = content(outcomes)
    assert text.startswith("1 of 3 files")
    assert [outcome.passed for outcome in outcomes] == [True, False, False]
    assert "- bad\n    - Material 'A': wrong" in text and "- broken\n    - ValueError: no such file" in text
