"""Rebound in a real Blender window on a virtual screen: `.venv/bin/python tools/test_window.py [SCENARIO …]`.

The package of `make package` is installed as a user does, then every scenario of tests/window/ runs in a Blender of
its own, on OpenGL and on Vulkan. Screenshots and logs go to out/window/. Where there is no Blender with a window and
none can be made (tools/window_tree.py), one line says why and nothing fails.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import package
import passed_before
from environments import ROOT
from window_tree import CACHE, Place, Unavailable, find_place

SCENARIOS = ROOT / "tests" / "window"
OUT = ROOT / "out" / "window"
EXAMPLE = ROOT / "examples" / "cornell_box.blend"  # what scenarios open that measure; REBOUND_SCENE names another
BACKENDS = ("opengl", "vulkan")
# What runs by default; the others are asked for by name. What hangs on no backend runs on one: ten minutes are enough.
_ON_BOTH = ("viewport", "views", "overlays", "edits", "final_render")
DEFAULT = {"opengl": (*_ON_BOTH, "hands", "motion", "looks", "panels", "bake"), "vulkan": _ON_BOTH}
SCREEN = "1280x800x24"
INSTALL_SECONDS = 120
# A Blender that is not done by then hangs, and is killed. The longest scenario takes a quarter of it; where others work
# on the machine, most of it.
LIMIT_SECONDS = 600
SOAK_SECONDS = 5400  # of soak, which is only asked for by name
# It measures memory: with the C library's allocator, that gives back what is freed (tests/window/soak.py).
SOAK_VARIABLES = {"LD_PRELOAD": "libc.so.6", "MALLOC_MMAP_THRESHOLD_": str(2**18), "MALLOC_ARENA_MAX": "4"}


@dataclass(frozen=True)
class Outcome:
    """What one scenario counted in one Blender."""

    passed: int
    failed: int
    seconds: float
    note: str = ""


class Blender:
    """Blenders of one place that share a home folder with Rebound installed in it."""

    def __init__(self, place: Place, home: Path) -> None:
        self._place, self._home = place, home
        for folder in (CACHE / "shaders", home / "tests", home / "out", home / "user"):
            folder.mkdir(exist_ok=True)
        for script in SCENARIOS.glob("*.py"):
            shutil.copy(script, home / "tests")
        shutil.copy(os.environ.get("REBOUND_SCENE", EXAMPLE), home / "tests" / "scene.blend")

    def path(self, file: Path) -> str:
        return self._place.path(file)

    def run(self, command: list[str], log: Path, seconds: float, **variables: str) -> int:
        """Run ``command`` there and return its exit status; 124 where it did not end in time and was killed."""
        kept = {name: value for name, value in os.environ.items() if name.startswith(("REBOUND_", "LP_", "MESA_"))}
        environment = kept | {
            "HOME": self.path(self._home),
            "PATH": os.environ["PATH"] if self._place.tree is None else "/usr/sbin:/usr/bin:/sbin:/bin",
            "LANG": "C.UTF-8",
            "BLENDER_USER_RESOURCES": self.path(self._home / "user"),
            "XDG_CACHE_HOME": self.path(CACHE / "shaders"),  # what Mesa and Blender compiled: kept
            "PYTHONPATH": self.path(self._home / "tests"),
            **variables,
        }
        with log.open("w") as file, _running(self._place.command(*command), environment, file) as process:
            try:
                return process.wait(seconds)
            except subprocess.TimeoutExpired:
                return 124

    @contextmanager
    def screen(self) -> Iterator[str]:
        """A virtual screen of its own; its name for DISPLAY."""
        xvfb = ["Xvfb", "-displayfd", "1", "-screen", "0", SCREEN, "-nolisten", "tcp", "+extension", "GLX"]
        environment = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin"}
        command = self._place.command(*xvfb)
        with _running(command, environment, subprocess.PIPE, subprocess.DEVNULL) as process:
            assert process.stdout is not None
            number = process.stdout.readline().decode().strip()
            if not number:
                raise SystemExit("test-window: Xvfb did not start")
            yield f":{number}"


@contextmanager
def _running(command: list[str], environment: dict, stdout, stderr=subprocess.STDOUT) -> Iterator[subprocess.Popen]:
    """A process with all that it starts, of which nothing outlives the block."""
    process = subprocess.Popen(
        command, env=environment, stdin=subprocess.DEVNULL, stdout=stdout, stderr=stderr, start_new_session=True
    )
    try:
        yield process
    finally:
        for kill in (signal.SIGTERM, signal.SIGKILL):
            if process.poll() is None:
                os.killpg(process.pid, kill)
                try:
                    process.wait(5)
                except subprocess.TimeoutExpired:
                    continue


def install(blender: Blender, home: Path) -> str:
    """Install the package the way a user does, without network. Returns Blender's version. Raises SystemExit."""
    built = max(package.DIST.glob("rebound-*.zip"), key=lambda path: path.stat().st_mtime)
    shutil.copy(built, home / built.name)
    log = home / "install.log"
    command = ["blender", "--offline-mode", "--command", "extension", "install-file", "--repo=user_default"]
    status = blender.run([*command, "--enable", blender.path(home / built.name)], log, INSTALL_SECONDS)
    if status != 0:
        raise SystemExit(f"{log.read_text()}\ntest-window: Blender could not install {built.name} (status {status})")
    blender.run(["blender", "--version"], log, INSTALL_SECONDS)
    return log.read_text().split("\n")[0]


def run_scenario(blender: Blender, home: Path, scenario: str, backend: str) -> Outcome:
    """Run one scenario in a Blender of its own; what it drew and said goes to out/window/<backend>/<scenario>/."""
    out, log, start = home / "out", home / "log.txt", time.monotonic()
    with blender.screen() as display:
        command = ["blender", "--offline-mode", "--python-use-system-env", "--window-geometry", "0", "0", "1280", "800"]
        command += ["--gpu-backend", backend, "--python", blender.path(home / "tests" / f"{scenario}.py")]
        limit, variables = (SOAK_SECONDS, SOAK_VARIABLES) if scenario == "soak" else (LIMIT_SECONDS, {})
        status = blender.run(command, log, limit, DISPLAY=display, WINDOW_OUT=blender.path(out), **variables)
    seconds = time.monotonic() - start
    shutil.move(log, out / "log.txt")
    outcome = read_log((out / "log.txt").read_text(errors="replace"), status, seconds)
    kept = OUT / backend / scenario
    shutil.rmtree(kept, ignore_errors=True)
    shutil.copytree(out, kept)
    shutil.rmtree(out)
    out.mkdir()
    if outcome.failed:
        print(f"test-window: {scenario} on {backend} FAILED: {outcome.note}\n{_told(kept / 'log.txt')}", flush=True)
    return outcome


def read_log(text: str, status: int, seconds: float) -> Outcome:
    """Count the checks that a scenario printed (tests/window/steps.py), and all else that must not happen."""
    lines = text.splitlines()
    passed, failed = (sum(line.startswith(f">> {word}") for line in lines) for word in ("ok  ", "FAIL "))
    notes = []
    if status == 124:
        notes.append(f"killed after {seconds:.0f} s")
    elif status != 0:
        notes.append(f"Blender ended with status {status}")
    if ">> DONE" not in lines:
        notes.append("the scenario did not come to its end")
    announced = sum(line.startswith(">> a traceback is expected") for line in lines)
    tracebacks = sum(line.startswith("Traceback") for line in lines)
    if tracebacks != announced:
        notes.append(f"{tracebacks} tracebacks, {announced} announced")
    return Outcome(passed, failed + len(notes), seconds, "; ".join(notes))


def _told(log: Path) -> str:
    """What scenario and extension said, and errors."""
    wanted = re.compile(r"(>>|rebound:|Traceback|[A-Za-z]*Error\b|    raise |  File .*(rebound|tests))")
    return "\n".join(line for line in log.read_text(errors="replace").splitlines() if wanted.match(line))


def _print_table(rows: list[tuple[str, str, Outcome]]) -> None:
    print(f"\n{'scenario':14} {'backend':8} {'passed':>7} {'failed':>7} {'time':>7}  note")
    for scenario, backend, one in rows:
        print(f"{scenario:14} {backend:8} {one.passed:7} {one.failed:7} {one.seconds:5.0f} s  {one.note}".rstrip())


def _copy_pictures(rows: list[tuple[str, str, Outcome]], folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for scenario, backend, _outcome in rows:
        for picture in (OUT / backend / scenario).glob("*.png"):
            shutil.copy(picture, folder)


def _arguments() -> argparse.Namespace:
    there = sorted(path.stem for path in SCENARIOS.glob("*.py") if path.stem != "steps")
    parser = argparse.ArgumentParser(description="Test Rebound in a real Blender window.")
    parser.add_argument("scenarios", nargs="*", metavar="SCENARIO", help=f"of {', '.join(there)}")
    parser.add_argument("--copy-to", type=Path, metavar="FOLDER", help="copy the scenarios' pictures into it")
    parser.add_argument("--backend", choices=BACKENDS, action="append", help="only this one")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.scenarios if name not in there]
    if unknown:
        parser.error(f"no such scenario: {', '.join(unknown)}; there are {', '.join(there)}")
    return arguments


def main() -> int:
    """Every default scenario, or those named, on both backends; non-zero when anything failed."""
    arguments = _arguments()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("test-window: stopped"))  # so that Blender is stopped as well
    try:
        place = find_place()
    except Unavailable as reason:
        print(f"test-window: skipped: {reason}")
        return 0
    package.main()
    CACHE.mkdir(parents=True, exist_ok=True)
    rows: list[tuple[str, str, Outcome]] = []
    # The folder of compiled shaders stays; all else is new every time.
    with tempfile.TemporaryDirectory(dir=CACHE, prefix="home-") as folder:
        home = Path(folder)
        blender = Blender(place, home)
        print(f"test-window: {install(blender, home)}", flush=True)
        for backend in arguments.backend or BACKENDS:
            for scenario in arguments.scenarios or DEFAULT[backend]:
                rows.append((scenario, backend, _run_or_recall(blender, home, scenario, backend, arguments)))
    if arguments.copy_to:
        _copy_pictures(rows, arguments.copy_to)
    _print_table(rows)
    total = [sum(getattr(row[2], name) for row in rows) for name in ("passed", "failed", "seconds")]
    print(f"{total[0]} passed, {total[1]} failed, {total[2]:.0f} s", flush=True)
    return 1 if total[1] or not total[0] else 0


def _run_or_recall(blender: Blender, home: Path, scenario: str, backend: str, arguments) -> Outcome:
    key = f"window/{backend}/{scenario}"
    known = None if arguments.scenarios else passed_before.recall(key)
    if known:
        return replace(Outcome(**known), note="already passed on this tree")
    tree, outcome = passed_before.tree_hash(), run_scenario(blender, home, scenario, backend)
    if not outcome.failed:
        passed_before.remember(key, asdict(outcome), tree)
    return outcome


if __name__ == "__main__":
    sys.exit(main())
