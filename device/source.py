"""GLSL text: includes resolved, every line traced to its file, and the rule kept that declarations live in Python."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

SHADER_ROOT = Path(__file__).resolve().parent.parent / "gpu_shaders"

_INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"\s*$')
_BAD_DIRECTIVE = re.compile(r"^\s*#\s*(version|extension|line|include|pragma)\b")
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
_TOKEN = re.compile(r"[A-Za-z_]\w*|[{}();]|\n")
# What may not begin a statement at file scope: it declares what belongs to the Shader in Python.
_DECLARATIONS = {
    "layout": "declare it in the Shader",
    "uniform": "declare it in the Shader",
    "buffer": "there are no storage buffers; use a texture",
    "in": "declare it in Shader.inputs or Shader.varyings",
    "out": "declare it in Shader.outputs or Shader.varyings",
    "inout": "declare it in the Shader",
    "attribute": "declare it in Shader.inputs",
    "varying": "declare it in Shader.varyings",
    "flat": "declare it in Shader.varyings",
    "smooth": "declare it in Shader.varyings",
    "noperspective": "declare it in Shader.varyings",
    "centroid": "declare it in Shader.varyings",
    "shared": "write SHARED (Blender 5.2 strips the bare word)",
    "precision": "leave it out",
}


class ShaderError(ValueError):
    """A shader that cannot be built: its name, the stage and ``file:line: what``, one a line."""

    def __init__(self, name: str, stage: str, message: str):
        super().__init__(f"Shader {name}, {stage}:\n{message}")
        self.name, self.stage, self.message = name, stage, message


@dataclass
class Source:
    """GLSL lines, each with the file and line it came from."""

    lines: list[str] = field(default_factory=list)
    origins: list[tuple[str, int]] = field(default_factory=list)

    def add(self, text: str, file: str, first_line: int = 1) -> None:
        """Append ``text`` as lines of ``file``."""
        for offset, line in enumerate(text.splitlines()):
            self.lines.append(line)
            self.origins.append((file, first_line + offset))

    def extend(self, other: "Source") -> None:
        """Append another source with its origins."""
        self.lines += other.lines
        self.origins += other.origins

    @property
    def text(self) -> str:
        """The whole text, ending in a newline."""
        return "\n".join(self.lines) + "\n"

    def origin(self, line: int) -> str:
        """``file:line`` of a line of the text, counted from 1 as compilers do."""
        if 1 <= line <= len(self.origins):
            return "{}:{}".format(*self.origins[line - 1])
        return f"<generated>:{line}"


def assemble(shader_name: str, stage: str, path: str, files: Mapping[str, str]) -> Source:
    """Read ``path`` and what it includes, each file once, comments removed.

    Paths are relative to gpu_shaders/; ``files`` (path to text) stand in front of the folder.
    Raises ShaderError naming file and line for a missing file, a cyclic include, a declaration that belongs in Python.
    """
    source, done = Source(), set()

    def visit(file: str, trail: tuple[str, ...], asked_at: str) -> None:
        if file in trail:
            raise ShaderError(shader_name, stage, f"{asked_at}: cyclic include: {' -> '.join((*trail, file))}")
        if file in done:
            return
        done.add(file)
        code = strip_comments(_read(shader_name, stage, file, files, asked_at))
        for number, line, included in _parsed(code):
            if included:
                visit(included, (*trail, file), f"{file}:{number}")
            else:
                source.lines.append(line)
                source.origins.append((file, number))
        faults = [f"{file}:{number}: {what}" for number, what in check(code)]
        if faults:
            raise ShaderError(shader_name, stage, "\n".join(faults))

    visit(path, (), f"Shader {shader_name}")
    return source


def _read(shader_name: str, stage: str, file: str, files: Mapping[str, str], asked_at: str) -> str:
    if file in files:
        return files[file]
    path = SHADER_ROOT / file
    # A path that leaves the folder would work here and be missing from the installed extension.
    if ".." in Path(file).parts or Path(file).is_absolute() or not path.is_file():
        raise ShaderError(shader_name, stage, f"{asked_at}: no file gpu_shaders/{file}")
    return path.read_text(encoding="utf-8")


@lru_cache(maxsize=512)  # the same libraries are in nearly every shader
def strip_comments(text: str) -> str:
    """Replace comments by blanks, keeping the lines. (GLSL has no strings that could hold a comment sign.)"""
    return _COMMENT.sub(lambda m: "\n" * m[0].count("\n") or " ", text)


@lru_cache(maxsize=512)
def _parsed(code: str) -> list[tuple[int, str, str]]:
    """Number, text and included file, "" if none, of every line of text without comments."""
    found = []
    for number, line in enumerate(code.splitlines(), 1):
        match = _INCLUDE.match(line)
        found.append((number, line or " ", match[1] if match else ""))
    return found


@lru_cache(maxsize=512)
def check(code: str) -> list[tuple[int, str]]:
    """Find declarations that belong in Python, in text without comments: (line, what is wrong) of each."""
    faults, plain = [], []
    continued = False
    for number, line in enumerate(code.splitlines(), 1):
        directive = continued or line.lstrip().startswith("#")
        match = _BAD_DIRECTIVE.match(line)
        if match and not _INCLUDE.match(line):
            faults.append((number, f"#{match[1]} is not allowed here"))
        continued = directive and line.rstrip().endswith("\\")
        plain.append("" if directive else line)
    return sorted(faults + _check_statements("\n".join(plain)))


def _check_statements(code: str) -> list[tuple[int, str]]:
    faults, line, depth, at_start = [], 1, 0, True
    for token in _TOKEN.findall(code):
        if token == "\n":
            line += 1
            continue
        if depth == 0 and at_start and token in _DECLARATIONS:
            faults.append((line, f"'{token}' at file scope: {_DECLARATIONS[token]}"))
        depth += (token in "{(") - (token in "})")
        at_start = token in ";}"
    return faults
