"""The built zip installs into a clean Blender, with no network, and brings the engine and its wheels."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
DEAD_PROXY = "http://127.0.0.1:9"

# What Blender carries itself: bpy and its own requirements. The test environment's OpenEXR and moderngl stay out.
BLENDER_OWN = ("bpy", "numpy", "numpy.libs")
BLENDER_OWN += ("requests", "urllib3", "idna", "certifi", "charset_normalizer", "zstandard")
BLENDER_OWN += ("attr", "attrs", "cattr", "cattrs", "typing_extensions.py")

# Runs in a Blender of its own.
INSTALL = """
import os, sys
import bpy
import addon_utils  # found once bpy has started
zip_file = sys.argv[1]
addon_utils.enable("bl_pkg")
result = bpy.ops.extensions.package_install_files(filepath=zip_file, repo="user_default", enable_on_install=True)
assert result == {"FINISHED"}, result
module = "bl_ext.user_default.rebound"
assert module in bpy.context.preferences.addons, list(bpy.context.preferences.addons.keys())
bpy.context.scene.render.engine = "REBOUND"
assert hasattr(bpy.context.scene, "rebound")
extensions = bpy.utils.user_resource("EXTENSIONS")
import OpenEXR, moderngl, glcontext
for wheel in (OpenEXR, moderngl, glcontext):
    assert wheel.__file__.startswith(extensions), wheel.__file__
assert sys.modules[module].__file__.startswith(extensions)
addon_utils.disable(module)
assert not hasattr(bpy.context.scene, "rebound")
print("INSTALLED", flush=True)
os._exit(0)
"""


@pytest.fixture(scope="module")
def package() -> Path:
    """The zip, built from this tree. Fetching the wheels is the one step that may use the network."""
    subprocess.run([sys.executable, ROOT / "tools" / "package.py"], check=True)
    return next((ROOT / "dist").glob("rebound-*.zip"))


def _without_network() -> list[str]:
    """A command prefix that cuts the network off, where the user may; elsewhere the dead proxies have to do."""
    unshare = shutil.which("unshare")
    if unshare and subprocess.run([unshare, "--net", "true"], capture_output=True).returncode == 0:
        return [unshare, "--net"]
    return []


@pytest.fixture
def bare_environment(tmp_path: Path) -> dict[str, str]:
    """Environment variables under which Python sees what Blender carries and no more, and Blender a clean user."""
    modules = tmp_path / "modules"
    modules.mkdir()
    site = Path(sysconfig.get_paths()["platlib"])
    for name in BLENDER_OWN:
        if (site / name).exists():
            (modules / name).symlink_to(site / name)
    proxies = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY"), DEAD_PROXY)
    return os.environ | proxies | {"PYTHONPATH": str(modules), "BLENDER_USER_RESOURCES": str(tmp_path / "user")}


@pytest.mark.slow
def test_package_installs_and_enables_without_network(package, bare_environment):
    python = Path(sys.base_prefix) / "bin" / f"python{sys.version_info.major}.{sys.version_info.minor}"
    command = [*_without_network(), python, "-S", "-c", INSTALL, package]
    answer = subprocess.run(command, env=bare_environment, capture_output=True, text=True, timeout=200)
    assert "INSTALLED" in answer.stdout, answer.stdout + answer.stderr
    assert "Traceback" not in answer.stderr, answer.stderr
