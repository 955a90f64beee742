"""blender_manifest.toml, wheels.lock and pyproject.toml agree, without building anything."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
WHEELS = [Path(wheel).name for wheel in MANIFEST["wheels"]]


def _pins(extra: str) -> dict[str, str]:
    return dict(line.lower().split("==") for line in PROJECT["optional-dependencies"][extra])


def test_manifest_and_lock_name_the_same_wheels():
    locked = [line.split()[1] for line in (ROOT / "wheels.lock").read_text().splitlines()]
    assert sorted(WHEELS) == sorted(locked)


def test_versions_agree():
    assert MANIFEST["version"] == PROJECT["version"]


def test_every_platform_and_python_has_its_wheels():
    # Intel Macs: Blender ended with 4.5 (Python 3.11) there; docs/dependencies.md says what else exists.
    wanted = {(platform, python) for platform in ("linux", "win", "arm64") for python in ("cp311", "cp313", "cp314")}
    wanted.add(("x86_64-mac", "cp311"))
    for name in ("openexr", "moderngl", "glcontext"):
        found = set()
        for wheel in WHEELS:
            package, _, python, _, platform = wheel.removesuffix(".whl").split("-")
            if package == name:
                found.add((_short(platform), python))
        assert wanted <= found, f"{name} lacks {wanted - found}"


def _short(platform: str) -> str:
    if platform.startswith("macosx"):
        return "arm64" if platform.endswith("arm64") else "x86_64-mac"
    return "win" if platform.startswith("win") else "linux"


def test_wheels_are_the_versions_that_are_tested():
    pins = _pins("test")
    for wheel in WHEELS:
        name, version, _, _, platform = wheel.removesuffix(".whl").split("-")
        if _short(platform) != "x86_64-mac":
            assert version == pins[name], wheel


@pytest.mark.parametrize("folder", ["benchmarks", "docs", "examples", "tests", "tools"])
def test_package_leaves_out_what_only_developers_use(folder):
    assert f"/{folder}/" in MANIFEST["build"]["paths_exclude_pattern"]


def test_tagline_fits_blenders_limits():
    assert len(MANIFEST["tagline"]) <= 64
    assert MANIFEST["tagline"][-1].isalnum()


def test_every_module_logs_as_rebound():
    """An installed extension is bl_ext.<repository>.rebound: a logger of a module's name would be no child of ours."""
    sources = [p for p in ROOT.rglob("*.py") if not {"tests", "tools", "examples"} & set(p.relative_to(ROOT).parts)]
    sources = [p for p in sources if not any(part.startswith(".") for part in p.relative_to(ROOT).parts)]
    assert len(sources) > 40
    assert not [str(p) for p in sources if "getLogger(__name__)" in p.read_text()]
