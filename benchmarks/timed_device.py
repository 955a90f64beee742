"""A device that keeps time: every draw, dispatch and clear that goes through it, by the shader's name.

It stands before a real device and has the same calls, so that neither renderer nor techniques know of it. A bracket of
``finish`` around each call is exact on software and keeps a GPU idle between calls; a real GPU has timers of its own.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, cast

import numpy as np

from rebound.device import Device

from .results import Pass

RASTER, COMPUTE, UPLOAD = "raster", "compute", "upload"


class WallClock:
    """Waits for the GPU before and after, and takes the time between."""

    name = "wall time with the GPU waited for"

    def __init__(self, device: Device) -> None:
        self._device = device
        self._spans: list[tuple[str, str, float]] = []

    @contextmanager
    def span(self, name: str, kind: str) -> Iterator[None]:
        self._device.finish()
        start = time.perf_counter()
        yield
        self._device.finish()
        self._spans.append((name, kind, time.perf_counter() - start))

    def take(self) -> list[tuple[str, str, float]]:
        """(name, kind, seconds) of every span since the last call."""
        spans, self._spans = self._spans, []
        return spans


class QueryClock:
    """OpenGL's timer queries of a headless device: the GPU's own time, read when all is done."""

    name = "GPU timer queries"

    def __init__(self, device: Any) -> None:
        self._device = device
        self._context = device._ctx  # moderngl's; no other code needs it
        self._spans: list[tuple[str, str, Any]] = []
        self._unused: list[Any] = []

    @contextmanager
    def span(self, name: str, kind: str) -> Iterator[None]:
        query = self._unused.pop() if self._unused else self._context.query(time=True)
        with query:
            yield
        self._spans.append((name, kind, query))

    def take(self) -> list[tuple[str, str, float]]:
        spans, self._spans = self._spans, []
        self._unused += [query for _, _, query in spans]
        return [(name, kind, query.elapsed * 1e-9) for name, kind, query in spans]


def best_clock(device: Device) -> WallClock | QueryClock:
    """Timer queries where a GPU answers them. A software device's leave out what it does on the calling thread."""
    if device.is_software or not hasattr(device, "_ctx"):
        return WallClock(device)
    clock = QueryClock(device)
    with clock.span("", RASTER):
        device.free(device.texture((1024, 1024), "RGBA32F"))
    return clock if clock.take()[0][2] > 0 else WallClock(device)  # a driver without the counter answers 0


class TimedDevice:
    """Stands before ``device``. ``passes`` is what was done since the last call of it."""

    def __init__(self, device: Device, clock: WallClock | QueryClock | None = None) -> None:
        self._device = device
        self.clock = clock or best_clock(device)

    @property
    def as_device(self) -> Device:
        """Itself, for who asks for a Device."""
        return cast(Device, self)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._device, name)

    def draw(self, shader: Any, *given: Any, **named: Any) -> None:
        self._timed(shader.name, RASTER, self._device.draw, shader, *given, **named)

    def fullscreen(self, shader: Any, *given: Any, **named: Any) -> None:
        self._timed(shader.name, RASTER, self._device.fullscreen, shader, *given, **named)

    def dispatch(self, shader: Any, *given: Any, **named: Any) -> None:
        self._timed(shader.name, COMPUTE, self._device.dispatch, shader, *given, **named)

    def clear(self, *given: Any, **named: Any) -> None:
        self._timed("clear", RASTER, self._device.clear, *given, **named)

    @contextmanager
    def drawing(self, shader: Any, *given: Any, **named: Any) -> Iterator[Any]:
        with self.clock.span(shader.name, RASTER), self._device.drawing(shader, *given, **named) as draw:
            yield draw

    def texture(self, size: Any, format: str, data: np.ndarray | None = None, **named: Any) -> Any:
        if data is None:
            return self._device.texture(size, format, data, **named)
        return self._timed("textures", UPLOAD, self._device.texture, size, format, data, **named)

    def vertices(self, attributes: Any) -> Any:
        return self._timed("vertices", UPLOAD, self._device.vertices, attributes)

    def _timed(self, name: str, kind: str, call: Callable[..., Any], *given: Any, **named: Any) -> Any:
        span: AbstractContextManager = self.clock.span(name, kind)
        with span:
            return call(*given, **named)

    def passes(self, frames: int = 1) -> list[Pass]:
        """What was done since the last call, summed by name, the longest first; divided by ``frames``."""
        sums: dict[tuple[str, str], list[float]] = {}
        for name, kind, seconds in self.clock.take():
            sums.setdefault((name, kind), []).append(seconds)
        passes = [Pass(n, k, 1000 * sum(s) / frames, len(s) / frames) for (n, k), s in sums.items()]
        return sorted(passes, key=lambda p: -p.milliseconds)


def median_passes(frames: list[list[Pass]]) -> list[Pass]:
    """The median of every pass over frames that were measured one by one; 0 for a frame that lacks it."""
    values: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for passes in frames:
        for p in passes:
            values.setdefault((p.name, p.kind), []).append((p.milliseconds, p.calls))
    result = []
    for (name, kind), seen in values.items():
        padded = np.array(seen + [(0.0, 0.0)] * (len(frames) - len(seen)))
        milliseconds, calls = np.median(padded, axis=0)
        if calls:
            result.append(Pass(name, kind, float(milliseconds), float(calls)))
    return sorted(result, key=lambda p: -p.milliseconds)
