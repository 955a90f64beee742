"""Compile every shader that Rebound generates with glslang, without a GPU: `.venv/bin/python tools/lint_shaders.py`.

A shader's standalone text is what the headless device compiles, so an error here has a name, a file and a line.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from rebound.gpu_shaders import all_shaders


def write_stages(folder: Path) -> list[Path]:
    """Write each stage of each shader as `<shader>.<stage>`; glslang tells the stage from the suffix."""
    files = []
    for shader in all_shaders():
        for stage, text in shader.standalone_sources().items():
            file = folder / f"{shader.name.replace('/', '-')}.{stage}"
            if file in files:
                raise SystemExit(f"lint: two shaders are called {shader.name}")
            file.write_text(text)
            files.append(file)
    return files


def complaints(report: str, folder: Path) -> list[str]:
    """glslang's error lines. It names each file it reads on a line of its own, before what it finds there."""
    current, found = "", []
    for line in report.replace(f"{folder}/", "").splitlines():
        if line.startswith(("ERROR:", "WARNING:")):
            found.append(f"{current}: {line}")
        elif line.strip():
            current = line.strip()
    return found


def main() -> int:
    """One glslang process over every file."""
    with tempfile.TemporaryDirectory(prefix="rebound-shaders-") as name:
        folder = Path(name)
        files = write_stages(folder)
        if not files:
            raise SystemExit("lint: no shader is declared")
        command = ["glslangValidator", *files]
        answer = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        errors = complaints(answer.stdout, folder)
    print("\n".join(errors))
    print(f"lint: glslang read {len(files)} shader stages, {len(errors)} complaints")
    return 1 if errors or answer.returncode != 0 else 0


if __name__ == "__main__":
    sys.exit(main())
