"""Struct: layout, packing and the GLSL it writes, without a GPU (device_contract.py reads it back on one)."""

import numpy as np
import pytest

from rebound.device import Struct
from rebound.device.structs import MAX_TABLE_ROWS, table_texels

LIGHT = Struct("SpotLight", position="vec3", kind="int", uv="vec2", angle="float", from_world="mat4", last="float")
MATRIX = np.arange(16.0).reshape(4, 4)
ROW = {"position": (1, 2, 3), "kind": -4, "uv": (5, 6), "angle": 7, "from_world": MATRIX, "last": 8}


@pytest.mark.parametrize(
    ("fields", "offsets", "texels"),
    [
        # The examples follow the rules of std140 (OpenGL 4.6, section 7.6.2.2), counted in floats.
        ({"a": "float", "b": "vec3", "c": "float"}, [0, 4, 7], 2),
        ({"a": "vec3", "b": "float"}, [0, 3], 1),
        ({"a": "float", "b": "vec2", "c": "float"}, [0, 2, 4], 2),
        ({"a": "vec2", "b": "vec2", "c": "vec4"}, [0, 2, 4], 2),
        ({"a": "int", "b": "mat4", "c": "int"}, [0, 4, 20], 6),
        ({"a": "vec3", "b": "vec3"}, [0, 4], 2),
        ({"a": "vec3", "b": "vec2"}, [0, 4], 2),
    ],
)
def test_layout_follows_std140(fields, offsets, texels):
    struct = Struct("S", **fields)
    assert [f.offset for f in struct.fields] == offsets
    assert (struct.texels, struct.size) == (texels, texels * 16)
    assert struct.dtype.itemsize == struct.size


def test_pack_puts_values_where_the_layout_says():
    packed = LIGHT.pack([ROW, ROW])
    assert packed.shape == (2, LIGHT.texels, 4) and packed.dtype == np.float32
    expected = [[1, 2, 3, -4], [5, 6, 7, 0], *MATRIX.T, [8, 0, 0, 0]]
    np.testing.assert_array_equal(packed, [expected, expected])


def test_pack_for_uniform_differs_in_the_ints_only():
    packed = LIGHT.pack([ROW], for_uniform=True)[0]
    assert packed.view(np.int32)[0, 3] == -4
    packed[0, 3] = -4
    np.testing.assert_array_equal(packed, LIGHT.pack([ROW])[0])


def test_pack_arrays_equals_pack():
    rows = [{**ROW, "kind": i, "position": (i, i, i), "from_world": MATRIX * i} for i in range(5)]
    columns = {name: np.array([row[name] for row in rows]) for name in ROW}
    np.testing.assert_array_equal(LIGHT.pack_arrays(5, **columns), LIGHT.pack(rows))
    np.testing.assert_array_equal(
        LIGHT.pack_arrays(5, **columns | {"from_world": MATRIX})[3], LIGHT.pack([{**rows[3], "from_world": MATRIX}])[0]
    )


def test_no_rows_pack_to_an_empty_table():
    assert LIGHT.pack([]).shape == (0, LIGHT.texels, 4)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"kind": None}, "SpotLight.*kind"),
        ({"kind": 1.5}, "SpotLight.*kind"),
        ({"kind": 2**24 + 1}, "SpotLight.*kind.*16777216"),
        ({"position": (1, 2)}, "SpotLight.*position"),
        ({"from_world": np.eye(3)}, "SpotLight.*from_world"),
        ({"angle": "wide"}, "SpotLight.*angle"),
        ({"color": 1}, "SpotLight.*unknown.*color"),
    ],
)
def test_wrong_value_names_struct_and_field(change, match):
    with pytest.raises(ValueError, match=match):
        LIGHT.pack([ROW | change])


def test_missing_field_is_named():
    with pytest.raises(ValueError, match="SpotLight.*missing.*'uv'"):
        LIGHT.pack([{k: v for k, v in ROW.items() if k != "uv"}])


def test_large_ints_fit_a_uniform_only():
    assert LIGHT.pack([ROW | {"kind": 2**31 - 1}], for_uniform=True).view(np.int32)[0, 0, 3] == 2**31 - 1
    with pytest.raises(ValueError, match="kind"):
        LIGHT.pack([ROW | {"kind": 2**31}], for_uniform=True)


@pytest.mark.parametrize(
    ("name", "fields"),
    [("light", {"a": "float"}), ("Light", {}), ("Light", {"a": "mat3"}), ("Light", {"a": "bool"}),
     ("Light", {"pad_1": "float"}), ("Light", {"a__b": "float"}), ("Light", {"_a": "float"}),
     ("Light", {"sample": "int"})],
)  # fmt: skip
def test_impossible_struct_raises(name, fields):
    with pytest.raises(ValueError, match=name):
        Struct(name, **fields)


def test_glsl_declares_padding_and_fetches_each_texel_once():
    assert LIGHT.glsl_struct() == (
        "struct SpotLight { vec3 position; int kind; vec2 uv; float angle; float pad_7; mat4 from_world; float last; "
        "float pad_25; float pad_26; float pad_27; };"
    )
    fetch = LIGHT.glsl_fetch()
    assert fetch.startswith("SpotLight spot_light_fetch(sampler2D table_tx, int index) {")
    assert fetch.count("texelFetch") == LIGHT.texels
    for line in (
        "e.position = t0.xyz;",
        "e.kind = int(t0.w);",
        "e.angle = t1.z;",
        "e.from_world = mat4(t2, t3, t4, t5);",
    ):
        assert line in fetch
    assert "\n" not in LIGHT.glsl_struct() + fetch


@pytest.mark.parametrize(
    ("name", "snake"), [("Light", "light"), ("SpotLight", "spot_light"), ("RSMTexel", "rsm_texel")]
)
def test_function_prefix_is_snake_case(name, snake):
    assert Struct(name, a="float").snake_name == snake


def test_equal_structs_are_equal():
    assert Struct("A", a="float", b="int") == Struct("A", a="float", b="int")
    assert Struct("A", a="float", b="int") != Struct("A", b="int", a="float")
    assert len({Struct("A", a="float"), Struct("A", a="float")}) == 1


def test_long_table_continues_beside_its_first_rows():
    count = MAX_TABLE_ROWS + 3
    packed = np.arange(count * 2 * 4, dtype=np.float32).reshape(count, 2, 4)
    texels = table_texels(packed)
    assert texels.shape == (MAX_TABLE_ROWS, 4, 4)
    np.testing.assert_array_equal(texels[2, 2:], packed[MAX_TABLE_ROWS + 2])
    np.testing.assert_array_equal(texels[5, :2], packed[5])
    assert not texels[3:, 2:].any()
