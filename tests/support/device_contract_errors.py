"""What every device must refuse, and how it names what is wrong. See device_contract.py."""

import numpy as np
import pytest

from rebound.device import DrawState, Image, Shader, ShaderError

from .device_contract import LIGHT, compute, fragment, show
from .device_contract_draw import FILL, TRIANGLES, WRITE_DEPTH, canvas, quad, quads


def test_wrong_names_raise_with_the_shaders_name(device):
    shader = fragment("named", "void main() { out_color = vec4(pc_a); }", constants={"pc_a": "FLOAT", "pc_b": "FLOAT"})
    for given, match in (
        ({"pc_a": 1}, "named.*missing pc_b"),
        ({"pc_a": 1, "pc_b": 1, "pc_c": 1}, "named.*unknown pc_c"),
        ({"pc_a": 1, "pc_d": 1}, "named.*missing pc_b.*unknown pc_d"),
        ({"pc_a": "x", "pc_b": 1}, "named.*pc_a"),
    ):
        with pytest.raises((TypeError, ValueError), match=match):
            show(device, shader, **given)


def test_texture_of_a_wrong_kind_raises(device):
    shader = fragment("kinds", "void main() { out_color = texture(a_tx, uv); }", samplers={"a_tx": "FLOAT_2D"})
    for texture in (device.texture((1, 1, 1), "RGBA32F"), device.texture((1, 1), "R32UI"), None, 7):
        with pytest.raises(TypeError, match="kinds.*a_tx.*FLOAT_2D"):
            show(device, shader, a_tx=texture)


def test_image_of_a_wrong_format_raises(device):
    shader = compute("image_kinds", "void main() { imageStore(a_img, ivec2(0), vec4(1)); }",
                     images={"a_img": Image("RGBA16F", "FLOAT_2D", "WRITE")})  # fmt: skip
    with pytest.raises(TypeError, match="image_kinds.*a_img.*RGBA16F"):
        device.dispatch(shader, (1, 1, 1), a_img=device.texture((1, 1), "RGBA32F"))


@pytest.mark.parametrize("stage", ["vertex", "fragment", "compute"])
def test_compile_error_names_file_and_line(device, stage):
    files = {
        # The same faulty line stands, right, in another place: a line must not be found by its text.
        "test/good_lib.glsl": "/* a comment\n over lines */\nfloat twice(float a)\n{\n  float wrong = a;\n"
        "  return 2.0 * wrong;\n}\n",
        "test/bad_lib.glsl": "// first\n\nfloat bad(float b)\n{\n  float wrong = a;\n  return wrong;\n}\n",
        "test/main.glsl": '#include "test/good_lib.glsl"\n#include "test/bad_lib.glsl"\nvoid main()\n{\n  FOO;\n}\n',
        "test/other.glsl": "void main() {}\n",
    }
    use = {
        "vertex": "gl_Position = vec4(bad(twice(1.0)))",
        "fragment": "out_color = vec4(bad(twice(1.0)))",
        "compute": "bad(twice(1.0))",
    }[stage]
    files["test/main.glsl"] = files["test/main.glsl"].replace("FOO", use)
    stages = {"vertex": "test/other.glsl", "fragment": "test/other.glsl", stage: "test/main.glsl"}
    if stage == "compute":
        shader = Shader("broken", compute="test/main.glsl", files=files)
    else:
        shader = Shader("broken", **stages, outputs={"out_color": "VEC4"}, files=files, structs=(LIGHT,))
    with pytest.raises(ShaderError) as caught:
        if stage == "compute":
            device.dispatch(shader, (1, 1, 1))
        else:
            device.draw(shader, None, device.target([device.texture((1, 1), "RGBA32F")]))
    assert caught.value.name == "broken"
    assert caught.value.stage == stage
    assert "test/bad_lib.glsl:5: " in str(caught.value), str(caught.value)
    assert "good_lib" not in str(caught.value), str(caught.value)


def test_shader_compiles_once_for_equal_declarations(device):
    first, second = (fragment("equal", "void main() { out_color = vec4(1); }") for _ in range(2))
    assert device._program(first) is device._program(second)
    other = fragment("equal", "void main() { out_color = vec4(VALUE); }", defines=(("VALUE", "2.0"),))
    assert show(device, other)[0, 0, 0] == 2.0
    assert show(device, first)[0, 0, 0] == 1.0


def test_wrong_vertices_raise(device):
    target, rest = canvas(device), {"pc_offset": (0, 0), "pc_matrix": np.eye(4)}
    with pytest.raises(TypeError, match="triangles.*in_position"):
        device.draw(TRIANGLES, None, target, **rest)
    with pytest.raises(TypeError, match="triangles.*in_id"):
        device.draw(
            TRIANGLES, device.vertices({"in_position": np.zeros((3, 3)), "in_value": np.zeros(3)}), target, **rest
        )
    arrays = {"in_position": np.zeros((3, 3)), "in_value": np.zeros(3), "in_id": np.zeros(3)}
    with pytest.raises(TypeError, match="triangles.*in_id is INT"):
        device.draw(TRIANGLES, device.vertices(arrays), target, **rest)
    with pytest.raises(ValueError, match="triangles.*4 corners"):
        device.draw(TRIANGLES, quads(device, np.zeros((4, 3))), target, **rest)
    with pytest.raises(ValueError, match="triangles.*count"):
        device.draw(TRIANGLES, quads(device, quad(-1, -1, 1, 1)), target, count=3, **rest)
    with pytest.raises(ValueError, match="unequal"):
        device.vertices({"in_position": np.zeros((3, 3)), "in_value": np.zeros(4)})


def test_depth_write_without_test_raises(device):
    with pytest.raises(ValueError, match="ALWAYS"):
        DrawState(depth_write=True)
    with pytest.raises(TypeError, match="fill.*depth"):
        device.fullscreen(FILL, canvas(device), state=WRITE_DEPTH, pc_color=(0, 0, 0, 0))


def test_reading_what_is_drawn_into_raises(device):
    shader = fragment("loop", "void main() { out_color = texture(a_tx, uv); }", samplers={"a_tx": "FLOAT_2D"})
    target = canvas(device)
    with pytest.raises(TypeError, match="loop.*a_tx.*target"):
        device.fullscreen(shader, target, a_tx=target.colors[0])


def test_freed_target_raises(device):
    for free_target in (True, False):
        target = canvas(device)
        device.free(target if free_target else target.colors[0])
        with pytest.raises(ValueError, match="fill.*freed"):
            device.fullscreen(FILL, target, pc_color=(0, 0, 0, 0))
        with pytest.raises(ValueError, match="freed"):
            device.clear(target)


def test_empty_viewport_raises(device):
    with pytest.raises(ValueError, match="fill.*viewport"):
        device.fullscreen(FILL, canvas(device), viewport=(0, 0, 0, 4), pc_color=(0, 0, 0, 0))


def test_wrong_target_raises(device):
    a, b, depth = device.texture((2, 2), "R8"), device.texture((3, 2), "R8"), device.texture((2, 2), "DEPTH32F")
    for colors, of_depth in (([a, b], None), ([], None), ([depth], None), ([a], a), ([a] * 7, None)):
        with pytest.raises(ValueError, match="target"):
            device.target(colors, of_depth)
    shader = fragment("two", "void main() { out_a = vec4(1); out_b = 1u; }", outputs={"out_a": "VEC4", "out_b": "UINT"})
    for colors in ([a], [a, device.texture((2, 2), "R8")]):
        with pytest.raises(TypeError, match="Shader two"):
            device.fullscreen(shader, device.target(colors))
