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


LOG = """>> ok   one thing
>> ok   another (with a Traceback in its text)
>> DONE
"""


def test_window_log_counts_checks(tool):
    outcome = tool("test_window").read_log(LOG, 0, 3.0)
    assert (outcome.passed, outcome.failed, outcome.note) == (2, 0, "")


@pytest.mark.parametrize(
    ("text", "status", "note"),
    [
        (LOG + ">> FAIL a third", 0, ""),
        (LOG.replace(">> DONE\n", ""), 0, "the scenario did not come to its end"),
        (LOG, 124, "killed after 3 s"),
        (LOG, 139, "Blender ended with status 139"),
        (LOG + "Traceback (most recent call last):", 0, "1 tracebacks, 0 announced"),
        (LOG + ">> a traceback is expected", 0, "0 tracebacks, 1 announced"),
    ],
)
def test_window_log_with_anything_wrong_has_failed(tool, text, status, note):
    outcome = tool("test_window").read_log(text, status, 3.0)
    assert (outcome.failed, outcome.note) == (1, note)


def test_process_that_hangs_is_killed_with_its_children(tool, tmp_path):
    window = tool("test_window")
    started = tmp_path / "started"
    command = ["sh", "-c", f"trap '' TERM; sleep 60 & echo $! > {started}; wait"]
    with window._running(command, dict(os.environ), subprocess.DEVNULL) as process:
        while not (started.exists() and started.read_text()):
            assert process.poll() is None
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.1)
    child = int(started.read_text())
    stat = Path(f"/proc/{child}/stat")
    assert not stat.exists() or stat.read_text().split()[2] == "Z"


def test_machine_without_a_window_says_why(tool, monkeypatch):
    tree = tool("window_tree")
    monkeypatch.setattr(tree, "_is_complete_here", lambda: False)
    monkeypatch.setattr(tree, "_is_made", lambda _tree: False)
    monkeypatch.setattr(tree.os, "geteuid", lambda: 1000)
    with pytest.raises(tree.Unavailable, match="only root"):
        tree.find_place()


def test_machine_without_a_window_skips(tool, monkeypatch, capsys):
    window = tool("test_window")

    def unavailable():
        raise window.Unavailable("no network")

    monkeypatch.setattr(window, "find_place", unavailable)
    monkeypatch.setattr(sys, "argv", ["test_window.py"])
    assert window.main() == 0
    assert capsys.readouterr().out == "test-window: skipped: no network\n"


def test_every_default_scenario_is_there(tool):
    window = tool("test_window")
    names = {name for scenarios in window.DEFAULT.values() for name in scenarios}
    assert all((window.SCENARIOS / f"{name}.py").exists() for name in names)
