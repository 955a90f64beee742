"""A final render: one view layer of one frame, from the depsgraph to Blender's RenderResult."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TypeVar

import bpy
import numpy as np

from .main_thread import MAIN_THREAD, NO_ANSWER, Cancelled
from .passes import PASSES, RenderPass
from .render_result import add_passes, fill, wanted_passes
from .renderer import RenderError
from .scene.cameras import active_camera, border_pixels, camera_view
from .scene.data import View
from .session import SESSIONS, Picture, Session, read_settings
from .settings import Settings

T = TypeVar("T")
LOGGER = logging.getLogger("rebound")

INTERIM_SECONDS = 1.0  # between two unfinished pictures shown in a window
LOG_SECONDS = 5.0  # between two progress lines on the console
LAST_READ_SECONDS = 2.0  # for fetching the picture after Esc; a Blender that quits does not answer any more
PREVIEW_SAMPLES = 8  # of a material's preview picture: it is small and redrawn at every edit
COMBINED = PASSES[:1]


def render(engine, depsgraph) -> None:
    """Render what ``engine.render`` was called for.

    Raises SceneError, DeviceError, RenderError and MainThreadError for what is not the programmer's fault. Cancelling
    is none: the samples so far are kept, as in Cycles.
    """
    session = Session()
    try:
        _FinalRender(engine, depsgraph, session).run()
    finally:
        MAIN_THREAD.post(session.free)


class _FinalRender:
    """The steps of one render."""

    def __init__(self, engine, depsgraph, session: Session) -> None:
        self.engine = engine
        self.depsgraph = depsgraph
        self.session = session
        self.settings = _settings(engine, depsgraph)
        self.total = int(self.settings["samples"])
        self.started = self.shown = self.logged = time.monotonic()
        self.said = ""
        self.passes = wanted_passes(depsgraph.view_layer)

    def run(self) -> None:
        if self.depsgraph.scene.render.use_multiview and not self.engine.is_preview:
            raise RenderError("Stereo and multi-view are not rendered yet: switch Output > Stereoscopy off")
        self.engine.update_stats("", "Reading the scene")
        try:
            self.session.sync(self.depsgraph, for_viewport=False, on_main_thread=self._on_main_thread)
            if not self.engine.is_preview:  # whose scene is Blender's, not the user's
                self._announce()
            view, wanted = _view(self.engine, self.depsgraph), [p.key for p in self.passes]
            picture = self._gpu(lambda: self.session.picture(view, self.settings, wanted))
            with _open_result(self.engine, self.depsgraph, view) as result:
                self._accumulate(picture, result)
                self._finish(picture, result)
        except Cancelled:
            LOGGER.info("cancelled before the first sample")

    def _announce(self) -> None:
        SESSIONS.newest = self.session.status
        for line in self.session.status.warnings:
            self.engine.report({"WARNING"}, line)

    def _accumulate(self, picture: Picture, result) -> None:
        """Add sample after sample until there are enough or the user cancels."""
        try:
            while picture.lacks(self.total) and not self.engine.test_break():
                whole = self._gpu(picture.piece)
                self._report_progress(picture, whole)
                if whole:
                    self._show(picture, result)
        except Cancelled:
            pass  # the samples so far are kept

    def _show(self, picture: Picture, result) -> None:
        """Show the unfinished picture in the window, about once a second."""
        now = time.monotonic()
        if bpy.app.background or picture.samples >= self.total or now - self.shown < INTERIM_SECONDS:
            return
        self.shown = now
        fill(result, COMBINED, self._gpu(lambda: _read(picture, COMBINED)).__getitem__)
        self.engine.update_result(result)

    def _finish(self, picture: Picture, result) -> None:
        """Put every pass into the result; after a cancel, those of the samples that were finished."""
        if not picture.samples:
            raise Cancelled
        cancelled = self.engine.test_break()
        patience = LAST_READ_SECONDS if cancelled else NO_ANSWER
        pictures = self._gpu(lambda: _read(picture, self.passes), lambda: False, patience)
        fill(result, self.passes, pictures.__getitem__)
        ending = "cancelled after" if cancelled else "finished"
        seconds = time.monotonic() - self.started
        LOGGER.info("%s %d samples, %.1f s, on %s", ending, picture.samples, seconds, self.session.status.device)

    def _report_progress(self, picture: Picture, whole: bool) -> None:
        done, now = picture.done, time.monotonic()
        self.engine.update_progress(min(done / self.total, 1.0))
        memory = picture.status.statistics.get("gpu_bytes")
        text = f"Sample {min(int(done) + 1, self.total)}/{self.total}"
        text += f" | GPU memory {memory / 2**20:.0f} MiB" if memory else ""
        if text != self.said:  # Blender 4.5 prints every one of these in background
            self.said = text
            self.engine.update_stats("", text)
        if whole and (picture.samples == self.total or now - self.logged >= LOG_SECONDS):
            self.logged = now
            LOGGER.info("sample %d/%d, %.1f s", picture.samples, self.total, now - self.started)

    def _on_main_thread(self, call: Callable[[], T]) -> T:
        return MAIN_THREAD.run(call, self.engine.test_break)

    def _gpu(self, call: Callable[[], T], cancelled: Callable[[], bool] | None = None, patience=NO_ANSWER) -> T:
        """Run a piece of GPU work where the GPU context is."""
        work = call if bpy.app.background else lambda: self.session.in_timer(call)
        return MAIN_THREAD.run(work, cancelled or self.engine.test_break, patience=patience)


def _read(picture: Picture, passes: Sequence[RenderPass]) -> dict[str, np.ndarray]:
    return {p.key: picture.read(p.key) for p in passes}


@contextmanager
def _open_result(engine, depsgraph, view: View) -> Iterator:
    """The RenderResult of this view layer, to be filled; thrown away if what is done with it raises."""
    layer = depsgraph.view_layer
    result = engine.begin_result(0, 0, view.width, view.height, layer=layer.name)
    failed = True
    try:
        if (result.resolution_x, result.resolution_y) != (view.width, view.height):
            raise RenderError(
                f"Blender wants {result.resolution_x} x {result.resolution_y} pixels where Rebound rendered "
                f"{view.width} x {view.height}: please report the scene's resolution and border"
            )
        add_passes(engine, layer)
        yield result
        failed = False
    finally:
        engine.end_result(result, cancel=failed)


def _settings(engine, depsgraph) -> Settings:
    settings = read_settings(depsgraph.scene_eval, viewport=engine.is_preview)
    if not engine.is_preview:
        return settings
    return Settings({**settings.values, "samples": min(int(settings["samples"]), PREVIEW_SAMPLES)})


def _view(engine, depsgraph) -> View:
    """The camera's view of the picture, or of its render border."""
    camera = active_camera(depsgraph, engine)
    width, height = engine.resolution_x, engine.resolution_y
    border = border_pixels(depsgraph.scene_eval.render, width, height)
    return camera_view(camera, depsgraph, engine, width=width, height=height, border=border)
