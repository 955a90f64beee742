"""Compile every shader that Rebound generates with glslang, without a GPU: `.venv/bin/python tools/lint_shaders.py`.

A shader's standalone text is what the headless device compiles. What glslang finds is told with the name of the shader
and the file and line below gpu_shaders/ that it came from.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from rebound.device.source import Source
from rebound.gpu_shaders import all_shaders

# "ERROR: 0:126: '=' : cannot convert ...": string 0, line 126.
_LOCATED = re.compile(r"(ERROR|WARNING): \d+:(\d+): (.*)")


def stage_sources() -> dict[str, Source]:
    """Every stage of every shader, by the file name whose suffix tells glslang the stage."""
    sources = {}
    for shader in all_shaders():
        for stage in shader.stages:
            name = f"{shader.name}.{stage[:4]}"
            if name in sources:
                raise SystemExit(f"lint: two shaders are called {shader.name}")
            sources[name] = shader.standalone(stage)
    return sources


def complaints(report: str, sources: dict[str, Source]) -> list[str]:
    """What glslang found. It prints each file's name on a line of its own, before what it finds there."""
    current, found = "", []
    for line in report.splitlines():
        located = _LOCATED.match(line)
        if located and current:
            place = sources[current].origin(int(located[2]))
            found.append(f"{place}: {located[1].lower()}: {located[3]} [{current}]")
        elif Path(line.strip()).name in sources:
            current = Path(line.strip()).name
        elif line.strip():
            found.append(f"{current}: {line.strip()}")
    return found


def main() -> int:
    """One glslang process over every file."""
    sources = stage_sources()
    if not sources:
        raise SystemExit("lint: no shader is declared")
    with tempfile.TemporaryDirectory(prefix="rebound-shaders-") as folder:
        files = [Path(folder) / name for name in sources]
        for file in files:
            file.write_text(sources[file.name].text)
        command = ["glslangValidator", *files]
        answer = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    found = complaints(answer.stdout, sources)
    print(*found, f"lint: glslang read {len(sources)} shader stages, {len(found)} complaints", sep="\n")
    return 1 if found or answer.returncode != 0 else 0


if __name__ == "__main__":
    sys.exit(main())
