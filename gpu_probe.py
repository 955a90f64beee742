"""Can Blender start its GPU in background? Asked before it tries, because without one it ends the whole process.

On Linux, background Blender makes an OpenGL 4.3 context through EGL, and crashes or aborts where it gets none, before
a render engine is called at all. So the same is tried here first, through the same library. The answer "no" is only
given when it is sure; on other systems and on Vulkan nothing is tried.
"""

from __future__ import annotations

import ctypes
import sys

import bpy
import gpu

_OPENGL_API = 0x30A2
_PLATFORM_SURFACELESS = 0x31DD
_NONE = 0x3038
_CONFIG = (ctypes.c_int * 5)(0x3033, 0, 0x3040, 0x0008, _NONE)  # any EGL_SURFACE_TYPE; EGL_RENDERABLE_TYPE: OpenGL
_OPENGL_4_3_CORE = (ctypes.c_int * 7)(0x3098, 4, 0x30FB, 3, 0x30FD, 1, _NONE)


def missing_gpu() -> str:
    """One line that says why Blender cannot start its GPU in background, or "" where it can or may."""
    if not sys.platform.startswith("linux") or _is_started() or _wants_vulkan():
        return ""
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return "No usable GPU: libEGL.so.1 is missing (on Debian: apt-get install libegl1 libgl1-mesa-dri)"
    if any(_makes_context(egl, display) for display in _displays(egl)):
        return ""
    return "No usable GPU: no OpenGL 4.3 (software OpenGL will do; on Debian: apt-get install libegl1 libgl1-mesa-dri)"


def _is_started() -> bool:
    try:
        return gpu.platform.backend_type_get() not in ("NONE", "UNKNOWN")
    except SystemError:  # Blender's word for "not started yet"
        return False


def _wants_vulkan() -> bool:
    return "--gpu-backend" in sys.argv or bpy.context.preferences.system.gpu_backend != "OPENGL"


def _displays(egl: ctypes.CDLL) -> list[ctypes.c_void_p]:
    """The displays that a context can be had from: the default one, and Mesa's without any window system."""
    egl.eglGetDisplay.restype = ctypes.c_void_p
    displays = [egl.eglGetDisplay(None)]
    if hasattr(egl, "eglGetPlatformDisplay"):
        egl.eglGetPlatformDisplay.restype = ctypes.c_void_p
        displays.append(egl.eglGetPlatformDisplay(_PLATFORM_SURFACELESS, None, None))
    return [ctypes.c_void_p(display) for display in displays if display]


def _makes_context(egl: ctypes.CDLL, display: ctypes.c_void_p) -> bool:
    """True if an OpenGL 4.3 context can be made on the display. It is destroyed, the display stays open for Blender."""
    config, count = ctypes.c_void_p(), ctypes.c_int()
    if not egl.eglInitialize(display, None, None) or not egl.eglBindAPI(_OPENGL_API):
        return False
    if not egl.eglChooseConfig(display, _CONFIG, ctypes.byref(config), 1, ctypes.byref(count)) or not count.value:
        return False
    egl.eglCreateContext.restype = ctypes.c_void_p
    context = egl.eglCreateContext(display, config, None, _OPENGL_4_3_CORE)
    if context:
        egl.eglDestroyContext(display, ctypes.c_void_p(context))
    return bool(context)
