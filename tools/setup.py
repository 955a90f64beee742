"""Make the virtual environment of one Blender version: `python3 tools/setup.py [--blender 5.2] [--for-tests]`.

Without --blender the newest Blender is taken whose Python this machine has, and `.venv` becomes a link to it.
A stamp in the environment makes a second run return at once.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import time
from pathlib import Path

import system_libraries
from environments import (
    PYTHON_OF_BLENDER,
    ROOT,
    Python,
    find_python,
    requirements,
    usable_blenders,
    venv_path,
    venv_python,
)

STAMP = "rebound-setup.txt"


def choose_blender(wanted: str | None) -> str:
    """The Blender version to set up. Raises SystemExit naming what is missing."""
    usable = usable_blenders()
    if wanted is None and usable:
        return usable[0]
    if wanted is None:
        raise SystemExit("setup: needs Python 3.13 (Blender 5.2) or 3.11 (Blender 5.0, 4.5); neither was found")
    if wanted not in PYTHON_OF_BLENDER:
        raise SystemExit(f"setup: Blender {wanted} is not one of {', '.join(PYTHON_OF_BLENDER)}")
    if wanted not in usable:
        raise SystemExit(f"setup: Blender {wanted} needs Python {PYTHON_OF_BLENDER[wanted]}, which was not found")
    return wanted


def _stamp_text(blender: str, python: Python) -> str:
    pins = "\n".join(requirements(blender))
    return f"{hashlib.sha256(pins.encode()).hexdigest()} Python {python.version} {python.path}\n"


def _missing_packages(blender: str, python: Python, for_tests: bool) -> list[str]:
    missing = system_libraries.missing_packages(for_tests)
    if not python.can_make_venv and not venv_python(blender).exists():
        missing.append("python3-venv")
    return missing


def _site_packages(blender: str) -> Path:
    return venv_path(blender) / "lib" / f"python{PYTHON_OF_BLENDER[blender]}" / "site-packages"


def _runs(interpreter: Path, version: str) -> bool:
    if not interpreter.exists():
        return False
    answer = subprocess.run([interpreter, "--version"], capture_output=True, text=True)
    return answer.returncode == 0 and answer.stdout.split()[-1] == version


def _install(blender: str, python: Python) -> None:
    venv = venv_path(blender)
    print(f"setup: installing Blender {blender} and the tools into {venv.name} (about 400 MB to fetch)", flush=True)
    if not _runs(venv_python(blender), python.version):
        shutil.rmtree(venv, ignore_errors=True)
        subprocess.run([python.path, "-m", "venv", str(venv)], check=True)
    pip = [str(venv_python(blender)), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, *requirements(blender)], check=True)
    unresolved = system_libraries.unresolved(_site_packages(blender) / "bpy")
    if unresolved:
        raise SystemExit(f"setup: Blender {blender} needs shared libraries that are missing: {' '.join(unresolved)}")


def _link_package(blender: str) -> None:
    """The repository root is the package, as Blender wants it; tests import it by its name through this link."""
    link = _site_packages(blender) / "rebound"
    target = os.path.relpath(ROOT, link.parent)
    if not link.is_symlink() or os.readlink(link) != target:
        link.unlink(missing_ok=True)
        link.symlink_to(target)


def _link_default(blender: str) -> None:
    link = ROOT / ".venv"
    if link.is_symlink() and os.readlink(link) == venv_path(blender).name:
        return
    if link.exists() and not link.is_symlink():
        raise SystemExit("setup: .venv is a folder; remove it, set-up makes it a link to one .venv-<Blender version>")
    link.unlink(missing_ok=True)
    link.symlink_to(venv_path(blender).name)


def set_up(blender: str, for_tests: bool) -> None:
    """Make or bring up to date the environment of `blender`. Raises SystemExit with one message."""
    python = find_python(PYTHON_OF_BLENDER[blender])
    assert python is not None, "choose_blender returns only versions whose Python was found"
    system_libraries.require(_missing_packages(blender, python, for_tests))
    stamp = venv_path(blender) / STAMP
    wanted = _stamp_text(blender, python)
    if not (stamp.exists() and stamp.read_text() == wanted):
        start = time.monotonic()
        _install(blender, python)
        stamp.write_text(wanted)
        print(f"setup: {venv_path(blender).name} is ready after {time.monotonic() - start:.0f} s", flush=True)
    _link_package(blender)


def main() -> None:
    """Set up the one environment asked for."""
    parser = argparse.ArgumentParser(description="Make the virtual environment of one Blender version.")
    parser.add_argument("--blender", help="4.5, 5.0 or 5.2; default: the newest this machine can run")
    parser.add_argument("--for-tests", action="store_true", help="also what lint and the Vulkan tests need")
    arguments = parser.parse_args()
    blender = choose_blender(arguments.blender or None)
    try:
        set_up(blender, arguments.for_tests)
    except subprocess.CalledProcessError as error:
        raise SystemExit(f"setup: failed: {' '.join(map(str, error.cmd[:5]))} ...") from error
    if not arguments.blender or not (ROOT / ".venv").exists():
        _link_default(blender)


if __name__ == "__main__":
    main()
