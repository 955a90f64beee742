"""What every test process shares: the headless device, the shared test scenes, and a quick way out."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def headless_device():
    """A standalone OpenGL device. Never in Blender's process: there a moderngl context hijacks Blender's own."""
    if "bpy" in sys.modules:
        pytest.fail("headless_device was asked for in a process that imported bpy; put the test in tests/headless")
    pytest.importorskip("moderngl", reason="moderngl is not installed")
    from rebound.device.headless import HeadlessDevice  # noqa: PLC0415  moderngl is optional

    return HeadlessDevice()


@pytest.fixture(scope="session")
def shared_dir() -> Path:
    """The folder of test scenes and path-traced references that lies beside the repository."""
    folder = Path(os.environ.get("REBOUND_SHARED", ROOT.parent / "shared"))
    if not folder.is_dir():
        pytest.skip(f"no test scenes at {folder} (set REBOUND_SHARED)")
    return folder


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Remember the status for the exit below."""
    session.config.stash[_EXIT_STATUS] = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """Leave without Python's and Blender's shutdown: bpy can take minutes there, listing leaked blocks."""
    status = config.stash.get(_EXIT_STATUS, None)
    if status is None or "bpy" not in sys.modules:
        return
    config.get_terminal_writer().flush()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


_EXIT_STATUS = pytest.StashKey[int]()
