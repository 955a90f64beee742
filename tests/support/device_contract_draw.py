"""What every device must do when it draws. Run by tests/headless and by tests/blender; see device_contract.py."""

import numpy as np
import pytest

from rebound.device import DrawState, Image, Shader

from .device_contract import fragment

WRITE_DEPTH = DrawState(depth_test="ALWAYS", depth_write=True)
FILL = fragment("fill", "void main() { out_color = pc_color; }", constants={"pc_color": "VEC4"})
TRIANGLES = Shader(
    "triangles",
    vertex="test/triangles_vert.glsl",
    fragment="test/triangles_frag.glsl",
    inputs={"in_position": "VEC3", "in_value": "FLOAT", "in_id": "INT"},
    varyings={"v_value": "FLOAT", "v_id": "flat INT", "v_instance": "flat INT"},
    outputs={"out_color": "VEC4"},
    constants={"pc_offset": "VEC2", "pc_matrix": "MAT4"},
    files={
        "test/triangles_vert.glsl": """
            void main()
            {
              v_value = in_value;
              v_id = in_id + 1000 * gl_VertexID;
              v_instance = gl_InstanceID;
              gl_Position = pc_matrix * vec4(in_position, 1.0);
              gl_Position.xy += pc_offset * float(gl_InstanceID);
            }""",
        "test/triangles_frag.glsl": "void main() { out_color = vec4(v_value, float(v_id), float(v_instance), 1.0); }",
    },
)


def quad(x0, y0, x1, y1, z=0.0):
    """Six corners of a counter-clockwise rectangle, (6, 3)."""
    a, b, c, d = (x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)
    return np.array([a, b, c, a, c, d], np.float64)


def quads(device, *positions, values=None, ids=None):
    """Vertices for TRIANGLES."""
    corners = np.concatenate(positions)
    n = len(corners)
    return device.vertices(
        {
            "in_position": corners,
            "in_value": np.ones(n) if values is None else np.asarray(values),
            "in_id": np.arange(n) if ids is None else np.asarray(ids),
            "in_unused": np.zeros((n, 2)),
        }
    )


def canvas(device, size=(8, 4), formats=("RGBA32F",), depth=False):
    """A cleared target of new textures."""
    target = device.target(
        [device.texture(size, f) for f in formats], device.texture(size, "DEPTH32F") if depth else None
    )
    device.clear(target)
    return target


def test_vertex_data_arrives(device):
    target = canvas(device)
    vertices = quads(device, quad(-1, -1, 0, 1), quad(0, -1, 1, 0), values=[1.0] * 6 + [2.0] * 6)
    device.draw(TRIANGLES, vertices, target, pc_offset=(0, 0), pc_matrix=np.eye(4))
    values = device.read(target.colors[0])
    expected = np.zeros((4, 8))
    expected[:, :4] = 1
    expected[:2, 4:] = 2
    np.testing.assert_array_equal(values[..., 0], expected)
    # Flat values come from the last corner of a triangle: 2, 5, 8 and 11 here.
    assert set(np.unique(values[..., 1])) == {0, 2002, 5005, 8008, 11011}


def test_matrix_moves_what_it_should(device):
    target = canvas(device)
    matrix = np.eye(4)
    matrix[:3, 3] = (1, 1, 0)  # by half the width and half the height
    device.draw(TRIANGLES, quads(device, quad(-1, -1, 0, 0)), target, pc_offset=(0, 0), pc_matrix=matrix)
    expected = np.zeros((4, 8))
    expected[2:, 4:] = 1
    np.testing.assert_array_equal(device.read(target.colors[0])[..., 0], expected)


def test_attribute_that_the_compiler_drops_is_accepted(device):
    shader = Shader(
        "dropped_input", vertex="v", fragment="f", outputs={"out_color": "VEC4"},
        inputs={"in_unused": "VEC2", "in_position": "VEC3"},
        files={"v": "void main() { gl_Position = vec4(in_position, 1); }", "f": "void main() { out_color = vec4(1); }"},
    )  # fmt: skip
    target = canvas(device)
    device.draw(shader, quads(device, quad(-1, -1, 1, 1)), target)
    assert (device.read(target.colors[0]) == 1).all()


def test_instances_count_from_0(device):
    vertices = quads(device, quad(-1, -1, -0.75, 1), quad(-0.75, -1, -0.5, 1), values=[1.0] * 6 + [2.0] * 6)
    target = canvas(device)
    device.draw(TRIANGLES, vertices, target, instances=3, pc_offset=(0.5, 0), pc_matrix=np.eye(4))
    expected = np.zeros((2, 8))
    for instance in range(3):
        for start in (0, 1):
            expected[:, 2 * instance + start] = start + 1, instance
    np.testing.assert_array_equal(device.read(target.colors[0])[0].T[[0, 2]], expected)


def test_no_vertices_draw_nothing(device):
    target = canvas(device)
    device.draw(TRIANGLES, quads(device, np.zeros((0, 3))), target, pc_offset=(0, 0), pc_matrix=np.eye(4))
    assert not device.read(target.colors[0]).any()


def test_corners_without_attributes(device):
    shader = Shader(
        "pulled", vertex="v", fragment="f", outputs={"out_color": "VEC4"}, varyings={"v_id": "flat INT"},
        files={
            "v": """void main() {
                      int corner = gl_VertexID % 3;
                      vec2 p = vec2(corner == 1 ? 2.0 : 0.0, corner == 2 ? 2.0 : 0.0);
                      v_id = 10 * gl_InstanceID + gl_VertexID / 3;
                      gl_Position = vec4((vec2(2 * (gl_VertexID / 3), gl_InstanceID) + p - 4.0) / 4.0, 0.0, 1.0); }""",
            "f": "void main() { out_color = vec4(float(v_id)); }",
        },
    )  # fmt: skip
    for instances in (1, 3):
        target = canvas(device, (8, 8))
        device.draw(shader, None, target, count=12, instances=instances)
        ids = device.read(target.colors[0])[..., 0]
        expected = {10 * i + t for i in range(instances) for t in range(4)}
        assert set(np.unique(ids)) == expected | {0}


# --- fixed function --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("format", ["RGBA32F", "RGBA16F"])
def test_additive_blend_adds_all_four_channels(device, format):
    target = canvas(device, formats=(format,))
    colors = np.array([(1, 2, 3, 0.5), (0.25, 0, 7, 0), (0, 0, 0, 2)], np.float32)
    for color in colors:
        device.fullscreen(FILL, target, state=DrawState(blend="ADDITIVE"), pc_color=color)
    np.testing.assert_array_equal(device.read(target.colors[0])[1, 1], colors.sum(0))


@pytest.mark.parametrize("format", ["RGBA32F", "RGBA16F"])
def test_multiplied_blend_multiplies_all_four_channels(device, format):
    target = canvas(device, formats=(format,))
    device.clear(target, (1, 2, 3, 0.5))
    device.fullscreen(FILL, target, state=DrawState(blend="MULTIPLY"), pc_color=(0.5, 3, 0, 0.5))
    np.testing.assert_array_equal(device.read(target.colors[0])[1, 1], [0.5, 6, 0, 0.25])


def test_premultiplied_alpha_blends_over(device):
    target = canvas(device)
    device.clear(target, (1, 2, 3, 1))
    device.fullscreen(FILL, target, state=DrawState(blend="ALPHA_PREMULT"), pc_color=(5, 5, 5, 0.75))
    np.testing.assert_array_equal(device.read(target.colors[0])[0, 0], [5.25, 5.5, 5.75, 1.0])


def test_no_blend_overwrites_after_a_blended_draw(device):
    target = canvas(device)
    device.fullscreen(FILL, target, state=DrawState(blend="ADDITIVE"), pc_color=(1, 1, 1, 1))
    device.fullscreen(FILL, target, pc_color=(2, 2, 2, 0))
    np.testing.assert_array_equal(device.read(target.colors[0])[0, 0], [2, 2, 2, 0])


def test_nearer_wins_and_depth_is_written(device):
    target = canvas(device, depth=True)
    state = DrawState(depth_test="LESS_EQUAL", depth_write=True)
    rest = {"pc_offset": (0, 0), "pc_matrix": np.eye(4)}
    for z, x0, value in ((0.0, -1, 1.0), (0.5, -1, 2.0), (-0.5, 0, 3.0)):
        device.draw(TRIANGLES, quads(device, quad(x0, -1, 1, 1, z), values=[value] * 6), target, state=state, **rest)
    np.testing.assert_array_equal(device.read(target.colors[0])[0, :, 0], [1] * 4 + [3] * 4)
    # Clip z in [-1, 1] becomes depth in [0, 1] on every backend.
    np.testing.assert_allclose(device.read(target.depth)[0, :, 0], [0.5] * 4 + [0.25] * 4, atol=1e-6)
    device.draw(TRIANGLES, quads(device, quad(-1, -1, 1, 1, 0.9), values=[4.0] * 6), target, **rest)
    assert (device.read(target.colors[0])[..., 0] == 4).all()
    np.testing.assert_allclose(device.read(target.depth)[0, :, 0], [0.5] * 4 + [0.25] * 4, atol=1e-6)


def test_depth_only_target(device):
    depth = device.texture((8, 4), "DEPTH32F")
    target = device.target((), depth)
    device.clear(target)
    shader = Shader(
        "depth_only", vertex="v", inputs={"in_position": "VEC3"}, constants={"pc_matrix": "MAT4"},
        files={"v": "void main() { gl_Position = pc_matrix * vec4(in_position, 1.0); }"},
    )  # fmt: skip
    state = DrawState(depth_test="LESS_EQUAL", depth_write=True)
    device.draw(shader, quads(device, quad(-1, -1, 0, 1, -0.5)), target, state=state, pc_matrix=np.eye(4))
    np.testing.assert_allclose(device.read(depth)[0, :, 0], [0.25] * 4 + [1] * 4, atol=1e-6)


def test_fragment_writes_depth(device):
    target = canvas(device, depth=True)
    shader = fragment("frag_depth", "void main() { out_color = vec4(1); gl_FragDepth = uv.x; }", depth_write=True)
    device.fullscreen(shader, target, state=WRITE_DEPTH)
    np.testing.assert_allclose(device.read(target.depth)[0, :, 0], (np.arange(8) + 0.5) / 8, atol=1e-6)


# --- targets ---------------------------------------------------------------------------------------------------------


def test_viewport_draws_a_tile_only(device):
    target = canvas(device)
    shader = fragment("tile", "void main() { out_color = vec4(uv, gl_FragCoord.xy); }")
    device.fullscreen(shader, target, viewport=(2, 1, 4, 2))
    values = device.read(target.colors[0])
    assert not values[0].any() and not values[3].any() and not values[:, :2].any() and not values[:, 6:].any()
    np.testing.assert_allclose(values[1, 2], [0.125, 0.25, 2.5, 1.5], atol=1e-6)
    device.fullscreen(shader, target)  # the tile is forgotten
    np.testing.assert_allclose(device.read(target.colors[0])[0, 0], [1 / 16, 1 / 8, 0.5, 0.5], atol=1e-6)


def test_clear_fills_each_slot(device):
    target = canvas(device, formats=("RGBA32F", "R32UI", "RG16F", "R32I", "RGBA8"), depth=True)
    device.clear(target, [(1, 2, 3, 4), (5, 0, 0, 0), (6, 7, 0, 0), (-8, 0, 0, 0), (1, 0, 1, 0.2)], depth=0.25)
    expected = ([1, 2, 3, 4], [5], [6, 7], [-8], [255, 0, 255, 51])
    for texture, value in zip(target.colors, expected, strict=True):
        np.testing.assert_array_equal(device.read(texture), np.broadcast_to(value, texture.shape))
    np.testing.assert_allclose(device.read(target.depth), 0.25, atol=1e-6)


def test_clear_of_a_tile_leaves_the_rest(device):
    target = canvas(device, formats=("RGBA32F", "R32UI", "R32I"), depth=True)
    device.clear(target, [(1, 2, 3, 4), (5, 0, 0, 0), (-8, 0, 0, 0)], depth=0.25, viewport=(4, 0, 4, 2))
    inside = np.zeros((4, 8), bool)
    inside[:2, 4:] = True
    for texture, value in zip(target.colors, (1, 5, -8), strict=True):
        np.testing.assert_array_equal(device.read(texture)[..., 0], np.where(inside, value, 0))
    np.testing.assert_allclose(device.read(target.depth)[..., 0], np.where(inside, 0.25, 1), atol=1e-6)
    depth_only = device.target((), target.depth)
    device.clear(depth_only, depth=0.5, viewport=(0, 0, 1, 1))
    np.testing.assert_allclose(device.read(target.depth)[0, :2, 0], [0.5, 1], atol=1e-6)


def test_six_outputs(device):
    formats = ("RGBA32F", "RGBA16F", "R32F", "RG16F", "RGBA8", "R32UI")
    target = canvas(device, formats=formats)
    shader = fragment(
        "six",
        "void main() { out_a = vec4(1, 2, 3, 4); out_b = vec4(5, 6, 7, 8); out_c = 9.5; out_d = vec2(10, 11);"
        " out_e = vec4(0, 1, 0.2, 1); out_f = 4000000000u; }",
        outputs={"out_a": "VEC4", "out_b": "VEC4", "out_c": "FLOAT", "out_d": "VEC2", "out_e": "VEC4", "out_f": "UINT"},
    )
    device.fullscreen(shader, target)
    expected = ([1, 2, 3, 4], [5, 6, 7, 8], [9.5], [10, 11], [0, 255, 51, 255], [4000000000])
    for texture, value in zip(target.colors, expected, strict=True):
        np.testing.assert_array_equal(device.read(texture), np.broadcast_to(value, texture.shape))


def test_fragment_stores_to_a_volume(device):
    volume = device.texture((4, 4, 2), "R32UI")
    shader = fragment(
        "voxelize",
        "void main() { imageAtomicAdd(voxel_img, ivec3(ivec2(gl_FragCoord.xy) / 2, 1), 3u); out_color = vec4(1); }",
        images={"voxel_img": Image("R32UI", "UINT_3D_ATOMIC")},
    )
    device.fullscreen(shader, canvas(device, (8, 8), ("R8",)), voxel_img=volume)
    expected = np.zeros((2, 4, 4, 1))
    expected[1] = 12
    np.testing.assert_array_equal(device.read(volume), expected)


# --- drawing() -------------------------------------------------------------------------------------------------------


def test_drawing_equals_draw(device):
    one, other = quads(device, quad(-1, -1, -0.5, 1)), quads(device, quad(-0.5, -1, 0, 0))
    draws = [(one, 2, np.eye(4)), (other, 2, np.diag([1, 0.5, 1, 1])), (one, 2, np.diag([0, 0, 0, 1]))]
    pictures = []
    for fast in (True, False):
        target = canvas(device)
        if fast:
            with device.drawing(TRIANGLES, target, viewport=(0, 0, 8, 2), pc_offset=(0.5, 0)) as draw:
                for vertices, instances, matrix in draws:
                    draw(vertices, instances=instances, pc_matrix=matrix)
        else:
            for vertices, instances, matrix in draws:
                device.draw(TRIANGLES, vertices, target, viewport=(0, 0, 8, 2), instances=instances,
                            pc_offset=(0.5, 0), pc_matrix=matrix)  # fmt: skip
        pictures.append(device.read(target.colors[0]))
    np.testing.assert_array_equal(*pictures)
    assert pictures[0].any()


def test_paired_triangles_are_drawn_without_asking_for_shared_corners(device):
    """Corners 3 and 4 of six lie elsewhere here: whoever asked for them would show it."""
    shader = Shader(
        "paired", vertex="v", fragment="f", outputs={"out_color": "VEC4"},
        files={
            "v": """void main() {
                      int square = gl_VertexID / 6;
                      int corner = gl_VertexID - 6 * square;
                      vec2 p = vec2(corner == 1 || corner == 2, corner == 2 || corner == 5);
                      p += corner == 3 || corner == 4 ? vec2(9.0) : vec2(square & 3, square >> 2);
                      gl_Position = vec4(0.5 * p - 1.0, 0.0, 1.0); }""",
            "f": "void main() { out_color = vec4(1.0); }",
        },
    )  # fmt: skip
    for squares in (1, 5, 16):  # ever more corners than before
        target = canvas(device, (8, 8))
        with device.drawing(shader, target) as draw:
            draw(count=6 * squares, paired=True)
        covered = device.read(target.colors[0])[..., 0] > 0
        assert covered.sum() == covered.size * squares // 16
        with pytest.raises(ValueError, match="paired"), device.drawing(shader, target) as draw:
            draw(count=6, instances=2, paired=True)


def test_drawing_switches_textures_from_draw_to_draw(device):
    shader = Shader(
        "textured", vertex="v", fragment="f", inputs={"in_position": "VEC3"}, outputs={"out_color": "VEC4"},
        samplers={"a_tx": "FLOAT_2D", "b_tx": "FLOAT_2D"},
        files={
            "v": "void main() { gl_Position = vec4(in_position, 1.0); }",
            "f": "void main() { out_color = texelFetch(a_tx, ivec2(0), 0) + texelFetch(b_tx, ivec2(0), 0); }",
        },
    )  # fmt: skip
    one, two, ten = (device.texture((1, 1), "RGBA32F", np.full((1, 1, 4), v, np.float32)) for v in (1, 2, 10))
    target = canvas(device)
    left, right = quads(device, quad(-1, -1, 0, 1)), quads(device, quad(0, -1, 1, 1))
    with device.drawing(shader, target, b_tx=ten) as draw:
        draw(left, a_tx=one)
        draw(right, a_tx=two)
    np.testing.assert_array_equal(device.read(target.colors[0])[0, :, 0], [11] * 4 + [12] * 4)


def test_drawing_checks_names_and_guards_the_device(device):
    vertices, target = quads(device, quad(-1, -1, 1, 1)), canvas(device)
    with pytest.raises(TypeError, match="triangles.*unknown pc_x"), device.drawing(TRIANGLES, target, pc_x=1):
        pass
    with device.drawing(TRIANGLES, target, pc_offset=(0, 0)) as draw:
        with pytest.raises(TypeError, match="triangles.*missing pc_matrix.*unknown pc_offset"):
            draw(vertices, pc_offset=(0, 0))
        with pytest.raises(RuntimeError, match="inside drawing"):
            device.read(target.colors[0])
        with pytest.raises(RuntimeError, match="fill.*inside drawing.*triangles"):
            device.fullscreen(FILL, target, pc_color=(1, 1, 1, 1))
        draw(vertices, pc_matrix=np.eye(4))
    assert (device.read(target.colors[0])[..., 0] == 1).all()


def test_an_exception_inside_drawing_leaves_the_device_usable(device):
    target = canvas(device)
    with pytest.raises(ZeroDivisionError), device.drawing(TRIANGLES, target, pc_offset=(0, 0)):
        raise ZeroDivisionError
    with pytest.raises(ValueError), device.drawing(TRIANGLES, target, pc_offset=(0, 0, 0)):
        pass
    device.fullscreen(FILL, target, pc_color=(1, 2, 3, 4))
    np.testing.assert_array_equal(device.read(target.colors[0])[0, 0], [1, 2, 3, 4])


def test_same_draw_twice_gives_the_same_bits(device):
    shader = fragment("noise", "void main() { out_color = fract(sin(vec4(uv, uv.yx) * 43.0) * 43758.5); }")
    pictures = []
    for _ in range(2):
        target = canvas(device, (33, 17))
        device.fullscreen(shader, target)
        pictures.append(device.read(target.colors[0]).tobytes())
    assert pictures[0] == pictures[1]


def test_device_tells_what_it_is(device):
    assert device.name and device.max_texture_size >= 4096 and isinstance(device.is_software, bool)
    device.finish()
