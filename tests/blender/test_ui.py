"""Settings as Blender properties, and panels: every one is registered, shown where it should be, and draws."""

from types import SimpleNamespace

import bpy
import pytest

from rebound.gpu_shaders import TECHNIQUES
from rebound.gpu_shaders.vpl import Vpl
from rebound.session import Status, read_settings
from rebound.settings import SETTINGS, Settings, named_settings
from rebound.tests.support.engine_build import rebound_scene
from rebound.ui import panels

__all__ = ["rebound_scene"]


class Layout:
    """Stands for bpy.types.UILayout: every row is this object, and what is drawn must exist."""

    def __init__(self):
        self.drawn: list[str] = []

    def prop(self, data, name, **_options):
        assert name in data.bl_rna.properties, f"{data.bl_rna.identifier} has no property {name}"
        self.drawn.append(name)

    def operator(self, name, **_options):
        group, operator = name.split(".")
        assert getattr(getattr(bpy.ops, group), operator).get_rna_type()
        self.drawn.append(name)
        return SimpleNamespace()  # whose properties are set

    def label(self, text="", **_options):
        self.drawn.append(text)

    def progress(self, text="", **_options):
        self.drawn.append(text)

    def menu(self, name, **_options):
        assert hasattr(bpy.types, name)
        self.drawn.append(name)

    def prop_enum(self, data, name, value, **_options):
        assert value in data.bl_rna.properties[name].enum_items
        self.drawn.append(f"{name}.{value}")

    def column(self, **_options):
        return self

    row = split = column


class Context:
    """What panels read of a context in the Properties editor."""

    def __init__(self, scene):
        self.scene, self.engine = scene, scene.render.engine
        self.view_layer = scene.view_layers[0]
        self.object = bpy.data.objects["Box"]
        self.light = bpy.data.lights["Spot"]
        self.window_manager = bpy.context.window_manager


def draw(panel, context):
    """What a panel draws."""
    layout = Layout()
    panel.draw(SimpleNamespace(layout=layout), context)
    return layout.drawn


def test_defaults_are_the_renderers(rebound_scene):
    small = ("resolution", "voxels", "pool", "bounces")
    own = [f"{viewport}vpl_{name}" for viewport in ("", "viewport_") for name in small]
    for name in ("samples", "shadow_resolution", "rsm_resolution", *own):
        rebound_scene.rebound.property_unset(name)
    for viewport in (False, True):
        found, wanted = read_settings(rebound_scene, viewport=viewport), Settings.defaults(viewport=viewport)
        assert found.values.keys() == wanted.values.keys()
        for name, value in found.values.items():  # Blender's floats are single precision
            assert value == (pytest.approx(wanted[name]) if isinstance(value, float) else wanted[name]), name


def test_viewport_and_render_have_values_of_their_own(rebound_scene):
    rebound_scene.rebound.samples, rebound_scene.rebound.viewport_samples = 11, 7
    assert read_settings(rebound_scene, viewport=False)["samples"] == 11
    assert read_settings(rebound_scene, viewport=True)["samples"] == 7


def test_settings_are_saved_with_the_file(rebound_scene, tmp_path):
    rebound_scene.rebound.samples = 123
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"), check_existing=False)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert bpy.context.scene.rebound.samples == 123


@pytest.mark.parametrize(("name", "setting"), list(named_settings()), ids=[name for name, _ in named_settings()])
def test_property_states_unit_and_holds_its_limits(rebound_scene, name, setting):
    entry = rebound_scene.rebound.bl_rna.properties[name]
    assert setting.description.rstrip(".") in entry.description
    assert entry.description.endswith(f". Unit: {setting.unit}" if setting.unit else setting.description)
    if setting.viewport_default is not None:
        in_viewport = rebound_scene.rebound.bl_rna.properties[f"viewport_{name}"].description
        assert in_viewport == f"In the viewport: {entry.description}"
    if setting.kind in ("INT", "FLOAT"):
        setattr(rebound_scene.rebound, name, setting.maximum + 1)
        assert getattr(rebound_scene.rebound, name) == pytest.approx(setting.maximum)
        setattr(rebound_scene.rebound, name, setting.minimum - 1)
        assert getattr(rebound_scene.rebound, name) == pytest.approx(setting.minimum)
    if setting.kind == "ENUM":
        assert [item.identifier for item in entry.enum_items] == [item.key for item in setting.items]
        assert all(item.description for item in entry.enum_items)


def shown(scene, method, context="render"):
    """What all panels of a tab draw with this method, in order."""
    scene.rebound.method = method
    found = []
    for panel in panels.PANELS:
        if panel.bl_context == context and panel.poll(Context(scene)):
            found += draw(panel, Context(scene))
    return found


METHODS = [item.key for setting in SETTINGS if setting.name == "method" for item in setting.items]


def test_every_setting_has_a_row(rebound_scene):
    drawn = {name for method in METHODS for name in shown(rebound_scene, method)}
    for kind in ("GLOSSY", "WAVELET", "WAVELET_GLOSSY"):
        rebound_scene.rebound.bake_kind = kind
        drawn |= set(shown(rebound_scene, "NONE"))
    names = {p.identifier for p in rebound_scene.rebound.bl_rna.properties} - {"rna_type", "name"}
    assert names - {"version", "show", "viewport_show"} <= drawn
    assert {"REBOUND_MT_show", "REBOUND_MT_viewport_show"} <= drawn


@pytest.mark.parametrize("method", METHODS)
def test_settings_of_other_methods_are_not_shown(rebound_scene, method):
    drawn = shown(rebound_scene, method)
    others = {f"{t.id}_{s.name}" for t in TECHNIQUES if t.id.upper() != method for s in t.settings}
    assert not others & set(drawn)
    once = [name for name in drawn if name not in ("Viewport", "Show") and not name.startswith("rebound.")]
    assert len(set(once)) == len(once)


def test_first_look_is_short(rebound_scene):
    """What is open before anybody opened anything: samples, method, its resolution and bounces; and the status."""
    rebound_scene.rebound.method = "VPL"
    rows = []
    for panel in panels.PANELS:
        if panel.bl_context == "render" and "DEFAULT_CLOSED" not in getattr(panel, "bl_options", ()):
            rows += [name for name in draw(panel, Context(rebound_scene)) if hasattr(rebound_scene.rebound, name)]
    assert {"samples", "method", "vpl_bounces", "viewport_vpl_bounces", "vpl_scale"} <= set(rows)
    assert len(rows) <= 10


def test_show_offers_views_of_the_method_only_and_keeps_others(rebound_scene):
    group = rebound_scene.rebound
    group.method, group.show = "VPL", "VPL_VOXELS"
    menu = panels.REBOUND_MT_show
    offered = draw(menu, Context(rebound_scene))
    assert {"show.PICTURE", *(f"show.{item.key}" for item in Vpl.views)} <= set(offered)
    group.method = "RSM"
    offered = draw(menu, Context(rebound_scene))
    assert "show.PICTURE" in offered and not [name for name in offered if "VPL" in name]
    assert panels.shown_label(group, "show") == "Picture"
    group.method = "VPL"
    assert group.show == "VPL_VOXELS" and panels.shown_label(group, "show") == "Voxels"


def test_memory_in_use_is_shown(rebound_scene, monkeypatch):
    status = Status(device="A card", statistics={"gpu_bytes": 100 << 20, "shadow_maps": 3})
    monkeypatch.setattr(panels.SESSIONS, "newest", status)
    assert "Memory in use: 100 MB on the GPU" in draw(panels.REBOUND_PT_status, Context(rebound_scene))
    assert "Shadow maps: 3" in draw(panels.REBOUND_PT_statistics, Context(rebound_scene))


@pytest.mark.parametrize("panel", panels.PANELS, ids=lambda panel: panel.__name__)
def test_panel_draws_with_rebound_and_is_hidden_with_others(rebound_scene, panel):
    context = Context(rebound_scene)
    rebound_scene.rebound.method = "RSM" if "_rsm_" in panel.__name__ else "VPL"
    draw(panel, context)
    assert panel.poll(context) or panel is panels.REBOUND_PT_override  # test_ui_compat.py
    context.engine = "CYCLES"
    assert not panel.poll(context)


@pytest.mark.parametrize("panel", panels.PANELS, ids=lambda panel: panel.__name__)
def test_parent_of_a_panel_is_shown_with_rebound(rebound_scene, panel):
    parent = getattr(panel, "bl_parent_id", None)
    if parent:
        assert "REBOUND" in getattr(bpy.types, parent).COMPAT_ENGINES
