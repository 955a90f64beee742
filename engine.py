"""The RenderEngine: each callback is a few lines that call a session. Only here and in operators are errors caught."""

from __future__ import annotations

import logging
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import bpy

from . import ENGINE_ID
from .device.blender import unbind
from .device.interface import DeviceError
from .final_render import render as render_final
from .gpu_probe import missing_gpu
from .main_thread import MAIN_THREAD, MainThreadError
from .render_result import register_passes
from .renderer import RenderError
from .scene.errors import SceneError
from .session import SESSIONS
from .viewport import Viewport

LOGGER = logging.getLogger("rebound")

# What a user, a file or a machine can cause; the message is one line that says what to do. All else is our own fault.
USER_FAULTS = (SceneError, RenderError, DeviceError, MainThreadError)


class ReboundEngine(bpy.types.RenderEngine):
    """Rebound for Blender. Its objects come and go as Blender likes; the state is in a Viewport or a final render."""

    bl_idname = ENGINE_ID
    bl_label = "Rebound"
    bl_use_preview = True
    bl_use_eevee_viewport = True  # Material Preview mode is drawn by EEVEE, with its own studio lights
    bl_use_shading_nodes_custom = False
    # In background this is the only way to a GPU context. In a window it would freeze the interface (main_thread.py).
    bl_use_gpu_context = bpy.app.background

    missing_gpu = ""  # why there is no GPU in background, see _stand_down_without_gpu

    def update_render_passes(self, scene=None, renderlayer=None):
        with boundary(self._fail):
            register_passes(self, scene, renderlayer)

    def render(self, depsgraph):
        with boundary(self._fail):
            if self.missing_gpu:
                raise DeviceError(self.missing_gpu)
            render_final(self, depsgraph)

    def view_update(self, context, depsgraph):
        with boundary(self._fail_view):
            self._viewport().update(context, depsgraph)

    def view_draw(self, context, depsgraph):
        with boundary(self._fail_view):
            self._viewport().draw(context, depsgraph)
        with boundary(self._fail_view):
            self._show_state(context)

    def _show_state(self, context) -> None:
        """What stands over the picture, and whether Blender is to come again."""
        viewport = self._viewport()
        viewport.draw_error(context)
        self.update_stats("", viewport.progress)
        if viewport.unfinished:
            self.tag_redraw()

    def _viewport(self) -> Viewport:
        # Not made in __init__, which Blender calls twice for one object and for final renders too.
        if not hasattr(self, "viewport"):
            self.viewport = Viewport()
            # Blender destroys an engine object on any thread, mostly without a GPU context.
            weakref.finalize(self, MAIN_THREAD.later, self.viewport.session.free).atexit = False
        return self.viewport

    def _fail_view(self, message: str) -> None:
        viewport = getattr(self, "viewport", None)
        if viewport is None:  # it could not be made
            self._fail(message)
        else:
            viewport.fail(message)

    def _fail(self, message: str) -> None:
        """An error that is reported (not raised, not error_set) makes Blender cancel: no picture is written."""
        self.report({"ERROR"}, f"Rebound: {message}")


@contextmanager
def boundary(fail: Callable[[str], None]) -> Iterator[None]:
    """Nothing gets past a callback: every error becomes one line for ``fail``, our own faults a traceback as well."""
    try:
        yield
    except USER_FAULTS as error:
        LOGGER.debug("user fault", exc_info=True)
        fail(_one_line(str(error)))
    except KeyboardInterrupt:  # Ctrl-C where Blender is a Python module: it would go on and write a black picture
        fail("interrupted")
    except Exception as error:  # our own fault: the boundary that architecture.md names
        LOGGER.exception("internal error")
        fail(_one_line(f"internal error, see the console: {type(error).__name__}: {error}"))


def _one_line(text: str) -> str:
    return " ".join(text.split())


@bpy.app.handlers.persistent
def _stand_down_without_gpu(scene, _depsgraph=None) -> None:
    """Before a background render: where Blender would crash starting its GPU, have render() called without one.

    Blender reads ``bl_use_gpu_context`` when the class is registered and then never asks again.
    """
    missing = missing_gpu() if scene.render.engine == ReboundEngine.bl_idname else ""
    if missing:
        bpy.utils.unregister_class(ReboundEngine)
        ReboundEngine.missing_gpu, ReboundEngine.bl_use_gpu_context = missing, False
        bpy.utils.register_class(ReboundEngine)


def register() -> None:
    if bpy.app.background:
        bpy.app.handlers.render_init.append(_stand_down_without_gpu)
    bpy.utils.register_class(ReboundEngine)


def unregister() -> None:
    if _stand_down_without_gpu in bpy.app.handlers.render_init:
        bpy.app.handlers.render_init.remove(_stand_down_without_gpu)
    SESSIONS.free_all()
    unbind()
    if getattr(ReboundEngine, "is_registered"):  # noqa: B009  unknown to Blender's stubs
        bpy.utils.unregister_class(ReboundEngine)
