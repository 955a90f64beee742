"""Run the test suite of one environment: `.venv/bin/python tools/run_tests.py`.

Two runs of pytest: one without Blender, one inside it. They never share a process, because a moderngl context takes
over Blender's. Each spreads its tests over a process for every core, as much of a test is one thread of Python. What
passed is remembered for this exact source tree, so that `make test-all` does not run it again.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import asdict, dataclass
from pathlib import Path

import passed_before
from environments import PYTHON_OF_BLENDER, ROOT, venv_path, venv_python

# Suite -> pytest arguments. The slow ones are for `make test-all`, on OpenGL.
SUITES = {
    "plain": ["tests/unit", "tests/headless", "-m", "not slow"],
    "blender": ["tests/blender", "-m", "not slow"],
    "plain, slow": ["tests/unit", "tests/headless", "-m", "slow"],
    "blender, slow": ["tests/blender", "-m", "slow"],
}
_NOTHING_COLLECTED = 5
# A process inside Blender takes up to 4 GB; tests that share a fixture of minutes are marked as one group.
_IN_PARALLEL = ("--numprocesses=auto", "--maxprocesses=4", "--dist=loadgroup")


@dataclass(frozen=True)
class Outcome:
    """What one pytest process counted."""

    passed: int
    failed: int
    skipped: int
    seconds: float

    def __add__(self, other: Outcome) -> Outcome:
        return Outcome(
            self.passed + other.passed,
            self.failed + other.failed,
            self.skipped + other.skipped,
            self.seconds + other.seconds,
        )


def run(blender: str, backend: str, suite: str) -> Outcome:
    """Run one suite in a process of its own. A process that dies without a report counts as one failure."""
    report = ROOT / ".cache" / f"{blender}-{backend}-{suite.replace(', ', '-')}.xml"
    report.parent.mkdir(exist_ok=True)
    report.unlink(missing_ok=True)
    print(f"\n=== Blender {blender}, {backend}, suite {suite}", flush=True)
    command = [venv_python(blender), "-m", "pytest", "--quiet", f"--junitxml={report}", *_IN_PARALLEL, *SUITES[suite]]
    tree, start = passed_before.tree_hash(), time.monotonic()
    status = subprocess.run(command, cwd=ROOT, env=os.environ | {"REBOUND_TEST_BACKEND": backend}).returncode
    outcome = _read(report, status, time.monotonic() - start)
    if outcome.failed == 0:
        passed_before.remember(f"{blender}/{backend}/{suite}", asdict(outcome), tree)
    return outcome


def _read(report: Path, status: int, seconds: float) -> Outcome:
    if not report.exists():
        print(f"test: pytest ended with status {status} and no report: it crashed or was stopped", flush=True)
        return Outcome(0, 1, 0, seconds)
    suite = ElementTree.parse(report).getroot()[0].attrib
    total, skipped = int(suite["tests"]), int(suite["skipped"])
    failed = int(suite["failures"]) + int(suite["errors"])
    if status not in (0, _NOTHING_COLLECTED):
        failed = max(failed, 1)
    return Outcome(max(total - failed - skipped, 0), failed, skipped, seconds)


def main() -> int:
    """Run the quick suites of the environment whose Python runs this script."""
    here = Path(sys.prefix).resolve()
    blender = next(version for version in PYTHON_OF_BLENDER if venv_path(version).resolve() == here)
    outcomes = [run(blender, "opengl", suite) for suite in ("plain", "blender")]
    total = outcomes[0] + outcomes[1]
    print(f"\ntest: Blender {blender}, OpenGL, {total.seconds:.0f} s")
    print(f"{total.passed} passed, {total.failed} failed, {total.skipped} skipped", flush=True)
    return 1 if total.failed or not total.passed else 0


if __name__ == "__main__":
    sys.exit(main())
