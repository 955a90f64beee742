"""What is derived from measurements: times to an error, tables, charts, kept files. No GPU, no Blender."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rebound.benchmarks import cases, jobs, page, published, results, tables
from rebound.benchmarks.jobs import Job
from rebound.benchmarks.pictures import INDIRECT, load_picture, quantity, save_picture
from rebound.benchmarks.plot import Line, chart
from rebound.benchmarks.results import (  # fmt: skip
    CYCLES,
    EEVEE,
    REBOUND,
    Curve,
    Figure,
    FigureSet,
    Pass,
    Point,
    ScalePoint,
    Scaling,
    SceneResult,
)
from rebound.benchmarks.score import energy, relative_squared_error

ROOT = Path(__file__).resolve().parents[2]
GOAL = "Combined/multi_bounce"


def point(samples, seconds, relmse):
    return Point(samples, seconds, 3, {GOAL: {"energy": 1.0, "relmse": relmse}})


def curve(engine=REBOUND, label="Method", points=((1, 1.0, 0.16), (4, 4.0, 0.04), (16, 16.0, 0.01)), **fields):
    return Curve(engine, label, [point(*p) for p in points], **fields)


def scene_result(**changed):
    passes = [Pass("gather", "raster", 30.0, 2.0), Pass("clear", "raster", 10.0, 4.0)]
    curves = [
        curve(first=0.5, frame=0.04, first_frame=0.2, passes=passes, device="llvmpipe"),
        curve(EEVEE, EEVEE, ((1, 2.0, 0.9), (4, 8.0, 0.5)), first=5.0),
        curve(CYCLES, CYCLES, ((1, 0.5, 0.2), (16, 8.0, 0.005)), first=0.1),
    ]
    result = SceneResult("room", (64, 48), [GOAL], ["Combined, multi bounce"], 0.5, curves, {}, 1234, 1)
    return replace(result, **changed)


# --- times -----------------------------------------------------------------------------------------------------------


def test_time_to_an_error_follows_the_power_law_between_points():
    """relmse 0.16 / seconds: 0.08 is met at 2 s exactly, which a straight line would put at 3 s."""
    assert curve().time_to(GOAL, 0.08) == pytest.approx(2.0)
    assert curve().time_to(GOAL, 0.01) == pytest.approx(16.0)


def test_time_to_an_error_of_the_first_point_is_its_own():
    assert curve().time_to(GOAL, 0.5) == 1.0


def test_error_that_was_never_reached_has_no_time():
    assert curve().time_to(GOAL, 0.009) is None
    assert curve().time_to("Combined/one_bounce", 0.5) is None


def test_rising_error_is_not_interpolated():
    assert curve(points=((1, 1.0, 0.1), (2, 2.0, 0.3), (4, 4.0, 0.05))).time_to(GOAL, 0.05) == 4.0


@given(st.lists(st.tuples(st.floats(1e-6, 1e6), st.floats(1e-9, 1e9)), min_size=1, max_size=6), st.floats(1e-9, 1e9))
def test_time_to_an_error_lies_within_the_ladder(steps, target):
    seconds = np.cumsum([s for s, _ in steps])
    measured = curve(points=[(i + 1, float(s), e) for i, (s, (_, e)) in enumerate(zip(seconds, steps, strict=True))])
    found = measured.time_to(GOAL, target)
    reached = any(e <= target for _, e in steps)
    assert (found is not None) == reached
    if found is not None:
        assert seconds[0] * 0.999 <= found <= seconds[-1] * 1.001


def test_one_more_sample_leaves_out_what_every_picture_costs():
    assert curve(points=((1, 10.5, 1.0), (5, 12.5, 1.0))).sample == pytest.approx(0.5)
    assert curve(points=((1, 10.5, 1.0),)).sample is None


# --- scores ----------------------------------------------------------------------------------------------------------


def test_score_of_a_brighter_picture_is_its_closed_form():
    """Twice as bright everywhere: energy 2, and (2r - r)² / (r² + 0.01 r²) = 1 / 1.01."""
    reference = np.full((16, 16, 3), 0.3)
    assert energy(reference, 2 * reference) == pytest.approx(2.0)
    assert relative_squared_error(reference, 2 * reference) == pytest.approx(1 / 1.01)


def test_noise_within_a_cell_does_not_count():
    reference = np.full((16, 16, 1), 1.0)
    noisy = reference + np.where(np.indices((16, 16)).sum(0) % 2, 0.5, -0.5)[..., None]
    assert relative_squared_error(reference, noisy) < 1e-12


def test_eevee_indirect_light_is_what_its_one_pass_has_beyond_the_direct():
    color = np.full((4, 4, 3), 0.5)
    eevee = {"Diffuse Direct": np.full((4, 4, 3), 3.0), "Diffuse Color": color}
    direct = np.full((4, 4, 3), 1.0)
    assert quantity(eevee, INDIRECT, direct) == pytest.approx(0.5)
    assert quantity(eevee, INDIRECT) is None
    cycles = {**eevee, "Diffuse Indirect": np.full((4, 4, 3), 2.0)}
    assert quantity(cycles, INDIRECT, direct) == pytest.approx(1.0)


def test_kept_picture_comes_back_in_half_precision(tmp_path):
    passes = {"Combined": np.random.default_rng(1).random((5, 7, 3), np.float32), "Diffuse Direct": np.ones((5, 7, 3))}
    save_picture(tmp_path / "deep" / "picture.npz", passes)
    loaded = load_picture(tmp_path / "deep" / "picture.npz")
    assert loaded.keys() == passes.keys()
    assert loaded["Combined"] == pytest.approx(passes["Combined"], rel=1e-3)


# --- files -----------------------------------------------------------------------------------------------------------


def test_results_come_back_from_json(tmp_path):
    result = scene_result()
    results.write(tmp_path / "scene.json", result)
    assert results.read(tmp_path / "scene.json", SceneResult) == result
    figures = [FigureSet("A", [Figure("b", 1.0, "s", 2.0, "c"), Figure("d", None, "s")])]
    results.write(tmp_path / "figures.json", figures)
    assert results.read_list(tmp_path / "figures.json", FigureSet) == figures
    assert results.read_list(tmp_path / "none.json", FigureSet) == []


@pytest.fixture
def blend(tmp_path):
    (tmp_path / "scene.blend").write_bytes(b"one")
    return str(tmp_path / "scene.blend")


def test_job_names_tell_apart_what_gives_other_pictures(blend):
    job = Job(blend, CYCLES, 4, (64, 64), 8)
    changes = [{"engine": EEVEE}, {"samples": 5}, {"size": (64, 65)}, {"bounces": 1}, {"cold": True}]
    changes.append({"camera": [[1.0, 0, 0, 0]] * 4})
    names = {job.name("5.2"), job.name("5.0"), *(replace(job, **c).name("5.2") for c in changes)}
    assert len(names) == 2 + len(changes)
    assert replace(job, runs=9).name("5.2") == job.name("5.2")
    assert replace(job, engine=EEVEE, bounces=1).name("5.2") == replace(job, engine=EEVEE).name("5.2")


def test_job_name_follows_the_content_of_the_file(blend):
    before = Job(blend, EEVEE).name("5.2")
    Path(blend).write_bytes(b"two")
    jobs._content.cache_clear()
    assert Job(blend, EEVEE).name("5.2") != before


def test_kept_pictures_are_not_rendered_again(blend, tmp_path, monkeypatch):
    ran: list[list[str]] = []

    def run(wanted, folder, say):
        ran.append(sorted(wanted))
        for name in wanted:
            (folder / f"{name}.json").write_text('{"file": "x.exr", "seconds": 2.0, "runs": 1, "details": {}}')

    monkeypatch.setattr(jobs, "_run_worker", run)
    monkeypatch.setattr(jobs, "blender_version", lambda: "5.2")
    wanted = [Job(blend, EEVEE), Job(blend, CYCLES, 4)]
    first = jobs.do(wanted, tmp_path / "kept")
    assert jobs.do([*wanted, Job(blend, CYCLES, 16)], tmp_path / "kept")[:2] == first
    assert [len(names) for names in ran] == [2, 1]
    jobs.do([Job(blend, REBOUND)], tmp_path / "kept")
    jobs.do([Job(blend, REBOUND)], tmp_path / "kept")
    assert [len(names) for names in ran] == [2, 1, 1, 1], "our own pictures change with the code"


def test_worker_that_fails_says_why(blend, tmp_path, monkeypatch):
    (tmp_path / "worker.py").write_text("raise SystemExit('no such engine')")
    monkeypatch.setattr(jobs, "WORKER", tmp_path / "worker.py")
    monkeypatch.setattr(jobs, "blender_version", lambda: "5.2")
    with pytest.raises(SystemExit, match="no such engine"):
        jobs.do([Job(blend, EEVEE)], tmp_path / "kept")


# --- scenes ----------------------------------------------------------------------------------------------------------


def test_example_is_always_there(tmp_path):
    (case,) = cases.find_cases(tmp_path / "nowhere")
    assert case.blend.exists() and case.references == {}
    assert [goal.key for goal in case.goals] == ["Combined/multi_bounce", "DiffInd*/multi_bounce"]


def test_shared_scenes_are_found_by_their_references(tmp_path):
    for path in ("scenes/a/room.blend", "scenes/hall.blend", "references/room.one_bounce.exr"):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).touch()
    assert [case.name for case in cases.find_cases(tmp_path)] == [cases.EXAMPLE, "room"]
    with pytest.raises(SystemExit, match="attic.*room"):
        cases.chosen_cases(tmp_path, ["attic"])


# --- tables and charts -----------------------------------------------------------------------------------------------


def test_scene_table_has_ratios_beside_its_figures():
    table = tables.scene_tables(scene_result())[0]
    rows = {row[0]: row for row in table.rows}
    assert rows["Method"][1] == "0.500 s (0.100 ×)"
    assert rows["Method"][4] == "16.0 s (3.37 ×)"  # Cycles: 0.2 to 0.005 from 0.5 to 8 s is at 0.01 after 4.75 s
    assert rows[EEVEE][3] == tables.MISSING
    assert len(set(map(len, [table.header, *table.rows]))) == 1


def test_every_table_is_whole_in_markdown_and_html():
    result = scene_result()
    figures = FigureSet("Leaks | walls <b>", [Figure("mean", 0.1, "radiance", 0.05, "path traced", "DiffInd*")])
    scaling = Scaling("Lights", "lights", "Method", [ScalePoint(1, 0.01, 0.2), ScalePoint(64, 0.05, 0.9)])
    for table in [*tables.scene_tables(result), tables.figure_table(figures), tables.scaling_table(scaling)]:
        rows = [line for line in table.markdown().splitlines() if line.startswith("|")]
        assert len({len(re.findall(r"(?<!\\)\|", row)) for row in rows}) == 1
        ElementTree.fromstring(f"<div>{table.html()}</div>")


def test_chart_places_points_on_logarithmic_axes():
    text = chart("Title", "x", "y", [Line("a", [(1, 1), (10, 10), (100, 100)])])
    (path,) = re.findall(r'<polyline points="([^"]+)"', text)
    (x0, y0), (x1, y1), (x2, y2) = (tuple(map(float, p.split(","))) for p in path.split())
    assert x1 - x0 == pytest.approx(x2 - x1, abs=0.2) and x1 > x0
    assert y1 - y0 == pytest.approx(y2 - y1, abs=0.2) and y1 < y0


@given(
    st.lists(
        st.lists(st.tuples(st.floats(allow_nan=True), st.floats(allow_nan=True)), max_size=4), max_size=3
    ),
    st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"], exclude_characters="\ufffe\uffff")),
)  # fmt: skip
def test_any_chart_is_valid_and_inside_its_frame(series, label):
    text = chart("A < B & C", "x", "y", [Line(label, points) for points in series], levels=(0.05,), paper=True)
    root = ElementTree.fromstring(text)
    width, height = map(float, root.attrib["viewBox"].split()[2:])
    for element in root.iter():
        for x, y in (p.split(",") for p in element.attrib.get("points", "").split()):
            assert -5 <= float(x) <= width + 5 and -5 <= float(y) <= height + 5


def test_published_part_replaces_only_itself(tmp_path):
    (tmp_path / "page.md").write_text(f"before\n{published.BEGIN}\nold\n{published.END}\nafter\n")
    for _ in range(2):
        published.publish(tmp_path / "page.md", [scene_result()], [], [], "2 cores")
    text = (tmp_path / "page.md").read_text()
    assert text.startswith(f"before\n{published.BEGIN}\n") and text.endswith(f"{published.END}\nafter\n")
    assert "old" not in text and text.count("### room") == 1
    for link in re.findall(r"\]\(([^)]+)\)", text):
        assert (tmp_path / link).exists()


def test_page_without_marks_is_left_alone(tmp_path):
    (tmp_path / "page.md").write_text("mine\n")
    with pytest.raises(SystemExit, match="marks"):
        published.publish(tmp_path / "page.md", [], [], [], "")
    assert (tmp_path / "page.md").read_text() == "mine\n"


def test_performance_page_has_the_marks():
    text = (ROOT / "docs" / "performance.md").read_text()
    assert text.count(published.BEGIN) == text.count(published.END) == 1


# --- the page --------------------------------------------------------------------------------------------------------


def test_display_is_srgb_after_exposure():
    assert page.display(np.array([0.0, 0.25, 0.5]), 1.0).tolist() == [0, 188, 255]


def test_error_colors_rise_from_black():
    colors = page.error_colors(np.array([0.0, 1e-4, 1e-2, 1.0, 50.0])).astype(int).sum(-1)
    assert colors[0] == colors[1] == 0
    assert colors[1] < colors[2] < colors[3] == colors[4]


def test_error_map_in_the_page_has_the_colours_of_its_scale():
    css = (ROOT / "benchmarks" / "page.css").read_text()
    stops = re.findall(r"#[0-9a-f]+", css.partition(".scale")[2].partition("}")[0])
    assert stops[0] == "#000"
    rgb = [(0, 0, 0), *([int(stop[i : i + 2], 16) for i in (1, 3, 5)] for stop in stops[1:])]
    assert np.abs(np.array(rgb) - page.MAP_COLORS).max() <= 1


def test_names_in_the_page_are_escaped(tmp_path):
    result = scene_result(name="<script>alert(1)</script>")
    figures = [FigureSet("<img src=x>", [Figure("<i>", 1.0, "s")])]
    text = page.make_page([result], figures, [], tmp_path, "<b>")
    assert text.count("<script>") == 1 and "<img src=x>" not in text and "<b>" not in text and "<i>" not in text
