"""Call a function of a GLSL library on many inputs and read what it returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rebound.device import Shader
from rebound.gpu_shaders.frame.structs import LIGHT_DEFINES, MAP_DEFINES

WIDTH = 64


def evaluate(
    device,
    libraries: Sequence[str],
    expression: str,
    inputs: Mapping[str, np.ndarray],
    *,
    tables=(),
    textures=(),
    files: Mapping[str, str] | None = None,
    **given,
) -> np.ndarray:
    """``expression``, a vec4, for every row of ``inputs``: (n, 4) float64.

    inputs: name -> (n, up to 4) numbers, a vec4 of that name in the expression. tables: Structs, whose rows are given
    as ``<name>_tx``; textures: names of other samplers. ``given`` holds both, and constants (``pc_...``, floats).
    """
    count = len(next(iter(inputs.values())))
    height = -(-count // WIDTH)
    sent = {}
    for name, values in inputs.items():
        texels = np.zeros((height * WIDTH, 4), np.float32)
        texels[:count, : values.shape[1]] = values
        sent[f"{name}_in_tx"] = device.texture((WIDTH, height), "RGBA32F", texels.reshape(height, WIDTH, 4))
    for struct in tables:
        name = f"{struct.snake_name}_tx"
        packed = struct.pack(given.pop(name))
        sent[name] = device.texture((packed.shape[1], packed.shape[0]), "RGBA32F", packed)
    for name in textures:
        sent[name] = given.pop(name)
    path = "test/evaluate_frag.glsl"
    text = "".join(f'#include "{library}"\n' for library in libraries)
    text += "void main()\n{\n  ivec2 pixel = ivec2(gl_FragCoord.xy);\n"
    text += "".join(f"  vec4 {name} = texelFetch({name}_in_tx, pixel, 0);\n" for name in inputs)
    text += f"  out_value = {expression};\n}}\n"
    shader = Shader(
        "evaluate",
        fragment=path,
        files={**(files or {}), path: text},
        outputs={"out_value": "VEC4"},
        samplers=dict.fromkeys(sent, "FLOAT_2D"),
        structs=tuple(tables),
        constants=dict.fromkeys(given, "FLOAT"),
        defines=(*LIGHT_DEFINES, *MAP_DEFINES),
    )
    result = device.texture((WIDTH, height), "RGBA32F")
    device.fullscreen(shader, device.target([result]), **sent, **given)
    return device.read(result).reshape(-1, 4)[:count].astype(np.float64)
