"""Blender's shader compile errors: caught from the console, where alone it prints them, and traced to file and line.

Blender 5 prints ":4:20: Error: text" or "python_shader.glsl:4:20: Error: text", counting in the source it was given.
Blender 4.5 prints the faulty line ahead of the error, "  257 | float x = y;", counting in the text that it made around
the source; how many lines come before ours is measured by compiling ``PROBE`` as the first of them.
"""

import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from .source import Source

#: A line that no compiler accepts.
PROBE = "int rebound_probe = rebound_undeclared;\n"

# "pyGPU_Shader FragShader: " on OpenGL, "pyGPU_Shader fragment: " on Vulkan.
_STAGE = re.compile(r"pyGPU_Shader (Vert|Frag|Comp|vertex|fragment|compute)", re.IGNORECASE)
_LOCATED = re.compile(r"(?:^|[|\s])(?:python_shader\.glsl)?:(\d+)(?::\d+)?: (?:Error: )?(.*)$")
_NUMBERED = re.compile(r"^\s*(\d+) \| ?(.*)$")
_MESSAGE = re.compile(r"(?:Error|preprocessor error): (.*)$")
_BLANK = re.compile(r"^\s*\|\s*$")


def run_captured(work: Callable[[], Any]) -> tuple[Any, Exception | None, str]:
    """Run ``work`` with the process's stdout and stderr going to a file: (result, exception, what was printed)."""
    result, error = None, None
    with tempfile.TemporaryFile() as log:
        with _redirected(log.fileno()):
            try:
                result = work()
            except Exception as caught:  # noqa: BLE001  gpu raises bare Exceptions; handed to the caller
                error = caught
        log.seek(0)
        return result, error, log.read().decode(errors="replace")


@contextmanager
def _redirected(to: int) -> Iterator[None]:
    saved = {}
    _flush()
    for descriptor in (1, 2):
        try:
            saved[descriptor] = os.dup(descriptor)
            os.dup2(to, descriptor)
        except OSError:  # a process without a console has nothing to catch
            continue
    try:
        yield
    finally:
        _flush()
        for descriptor, copy in saved.items():
            os.dup2(copy, descriptor)
            os.close(copy)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()


def failed_stage(log: str, stages: tuple[str, ...]) -> str:
    """The stage that a log names first, else the last there is (linking)."""
    found = _STAGE.search(log)
    return {"v": "vertex", "f": "fragment", "c": "compute"}[found[1][0].lower()] if found else stages[-1]


def probed_line(log: str) -> int | None:
    """The number under which Blender 4.5 reports ``PROBE``; None if the log does not show it."""
    for line in log.splitlines():
        found = _NUMBERED.match(line)
        if found and found[2].strip() == PROBE.strip():
            return int(found[1])
    return None


def trace(log: str, sources: Mapping[str, Source], probed: int | None = None) -> tuple[str, str]:
    """(stage, message) of a compile log, one ``file:line: text`` an error, as far as the log tells.

    probed: the number of the first line of the failed stage, for the logs of Blender 4.5.
    """
    stage = failed_stage(log, tuple(sources))
    lines, current, previous, after_text = [], None, None, False
    for line in log.splitlines():
        located, numbered, message = _LOCATED.search(line), _NUMBERED.match(line), _MESSAGE.search(line)
        if located:
            lines.append(f"{sources[stage].origin(int(located[1]))}: {located[2]}")
        elif numbered:
            current = previous = int(numbered[1])
        elif message:
            place = "" if current is None or probed is None else f"{sources[stage].origin(current - probed + 1)}: "
            lines.append(place + message[1])
        elif _BLANK.match(line):
            # Another place follows, unknown until its text is shown. Vulkan sets a blank after the text as well.
            current = current if after_text else None
        elif "|" in line and current is None:
            current = previous  # the same line again, another column
        after_text = bool(numbered)
    return stage, "\n".join(lines) or log.strip()
