"""Run the suite on every Blender that this machine can run, on OpenGL and on Vulkan, and print one table."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass

import passed_before
import run_tests
from environments import PYTHON_OF_BLENDER, usable_blenders
from setup import set_up

SUITES_OF_BACKEND = {"opengl": ("plain", "blender", "plain, slow", "blender, slow"), "vulkan": ("blender",)}
# What needs no Blender runs once a Python, on the newest Blender of it.
_NEEDS_PYTHON_ONLY = ("plain", "plain, slow")


@dataclass
class Row:
    """One line of the table."""

    blender: str
    backend: str
    outcome: run_tests.Outcome | None
    note: str


def _suites(blender: str, backend: str) -> list[str]:
    same_python = [other for other in usable_blenders() if PYTHON_OF_BLENDER[other] == PYTHON_OF_BLENDER[blender]]
    first = same_python[0] == blender
    return [suite for suite in SUITES_OF_BACKEND[backend] if first or suite not in _NEEDS_PYTHON_ONLY]


def _run_backend(blender: str, backend: str) -> Row:
    total, reused = run_tests.Outcome(0, 0, 0, 0.0), []
    for suite in _suites(blender, backend):
        known = passed_before.recall(f"{blender}/{backend}/{suite}")
        if known:
            reused.append(suite)
            print(f"\n=== Blender {blender}, {backend}, suite {suite}: already passed on this tree, not run again")
        total += run_tests.Outcome(**known) if known else run_tests.run(blender, backend, suite)
    return Row(blender, backend, total, f"already passed: {'; '.join(reused)}" if reused else "")


def _run_blender(blender: str) -> list[Row]:
    if blender not in usable_blenders():
        reason = f"skipped: needs Python {PYTHON_OF_BLENDER[blender]}, not found"
        return [Row(blender, backend, None, reason) for backend in SUITES_OF_BACKEND]
    try:
        set_up(blender, for_tests=True)
    except (SystemExit, subprocess.CalledProcessError) as error:
        failure = run_tests.Outcome(0, 1, 0, 0.0)
        return [Row(blender, backend, failure, f"set-up failed: {error}") for backend in SUITES_OF_BACKEND]
    return [_run_backend(blender, backend) for backend in SUITES_OF_BACKEND]


def _print_table(rows: list[Row]) -> None:
    print(f"\n{'Blender':8} {'backend':8} {'passed':>7} {'failed':>7} {'skipped':>8} {'time':>7}  note")
    for row in rows:
        counts = f"{'-':>7} {'-':>7} {'-':>8} {'-':>7}"
        if row.outcome:
            one = row.outcome
            counts = f"{one.passed:7} {one.failed:7} {one.skipped:8} {one.seconds:5.0f} s"
        print(f"{row.blender:8} {row.backend:8} {counts}  {row.note}".rstrip())


def main() -> int:
    """Every version on every backend; non-zero when anything failed or nothing ran."""
    rows = [row for blender in PYTHON_OF_BLENDER for row in _run_blender(blender)]
    _print_table(rows)
    total = sum((row.outcome for row in rows if row.outcome), run_tests.Outcome(0, 0, 0, 0.0))
    print(f"{total.passed} passed, {total.failed} failed, {total.skipped} skipped", flush=True)
    return 1 if total.failed or not total.passed else 0


if __name__ == "__main__":
    sys.exit(main())
