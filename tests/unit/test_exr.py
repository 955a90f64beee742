"""Multi-layer EXR files: names, orientation, sizes, exact values."""

import numpy as np
import OpenEXR
import pytest

from rebound.exr import ExrError, Layer, layer_name, write_layers


def picture(height, width, channels, seed=0):
    return np.random.default_rng(seed).normal(size=(height, width, channels)).astype(np.float32)


def parts(path):
    """{channel: pixels} of each part, row 0 at the top as in the file."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return [{name: c.pixels.copy() for name, c in part.channels.items()} for part in file.parts]


def test_values_come_back_bit_for_bit_with_row_0_at_the_bottom(tmp_path):
    pixels = picture(5, 3, 3)
    pixels[0, 0] = (np.inf, -0.0, 1e-42)
    write_layers(tmp_path / "a.exr", {"Spot.position": Layer("XYZ", pixels)})
    (found,) = parts(tmp_path / "a.exr")
    assert found.keys() == {"Spot.position.X", "Spot.position.Y", "Spot.position.Z"}
    for index, letter in enumerate("XYZ"):
        read = found[f"Spot.position.{letter}"]
        assert read.dtype == np.float32
        assert read[::-1].tobytes() == pixels[..., index].tobytes()


def test_layers_of_one_size_share_a_part(tmp_path):
    layers = {"A.depth": Layer("Z", picture(4, 4, 1)), "A.flux": Layer("RGB", picture(4, 4, 3))}
    write_layers(tmp_path / "a.exr", layers)
    assert [len(part) for part in parts(tmp_path / "a.exr")] == [4]


def test_layers_of_other_sizes_get_parts_of_their_own(tmp_path):
    layers = {"A.depth": Layer("Z", picture(4, 4, 1)), "B.depth": Layer("Z", picture(8, 2, 1))}
    write_layers(tmp_path / "a.exr", layers)
    assert [part.keys() for part in parts(tmp_path / "a.exr")] == [{"A.depth.Z"}, {"B.depth.Z"}]


def test_dots_of_a_name_do_not_make_layers():
    assert layer_name("Light.001") == "Light_001"


def test_array_that_does_not_fit_its_channels_is_refused(tmp_path):
    with pytest.raises(ValueError, match="zip"):
        write_layers(tmp_path / "a.exr", {"A.flux": Layer("RGB", picture(4, 4, 1))})


def test_folder_that_does_not_exist_is_named(tmp_path):
    with pytest.raises(ExrError, match="nowhere"):
        write_layers(tmp_path / "nowhere" / "a.exr", {"A.depth": Layer("Z", picture(4, 4, 1))})
