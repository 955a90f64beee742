"""How long each pass takes. A GPU tells no times here: it is waited for after every pass, which costs time itself."""

from __future__ import annotations

import time
from collections.abc import Mapping

from ...device.interface import Device


class Clock:
    """Times the passes of a sample while it is ``on``; does nothing else."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.on = False
        self.seconds: Mapping[str, float] = {}  # by pass, of the newest whole sample
        self._new: dict[str, float] | None = None
        self._since = 0.0
        self._before = 0.0  # seconds of the pass under way before the last pause

    def begin(self) -> None:
        """A sample begins."""
        self._new = {} if self.on else None
        if self._new is None:
            self.seconds = {}
            return
        self.device.finish()
        self._since, self._before = time.perf_counter(), 0.0

    def mark(self, name: str) -> None:
        """What was done since the last mark was the pass ``name``."""
        if self._new is None:
            return
        self.device.finish()
        now = time.perf_counter()
        self._new[name] = self._new.get(name, 0.0) + self._before + now - self._since
        self._since, self._before = now, 0.0

    def pause(self) -> None:
        """Others work from here: their time is not counted."""
        if self._new is not None:
            self.device.finish()
            self._before += time.perf_counter() - self._since

    def resume(self) -> None:
        """The sample goes on."""
        self._since = time.perf_counter()

    def end(self) -> None:
        """The sample is whole."""
        if self._new is not None:
            self.seconds = self._new
