"""Material node graphs -> GLSL: one function a graph, its numbers in a table, for every pass that meets a surface."""

from __future__ import annotations

from .code import Attribute
from .generator import VALUE_WIDTH, MaterialShader, generate
from .node_code import gives, is_supported, supported_kinds

__all__ = [
    "VALUE_WIDTH",
    "Attribute",
    "MaterialShader",
    "generate",
    "gives",
    "is_supported",
    "supported_kinds",
]
