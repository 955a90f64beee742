"""What Blender is asked to do: jobs as plain data, done by blender_worker.py, and never twice where nothing changed."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from .results import CYCLES, REBOUND

WORKER = Path(__file__).resolve().parent / "blender_worker.py"
SAID = "bench: "  # what the worker's lines for a person begin with; Blender prints many others


@dataclass(frozen=True)
class Job:
    """One thing that Blender does with a file: a picture, or with ``engine`` "" a snapshot of the scene.

    ``cold``: the engine's first picture in its process; its time has shaders compiled and geometry read in it.
    ``camera``: where the camera stands instead, (4, 4) by rows. ``staged``: given what it lacks to be rendered.
    """

    blend: str
    engine: str = ""
    samples: int = 1
    size: tuple[int, int] | None = None  # None: the file's own; a height of 0: by the file's aspect
    bounces: int = 8
    cold: bool = False
    runs: int = 1
    camera: list[list[float]] | None = None
    settings: dict[str, Any] = field(default_factory=dict)  # of scene.rebound
    staged: bool = False

    @property
    def is_kept(self) -> bool:
        """What Rebound does changes from day to day, and reading a scene takes no time."""
        return self.engine not in ("", REBOUND)

    def name(self, blender: str) -> str:
        """The name of its files: the same for the same work on the same Blender."""
        values = asdict(replace(self, blend="", runs=1)) | {"blender": blender, "content": _content(self.blend)}
        if self.engine != CYCLES:
            values.pop("bounces")
        if not self.staged:
            values.pop("staged")
        digest = hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:12]
        what = f"{self.engine.lower()}-{self.samples}{'-first' if self.cold else ''}" if self.engine else "scene"
        return f"{Path(self.blend).stem}-{what}-{digest}"


@dataclass(frozen=True)
class Done:
    """What came of a job: ``file`` is an EXR with passes, or a snapshot."""

    file: Path
    seconds: float
    runs: int
    details: dict[str, Any]


@cache
def _content(blend: str) -> str:
    return hashlib.sha256(Path(blend).read_bytes()).hexdigest()


def blender_version() -> str:
    """The version of the bpy that this environment has, "" without one."""
    try:
        return metadata.version("bpy")
    except metadata.PackageNotFoundError:
        return ""


def do(jobs: Sequence[Job], folder: Path, say: Callable[[str], None] = print, *, redo: bool = False) -> list[Done]:
    """The jobs' results in order, from ``folder`` where they lie there, else from one process of Blender.

    All jobs must be about one file. Raises SystemExit with the end of Blender's output when it fails.
    """
    folder.mkdir(parents=True, exist_ok=True)
    version = blender_version()
    names = [job.name(version) for job in jobs]
    wanted = {n: job for n, job in zip(names, jobs, strict=True) if redo or not (job.is_kept and _is_done(folder, n))}
    if wanted and not version:
        raise SystemExit("bench: this Python has no bpy: run it with the one in .venv, made by `make setup`")
    if wanted:
        _run_worker(wanted, folder, say)
    return [_done(folder, name) for name in names]


def _is_done(folder: Path, name: str) -> bool:
    return (folder / f"{name}.json").exists()


def _done(folder: Path, name: str) -> Done:
    answer = json.loads((folder / f"{name}.json").read_text())
    return Done(folder / answer["file"], answer["seconds"], answer["runs"], answer["details"])


def _run_worker(wanted: dict[str, Job], folder: Path, say: Callable[[str], None]) -> None:
    for name in wanted:
        (folder / f"{name}.json").unlink(missing_ok=True)
    order = folder / "jobs.json"
    order.write_text(json.dumps({name: asdict(job) for name, job in wanted.items()}))
    log = folder / "blender.log"
    with open(log, "w") as output:
        process = subprocess.Popen(
            [sys.executable, str(WORKER), str(order)],
            stdout=subprocess.PIPE,
            stderr=output,
            text=True,
            errors="replace",
        )
        assert process.stdout is not None
        for line in process.stdout:
            output.write(line)
            if line.startswith(SAID):
                say(line.removeprefix(SAID).rstrip())
        process.wait()
    missing = [name for name in wanted if not _is_done(folder, name)]
    if missing:
        tail = "".join(log.read_text(errors="replace").splitlines(keepends=True)[-15:])
        raise SystemExit(f"{tail}\nbench: Blender did not finish {', '.join(missing)} (all it said is in {log})")
