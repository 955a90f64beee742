"""Tracing compile logs, as each Blender version was seen to print them, to the project's file and line."""

import os

import pytest

from rebound.device.blender_log import PROBE, probed_line, run_captured, trace
from rebound.device.source import Source

BLENDER_4_5_OPENGL = """ERROR (gpu.shader): pyGPU_Shader FragShader:
      |
  257 |  vec4 b = vec4(undefined_thing);
      |                 ^
      | Error: `undefined_thing' undeclared
      |
      |  vec4 b = vec4(undefined_thing);
      |            ^
      | Error: cannot construct `vec4' from a non-numeric data type
"""
BLENDER_4_5_VULKAN = """ERROR (gpu.shader): pyGPU_Shader fragment:
      |
  257 | float wrong = bogus;
      |
      | Error: 'bogus' : undeclared identifier
"""
BLENDER_5_0_OPENGL = """00:00.624  gpu.shader       | ERROR pyGPU_Shader FragShader:
                            |       |
                            |   283 |  out_color = vec4(undefined_thing);
                            |       |                    ^
                            |       | :2:20: Error: `undefined_thing' undeclared
"""
BLENDER_5_0_VULKAN = """00:01.181  gpu.shader       | ERROR pyGPU_Shader vertex:
                            |       | :1: Error: '=' :  cannot convert from ' const vec2' to ' temp highp int'
                            |       | :2: Error: 'bogus' : undeclared identifier
"""
BLENDER_5_2_OPENGL = """00:00.644  gpu.shader       | ERROR pyGPU_Shader CompShader:
                            |       | python_shader.glsl:2:20: Error: `undefined_thing' undeclared
"""
LINKING = """00:00.645  gpu.shader       | ERROR pyGPU_Shader Linking:
                            |       | Error: unresolved reference to function `foo'
"""


def sources(*stages):
    """Per stage a source of two lines, stage.glsl:11 and :12."""
    result = {}
    for stage in stages:
        result[stage] = Source()
        result[stage].add("first\nsecond", f"{stage}.glsl", 11)
    return result


@pytest.mark.parametrize(
    ("log", "probed", "stages", "stage", "expected"),
    [
        (BLENDER_4_5_OPENGL, 256, ("vertex", "fragment"), "fragment",
         ["fragment.glsl:12: `undefined_thing' undeclared",
          "fragment.glsl:12: cannot construct `vec4' from a non-numeric data type"]),
        (BLENDER_4_5_VULKAN, 256, ("vertex", "fragment"), "fragment",
         ["fragment.glsl:12: 'bogus' : undeclared identifier"]),
        (BLENDER_4_5_VULKAN, None, ("vertex", "fragment"), "fragment", ["'bogus' : undeclared identifier"]),
        (BLENDER_5_0_OPENGL, None, ("vertex", "fragment"), "fragment",
         ["fragment.glsl:12: `undefined_thing' undeclared"]),
        (BLENDER_5_0_VULKAN, None, ("vertex", "fragment"), "vertex",
         ["vertex.glsl:11: '=' :  cannot convert from ' const vec2' to ' temp highp int'",
          "vertex.glsl:12: 'bogus' : undeclared identifier"]),
        (BLENDER_5_2_OPENGL, None, ("compute",), "compute", ["compute.glsl:12: `undefined_thing' undeclared"]),
        (LINKING, None, ("vertex", "fragment"), "fragment", ["unresolved reference to function `foo'"]),
        ("something new", None, ("vertex", "fragment"), "fragment", ["something new"]),
    ],
)  # fmt: skip
def test_log_is_traced(log, probed, stages, stage, expected):
    found_stage, message = trace(log, sources(*stages), probed)
    assert (found_stage, message.splitlines()) == (stage, expected)


def test_probe_is_found_in_a_log():
    assert probed_line(f"      |\n  256 | {PROBE}      |\n") == 256
    assert probed_line(BLENDER_4_5_VULKAN) is None


def test_console_is_captured_and_given_back(capfd):
    def work():
        os.write(1, b"to stdout\n")
        os.write(2, b"to stderr\n")
        raise Exception("broken")

    result, error, log = run_captured(work)
    assert result is None and str(error) == "broken" and "to stdout" in log and "to stderr" in log
    os.write(1, b"after\n")
    assert capfd.readouterr().out == "after\n"
    assert run_captured(lambda: 7)[0] == 7
