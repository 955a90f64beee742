"""A render that failed makes ``blender --background --render-frame`` end with a non-zero exit status.

Blender before 5.2 ends with 0 whatever its renders did. What is known here: a render that an engine reported an error
in, and one that Blender refused (no camera), both end in the handler ``render_cancel``, and no picture file is written.
On the command line we then leave the process with 1 when Python is finalised, after everything else has run.

A script that calls ``bpy.ops.render.render()`` gets a RuntimeError instead, and is never ended from here: under it
stand Python frames, under the command line there are none.
"""

import atexit
import os
import shutil
import sys
from types import FrameType

import bpy

from . import ENGINE_ID

FAILED = 1


@bpy.app.handlers.persistent
def _on_render_cancel(scene, _depsgraph=None) -> None:
    if bpy.app.background and not _driven_by_python(sys._getframe()) and scene.render.engine == ENGINE_ID:
        atexit.unregister(_leave)  # once is enough
        atexit.register(_leave, bpy.app.tempdir)


def _driven_by_python(handler: FrameType) -> bool:
    """True if a script called the render that called the handler."""
    return handler.f_back is not None


def _leave(temporary_directory: str) -> None:
    """End the process with the failure status; Blender gets no further chance to remove its temporary directory."""
    if os.path.basename(os.path.normpath(temporary_directory)).startswith("blender_"):
        shutil.rmtree(temporary_directory, ignore_errors=True)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(FAILED)


def register() -> None:
    bpy.app.handlers.render_cancel.append(_on_render_cancel)


def unregister() -> None:
    # Blender disables every extension before it finalises Python: a status that is already set has to survive this.
    if _on_render_cancel in bpy.app.handlers.render_cancel:
        bpy.app.handlers.render_cancel.remove(_on_render_cancel)
