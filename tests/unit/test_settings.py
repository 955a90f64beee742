"""Settings describe themselves fully; the pixel filter is Blender's."""

import numpy as np
import pytest

from rebound.gpu_shaders import TECHNIQUES
from rebound.gpu_shaders.frame.pixel_filter import blackman_harris, pixel_offset
from rebound.passes import PASSES
from rebound.settings import CHOICE_NUMBERS, Settings, choice_number, every_setting, named_settings, views_of

NAMED = dict(named_settings())


EVERY = dict(every_setting())


@pytest.mark.parametrize("name", EVERY)
def test_setting_describes_itself(name):
    setting = EVERY[name]
    assert setting.label and setting.description[0].isupper() and not setting.description.endswith(".")
    defaults = [setting.default] + ([] if setting.viewport_default is None else [setting.viewport_default])
    if setting.kind == "ENUM":
        keys = [item.key for item in setting.items]
        assert len(set(keys)) == len(keys) and set(defaults) <= set(keys)
        assert all(item.label and item.description for item in setting.items)
        return
    assert not setting.items
    if setting.kind == "BOOL":
        assert all(isinstance(value, bool) for value in defaults)
        return
    assert all(setting.minimum <= float(value) <= setting.maximum for value in defaults)
    assert setting.minimum < setting.maximum
    number = int if setting.kind == "INT" else (int, float)
    assert all(isinstance(value, number) and not isinstance(value, bool) for value in (*defaults, setting.minimum))
    if name != "seed":  # a seed counts nothing
        assert setting.unit
        # What costs time says so, and so says what the lower value gives up.
        assert (
            "at the cost of" in setting.description
            or "lower" in setting.description
            or "smaller" in setting.description
        )


def test_names_are_distinct_and_choosable():
    assert len(NAMED) == len(list(named_settings()))
    methods = {item.key for item in NAMED["method"].items}
    assert methods == {"NONE", *(technique.id.upper() for technique in TECHNIQUES)}
    assert len({technique.id for technique in TECHNIQUES}) == len(TECHNIQUES)


@pytest.mark.parametrize("name", [name for name, setting in EVERY.items() if setting.kind == "ENUM"])
def test_choices_have_numbers_of_their_own(name):
    """What files hold of a choice; a choice that CHOICE_NUMBERS lacks raises: add it to the end of its line there."""
    numbers = [choice_number(name, item.key) for item in EVERY[name].items]
    assert len(set(numbers)) == len(numbers)


def test_numbers_of_choices_are_those_of_every_release():
    """Saved files hold them. Lines are added to, never changed: these are the first of each."""
    first = {"method": ("NONE", "RSM", "VPL"), "show": ("PICTURE", "VPL_BOUND", "VPL_VOXELS", "VPL_HISTORY")}
    for name, keys in first.items():
        assert CHOICE_NUMBERS[name][: len(keys)] == keys
    with pytest.raises(ValueError):
        choice_number("method", "NO_SUCH")


def test_views_of_a_method_are_its_own_and_those_of_none():
    for technique in TECHNIQUES:
        own = {item.key for item in technique.views}
        offered = set(views_of(technique.id.upper()))
        others = {item.key for other in TECHNIQUES if other is not technique for item in other.views}
        assert own | {"PICTURE"} <= offered and not offered & others
    assert "PICTURE" in views_of("NONE")


def test_defaults_differ_between_viewport_and_final_render_as_declared():
    final, viewport = Settings.defaults(), Settings.defaults(viewport=True)
    for name, setting in NAMED.items():
        assert final[name] == setting.default
        assert viewport[name] == (setting.default if setting.viewport_default is None else setting.viewport_default)
    assert final != viewport and final == Settings.defaults()
    with pytest.raises(KeyError, match="no_such"):
        Settings.defaults(no_such=1)


def test_settings_of_a_technique_have_its_short_names():
    for technique in TECHNIQUES:
        assert set(Settings.defaults().of(technique.id)) == {setting.name for setting in technique.settings}


def test_passes_are_named_once():
    assert len({p.key for p in PASSES}) == len({p.label for p in PASSES}) == len(PASSES)
    assert all(p.channels in ("RGBA", "RGB", "XYZ", "Z") for p in PASSES)


def test_pixel_filter_is_blackman_harris_over_its_width():
    width = 1.5
    offsets = np.array([pixel_offset(i, width) for i in range(8192)])
    np.testing.assert_allclose(offsets[0], 0, atol=1e-9)  # the first sample of a viewport lies in the pixel's middle
    assert np.abs(offsets).max() <= width  # 1.5 pixels to either side, as in Cycles and EEVEE
    x = np.linspace(-0.5, 0.5, 20001)
    weight = blackman_harris(x)
    variance = (weight * (2 * width * x) ** 2).sum() / weight.sum()
    np.testing.assert_allclose(offsets.mean(0), 0, atol=1e-3)
    np.testing.assert_allclose(offsets.var(0), variance, rtol=1e-3)
    quantiles = np.interp([0.05, 0.25, 0.75, 0.95], np.cumsum(weight) / weight.sum(), 2 * width * x)
    np.testing.assert_allclose(np.quantile(offsets, [0.05, 0.25, 0.75, 0.95], 0).T, [quantiles] * 2, atol=2e-3)
    assert not pixel_offset(3, 0.0).any()


def test_offsets_are_spread_from_the_start():
    offsets = np.array([pixel_offset(i, 1.5) for i in range(16)])
    assert len(np.unique(np.sign(offsets[1:]), axis=0)) == 4
    assert np.abs(offsets.mean(0)).max() < 0.2
