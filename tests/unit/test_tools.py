"""The set-up scripts find what runs, name what is missing, and forget nothing that passed."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

TOOLS = Path(__file__).resolve().parents[2] / "tools"


@pytest.fixture
def tool(monkeypatch):
    """Import a script of tools/ by name, as the scripts import each other."""
    monkeypatch.syspath_prepend(str(TOOLS))
    return importlib.import_module


def _fake_program(folder: Path, name: str, body: str) -> None:
    program = folder / name
    program.write_text(f"#!/bin/sh\n{body}\n")
    program.chmod(0o755)


def test_python_that_fails_to_run_is_passed_over(tool, tmp_path, monkeypatch):
    environments = tool("environments")
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    _fake_program(tmp_path, f"python{version}", "echo not installed >&2; exit 127")
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    environments.find_python.cache_clear()
    found = environments.find_python(version)
    environments.find_python.cache_clear()
    assert found is not None and found.version.startswith(version)
    assert Path(found.path).parent != tmp_path


def test_python_of_another_version_is_not_taken(tool, monkeypatch):
    environments = tool("environments")
    monkeypatch.setattr(environments, "_candidates", lambda version: iter([sys.executable]))
    environments.find_python.cache_clear()
    assert environments.find_python("2.7") is None
    environments.find_python.cache_clear()


def test_missing_packages_are_named_in_one_line(tool, monkeypatch):
    libraries = tool("system_libraries")
    monkeypatch.setattr(libraries.os, "geteuid", lambda: 1000)
    with pytest.raises(SystemExit) as left:
        libraries.require(["libegl1", "libgl1"])
    fixes = [line for line in str(left.value).splitlines() if "apt-get install" in line]
    assert len(fixes) == 1 and fixes[0].endswith("libegl1 libgl1")


def test_library_that_cannot_load_is_missing(tool, monkeypatch):
    libraries = tool("system_libraries")
    monkeypatch.setattr(libraries, "BLENDER_LIBRARIES", {"libno-such-thing.so.9": "libno-such-thing9"})
    monkeypatch.setattr(libraries, "BLENDER_FILES", {})
    assert libraries.missing_packages(for_tests=False) == ["libno-such-thing9"]


@pytest.fixture
def passed(tool, tmp_path, monkeypatch):
    """passed_before.py on a repository of its own."""
    module = tool("passed_before")
    subprocess.run(["git", "init", "--quiet", str(tmp_path)], check=True)
    (tmp_path / ".gitignore").write_text(".cache/\n")
    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(module, "_FILE", tmp_path / ".cache" / "passed.json")
    return module


def test_what_passed_is_recalled_until_a_file_changes(passed, tmp_path):
    passed.remember("5.2/opengl/plain", {"passed": 3}, passed.tree_hash())
    assert passed.recall("5.2/opengl/plain") == {"passed": 3}
    assert passed.recall("5.0/opengl/plain") is None
    (tmp_path / "new.py").write_text("")
    assert passed.recall("5.2/opengl/plain") is None


def test_pass_on_a_tree_that_changed_meanwhile_is_not_kept(passed, tmp_path):
    before = passed.tree_hash()
    (tmp_path / "new.py").write_text("")
    passed.remember("5.2/opengl/plain", {"passed": 3}, before)
    assert passed.recall("5.2/opengl/plain") is None


def test_report_with_failures_is_counted(tool, tmp_path):
    run_tests = tool("run_tests")
    report = tmp_path / "report.xml"
    report.write_text('<testsuites><testsuite tests="7" errors="1" failures="2" skipped="1"/></testsuites>')
    assert run_tests._read(report, 1, 2.0) == run_tests.Outcome(passed=3, failed=3, skipped=1, seconds=2.0)


def test_process_that_died_counts_as_a_failure(tool, tmp_path):
    run_tests = tool("run_tests")
    assert run_tests._read(tmp_path / "none.xml", -11, 2.0).failed == 1
