"""The process that bakes: `python -m rebound.bake.worker SNAPSHOT.npz --bake ROW=FILE.exr ... [--kind GLOSSY] ...`

ROW is the place of the object among the scene's instances. What happens is said in lines of JSON on the standard
output:

    {"device": "CPU, rays by Embree 4.4.1"}     once, before the first ray
    {"progress": 0.25, "doing": "shadows"}      any number of them
    {"warning": "..."}                          what was done in another way than it should be
    {"done": ["FILE.exr", ...], "seconds": 12}  exit status 0
    {"error": "..."}                            exit status 1
    {"cancelled": true}                         exit status 2

With --ask, a line "cancel" on the standard input, or its end, cancels: a worker does not outlive its Blender. An
interrupt or a request to terminate cancels too. Files are written when all is done, each in one step: a bake that
failed or was cancelled leaves those there were.
"""

from __future__ import annotations

import argparse
import json
import logging
import signal
import sys
import threading
import time
from collections.abc import Hashable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TextIO

from ..scene.data import Scene
from ..scene.snapshot import SnapshotError, load_snapshot
from .file import BakeFileError, write_bake
from .job import BakeSettings, bake_objects

DONE, FAILED, CANCELLED = 0, 1, 2
# Seconds between two lines of progress.
_INTERVAL = 0.2


class _Reporter(logging.Handler):
    """Says what happens, a line of JSON each; the log's warnings too."""

    def __init__(self, out: TextIO) -> None:
        super().__init__(logging.WARNING)
        self._out = out
        self._said = float("-inf")

    def say(self, **what: object) -> None:
        self._out.write(json.dumps(what) + "\n")
        self._out.flush()

    def progress(self, part: float, doing: str) -> None:
        """Not more often than a person can see."""
        now = time.monotonic()
        if now - self._said >= _INTERVAL:
            self._said = now
            self.say(progress=round(part, 4), doing=doing)

    def emit(self, record: logging.LogRecord) -> None:
        self.say(warning=record.getMessage())


def _arguments(words: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Bake the radiance transfer of objects of a snapshot.")
    parser.add_argument("snapshot", type=Path)
    parser.add_argument("--bake", action="append", required=True, metavar="ROW=FILE.exr", type=_target)
    parser.add_argument("--ask", action="store_true", help="a line on the standard input, or its end, cancels")
    defaults = BakeSettings()
    for field in fields(BakeSettings):
        value = getattr(defaults, field.name)
        if isinstance(value, bool):
            parser.add_argument(f"--{field.name}", action=argparse.BooleanOptionalAction, default=value)
        else:
            name = f"--{field.name.replace('_', '-')}"
            parser.add_argument(name, type=type(value), default=value, dest=field.name)
    return parser.parse_args(words)


def _target(text: str) -> tuple[int, Path]:
    row, _, path = text.partition("=")
    if not path:
        raise ValueError(text)
    return int(row), Path(path)


def _listen(asked: threading.Event, source: TextIO) -> None:
    for line in source:
        if line.strip() == "cancel":
            break
    asked.set()


def _targets(scene: Scene, wanted: Sequence[tuple[int, Path]]) -> dict[Hashable, Path]:
    """The keys of the objects and where they go. Raises ValueError for a row that there is not."""
    wrong = [row for row, _ in wanted if not 0 <= row < len(scene.instances)]
    if wrong:
        raise ValueError(f"the scene has {len(scene.instances)} objects and none in row {wrong[0]}")
    rows = [row for row, _ in wanted]
    if len(set(rows)) < len(rows):
        raise ValueError("a row is to be baked into two files: name each object once")
    return {scene.instances[row].key: path for row, path in wanted}


def bake(arguments: argparse.Namespace, reporter: _Reporter, asked: threading.Event) -> int:
    """Bake and write, unless ``asked`` to stop; the exit status."""
    start = time.monotonic()
    try:
        settings = BakeSettings(**{field.name: getattr(arguments, field.name) for field in fields(BakeSettings)})
        scene, _ = load_snapshot(arguments.snapshot)
        targets = _targets(scene, arguments.bake)
        work = bake_objects(scene, list(targets), settings)
        while not asked.is_set():
            try:
                step = next(work)
            except StopIteration as end:
                for key, path in targets.items():
                    write_bake(path, end.value[key])
                reporter.say(done=[str(p) for p in targets.values()], seconds=round(time.monotonic() - start, 2))
                return DONE
            if step.device:
                reporter.say(device=step.device)
            reporter.progress(step.part, step.doing)
    except (SnapshotError, BakeFileError, OSError, ValueError, ImportError, MemoryError) as error:
        reporter.say(error=str(error) or type(error).__name__)
        return FAILED
    reporter.say(cancelled=True)
    return CANCELLED


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; the exit status."""
    arguments = _arguments(words)
    asked, reporter = threading.Event(), _Reporter(sys.stdout)
    logging.getLogger("rebound").addHandler(reporter)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: asked.set())
    if arguments.ask:
        threading.Thread(target=_listen, args=(asked, sys.stdin), daemon=True).start()
    return bake(arguments, reporter, asked)


if __name__ == "__main__":
    sys.exit(main())
