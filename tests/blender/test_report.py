"""The report as a reader has it: measured for real on the example scene, opened in a real browser."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rebound.tests.support import browser

# A minute, and the same on every backend.
pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("report")]

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def measured(tmp_path_factory) -> Path:
    """The folder of the smallest measurement there is: EEVEE's shaders take most of its time."""
    folder = tmp_path_factory.mktemp("bench")
    command = [sys.executable, ROOT / "benchmarks" / "bench.py", "--scenes", "cornell_box", "--tiny"]
    answer = subprocess.run(
        [*command, "--steps", "curves", "report", "--out", folder], capture_output=True, text=True, timeout=280
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
    return folder


@pytest.fixture
def page(measured, tmp_path):
    """The report in a browser."""
    if browser.program() is None:
        pytest.skip(f"none of {', '.join(browser.PROGRAMS)} is installed")
    with browser.browser(tmp_path) as opened:
        opened.open((measured / "report.html").as_uri())
        yield opened


def test_every_engine_was_measured(measured):
    result = json.loads((measured / "scene-cornell_box.json").read_text())
    assert {curve["engine"] for curve in result["curves"]} == {"Rebound", "EEVEE", "Cycles"}
    for curve in result["curves"]:
        assert curve["first"] > 0 and curve["points"][-1]["seconds"] > 0, curve["label"]
        assert 0 < curve["points"][-1]["scores"]["Combined/multi_bounce"]["energy"] < 2, curve["label"]
    methods = [curve for curve in result["curves"] if curve["engine"] == "Rebound" and curve["passes"]]
    assert methods
    for curve in methods:
        names = {p["name"] for p in curve["passes"]}
        for part in ("frame_gbuffer", "frame_direct", "frame_accumulate"):
            assert any(name.startswith(part) for name in names), (curve["label"], names)
        assert all(p["milliseconds"] > 0 and p["calls"] >= 1 for p in curve["passes"])


def test_second_run_renders_no_engine_of_blender_again(measured):
    command = [sys.executable, ROOT / "benchmarks" / "bench.py", "--scenes", "cornell_box", "--tiny"]
    answer = subprocess.run([*command, "--steps", "report", "--out", measured], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert "EEVEE" not in answer.stdout


def test_page_loads_without_complaint_and_asks_for_nothing_else(page):
    assert page.errors == []
    outside = [url for url in page.requests if not url.startswith("data:")]
    assert len(outside) == 1 and outside[0].startswith("file:"), outside
    assert page.evaluate("[...document.images].filter(i => !i.hidden && i.src && !i.naturalWidth).length") == 0


def test_page_names_no_place_outside_itself(measured):
    text = (measured / "report.html").read_text()
    links = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert links and all(link.startswith(("data:", "#")) for link in links)
    assert str(measured) not in text


def _box(page) -> dict[str, float]:
    page.evaluate("document.querySelector('.compare').scrollIntoView()")
    return page.evaluate("(({x, y, width, height}) => ({x, y, width, height}))"
                         "(document.querySelector('.compare').getBoundingClientRect())")  # fmt: skip


def _picture(page, box) -> np.ndarray:
    shot = page.screenshot(x=box["x"], y=box["y"], width=box["width"], height=box["height"])
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)


def _now(page) -> int:
    return int(page.evaluate("document.querySelector('.divider').getAttribute('aria-valuenow')"))


def test_dragging_the_divider_changes_the_picture_under_it(page):
    page.call("Emulation.setDeviceMetricsOverride", width=1000, height=1600, deviceScaleFactor=1, mobile=False)
    box = _box(page)
    before = _picture(page, box)
    middle, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 3
    page.mouse("pressed", middle, y)
    for part in (0.4, 0.3, 0.2):
        page.mouse("moved", box["x"] + part * box["width"], y)
    page.mouse("released", box["x"] + 0.2 * box["width"], y)
    assert _now(page) == 20
    changed = np.abs(_picture(page, box) - before).max(-1) > 8
    width = changed.shape[1]
    assert changed[:, int(0.27 * width) : int(0.43 * width)].mean() > 0.2  # now the right picture, another engine's
    assert not changed[:, : int(0.13 * width)].any()
    assert not changed[:, int(0.57 * width) :].any()
    page.mouse("moved", box["x"] + 0.9 * box["width"], y)  # let go: it no longer follows
    assert _now(page) == 20
    assert page.errors == []


def test_divider_answers_the_keyboard(page):
    page.evaluate("document.querySelector('.divider').focus()")
    page.key("ArrowRight", 39)
    assert _now(page) == 52
    page.key("Home", 36)
    assert _now(page) == 0
    page.key("ArrowLeft", 37)
    assert _now(page) == 0
    page.key("End", 35)
    assert _now(page) == 100
    assert page.errors == []


def test_either_side_can_show_any_engine(page):
    labels = page.evaluate("[...document.querySelector('.choose select').options].map(o => o.textContent)")
    for name in ("EEVEE", "Cycles", "Reference"):
        assert any(label.startswith(name) for label in labels), labels
    assert len(labels) >= 4
    sources = page.evaluate(
        "(() => { const choice = document.querySelectorAll('.choose select')[1];"
        " const image = document.querySelector('.compare .right');"
        " return [...choice.options].map(o => { choice.value = o.value;"
        " choice.dispatchEvent(new Event('change')); return image.src + image.alt; }); })()"
    )
    assert len(set(sources)) == len(labels)


@pytest.mark.parametrize("dark", [False, True])
def test_page_follows_the_colour_scheme(measured, tmp_path, dark):
    if browser.program() is None:
        pytest.skip(f"none of {', '.join(browser.PROGRAMS)} is installed")
    with browser.browser(tmp_path) as opened:
        opened.open((measured / "report.html").as_uri(), dark=dark, width=400)
        color = opened.evaluate("getComputedStyle(document.body).backgroundColor")
        brightness = np.mean([int(n) for n in re.findall(r"\d+", color)[:3]])
        assert brightness < 60 if dark else brightness > 200
        assert opened.evaluate("document.documentElement.scrollWidth") <= 400, "a narrow window has to scroll sideways"
