"""Set-up of the tests that run inside Blender: which GPU backend, a GPU context at module level, a clean scene."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator

import pytest

import rebound
from rebound.tests.blender import vulkan_backend

# A user folder of their own keeps the developer's preferences and add-ons out of the tests. Set before bpy starts.
_USER_FOLDER = tempfile.mkdtemp(prefix="rebound-test-user-")
os.environ["BLENDER_USER_RESOURCES"] = _USER_FOLDER

BACKEND = os.environ.get("REBOUND_TEST_BACKEND", "opengl").lower()

try:
    import bpy
    import gpu  # built into bpy, importable only after it

    _NO_BLENDER = ""
except ImportError as error:
    _NO_BLENDER = f"Blender cannot be imported here: {error}"


class _SkippedModule(pytest.Module):
    """Stands for a test file that cannot even be imported without bpy."""

    def collect(self):
        pytest.skip(_NO_BLENDER, allow_module_level=True)


def pytest_pycollect_makemodule(module_path, parent):
    """Skip every file of this folder, with the reason, where there is no Blender."""
    return _SkippedModule.from_parent(parent, path=module_path) if _NO_BLENDER else None


def pytest_unconfigure() -> None:
    """Remove the user folder; runs before the process leaves in tests/conftest.py."""
    shutil.rmtree(_USER_FOLDER, ignore_errors=True)


def _start_gpu_by_rendering() -> None:
    """Before 5.2 there is no gpu.init(): one render of an engine that owns a GPU context brings the GPU up for good."""

    class StarterEngine(bpy.types.RenderEngine):
        bl_idname = "REBOUND_TEST_STARTER"
        bl_label = "Test starter"
        bl_use_gpu_context = True

        def render(self, depsgraph):
            pass

    bpy.utils.register_class(StarterEngine)
    bpy.ops.wm.read_factory_settings(use_empty=False)  # its camera: Blender renders nothing without one
    scene = bpy.context.scene
    scene.render.engine = StarterEngine.bl_idname
    scene.render.resolution_x = scene.render.resolution_y = 8
    bpy.ops.render.render()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.utils.unregister_class(StarterEngine)


@pytest.fixture(scope="session", autouse=True)
def gpu_backend() -> str:
    """Start Blender's GPU once a process, on the backend of REBOUND_TEST_BACKEND; its name, "OPENGL" or "VULKAN"."""
    if BACKEND == "vulkan":
        vulkan_backend.select_vulkan()
    if bpy.app.version >= (5, 2):
        gpu.init()
    else:
        _start_gpu_by_rendering()
    name = gpu.platform.backend_type_get()
    assert name == BACKEND.upper(), f"asked for {BACKEND}, Blender runs on {name}"
    return name


@pytest.fixture
def clean_scene(gpu_backend) -> Iterator:
    """An empty file with factory settings; the scene of it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    yield bpy.context.scene


@pytest.fixture
def registered(clean_scene) -> Iterator:
    """The extension enabled in an empty file, and disabled again however the test ends."""
    rebound.register()
    yield clean_scene
    rebound.unregister()
