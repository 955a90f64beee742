"""Check the system libraries that the bpy wheel, the tests and the lint need; install them when root.

Everything that is missing is named in one message with the one apt-get line that fixes it.
"""

from __future__ import annotations

import ctypes
import glob
import os
import shutil
import subprocess
import sys
from pathlib import Path

# Shared library -> Debian package. What `ldd` lists for bpy 4.5 to 5.2 beyond libc, and EGL, opened at run time.
BLENDER_LIBRARIES = {
    "libX11.so.6": "libx11-6",
    "libXrender.so.1": "libxrender1",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libXxf86vm.so.1": "libxxf86vm1",
    "libXext.so.6": "libxext6",
    "libSM.so.6": "libsm6",
    "libICE.so.6": "libice6",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libstdc++.so.6": "libstdc++6",
}
# Files of which any one will do -> Debian package. A vendor's own driver is as good as Mesa's software one.
BLENDER_FILES = {
    ("/usr/share/glvnd/egl_vendor.d/*.json", "/etc/glvnd/egl_vendor.d/*.json"): "libegl-mesa0",
    ("/usr/lib/*/dri/*_dri.so", "/usr/lib/*/libEGL_nvidia.so*"): "libgl1-mesa-dri",
}
TEST_LIBRARIES = {"libvulkan.so.1": "libvulkan1"}
TEST_FILES = {("/usr/share/vulkan/icd.d/*.json", "/etc/vulkan/icd.d/*.json"): "mesa-vulkan-drivers"}
# Programs of which any one will do -> Debian package.
TEST_PROGRAMS = {
    ("glslangValidator",): "glslang-tools",
    ("chromium-headless-shell", "chromium", "google-chrome"): "chromium-headless-shell",
}


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def missing_packages(for_tests: bool) -> list[str]:
    """Debian packages to install before bpy can render, and, for tests, before lint and Vulkan can run."""
    libraries = BLENDER_LIBRARIES | (TEST_LIBRARIES if for_tests else {})
    files = BLENDER_FILES | (TEST_FILES if for_tests else {})
    programs = TEST_PROGRAMS if for_tests else {}
    packages = [package for library, package in libraries.items() if not _loads(library)]
    packages += [package for patterns, package in files.items() if not any(map(glob.glob, patterns))]
    packages += [package for names, package in programs.items() if not any(map(shutil.which, names))]
    return list(dict.fromkeys(packages))


def unresolved(bpy_folder: Path) -> list[str]:
    """Libraries that the installed bpy wheel links and the loader cannot find."""
    listing = subprocess.run(["ldd", str(bpy_folder / "__init__.so")], capture_output=True, text=True)
    return [line.split()[0] for line in listing.stdout.splitlines() if "not found" in line]


def require(packages: list[str]) -> None:
    """Install `packages` when root, else leave with the line that does. Raises SystemExit."""
    if not packages:
        return
    install = ["apt-get", "install", "--yes", "--no-install-recommends", *packages]
    line = f"apt-get update && {' '.join(install)}"
    if os.geteuid() != 0 or not shutil.which("apt-get"):
        raise SystemExit(f"setup: missing system packages: {' '.join(packages)}\n       run as root:  {line}")
    print(f"setup: installing system packages: {' '.join(packages)}", flush=True)
    quiet = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    for command in (["apt-get", "update"], install):
        answer = subprocess.run(command, env=quiet, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if answer.returncode != 0:
            raise SystemExit(f"{answer.stdout}\nsetup: {' '.join(command)} failed; as root, run:  {line}")


if __name__ == "__main__":
    require(missing_packages(for_tests="--for-tests" in sys.argv))
