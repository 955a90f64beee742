"""What every device must do: data that arrives. Run by tests/headless and by tests/blender.

Expected pictures are closed forms in numpy; a test gets its device from the fixture ``device``.
"""

import numpy as np
import pytest

from rebound.device import Image, Shader, Struct

LIGHT = Struct(
    "Light", position="vec3", kind="int", power="vec3", radius="float", uv="vec2", index="int", from_world="mat4"
)
MATRIX = np.arange(1.0, 17.0, dtype=np.float32).reshape(4, 4)
LIGHTS = [
    {"position": (1.5, -2, 3), "kind": -7, "power": (4, 5, 6), "radius": 0.1, "uv": (8, 9), "index": 2**24,
     "from_world": MATRIX},
    {"position": (0, 0, 1e-30), "kind": 0, "power": (7, 7, 7e30), "radius": -0.0, "uv": (1, 2), "index": -1,
     "from_world": MATRIX.T},
]  # fmt: skip


def fragment(name, text, **declared):
    """A full-screen shader from its text."""
    path = f"test/{name}_frag.glsl"
    declared.setdefault("outputs", {"out_color": "VEC4"})
    return Shader(name, fragment=path, files={path: text, **declared.pop("files", {})}, **declared)


def compute(name, text, **declared):
    """A compute shader from its text."""
    path = f"test/{name}_comp.glsl"
    return Shader(name, compute=path, files={path: text}, **declared)


def show(device, shader, size=(1, 1), format="RGBA32F", **resources):
    """What a full-screen shader writes, (h, w, c)."""
    texture = device.texture(size, format)
    device.fullscreen(shader, device.target([texture]), **resources)
    return device.read(texture)


# --- constants and structs -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("type_name", "value", "expression", "expected"),
    [
        ("FLOAT", 0.1, "vec4(pc_value)", [0.1] * 4),
        ("FLOAT", np.float32(3), "vec4(pc_value)", [3] * 4),
        ("INT", -5, "vec4(pc_value)", [-5] * 4),
        ("INT", np.int64(7), "vec4(pc_value)", [7] * 4),
        ("INT", 2**31 - 1, "intBitsToFloat(ivec4(pc_value))", np.full(4, 2**31 - 1, np.int32).view(np.float32)),
        ("INT", True, "vec4(pc_value)", [1] * 4),
        ("VEC2", (1, 2), "vec4(pc_value, 0, 0)", [1, 2, 0, 0]),
        ("VEC3", np.array([1.0, 2.0, 3.0]), "vec4(pc_value, 0)", [1, 2, 3, 0]),
        ("VEC4", [1, 2, 3, 4], "pc_value", [1, 2, 3, 4]),
        ("IVEC2", (-3, 40000), "vec4(pc_value, 0, 0)", [-3, 40000, 0, 0]),
        ("MAT4", MATRIX, "pc_value * vec4(1, 10, 100, 1000)", MATRIX @ [1, 10, 100, 1000]),
        ("MAT4", MATRIX.astype(np.float64).T, "pc_value[3]", MATRIX[3]),
    ],
)
def test_constant_arrives(device, type_name, value, expression, expected):
    shader = fragment("constant", f"void main() {{ out_color = {expression}; }}", constants={"pc_value": type_name})
    np.testing.assert_array_equal(show(device, shader, pc_value=value)[0, 0], np.asarray(expected, np.float32))


def test_constant_that_the_compiler_drops_is_accepted_and_checked(device):
    declared = {"pc_used": "FLOAT", "pc_unused": "MAT4", "pc_unused_int": "INT"}
    shader = fragment("unused_constant", "void main() { out_color = vec4(pc_used); }", constants=declared)
    values = show(device, shader, pc_used=2.0, pc_unused=MATRIX, pc_unused_int=3)
    np.testing.assert_array_equal(values, np.full((1, 1, 4), 2.0))
    with pytest.raises(ValueError, match="unused_constant.*pc_unused"):
        show(device, shader, pc_used=2.0, pc_unused=np.eye(3), pc_unused_int=3)


def test_constants_keep_apart_from_draw_to_draw(device):
    shader = fragment("per_draw", "void main() { out_color = vec4(pc_value); }", constants={"pc_value": "FLOAT"})
    assert [show(device, shader, pc_value=v)[0, 0, 0] for v in (1.0, 2.0, 1.0)] == [1.0, 2.0, 1.0]


_LIGHT_TEXELS = """
vec4 texel(Light l, int k)
{
  if (k == 0) { return vec4(l.position, intBitsToFloat(l.kind)); }
  if (k == 1) { return vec4(l.power, l.radius); }
  if (k == 2) { return vec4(l.uv, intBitsToFloat(l.index), 0.0); }
  return l.from_world * vec4(float(k == 3), float(k == 4), float(k == 5), float(k == 6));
}
"""


def expected_light(light):
    """The seven texels that _LIGHT_TEXELS gives back: matrix columns last."""
    rows = np.zeros((7, 4), np.float32)
    rows[0] = (*light["position"], np.int32(light["kind"]).view(np.float32))
    rows[1] = (*light["power"], light["radius"])
    rows[2, :3] = (*light["uv"], np.int32(light["index"]).view(np.float32))
    rows[3:] = np.asarray(light["from_world"]).T
    return rows


def test_struct_table_arrives_bit_exact(device):
    shader = fragment(
        "table",
        _LIGHT_TEXELS
        + "void main() { ivec2 at = ivec2(gl_FragCoord.xy); out_color = texel(light_fetch(light_tx, at.y), at.x); }",
        samplers={"light_tx": "FLOAT_2D"},
        structs=(LIGHT,),
    )
    table = device.texture((LIGHT.texels, 2), "RGBA32F", LIGHT.pack(LIGHTS))
    values = show(device, shader, (7, 2), light_tx=table)
    np.testing.assert_array_equal(values.view(np.uint32), np.array([expected_light(r) for r in LIGHTS]).view(np.uint32))


def test_uniform_block_arrives_bit_exact(device):
    shader = fragment(
        "block",
        _LIGHT_TEXELS + "void main() { out_color = texel(light, int(gl_FragCoord.x)); }",
        uniforms={"light": LIGHT},
    )
    for light in LIGHTS:
        packed = LIGHT.pack([light], for_uniform=True)
        values = show(device, shader, (7, 1), light=packed)[0]
        np.testing.assert_array_equal(values.view(np.uint32), expected_light(light).view(np.uint32))
        np.testing.assert_array_equal(show(device, shader, (7, 1), light=packed.tobytes())[0], values)


def test_uniforms_and_constants_change_between_draws_without_waiting(device):
    shader = fragment(
        "changing", "void main() { out_color = light.from_world[0] + pc_add; }",
        uniforms={"light": LIGHT}, constants={"pc_add": "VEC4"},
    )  # fmt: skip
    texture = device.texture((16, 1), "RGBA32F")
    target = device.target([texture])
    for x in range(16):
        packed = LIGHT.pack([{**LIGHTS[0], "from_world": MATRIX * x}], for_uniform=True)
        device.fullscreen(shader, target, viewport=(x, 0, 1, 1), light=packed, pc_add=(x, 0, 0, 0))
    expected = np.arange(16)[:, None] * (MATRIX[:, 0] + [1, 0, 0, 0])
    np.testing.assert_array_equal(device.read(texture)[0], expected)


def test_one_struct_as_table_and_block(device):
    shader = fragment(
        "both",
        "void main() { out_color = vec4(light.position - light_fetch(light_tx, 0).position, 1); }",
        samplers={"light_tx": "FLOAT_2D"}, uniforms={"light": LIGHT}, structs=(LIGHT,),
    )  # fmt: skip
    table = device.texture((LIGHT.texels, 1), "RGBA32F", LIGHT.pack(LIGHTS[:1]))
    values = show(device, shader, light_tx=table, light=LIGHT.pack(LIGHTS[:1], for_uniform=True))
    np.testing.assert_array_equal(values[0, 0], [0, 0, 0, 1])


def test_uniform_of_wrong_size_raises(device):
    shader = fragment("small_block", "void main() { out_color = light.from_world[0]; }", uniforms={"light": LIGHT})
    with pytest.raises(ValueError, match="small_block.*light.*Light"):
        show(device, shader, light=np.zeros(4, np.float32))


# --- textures --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("format", ["RGBA32F", "RGBA16F", "RG32F", "RG16F", "R32F", "R16F"])
def test_float_texture_comes_back(device, format):
    texture = device.texture((5, 3), format)
    np.testing.assert_array_equal(device.read(texture), np.zeros(texture.shape))
    data = np.random.default_rng(1).uniform(-100, 100, texture.shape).astype(np.float16).astype(np.float32)
    for given in (data, data.astype(np.float64), np.asfortranarray(data)):
        np.testing.assert_array_equal(device.read(device.texture((5, 3), format, given)), data)


@pytest.mark.parametrize("format", ["RGBA8", "RG8", "R8", "SRGB8_A8"])
def test_8_bit_texture_comes_back(device, format):
    texture = device.texture((16, 16), format)
    data = np.resize(np.arange(256, dtype=np.uint8), texture.shape)
    np.testing.assert_array_equal(device.read(texture), np.zeros(texture.shape))
    np.testing.assert_array_equal(device.read(device.texture((16, 16), format, data)), data)
    np.testing.assert_array_equal(device.read(device.texture((16, 16), format, data / 255.0)), data)


@pytest.mark.parametrize(("format", "dtype"), [("R32UI", np.uint32), ("R32I", np.int32)])
def test_integer_texture_comes_back(device, format, dtype):
    bits = np.array([[0, 1, 2**31 - 1, 2**31], [2**32 - 1, 0x7FC00001, 0xFF800001, 12345]], np.uint32)
    data = bits.view(dtype)
    np.testing.assert_array_equal(device.read(device.texture((4, 2), format)), np.zeros((2, 4, 1)))
    np.testing.assert_array_equal(device.read(device.texture((4, 2), format, data))[..., 0], data)


def test_depth_texture_comes_back(device):
    data = np.array([[0.0, 0.25, 0.5], [0.75, 1.0, 0.1]], np.float32)
    # The standalone device's depth has 24 bits.
    np.testing.assert_allclose(device.read(device.texture((3, 2), "DEPTH32F", data))[..., 0], data, atol=1e-7)
    shader = fragment(
        "depth_read",
        "void main() { out_color = vec4(texelFetch(depth_tx, ivec2(gl_FragCoord.xy), 0).x); }",
        samplers={"depth_tx": "FLOAT_2D"},
    )
    values = show(device, shader, (3, 2), depth_tx=device.texture((3, 2), "DEPTH32F", data))
    np.testing.assert_allclose(values[..., 0], data, atol=1e-7)


@pytest.mark.parametrize("format", ["RGBA32F", "RGBA16F", "R32F"])
def test_volume_comes_back(device, format):
    texture = device.texture((3, 4, 5), format)
    assert texture.shape[:3] == (5, 4, 3)
    np.testing.assert_array_equal(device.read(texture), np.zeros(texture.shape))
    data = np.arange(np.prod(texture.shape), dtype=np.float32).reshape(texture.shape)
    np.testing.assert_array_equal(device.read(device.texture((3, 4, 5), format, data)), data)


def test_row_0_is_at_the_bottom(device):
    shader = fragment("rows", "void main() { out_color = vec4(floor(gl_FragCoord.xy), uv); }")
    values = show(device, shader, (5, 3))
    x, y = np.meshgrid(np.arange(5), np.arange(3))
    # uv comes from an interpolated triangle of twice the size: a few bits are lost.
    expected = np.stack([x, y, (x + 0.5) / 5, (y + 0.5) / 3], -1)
    np.testing.assert_allclose(values, expected, atol=1e-6)
    copy = device.texture((5, 3), "RGBA32F", values)
    shader = fragment("copy", "void main() { out_color = texture(copy_tx, uv); }", samplers={"copy_tx": "FLOAT_2D"})
    np.testing.assert_allclose(show(device, shader, (5, 3), copy_tx=copy), values, atol=1e-5)


def test_texture_clamps(device):
    texture = device.texture((2, 1), "R32F", np.array([[0.0, 4.0]], np.float32))
    shader = fragment(
        "clamp",
        "void main() { out_color = vec4(texture(a_tx, vec2(-3.0)).x, texture(a_tx, vec2(9.0)).x, 0.0, 0.0); }",
        samplers={"a_tx": "FLOAT_2D"},
    )
    np.testing.assert_allclose(show(device, shader, a_tx=texture)[0, 0], [0, 4, 0, 0], atol=0.02)


def test_srgb_texture_is_decoded(device):
    shader = fragment(
        "srgb", "void main() { out_color = texelFetch(a_tx, ivec2(0), 0); }", samplers={"a_tx": "FLOAT_2D"}
    )
    texture = device.texture((1, 1), "SRGB8_A8", np.full((1, 1, 4), 128, np.uint8))
    # ((128/255 + 0.055) / 1.055) ** 2.4 = 0.2158605; hardware tables are good to about 8 bits. Alpha is linear.
    np.testing.assert_allclose(show(device, shader, a_tx=texture)[0, 0], [0.21586] * 3 + [128 / 255], atol=1e-3)


@pytest.mark.parametrize(
    ("size", "format", "data"),
    [
        ((0, 4), "RGBA32F", None),
        ((4,), "RGBA32F", None),
        ((4, 4), "RGB32F", None),
        ((40000, 1), "R8", None),
        ((4, 4), "RGBA32F", np.zeros((4, 4, 3))),
        ((4, 2), "R32F", np.zeros((4, 2))),
        ((4, 4), "R32UI", np.zeros((4, 4))),
        ((4, 4), "R32UI", np.zeros((4, 4), np.int64)),
        ((4, 4), "RGBA32F", np.zeros((4, 4, 4), int)),
    ],
)
def test_impossible_texture_raises(device, size, format, data):
    with pytest.raises(ValueError):
        device.texture(size, format, data)


def test_free_twice_is_harmless_and_use_after_it_raises(device):
    texture = device.texture((2, 2), "RGBA32F")
    target, vertices = device.target([texture]), device.vertices({"in_position": np.zeros((3, 3))})
    for resource in (vertices, target, texture, None) * 2:
        device.free(resource)
    with pytest.raises(ValueError, match="freed"):
        device.read(texture)
    shader = fragment("freed", "void main() { out_color = texture(a_tx, uv); }", samplers={"a_tx": "FLOAT_2D"})
    with pytest.raises(ValueError, match="freed.*a_tx.*freed"):
        show(device, shader, a_tx=texture)


# --- compute ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("format", ["RGBA32F", "RGBA16F", "R32F", "R16F", "RG16F", "RGBA8"])
def test_compute_reads_and_writes_images(device, format):
    source = np.arange(4 * 6, dtype=np.float32).reshape(4, 6, 1)
    texture = device.texture((6, 4), "R32F", source)
    result = device.texture((6, 4), format)
    shader = compute(
        f"image_{format.lower()}",
        """
        void main()
        {
          ivec2 at = ivec2(gl_GlobalInvocationID.xy);
          if (at.x < 6 && at.y < 4) {
            imageStore(out_img, at, vec4(imageLoad(in_img, at).x / 255.0) + texelFetch(source_tx, at, 0).x / 255.0);
          }
        }""",
        samplers={"source_tx": "FLOAT_2D"},
        images={"in_img": Image("R32F", "FLOAT_2D", "READ"), "out_img": Image(format, "FLOAT_2D", "WRITE")},
    )
    device.dispatch(shader, (1, 1, 1), in_img=texture, out_img=result, source_tx=texture)
    expected = np.broadcast_to(source * 2 / (1 if format == "RGBA8" else 255), result.shape)
    np.testing.assert_allclose(device.read(result), expected, atol=1e-4)  # half floats near 0.18


def test_compute_updates_a_volume_in_place(device):
    volume = device.texture((4, 4, 4), "RGBA16F", np.ones((4, 4, 4, 4), np.float32))
    shader = compute(
        "volume",
        "void main() { ivec3 p = ivec3(gl_GlobalInvocationID);"
        " imageStore(grid_img, p, imageLoad(grid_img, p) + vec4(p, pc_add)); }",
        local_size=(2, 2, 2), images={"grid_img": Image("RGBA16F", "FLOAT_3D")}, constants={"pc_add": "FLOAT"},
    )  # fmt: skip
    for _ in range(3):
        device.dispatch(shader, (2, 2, 2), grid_img=volume, pc_add=0.5)
    z, y, x = np.meshgrid(*[np.arange(4.0)] * 3, indexing="ij")
    np.testing.assert_array_equal(device.read(volume), np.stack([3 * x, 3 * y, 3 * z, 0 * x + 1.5], -1) + 1)


def test_compute_has_shared_memory_and_atomics(device):
    shader = compute(
        "shared_sum",
        """
        SHARED uint total;
        void main()
        {
          if (gl_LocalInvocationIndex == 0u) { total = 0u; }
          barrier();
          atomicAdd(total, gl_LocalInvocationIndex);
          barrier();
          if (gl_LocalInvocationIndex == 0u) { imageAtomicAdd(sum_img, ivec2(0), total); }
        }""",
        local_size=(8, 8, 1), images={"sum_img": Image("R32UI", "UINT_2D_ATOMIC")},
    )  # fmt: skip
    texture = device.texture((1, 1), "R32UI", np.array([[5]], np.uint32))
    device.dispatch(shader, (3, 2), sum_img=texture)
    assert device.read(texture)[0, 0, 0] == 5 + 6 * (63 * 64 // 2)


def test_allocated_bytes_follow_what_is_made_and_freed(device):
    before = device.allocated_bytes
    texture = device.texture((8, 4), "RGBA16F")
    vertices = device.vertices({"in_position": np.zeros((6, 3), np.float32)})
    assert device.allocated_bytes - before == 8 * 4 * 8 + 6 * 3 * 4
    device.free(texture)
    device.free(vertices)
    assert device.allocated_bytes == before
