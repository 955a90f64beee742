"""Settings as Blender properties, and panels: every one is registered, shown where it should be, and draws."""

from types import SimpleNamespace

import bpy
import pytest

from rebound.session import read_settings
from rebound.settings import Settings, named_settings
from rebound.tests.support.engine_build import rebound_scene
from rebound.ui import compat, panels

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

    def label(self, text="", **_options):
        self.drawn.append(text)

    def column(self, **_options):
        return self

    row = column


class Context:
    """What panels read of a context in the Properties editor."""

    def __init__(self, scene):
        self.scene, self.engine = scene, scene.render.engine
        self.view_layer = scene.view_layers[0]
        self.object = bpy.data.objects["Box"]
        self.light = bpy.data.lights["Spot"]


def draw(panel, context):
    """What a panel draws."""
    layout = Layout()
    panel.draw(SimpleNamespace(layout=layout), context)
    return layout.drawn


def test_defaults_are_the_renderers(rebound_scene):
    small = ("resolution", "voxels", "pool")
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


def test_every_setting_has_a_row(rebound_scene):
    context, drawn = Context(rebound_scene), set()
    for method in rebound_scene.rebound.bl_rna.properties["method"].enum_items:
        rebound_scene.rebound.method = method.identifier
        for panel in panels.CLASSES:
            if panel.bl_context == "render":
                drawn.update(draw(panel, context))
    wanted = {p.identifier for p in rebound_scene.rebound.bl_rna.properties} - {"rna_type", "name"}
    assert wanted <= drawn


@pytest.mark.parametrize("panel", panels.CLASSES, ids=lambda panel: panel.__name__)
def test_panel_draws_with_rebound_and_is_hidden_with_others(rebound_scene, panel):
    context = Context(rebound_scene)
    draw(panel, context)
    assert panel.poll(context)
    context.engine = "CYCLES"
    assert not panel.poll(context)


@pytest.mark.parametrize("panel", panels.CLASSES, ids=lambda panel: panel.__name__)
def test_parent_of_a_panel_is_shown_with_rebound(rebound_scene, panel):
    parent = getattr(panel, "bl_parent_id", None)
    if parent:
        assert "REBOUND" in getattr(bpy.types, parent).COMPAT_ENGINES


EXPECTED = (
    "RENDER_PT_output", "RENDER_PT_format", "RENDER_PT_color_management", "DATA_PT_lens", "DATA_PT_camera",
    "DATA_PT_EEVEE_light", "DATA_PT_spot", "EEVEE_MATERIAL_PT_surface", "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_WORLD_PT_surface", "WORLD_PT_context_world", "VIEWLAYER_PT_layer", "OBJECT_PT_visibility",
    "DATA_PT_uv_texture", "MATERIAL_PT_preview",
)  # fmt: skip
UNWANTED = (
    "RENDER_PT_eevee_raytracing", "RENDER_PT_eevee_next_raytracing", "DATA_PT_lightprobe", "DATA_PT_camera_dof",
    "RENDER_PT_freestyle", "EEVEE_WORLD_PT_volume",
)  # fmt: skip


def test_blenders_own_panels_are_shown_where_they_mean_something(rebound_scene):
    for name in EXPECTED:
        assert "REBOUND" in getattr(bpy.types, name).COMPAT_ENGINES, name
    for name in UNWANTED:
        panel = getattr(bpy.types, name, None)
        assert panel is None or "REBOUND" not in panel.COMPAT_ENGINES, name


def test_every_name_in_the_panel_lists_exists_in_some_version(rebound_scene):
    """A name is passed over where a version lacks it, so a typing mistake would never show."""
    lacking = [name for name in compat.INCLUDED | compat.EXCLUDED if not hasattr(bpy.types, name)]
    newer_or_older = {"VIEWLAYER_PT_override", "DATA_PT_falloff_curve"}
    assert set(lacking) <= newer_or_older


def test_unregister_hides_blenders_panels_again(rebound_scene):
    compat.unregister()
    shown = [p.__name__ for p in compat._all_panels() if "REBOUND" in p.COMPAT_ENGINES]
    assert set(shown) <= {panel.__name__ for panel in panels.CLASSES}
    compat.register()
