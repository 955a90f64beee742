# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's shader compile errors: caught from the console, where alone it prints them, and traced to file and line."""

import os
import re
import sys
import tempfile
from collections.abc import Callable, Mapping
from typing import Any

from .source import Source

# "pyGPU_Shader FragShader: " on OpenGL, "pyGPU_Shader fragment: " on Vulkan.
_STAGE = re.compile(r"pyGPU_Shader (Vert|Frag|Comp|vertex|fragment|compute)", re.IGNORECASE)
# 5.0 ":4:20: Error: text", 5.2 "python_shader.glsl:4:20: Error: text"; Vulkan gives no column.
_LOCATED = re.compile(r"(?:^|[|\s])(?:python_shader\.glsl)?:(\d+)(?::\d+)?: (?:Error|Warning): (.*)$")
_MESSAGE = re.compile(r"Error: (.*)$")


def run_captured(work: Callable[[], Any]) -> tuple[Any, Exception | None, str]:
    """Run ``work`` with the process's stdout and stderr going to a file: (result, exception, what was printed)."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    with tempfile.TemporaryFile() as log:
        try:
            saved = os.dup(1), os.dup(2)
        except OSError:  # no console (Windows): nothing to catch
            saved = None
        if saved:
            os.dup2(log.fileno(), 1)
            os.dup2(log.fileno(), 2)
        result, error = None, None
        try:
            result = work()
        except Exception as caught:  # gpu raises bare Exceptions
            error = caught
        finally:
            for stream in (sys.stdout, sys.stderr):
                if stream is not None:
                    stream.flush()
            if saved:
                os.dup2(saved[0], 1)
                os.dup2(saved[1], 2)
                os.close(saved[0])
                os.close(saved[1])
        log.seek(0)
        return result, error, log.read().decode(errors="replace")


def trace(log: str, sources: Mapping[str, Source]) -> tuple[str, str]:
    """(stage, message) of a compile log, one ``file:line: text`` a line, as far as the log tells."""
    stage, lines = next(reversed(sources)), []
    for line in log.splitlines():
        found = _STAGE.search(line)
        if found:
            stage = {"v": "vertex", "f": "fragment", "c": "compute"}[found[1][0].lower()]
        located = _LOCATED.search(line)
        message = _MESSAGE.search(line)
        if located:
            lines.append(f"{sources[stage].origin(int(located[1]))}: {located[2]}")
        elif message:
            lines.append(message[1])
    return stage, "\n".join(lines) or log.strip()
