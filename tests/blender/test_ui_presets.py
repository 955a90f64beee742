"""Quality presets: ours are plain values that make sense, users add and remove their own, ours stay."""

import os
import re
from pathlib import Path

import bpy
import pytest

from rebound.settings import named_settings
from rebound.tests.blender.test_ui import Context, Layout
from rebound.tests.support.engine_build import rebound_scene
from rebound.ui import quality

__all__ = ["rebound_scene"]

SETTINGS = {f"{where}{name}": s for name, s in named_settings() for where in ("", "viewport_")}
# Choices from quick to good.
ORDER = {
    "scale": ("EIGHTH", "QUARTER", "HALF", "FULL"),
    "interpolation": ("EIGHTH", "QUARTER", "HALF", "OFF"),
    "bounces": ("ONE", "MANY"),
    "soft_shadows": ("FILTERED", "SAMPLED"),
}


def values(name):
    """What a shipped preset sets, read as text."""
    text = quality.shipped_file(name).read_text(encoding="utf-8")
    found = re.findall(r"^rebound\.(\w+) = (.+)$", text, re.MULTILINE)
    return {key: eval(value) for key, value in found}


def apply(name):
    bpy.ops.script.execute_preset(filepath=str(quality.shipped_file(name)), menu_idname="REBOUND_PT_presets")


def own_files():
    folders = [Path(folder) for folder in bpy.utils.preset_paths(quality.SUBDIR)]
    return {path.stem: path for folder in folders for path in folder.glob("*.py") if quality.is_users(path.name)}


@pytest.mark.parametrize("name", quality.SHIPPED)
def test_preset_is_found_and_sets_what_it_says(rebound_scene, name):
    found = bpy.utils.preset_find(name, quality.SUBDIR)
    assert Path(found) == quality.shipped_file(name)
    rebound_scene.rebound.seed = 7
    apply(name)
    assert {key: getattr(rebound_scene.rebound, key) for key in values(name)} == values(name)
    assert rebound_scene.rebound.seed == 7, "what is no matter of quality stays"


def test_presets_set_the_same_properties(rebound_scene):
    keys = values("Balanced").keys()
    assert all(values(name).keys() == keys for name in quality.SHIPPED)
    assert {
        "samples",
        "shadow_resolution",
        "vpl_scale",
        "vpl_pool",
        "vpl_candidates",
        "vpl_bounces",
        "vpl_voxels",
    } <= keys
    # What has a value of its own in the viewport is set for both.
    for key in keys:
        assert key in SETTINGS
        name = key.removeprefix("viewport_")
        if SETTINGS[name].viewport_default is not None:
            assert f"viewport_{name}" in keys
    assert keys <= set(quality.kept_properties())


def test_balanced_equals_the_defaults(rebound_scene):
    for key, value in values("Balanced").items():
        assert value == rebound_scene.rebound.bl_rna.properties[key].default, key


@pytest.mark.parametrize(("lower", "higher"), list(zip(quality.SHIPPED, quality.SHIPPED[1:], strict=False)))
def test_each_preset_is_nowhere_worse_than_the_one_before(lower, higher):
    before, after = values(lower), values(higher)
    for key in before:
        choices = next((order for name, order in ORDER.items() if key.endswith(name)), None)
        rank = choices.index if choices else float
        if key.endswith("maps_at_once"):
            continue  # 0 is all of them
        assert rank(before[key]) <= rank(after[key]), key
    assert before != after


@pytest.mark.parametrize("name", quality.SHIPPED)
def test_preset_is_no_worse_in_renders_than_in_viewports(name):
    found = values(name)
    for key, value in found.items():
        own = found.get(f"viewport_{key}")
        if own is not None and not key.endswith("maps_at_once"):
            choices = next((order for end, order in ORDER.items() if key.endswith(end)), None)
            rank = choices.index if choices else float
            assert rank(own) <= rank(value), key


def test_user_adds_and_removes_a_preset(rebound_scene):
    rebound_scene.rebound.samples, rebound_scene.rebound.method = 77, "RSM"
    assert bpy.ops.rebound.preset_add(name="My Own") == {"FINISHED"}
    path = own_files()["My_Own"]
    assert not str(path).startswith(quality.ROOT)
    apply("Draft")
    rebound_scene.rebound.method = "VPL"
    bpy.ops.script.execute_preset(filepath=str(path), menu_idname="REBOUND_PT_presets")
    assert (rebound_scene.rebound.samples, rebound_scene.rebound.method) == (77, "RSM")
    assert bpy.ops.rebound.preset_add(name="My_Own", remove_name=True) == {"FINISHED"}
    assert not own_files() and not path.exists()


@pytest.mark.parametrize("name", quality.SHIPPED)
def test_own_presets_stay(rebound_scene, name):
    assert bpy.ops.rebound.preset_add(name=name, remove_name=True) == {"CANCELLED"}
    assert quality.shipped_file(name).exists()
    assert bpy.ops.rebound.preset_add(name=name) == {"CANCELLED"}, "nor are they written over"
    assert name not in own_files()


def test_active_preset_that_is_ours_stays(rebound_scene):
    apply("High")
    assert bpy.ops.rebound.preset_add(remove_active=True) == {"CANCELLED"}
    assert quality.shipped_file("High").exists()


def test_list_shows_ours_by_quality_and_the_users_after_them(rebound_scene):
    bpy.ops.rebound.preset_add(name="Zebra")
    bpy.ops.rebound.preset_add(name="Antelope")
    buttons = []

    class Buttons(Layout):
        def operator(self, name, text="", **_options):
            buttons.append(text)
            return type("Properties", (), {})()

        def prop(self, *_arguments, **_options):
            pass

        def separator(self):
            buttons.append("-")

    panel = type("Panel", (), dict(vars(quality.REBOUND_PT_presets)))
    panel.path_menu, panel.bl_idname = quality.REBOUND_PT_presets.path_menu, "REBOUND_PT_presets"
    shown = panel()
    shown.layout = Buttons()
    shown.draw(Context(rebound_scene))
    names = [name for name in buttons if name]
    assert names == [*quality.SHIPPED, "-", "Antelope", "Zebra", "-"]
    for name in ("Zebra", "Antelope"):
        bpy.ops.rebound.preset_add(name=name, remove_name=True)


def test_presets_are_in_the_package():
    """They lie below ``ui``, which the package takes whole."""
    assert {path.stem for path in Path(quality.ROOT, "presets", quality.SUBDIR).glob("*.py")} == set(quality.SHIPPED)
    assert os.path.basename(quality.ROOT) == "ui"


def test_disabling_takes_our_folder_away(rebound_scene):
    quality.unregister()
    assert quality.ROOT not in bpy.utils._preset_path_registry
    quality.register()
    assert bpy.utils.preset_find("Draft", quality.SUBDIR)
