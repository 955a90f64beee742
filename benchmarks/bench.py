"""Measure Rebound beside EEVEE and Cycles: `.venv/bin/python benchmarks/bench.py [--scenes NAME ...] [--quick]`.

`make bench` runs all steps but the report, `make report` that one. Each step writes JSON to out/bench or reads what
another has written there, so that any can be run again by itself. docs/benchmarks.md explains what is measured.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import checkout  # noqa: F401  makes `rebound` importable

from rebound.benchmarks import results
from rebound.benchmarks.cases import ROOT, Case, chosen_cases, shared_folder
from rebound.benchmarks.curves import Plan, measure_scene
from rebound.benchmarks.figures import measure_figures
from rebound.benchmarks.jobs import blender_version
from rebound.benchmarks.page import make_page
from rebound.benchmarks.published import publish
from rebound.benchmarks.results import FigureSet, Scaling, SceneResult
from rebound.benchmarks.scaling import measure_scaling
from rebound.benchmarks.tables import figure_table, scene_tables

STEPS = ("curves", "figures", "scaling", "docs", "report")
DEFAULT_STEPS = STEPS[:-1]
SCALING_FRAMES, SCALING_FRAMES_QUICK = 5, 3


def main() -> None:
    """Run the steps that were asked for, in their order."""
    arguments = _arguments()
    plan = _plan(arguments)
    cases = chosen_cases(shared_folder(arguments.scenes_dir), arguments.scenes)
    folder = Path(arguments.out).resolve()
    start = time.monotonic()
    for step in [step for step in STEPS if step in arguments.steps]:
        _STEPS[step](cases, plan, folder, arguments)
    _say(f"done after {time.monotonic() - start:.0f} s")


def _curves(cases: list[Case], plan: Plan, folder: Path, arguments: argparse.Namespace) -> None:
    for case in cases:
        result = measure_scene(case, plan, folder, _say)
        results.write(folder / f"scene-{case.name}.json", result)
        print("\n".join(table.markdown() for table in scene_tables(result)), flush=True)


def _figures(cases: list[Case], plan: Plan, folder: Path, arguments: argparse.Namespace) -> None:
    for case in cases:
        found = measure_figures(case, plan, folder, arguments.quick, _say)
        for figure_set in found:
            print(figure_table(figure_set).markdown(), flush=True)
        if found:
            results.write(folder / f"figures-{case.name}.json", found)


def _scaling(cases: list[Case], plan: Plan, folder: Path, arguments: argparse.Namespace) -> None:
    frames = SCALING_FRAMES_QUICK if arguments.quick else SCALING_FRAMES
    results.write(folder / "scaling.json", measure_scaling(arguments.quick, frames, _say, arguments.curves))


def _docs(cases: list[Case], plan: Plan, folder: Path, arguments: argparse.Namespace) -> None:
    publish(ROOT / "docs" / "performance.md", *_measured(cases, folder), _machine(_measured(cases, folder)[0]))


def _report(cases: list[Case], plan: Plan, folder: Path, arguments: argparse.Namespace) -> None:
    missing = [case for case in cases if not (folder / f"scene-{case.name}.json").exists()]
    _curves(missing, plan, folder, arguments)
    measured = _measured(cases, folder)
    page = folder / "report.html"
    page.write_text(make_page(*measured, folder, _machine(measured[0])), encoding="utf-8")
    _say(f"{page}, {page.stat().st_size / 1e6:.1f} MB")


_STEPS = {"curves": _curves, "figures": _figures, "scaling": _scaling, "docs": _docs, "report": _report}


def _measured(cases: list[Case], folder: Path) -> tuple[list[SceneResult], list[FigureSet], list[Scaling]]:
    """What lies in ``folder`` of these scenes."""
    files = [folder / f"scene-{case.name}.json" for case in cases]
    scenes = [results.read(file, SceneResult) for file in files if file.exists()]
    figures = [f for case in cases for f in results.read_list(folder / f"figures-{case.name}.json", FigureSet)]
    return scenes, figures, results.read_list(folder / "scaling.json", Scaling)


def _machine(scenes: list[SceneResult]) -> str:
    devices = dict.fromkeys(curve.device for result in scenes for curve in result.curves if curve.device)
    return ", ".join([results.machine(), *devices, f"Blender {blender_version()}"])


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Measure Rebound beside EEVEE and Cycles.")
    parser.add_argument(
        "--scenes", nargs="*", default=[], metavar="NAME", help="default: the example, all shared scenes"
    )
    parser.add_argument(
        "--scenes-dir", metavar="DIR", help="the shared test scenes; default: REBOUND_SHARED, or ../shared"
    )
    parser.add_argument("--quick", action="store_true", help="few samples, one run, small sizes: minutes")
    parser.add_argument("--steps", nargs="+", choices=STEPS, default=list(DEFAULT_STEPS))
    parser.add_argument("--out", default=str(ROOT / "out" / "bench"), help="where results and pictures are kept")
    parser.add_argument("--runs", type=int, help="how often each is measured; the median counts")
    parser.add_argument("--size", type=int, nargs=2, metavar=("W", "H"), help="instead of the references' own size")
    parser.add_argument("--estimators", action="store_true", help="also every estimator that is not a method's default")
    parser.add_argument(
        "--curves", nargs="*", default=[], metavar="AXIS", help="scaling: lights pixels triangles instances"
    )
    parser.add_argument("--tiny", action="store_true", help="as little as possible: to see that everything works")
    return parser.parse_args()


def _plan(arguments: argparse.Namespace) -> Plan:
    plan = Plan.quick() if arguments.quick else Plan()
    if arguments.tiny:
        plan = Plan((1, 2), (1,), (1, 4), 10.0, 1, 2, (48, 32), (48, 48))
    changed = {"runs": arguments.runs, "size": arguments.size and tuple(arguments.size)}
    return replace(plan, estimators=arguments.estimators, **{k: v for k, v in changed.items() if v is not None})


def _say(line: str) -> None:
    print(f"bench: {line}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
