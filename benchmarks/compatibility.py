"""Render files as people have them, beside Cycles: `.venv/bin/python benchmarks/compatibility.py [FILE ...] [--write]`.

Every .blend of the shared test scenes with default settings, by a real F12 in background; a list of what is right and
what is not, and a picture of both in the out folder. docs/benchmarks.md explains what is measured.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import checkout  # noqa: F401  makes `rebound` importable

from rebound.benchmarks import results
from rebound.benchmarks.cases import ROOT, shared_folder
from rebound.benchmarks.jobs import Done, Job, do
from rebound.benchmarks.outcomes import LIMITS, Outcome, content, counted, line, publish, save_pair
from rebound.benchmarks.pictures import COMBINED, read_passes
from rebound.benchmarks.results import CYCLES, REBOUND
from rebound.benchmarks.score import scores

WIDTH, SAMPLES = 320, 64  # of files without a reference, and of Cycles' picture of them
DEFAULT_SAMPLES = 64  # Rebound's


def main() -> None:
    """Measure the files that were asked for, show what came of them, and write the page where that is wanted."""
    arguments = _arguments()
    shared = shared_folder(arguments.scenes_dir)
    files = [Path(name).resolve() for name in arguments.files] or sorted((shared / "scenes").rglob("*.blend"))
    if not files:
        raise SystemExit(f"bench: no .blend below {shared / 'scenes'}")
    folder = Path(arguments.out).resolve()
    for blend in files:
        found = arguments.table or measure(blend, shared, folder, arguments)
        if isinstance(found, Outcome):
            results.write(folder / f"outcome-{blend.stem}.json", found)
            print(f"bench: {line(found)}", flush=True)
    kept = [folder / f"outcome-{blend.stem}.json" for blend in files]
    outcomes = [results.read(path, Outcome) for path in kept if path.exists()]
    print(text := content(outcomes), flush=True)
    if arguments.write:
        publish(text)


def measure(blend: Path, shared: Path, folder: Path, arguments: argparse.Namespace) -> Outcome:
    """Render one file with Rebound, and with Cycles where it has no reference; a pair of pictures into ``folder``."""
    reference = shared / "references" / f"{blend.stem}.multi_bounce.exr"
    try:
        if reference.exists():
            truth, said = read_passes(reference), "shared"
            height, width = truth[COMBINED].shape[:2]
        else:
            order = Job(str(blend), CYCLES, arguments.cycles_samples, (arguments.width, 0), staged=True)
            truth, said = read_passes(_one(order, folder / "jobs").file), f"Cycles, {order.samples} samples"
            height, width = truth[COMBINED].shape[:2]
        order = Job(str(blend), REBOUND, arguments.samples, (width, height), cold=True, staged=True)
        done = _one(order, folder / "jobs")
    except SystemExit as error:
        return Outcome(blend.stem, error=str(error))
    passes = read_passes(done.file)
    save_pair(folder / f"{blend.stem}.png", truth, passes)
    found = {name: scores(*(counted(name, p) for p in (truth, passes))) for name in LIMITS}
    return Outcome(
        blend.stem, said, (width, height), done.seconds, found, done.details["warnings"], samples=order.samples
    )


def _one(job: Job, folder: Path) -> Done:
    return do([job], folder, lambda _line: None)[0]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Render files as people have them, beside Cycles.")
    parser.add_argument("files", nargs="*", metavar="FILE.blend", help="default: all shared test scenes")
    parser.add_argument("--scenes-dir", metavar="DIR", help="the shared test scenes; default: REBOUND_SHARED")
    parser.add_argument("--out", default=str(ROOT / "out" / "compatibility"), help="where pictures and results go")
    parser.add_argument("--width", type=int, default=WIDTH, help="pixels, of files without a reference")
    parser.add_argument("--samples", type=int, default=DEFAULT_SAMPLES, help="Rebound's; its default is the default")
    parser.add_argument("--cycles-samples", type=int, default=SAMPLES, help="of files without a reference")
    parser.add_argument("--table", action="store_true", help="render nothing: only what was measured before")
    parser.add_argument("--write", action="store_true", help="write the table into docs/compatibility.md")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
