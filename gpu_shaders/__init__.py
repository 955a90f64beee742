"""Everything that runs on the GPU: declarations in Python beside their GLSL, one folder a subject."""

from __future__ import annotations

from ..device.shader import Shader
from . import frame, prt
from .rsm import Rsm
from .technique import Technique
from .vpl import Vpl

TECHNIQUES: tuple[type[Technique], ...] = (Vpl, Rsm)


def all_shaders() -> tuple[Shader, ...]:
    """Every declared shader, for the checks that need no GPU."""
    return (*frame.SHADERS, *prt.SHADERS, *(shader for technique in TECHNIQUES for shader in technique.shaders))
