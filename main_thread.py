"""GPU work of a final render, run on the thread that has Blender's GPU context.

In background, and wherever a render runs on the main thread, that is the calling thread itself. F12 in a window renders
in a thread of its own. Blender would lend it the GPU context (``bl_use_gpu_context``), but then freezes its whole
interface until the render ends, so that Esc never arrives. Instead the render thread posts each bounded piece of GPU
work here, a timer on the main thread runs it, and between two pieces Blender draws its interface.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import TypeVar

import bpy

T = TypeVar("T")
LOGGER = logging.getLogger("rebound")

IDLE_INTERVAL = 0.1  # seconds between two looks at an empty queue: how long the first piece of a render may wait
BUSY_INTERVAL = 0.002  # seconds between two ticks of a running render: time for Blender's own events
BUDGET = 0.03  # seconds of work in one tick, so that the interface keeps 20 to 30 frames a second
BUSY_AFTER_JOB = 0.5  # seconds after a piece for which the timer stays fast
NO_ANSWER = 120.0  # seconds after which a main thread that took no job is given up


class Cancelled(Exception):  # noqa: N818  an event, no error
    """The render was cancelled before this piece of work was begun."""


class MainThreadError(Exception):
    """The main thread took no work for so long that the render gives up."""


class MainThread:
    """The queue between render threads and the timer."""

    def __init__(self) -> None:
        self._jobs: queue.SimpleQueue[tuple[Future, Callable[[], object]]] = queue.SimpleQueue()
        self._newest_job = 0.0
        self._rendered = False  # whether viewports wait for a final render to end

    def is_busy(self) -> bool:
        """True while a final render gives this thread work; all viewports are redrawn when that ends."""
        return time.monotonic() - self._newest_job < BUSY_AFTER_JOB

    def run(self, call: Callable[[], T], cancelled: Callable[[], bool], *, patience: float = NO_ANSWER) -> T:
        """Run ``call`` on the main thread and return what it returns, or raise what it raises.

        Work that was not begun yet is withdrawn when ``cancelled()`` says so (raises Cancelled) and when the main
        thread does not get to it within ``patience`` seconds (raises MainThreadError): Blender may be quitting,
        and then waits for us.
        """
        if threading.current_thread() is threading.main_thread():
            return call()
        future = self._put(call)
        deadline = time.monotonic() + patience
        while not wait((future,), timeout=0.05).done:
            if cancelled() and future.cancel():
                raise Cancelled
            if time.monotonic() > deadline and future.cancel():
                raise MainThreadError(f"Blender's main thread did not answer for {patience:.0f} s")
        try:
            return future.result()
        finally:
            del future  # an error would refer to this frame, and this frame to the error

    def post(self, call: Callable[[], object]) -> None:
        """Run ``call`` on the main thread some time later (now, where this is the main thread)."""
        if threading.current_thread() is threading.main_thread():
            call()
        else:
            self.later(call)

    def later(self, call: Callable[[], object]) -> None:
        """Run ``call`` from the timer, when the main thread is sure to have its GPU context."""
        self._put(call).add_done_callback(_log_error)

    def _put(self, call: Callable[[], object]) -> Future:
        future: Future = Future()
        self._jobs.put((future, call))
        return future

    def tick(self) -> float:
        """What the timer calls: do waiting work for a bounded time and say when to come again."""
        end = time.monotonic() + BUDGET
        while time.monotonic() < end:
            try:
                job = self._jobs.get_nowait()
            except queue.Empty:
                break
            _complete(*job)
            del job  # an error refers to the frames it came through and to their callers, so to this one
            self._newest_job = time.monotonic()
        busy = self.is_busy()
        if self._rendered and not busy:
            _redraw_viewports()
        self._rendered = busy
        return BUSY_INTERVAL if busy else IDLE_INTERVAL


def _redraw_viewports() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _log_error(future: Future) -> None:
    """For work that nobody waits for."""
    error = None if future.cancelled() else future.exception()
    if error is not None:
        LOGGER.error("internal error", exc_info=error)


def _complete(future: Future, call: Callable[[], object]) -> None:
    """Run ``call`` for ``future`` unless it was withdrawn."""
    if not future.set_running_or_notify_cancel():
        return
    try:
        future.set_result(call())
    except Exception as error:  # noqa: BLE001  not swallowed: handed to the thread that waits for it, which raises it
        _forget_locals(error)
        waiting = future
        # This very frame is part of the traceback: what it still names would live and die with the error.
        del future, call
        waiting.set_exception(error)
        del waiting


def _forget_locals(error: BaseException) -> None:
    """Let go of what the frames that an error came through still hold: GPU objects may die on this thread only.

    The traceback keeps its lines. The errors that this one came of have frames of their own.
    """
    seen: set[int] = set()
    waiting: list[BaseException | None] = [error]
    while waiting:
        at = waiting.pop()
        if at is None or id(at) in seen:
            continue
        seen.add(id(at))
        traceback.clear_frames(at.__traceback__)
        waiting += (at.__cause__, at.__context__)


# One per process, as Blender has one main thread. The timer is registered when the extension is enabled, because
# registering one from a render thread is a race inside Blender.
MAIN_THREAD = MainThread()


def _tick() -> float:
    return MAIN_THREAD.tick()  # a function and no bound method: Blender knows a timer by the identity of its function


def register() -> None:
    if not bpy.app.background:
        bpy.app.timers.register(_tick, first_interval=IDLE_INTERVAL, persistent=True)


def unregister() -> None:
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
