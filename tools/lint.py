"""Run every linter and say which failed: `.venv/bin/python tools/lint.py [--fix]`.

With --fix, let ruff and clang-format rewrite the files instead.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from environments import ROOT

BIN = Path(sys.executable).parent
Command = list[str | Path]


def glsl_files() -> list[str]:
    """Every GLSL file that git tracks or would track."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.glsl"]
    listing = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return [name for name in listing.stdout.splitlines() if (ROOT / name).exists()]


def _clang_format(*options: str) -> Command:
    return [BIN / "clang-format", "--assume-filename=x.cpp", *options, *glsl_files()]


def fixes() -> dict[str, Command]:
    """What rewrites files."""
    return {
        "ruff check": [BIN / "ruff", "check", "--fix", "--quiet", "."],
        "ruff format": [BIN / "ruff", "format", "--quiet", "."],
        "clang-format": _clang_format("-i"),
    }


def checks() -> dict[str, Command]:
    """What judges files."""
    return {
        "ruff check": [BIN / "ruff", "check", "--quiet", "."],
        "ruff format": [BIN / "ruff", "format", "--check", "--quiet", "."],
        "import-linter": [BIN / "lint-imports", "--config", "pyproject.toml"],
        "clang-format": _clang_format("--dry-run", "--Werror"),
        "glslang": [sys.executable, ROOT / "tools" / "lint_shaders.py"],
        "mkdocs": [BIN / "mkdocs", "build", "--strict", "--quiet"],
        "pyright": [BIN / "pyright", "--pythonpath", sys.executable],
    }


def _passes(name: str, command: Command) -> bool:
    """Run one linter; show what it says only when it finds something."""
    start = time.monotonic()
    # pyright is installed with its own node and must not look for a newer pyright; mkdocs advertises what follows it.
    quiet = os.environ | {"PYRIGHT_PYTHON_IGNORE_WARNINGS": "1", "NO_MKDOCS_2_WARNING": "1"}
    answer = subprocess.run(command, cwd=ROOT, env=quiet, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    good = answer.returncode == 0
    print(f"lint: {name:14} {'ok' if good else 'FAILED':6} {time.monotonic() - start:5.1f} s", flush=True)
    if not good:
        print(answer.stdout, flush=True)
    return good


def main() -> int:
    """Run all of them, even after one failed: a person wants to see everything at once."""
    commands = fixes() if "--fix" in sys.argv else checks()
    failed = [name for name, command in commands.items() if not _passes(name, command)]
    if failed:
        print(f"lint: failed: {', '.join(failed)}   (make format rewrites layout)", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
