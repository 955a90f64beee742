"""A bake in a process of its own, as whoever asked for it sees it: how far it is, and how to end it.

Knows no Blender: the operator asks ``poll`` in a timer, scripts and the command line call ``wait``.
"""

from __future__ import annotations

import importlib.util
import json
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Hashable, Mapping
from dataclasses import asdict, replace
from enum import Enum
from pathlib import Path

import numpy as np

from ..scene.data import Scene, View
from ..scene.snapshot import save_snapshot
from .job import BakeSettings

ROOT = Path(__file__).resolve().parent.parent
# The extension may lie in any folder and be called bl_ext.….rebound: the worker makes it "rebound" again.
_START = """
import importlib.util, runpy, sys
root = sys.argv.pop(1)
spec = importlib.util.spec_from_file_location("rebound", root + "/__init__.py", submodule_search_locations=[root])
sys.modules["rebound"] = importlib.util.module_from_spec(spec)
runpy.run_module("rebound.bake.worker", run_name="__main__", alter_sys=True)
"""
# What the worker imports from outside; Blender keeps an extension's wheels where only its own process looks.
_LIBRARIES = ("numpy", "OpenEXR")
_NOTHING_SEEN = View(np.eye(4), np.eye(4), 1, 1)
# Progress below this part tells nothing of how long the rest takes.
_TELLS = 0.02
_PATIENCE = 0.05  # seconds between two looks of ``wait``


class Outcome(Enum):
    """How a bake ended."""

    DONE = "DONE"
    FAILED = "FAILED"
    CANCELLED = "CANCELLED"


class BakeProcess:
    """One worker at its work. ``poll`` brings the attributes up to date; ``close`` ends it, however it stands."""

    def __init__(self, scene: Scene, files: Mapping[Hashable, Path], settings: BakeSettings) -> None:
        """Start to bake the instances with the keys of ``files`` into these. Raises OSError, ValueError."""
        self.part = 0.0  # 0..1
        self.doing = "starting"
        self.device = ""  # what traces the rays
        self.warnings: list[str] = []
        self.error = ""
        self.outcome: Outcome | None = None
        self._files = dict(files)
        self._started = time.monotonic()
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._folder = Path(tempfile.mkdtemp(prefix="rebound-bake-"))
        try:
            snapshot = self._folder / "scene.npz"
            save_snapshot(snapshot, _without_bakes(scene), _NOTHING_SEEN)
            self._process = self._start(_words(scene, snapshot, self._files, settings))
        except BaseException:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def seconds(self) -> float:
        """Since the start."""
        return time.monotonic() - self._started

    @property
    def seconds_left(self) -> float | None:
        """About how long it still takes; None while nobody can tell."""
        return None if self.part < _TELLS else self.seconds * (1.0 - self.part) / self.part

    def poll(self) -> Outcome | None:
        """Take in what the worker said since the last call; how it ended, once it did."""
        while self.outcome is None:
            try:
                line = self._lines.get_nowait()
            except queue.Empty:
                return None
            if line is None:
                self._ended_without_a_word()
            else:
                self._take_in(line)
        return self.outcome

    def wait(self, each: Callable[[BakeProcess], None] = lambda process: None) -> Outcome:
        """Let it work to its end; ``each`` is called now and then."""
        while self.poll() is None:
            each(self)
            time.sleep(_PATIENCE)
        assert self.outcome is not None
        return self.outcome

    def cancel(self) -> None:
        """Ask it to end; ``poll`` tells when it did."""
        try:
            if self._process.stdin and not self._process.stdin.closed:
                self._process.stdin.close()
        except OSError:  # it has ended already
            return

    def close(self) -> None:
        """End the worker if it still works, and clean up. Harmless when repeated."""
        self.cancel()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join(5.0)
        if self._process.stdout:
            self._process.stdout.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _start(self, words: list[str]) -> subprocess.Popen:
        folders = dict.fromkeys(filter(None, map(_folder_of, _LIBRARIES)))
        paths = [*folders, os.environ.get("PYTHONPATH", "")]
        with open(self._folder / "errors.txt", "wb") as errors:
            return subprocess.Popen(
                [sys.executable, "-c", _START, str(ROOT), *words],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                encoding="utf-8",
                env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths)), "PYTHONIOENCODING": "utf-8"},
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),  # Windows
            )

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def _take_in(self, line: str) -> None:
        try:
            said = json.loads(line)
        except ValueError:  # a library that prints
            return
        self.part = said.get("progress", self.part)
        self.doing = said.get("doing", self.doing)
        self.device = said.get("device", self.device)
        if "warning" in said:
            self.warnings.append(said["warning"])
        if "done" in said:
            self.part, self.outcome = 1.0, Outcome.DONE
        elif "error" in said:
            self.error, self.outcome = said["error"], Outcome.FAILED
        elif "cancelled" in said:
            self.outcome = Outcome.CANCELLED

    def _ended_without_a_word(self) -> None:
        status = self._process.wait()
        said = (self._folder / "errors.txt").read_text(encoding="utf-8", errors="replace").strip().splitlines()
        reason = said[-1] if said else "it was ended from outside, or there was not enough memory"
        self.error, self.outcome = f"the process that bakes ended with status {status}: {reason}", Outcome.FAILED


def _words(scene: Scene, snapshot: Path, files: Mapping[Hashable, Path], settings: BakeSettings) -> list[str]:
    """The worker's command line."""
    rows = {instance.key: row for row, instance in enumerate(scene.instances)}
    words = [str(snapshot), "--ask"]
    for key, path in files.items():
        words += ["--bake", f"{rows[key]}={path}"]
    for name, value in asdict(settings).items():
        dashed = name.replace("_", "-")
        if isinstance(value, bool):
            words.append(f"--{name}" if value else f"--no-{name}")
        else:
            words.append(f"--{dashed}={value.value if isinstance(value, Enum) else value}")
    return words


def _without_bakes(scene: Scene) -> Scene:
    """What the worker need not read."""
    return replace(scene, instances=tuple(replace(i, transfer=None) for i in scene.instances), transfers={})


def _folder_of(library: str) -> str | None:
    """Where a library that can be imported lies."""
    spec = importlib.util.find_spec(library)
    if spec is None or spec.origin is None:
        return None
    path = Path(spec.origin)
    return str(path.parent.parent if spec.submodule_search_locations else path.parent)
