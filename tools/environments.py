"""The Blender versions we build against, the Pythons that run them, and where their virtual environments are.

A `bpy` wheel runs on exactly one Python, so the Python that a machine has decides which Blender it can test.
"""

from __future__ import annotations

import functools
import glob
import json
import os
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# Blender version -> the only Python its wheel runs on. First is preferred.
PYTHON_OF_BLENDER = {"5.2": "3.13", "5.0": "3.11", "4.5": "3.11"}

_PROBE = """
import importlib.util, json, platform, ssl, sys
print(json.dumps([platform.python_version(), importlib.util.find_spec("ensurepip") is not None]))
"""

# Where Pythons live that are not on PATH, or hide behind a shim that fails when another version is selected.
_PLACES = (
    "{pyenv}/versions/{version}*/bin/python{version}",
    "/usr/local/bin/python{version}",
    "/usr/bin/python{version}",
    "/opt/*/bin/python{version}",
    "{home}/.local/bin/python{version}",
    "{home}/.local/share/uv/python/cpython-{version}*/bin/python{version}",
)


@dataclass(frozen=True)
class Python:
    """An interpreter that was run and answered."""

    path: str
    version: str
    can_make_venv: bool


def _candidates(version: str) -> Iterator[str]:
    home = str(Path.home())
    pyenv = os.environ.get("PYENV_ROOT", f"{home}/.pyenv")
    on_path = shutil.which(f"python{version}")
    if on_path:
        yield on_path
    for place in _PLACES:
        yield from sorted(glob.glob(place.format(pyenv=pyenv, home=home, version=version)), reverse=True)
    fallback = shutil.which("python3")
    if fallback:
        yield fallback


def _probe(path: str) -> Python | None:
    try:
        answer = subprocess.run([path, "-c", _PROBE], capture_output=True, text=True, timeout=30)
    except (OSError, subprocess.TimeoutExpired):
        return None
    if answer.returncode != 0:
        return None
    version, can_make_venv = json.loads(answer.stdout)
    return Python(path, version, can_make_venv)


@functools.cache
def find_python(version: str) -> Python | None:
    """The first Python `version` ("3.13") that runs, preferring one that can make virtual environments."""
    without_venv = None
    for path in dict.fromkeys(_candidates(version)):
        python = _probe(path)
        if python is None or not python.version.startswith(version + "."):
            continue
        if python.can_make_venv:
            return python
        without_venv = without_venv or python
    return without_venv


def usable_blenders() -> list[str]:
    """Blender versions whose Python was found, preferred first."""
    return [blender for blender, python in PYTHON_OF_BLENDER.items() if find_python(python)]


def requirements(blender: str) -> list[str]:
    """The pinned requirements of one virtual environment, from pyproject.toml."""
    with open(ROOT / "pyproject.toml", "rb") as file:
        extras = tomllib.load(file)["project"]["optional-dependencies"]
    return [*extras["blender-" + blender.replace(".", "-")], *extras["test"], *extras["lint"]]


def venv_path(blender: str) -> Path:
    """Where the virtual environment of one Blender version lies."""
    return ROOT / f".venv-{blender}"


def venv_python(blender: str) -> Path:
    """The interpreter of one Blender version's virtual environment."""
    return venv_path(blender) / "bin" / "python"
