"""Whole programs around generated material functions, to compile and run them."""

from __future__ import annotations

import re

from rebound.device import Shader
from rebound.gpu_shaders.materials import MaterialShader


def material_program(shader: MaterialShader, shown: str = "diffuse") -> Shader:
    """A full-screen program that gives one field of the surface, at a point whose every field is a half."""
    fields = "".join(f"  point.{need} = {field_type(shader, need)}(0.5);\n" for need in shader.needs)
    text = f"{shader.text}\nvoid main()\n{{\n  MaterialPoint point;\n{fields}"
    text += f"  out_value = vec4(material_surface(point).{shown}, 1.0);\n}}\n"
    path = "test/material_frag.glsl"
    return Shader(
        "material_test",
        fragment=path,
        files={path: text},
        outputs={"out_value": "VEC4"},
        samplers=shader.samplers,
        constants={"pc_values": "INT"},
        defines=shader.defines,
    )


def field_type(shader: MaterialShader, need: str) -> str:
    """The GLSL type of a field of MaterialPoint, as the text declares it."""
    declared = re.search(rf"(\w+) {need};", shader.text)
    assert declared, need
    return declared[1]
