"""Files of bakes: every bit comes back, and what is no whole bake is refused with its reason."""

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from rebound.bake import file as bake_file
from rebound.bake.file import Bake, BakeFileError, read_bake, write_bake
from rebound.exr import Layer, write_layers

ABOUT = {"kind": "DIFFUSE", "object": "Ball", "settings": {"bands": 5}}
NUMBERS = st.sampled_from([np.float16, np.float32, np.uint32])
TABLES = NUMBERS.flatmap(lambda t: arrays_of.arrays(t, arrays_of.array_shapes(max_dims=4, max_side=6)))


def some():
    random = np.random.default_rng(0)
    return Bake(
        ABOUT, {"diffuse": random.normal(size=(2500, 3, 25)).astype(np.float16), "wide": np.ones((2, 300), "f4")}
    )


@given(st.dictionaries(st.sampled_from(["a", "b", "c"]), TABLES, min_size=1))
@settings(max_examples=25, deadline=None)
def test_any_arrays_come_back_bit_for_bit(tmp_path_factory, arrays):
    path = tmp_path_factory.mktemp("bake") / "bake.exr"
    write_bake(path, Bake(ABOUT, arrays))
    back = read_bake(path)
    assert back.about == ABOUT
    assert {n: (a.dtype, a.shape, a.tobytes()) for n, a in back.arrays.items()} == {
        n: (a.dtype, a.shape, a.tobytes()) for n, a in arrays.items()
    }


def test_other_programs_see_named_layers(tmp_path):
    write_bake(tmp_path / "bake.exr", some())
    with OpenEXR.File(str(tmp_path / "bake.exr"), separate_channels=True) as file:
        assert [part.name() for part in file.parts] == ["diffuse", "wide"]
        assert sorted(file.parts[0].channels)[::74] == ["diffuse.000", "diffuse.074"]


def test_flipped_byte_is_refused(tmp_path):
    path = tmp_path / "bake.exr"
    write_bake(path, some())
    whole = path.read_bytes()
    for place in range(2000, len(whole), len(whole) // 7):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        with pytest.raises(BakeFileError, match="damaged"):
            read_bake(path)


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.99])
def test_cut_off_file_is_refused(tmp_path, keep):
    path = tmp_path / "bake.exr"
    write_bake(path, some())
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * keep)])
    with pytest.raises(BakeFileError, match="damaged"):
        read_bake(path)


def test_picture_is_refused_as_no_bake(tmp_path):
    write_layers(tmp_path / "picture.exr", {"a": Layer("RGB", np.zeros((2, 2, 3)))})
    with pytest.raises(BakeFileError, match="no bake of Rebound's"):
        read_bake(tmp_path / "picture.exr")


def test_missing_file_says_to_bake(tmp_path):
    with pytest.raises(BakeFileError, match="is missing: bake again"):
        read_bake(tmp_path / "none.exr")


def test_newer_file_says_to_update(tmp_path, monkeypatch):
    monkeypatch.setattr(bake_file, "VERSION", 99)
    write_bake(tmp_path / "bake.exr", some())
    monkeypatch.undo()
    with pytest.raises(BakeFileError, match=r"newer Rebound \(format 99\)"):
        read_bake(tmp_path / "bake.exr")


@pytest.mark.parametrize("array", [np.zeros((0, 3), np.float32), np.zeros(3), np.zeros((2, 0), np.float16)])
def test_array_without_a_place_is_refused(tmp_path, array):
    with pytest.raises(BakeFileError, match="in odd"):
        write_bake(tmp_path / "bake.exr", Bake(ABOUT, {"odd": array}))


def test_failure_leaves_the_file_before(tmp_path, monkeypatch):
    path = tmp_path / "bake.exr"
    write_bake(path, some())
    before = path.read_bytes()

    def full(*_):
        raise OSError("No space left on device")

    monkeypatch.setattr(bake_file.os, "replace", full)
    with pytest.raises(BakeFileError, match="No space left"):
        write_bake(path, Bake(ABOUT, {"a": np.ones((3, 3), np.float32)}))
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["bake.exr"]


def test_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(BakeFileError, match="nowhere"):
        write_bake(tmp_path / "nowhere" / "bake.exr", some())
