"""Shader declarations and the text made of them, without a GPU."""

import dataclasses
import shutil
import subprocess

import pytest

from rebound.device import Image, Shader, ShaderError, Struct
from rebound.device.source import check, strip_comments

VIEW = Struct("View", clip_from_world="mat4", eye="vec3", index="int")
MAIN = "void main() { out_color = vec4(1); }\n"


def shader(text=MAIN, name="test", files=None, **declared):
    """A full-screen shader whose fragment file is a_frag.glsl."""
    declared = {"fragment": "a_frag.glsl", "outputs": {"out_color": "VEC4"}, **declared}
    return Shader(name, files={"a_frag.glsl": text, **(files or {})}, **declared)


# --- includes --------------------------------------------------------------------------------------------------------


def test_include_is_resolved_once():
    source = shader(
        '#include "b.glsl"\n#include "c.glsl"\n  #  include "b.glsl"\n' + MAIN,
        files={"b.glsl": "float b() { return 1.0; }\n", "c.glsl": '#include "b.glsl"\nfloat c() { return b(); }\n'},
    ).assemble("fragment")
    assert [line for line in source.lines if line.strip()] == [
        "float b() { return 1.0; }", "float c() { return b(); }", MAIN.strip()
    ]  # fmt: skip
    assert source.origins == [("b.glsl", 1), ("c.glsl", 2), ("a_frag.glsl", 4)]
    assert source.origin(3) == "a_frag.glsl:4"
    assert source.origin(99) == "<generated>:99"


def test_cyclic_include_names_the_files():
    with pytest.raises(ShaderError, match=r"test.*\n.*c\.glsl:2: cyclic include: .*b\.glsl -> c\.glsl -> b\.glsl"):
        shader(
            '#include "b.glsl"\n', files={"b.glsl": '#include "c.glsl"\n', "c.glsl": '\n#include "b.glsl"\n'}
        ).source("fragment")


@pytest.mark.parametrize("path", ["lib/no_such_lib.glsl", "../README.md", "/etc/hostname"])
def test_missing_include_names_file_and_line(path):
    with pytest.raises(ShaderError, match=r"a_frag\.glsl:2: no file"):
        shader(f'\n#include "{path}"\n').source("fragment")


def test_include_in_a_comment_is_none():
    assert "include" not in shader('// #include "x"\n/*\n#include "x"\n*/\n' + MAIN).source("fragment")


# --- what GLSL files may not hold ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "line", "word"),
    [
        ("#version 430\n", 1, "#version"),
        ("\n  #extension GL_foo : enable\n", 2, "#extension"),
        ("uniform float x;\n", 1, "'uniform'"),
        ("float f() { return 1.0; }\nlayout(location = 0) out vec4 c;\n", 2, "'layout'"),
        ("int x; in vec3 p;\n", 1, "'in'"),
        ("\n\nout vec4 c;\n", 3, "'out'"),
        ("buffer B { float x[]; };\n", 1, "'buffer'"),
        ("shared float s[4];\n", 1, "SHARED"),
        ("flat in int x;\n", 1, "'flat'"),
        ("#define A \\\n  1\nuniform int b;\n", 3, "'uniform'"),
    ],
)
def test_declaration_in_a_file_raises_with_file_and_line(code, line, word):
    assert [fault[0] for fault in check(strip_comments(code))] == [line]
    with pytest.raises(ShaderError, match=rf"test.*\na_frag\.glsl:{line}: .*{word}"):
        shader(code + MAIN).source("fragment")


@pytest.mark.parametrize(
    "code",
    [
        "void f(in vec3 a, inout float b, out int c) { }\n",
        "void f(\n  in vec3 a,\n  out int c) { c = 1; }\n",
        "// uniform float x;\n/* layout\n in */\nconst int uniforms = 1;\n",
        "#define in_place(x) \\\n  uniform x\n",
        "struct S { vec3 a; };\nSHARED float s[4];\n",
    ],
)
def test_parameters_comments_and_macros_are_allowed(code):
    assert check(strip_comments(code)) == []


# --- standalone text -------------------------------------------------------------------------------------------------

FULL = Shader(
    "full", vertex="v.glsl", fragment="f.glsl",
    inputs={"in_position": "VEC3", "in_id": "INT"}, varyings={"v_uv": "VEC2", "v_id": "flat INT"},
    outputs={"out_color": "VEC4", "out_id": "UINT"},
    samplers={"a_tx": "FLOAT_2D", "b_tx": "UINT_3D", "t_tx": "FLOAT_2D"},
    images={"c_img": Image("RGBA16F", "FLOAT_3D", "WRITE"), "d_img": Image("R32UI", "UINT_2D_ATOMIC")},
    uniforms={"view": VIEW}, structs=(VIEW, Struct("Light", power="vec3")),
    constants={"pc_gain": "FLOAT", "pc_matrix": "MAT4", "pc_at": "IVEC2"}, defines=(("COUNT", "4"),), depth_write=True,
    files={
        "v.glsl": """void main() {
            v_uv = in_position.xy; v_id = in_id; gl_Position = view.clip_from_world * pc_matrix[0]; }""",
        "f.glsl": """void main() {
            out_color = texture(a_tx, v_uv) * pc_gain + vec4(light_fetch(t_tx, COUNT).power + view.eye, view.index);
            out_id = texelFetch(b_tx, ivec3(pc_at, v_id), 0).x + imageAtomicAdd(d_img, pc_at, 1u);
            imageStore(c_img, ivec3(0), out_color); gl_FragDepth = 0.5; }""",
    },
)  # fmt: skip
BLUR = Shader(
    "blur", compute="c.glsl", local_size=(4, 2, 1), images={"a_img": Image("R32F", "FLOAT_2D")},
    files={"c.glsl": "SHARED float s[8];\nvoid main() { imageStore(a_img, ivec2(0), vec4(s[0])); }"},
)  # fmt: skip
DEPTH = Shader(
    "depth", vertex="v.glsl", inputs={"in_p": "VEC4"}, files={"v.glsl": "void main() { gl_Position = in_p; }"}
)


@pytest.mark.parametrize("declared", [FULL, BLUR, DEPTH, shader("void main() { out_color = vec4(uv, 0, 1); }")])
def test_standalone_text_compiles(declared, tmp_path):
    sources = declared.standalone_sources()
    assert set(sources) == ({"comp"} if declared.compute else {"vert", "frag"})
    validator = shutil.which("glslangValidator")
    if validator is None:
        pytest.skip("glslangValidator is not installed (Debian: glslang-tools)")
    paths = []
    for stage, text in sources.items():
        paths.append(tmp_path / f"shader.{stage}")
        paths[-1].write_text(text)
    result = subprocess.run([validator, "-l", *paths], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout


def test_standalone_lines_are_traced():
    source = FULL.standalone("fragment")
    at = source.lines.index("void main() {") + 1
    assert source.origin(at) == "f.glsl:1"
    assert source.origin(1).startswith("<declarations of full>")
    assert len(source.lines) == len(source.origins) == len(source.text.splitlines())


def test_full_screen_triangle_gives_uv():
    sources = shader().standalone_sources()
    assert "smooth out vec2 uv;" in sources["vert"]
    assert "smooth in vec2 uv;" in sources["frag"]


def test_unknown_stage_raises():
    with pytest.raises(ShaderError, match="no such stage"):
        BLUR.source("fragment")


# --- declarations that no Blender could run --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("declared", "match"),
    [
        ({"name": "Bad Name"}, "snake"),
        ({"fragment": ""}, "compute, or"),
        ({"compute": "c.glsl"}, "compute, or"),
        ({"varyings": {"v_a": "VEC2"}}, "full-screen"),
        ({"inputs": {"in_a": "VEC2"}}, "full-screen"),
        ({"vertex": "v.glsl", "varyings": {"v_a": "INT"}}, "flat"),
        ({"vertex": "v.glsl", "varyings": {"v_a": "MAT3"}}, "v_a.*MAT3"),
        ({"constants": {"gain": "FLOAT"}}, "gain.*pc_"),
        ({"constants": {"pc_a": "BOOL"}}, "pc_a.*use INT"),
        ({"constants": {"pc_a": "UINT"}}, "pc_a.*use INT"),
        ({"constants": {"pc_a": "MAT4", "pc_b": "MAT4", "pc_c": "FLOAT"}}, "132 bytes.*128"),
        ({"constants": {"pc_a": "FLOAT", "pc_b": "MAT4", "pc_c": "VEC3", "pc_d": "MAT4"}}, "bytes"),
        ({"samplers": {"a_tx": "SHADOW_2D"}}, "a_tx.*SHADOW_2D"),
        ({"samplers": {"a": "FLOAT_2D"}, "images": {"a": Image("R32F", "FLOAT_2D")}}, "a.*images and in samplers"),
        ({"samplers": {"uv": "FLOAT_2D"}}, "uv.*varyings and in samplers"),
        ({"samplers": {"filter": "FLOAT_2D"}}, "filter"),
        ({"samplers": {"thread": "FLOAT_2D"}}, "thread"),
        ({"samplers": {"gl_tx": "FLOAT_2D"}}, "gl_tx"),
        ({"samplers": {"a__tx": "FLOAT_2D"}}, "a__tx"),
        ({"images": {f"i{n}_img": Image("R32F", "FLOAT_2D") for n in range(9)}}, "9 images; at most 8"),
        ({"outputs": {f"out_{n}": "VEC4" for n in range(7)}}, "7 outputs; at most 6"),
        ({"samplers": {f"s{n}_tx": "FLOAT_2D" for n in range(33)}}, "33 samplers; at most 32"),
        ({"uniforms": {"a": Struct("Big", **{f"m_{n}": "mat4" for n in range(1025)})}}, "64 KiB"),
        ({"uniforms": {"a": VIEW, "b": Struct("View", x="vec4")}}, "one name"),
        ({"uniforms": {"View": VIEW}}, "View"),
        ({"uniforms": {"a": VIEW}, "defines": (("a", "1"),)}, "define"),
    ],
)  # fmt: skip
def test_impossible_declaration_names_the_shader(declared, match):
    name = declared.get("name", "test")
    with pytest.raises(ValueError, match=f"Shader {name}: .*{match}"):
        shader(**declared)


@pytest.mark.parametrize("local_size", [(0, 1, 1), (32, 32, 2)])
def test_impossible_local_size_raises(local_size):
    with pytest.raises(ValueError, match="local_size"):
        Shader("test", compute="c.glsl", local_size=local_size)


@pytest.mark.parametrize(
    "arguments",
    [("SRGB8_A8", "FLOAT_2D"), ("R32F", "FLOAT_1D"), ("R32F", "FLOAT_2D", "APPEND"), ("R32F", "UINT_2D"),
     ("R32UI", "FLOAT_2D"), ("R32I", "UINT_2D_ATOMIC")],
)  # fmt: skip
def test_impossible_image_raises(arguments):
    with pytest.raises(ValueError, match="Image"):
        Image(*arguments)


def test_constants_of_128_bytes_are_allowed():
    shader(constants={"pc_a": "MAT4", "pc_b": "VEC4", "pc_c": "VEC3", "pc_d": "FLOAT", "pc_e": "VEC4", "pc_f": "VEC4"})


# --- identity --------------------------------------------------------------------------------------------------------


def test_equal_declarations_are_equal_and_hash_alike():
    assert shader() == shader()
    assert len({shader(), shader(), shader(defines=(("A", "1"),)), shader(MAIN + "\n")}) == 3
    assert dataclasses.replace(shader(), name="other").files == shader().files


def test_a_shader_cannot_be_changed_after_the_fact():
    outputs = {"out_color": "VEC4"}
    made = shader(outputs=outputs)
    outputs["out_b"] = "VEC4"
    assert list(made.outputs) == ["out_color"]
    with pytest.raises(TypeError):
        made.outputs["out_b"] = "VEC4"
