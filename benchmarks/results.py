"""What was measured, as plain data and as JSON in out/bench. Tables, plots and pages are made from these alone."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

T = TypeVar("T")

REBOUND, EEVEE, CYCLES = "Rebound", "EEVEE", "Cycles"
F12 = ", F12 in Blender"  # ends the label of a method as Blender calls it; without it, the renderer alone


@dataclass(frozen=True)
class Point:
    """A picture after so many samples. ``seconds`` is the median of ``runs``, loading left out."""

    samples: int
    seconds: float
    runs: int
    scores: dict[str, dict[str, float]]  # Goal.key -> energy, relmse
    picture: str = ""  # file in the results' folder


@dataclass(frozen=True)
class Pass:
    """One kind of GPU work in a frame, by its shader's name; milliseconds a frame."""

    name: str
    kind: str  # raster, compute, upload
    milliseconds: float
    calls: float


@dataclass(frozen=True)
class Curve:
    """One engine, with Rebound one method, on one scene."""

    engine: str
    label: str  # as tables show it
    points: list[Point] = field(default_factory=list)
    first: float | None = None  # seconds from the loaded scene to its first picture
    passes: list[Pass] = field(default_factory=list)  # of a steady frame
    frame: float | None = None  # seconds of a steady frame with viewport settings
    first_frame: float | None = None  # the same for the first one
    device: str = ""

    @property
    def sample(self) -> float | None:
        """Seconds of one more sample: what grows along the curve, without what every picture costs."""
        if len(self.points) < 2:
            return None
        a, b = self.points[0], self.points[-1]
        return max(b.seconds - a.seconds, 0.0) / (b.samples - a.samples)

    def time_to(self, goal: str, relmse: float) -> float | None:
        """Seconds until the error is down to ``relmse``; None where it never was. Between two points, power laws."""
        before = None
        for point in self.points:
            error = point.scores.get(goal, {}).get("relmse", math.inf)
            if error <= relmse:
                return point.seconds if before is None else _crossing(before, (point.seconds, error), relmse)
            before = (point.seconds, error)
        return None


def _crossing(a: tuple[float, float], b: tuple[float, float], relmse: float) -> float:
    """Where the line from a to b on logarithmic axes meets ``relmse``. Each is (seconds, relmse)."""
    if not (math.isfinite(a[1]) and 0 < b[1] < a[1] and 0 < a[0] < b[0]):
        return b[0]
    part = math.log(a[1] / relmse) / math.log(a[1] / b[1])
    return a[0] * (b[0] / a[0]) ** part


@dataclass(frozen=True)
class SceneResult:
    """All curves of one scene."""

    name: str
    size: tuple[int, int]
    goals: list[str]
    labels: list[str]  # of the goals
    exposure: float
    curves: list[Curve]
    references: dict[str, str] = field(default_factory=dict)  # kind -> picture file
    triangles: int = 0
    lights: int = 0


@dataclass(frozen=True)
class Figure:
    """One figure with its meaning; ``against`` is what it is compared with, of the same unit."""

    name: str
    value: float | None
    unit: str
    against: float | None = None
    against_name: str = ""
    note: str = ""

    @property
    def ratio(self) -> float | None:
        return self.value / self.against if self.value is not None and self.against else None


@dataclass(frozen=True)
class FigureSet:
    """The figures of one question, e.g. what moving a light leaves behind."""

    title: str
    figures: list[Figure]
    device: str = ""


@dataclass(frozen=True)
class ScalePoint:
    x: int
    seconds: float  # a steady frame
    first: float  # from the loaded scene to its first picture
    passes: list[Pass] = field(default_factory=list)


@dataclass(frozen=True)
class Scaling:
    """How the time of a frame grows with one number."""

    title: str
    unit: str
    method: str
    points: list[ScalePoint]
    device: str = ""


def machine() -> str:
    """What times depend on, in words, without a name that could tell whose machine it was."""
    return f"{os.cpu_count()} CPU cores, {platform.system()} {platform.machine()}"


# --- files -----------------------------------------------------------------------------------------------------------


def write(path: Path, content: Any) -> None:
    """Write a dataclass, or a list of them, as JSON in one step."""
    path.parent.mkdir(parents=True, exist_ok=True)
    plain = [asdict(c) for c in content] if isinstance(content, list) else asdict(content)
    unfinished = path.with_suffix(".part")
    unfinished.write_text(json.dumps(plain, indent=1))
    os.replace(unfinished, path)


def read(path: Path, kind: type[T]) -> T:
    """What ``write`` wrote of one dataclass."""
    return _build(kind, json.loads(path.read_text()))


def read_list(path: Path, kind: type[T]) -> list[T]:
    """What ``write`` wrote of a list; nothing where there is no file."""
    return [_build(kind, item) for item in json.loads(path.read_text())] if path.exists() else []


def _build(kind: Any, plain: Any) -> Any:
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        hints = get_type_hints(kind)
        return kind(**{name: _build(hints[name], value) for name, value in plain.items() if name in hints})
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is list:
        return [_build(arguments[0], item) for item in plain]
    if origin is tuple:
        return tuple(plain)
    if origin in (dict, Mapping):
        return {key: _build(arguments[1], value) for key, value in plain.items()}
    return plain
