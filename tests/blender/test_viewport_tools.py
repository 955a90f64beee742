"""What helps to look at light in a viewport: bounce off and on, the split view, views, the statistics."""

import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import rebound
from rebound.gpu_shaders import TECHNIQUES
from rebound.gpu_shaders.frame.views import VIEWS
from rebound.session import SESSIONS, Status
from rebound.settings import Settings
from rebound.tests.blender.test_ui import Layout
from rebound.tests.support.engine_build import picture, rebound_scene, render
from rebound.tests.support.viewport_build import View
from rebound.ui import keymap, overlay, split

__all__ = ["rebound_scene"]

OF_ALL = [("NONE", view.key) for view in VIEWS]
OF_ONE = [(technique.id.upper(), view.key) for technique in TECHNIQUES for view in technique.views]


@pytest.fixture
def view(rebound_scene):
    rebound_scene.rebound.viewport_samples = 2
    rebound_scene.rebound.viewport_shadow_resolution = 128
    rebound_scene.rebound.viewport_rsm_resolution = 32
    made = View(rebound_scene)
    made.update()
    yield made
    made.viewport.session.free()


def in_viewport(scene, shading="RENDERED"):
    """What buttons, gizmos and the overlay read of a context in a 3D viewport."""
    space = SimpleNamespace(
        type="VIEW_3D", shading=SimpleNamespace(type=shading), overlay=SimpleNamespace(show_overlays=True)
    )
    return SimpleNamespace(scene=scene, engine=scene.render.engine, space_data=space)


# --- bounce off and on -----------------------------------------------------------------------------------------------


def test_toggle_takes_one_redraw_and_keeps_what_was_found(view):
    lit = view.finish()
    technique = view.viewport.session._gpu.renderer._techniques["vpl"]
    built = technique.voxels.built
    assert bpy.ops.rebound.toggle_indirect() == {"FINISHED"}
    off = view.draw()
    assert view.picture.samples == 1 and off[..., :3].sum() < 0.98 * lit[..., :3].sum()
    assert bpy.ops.rebound.toggle_indirect() == {"FINISHED"}
    on = view.draw()
    assert view.viewport.session._gpu.renderer._techniques["vpl"] is technique
    assert technique.voxels.built == built and on[..., :3].sum() > 1.02 * off[..., :3].sum()


def test_toggle_belongs_to_rebound_in_rendered_shading(rebound_scene):
    operator = bpy.types.REBOUND_OT_toggle_indirect
    assert operator.poll(in_viewport(rebound_scene))
    assert not operator.poll(in_viewport(rebound_scene, "SOLID"))
    rebound_scene.render.engine = "CYCLES"
    assert not operator.poll(in_viewport(rebound_scene))
    assert "UNDO" in operator.bl_options


def test_what_viewports_show_is_saved_and_never_rendered(rebound_scene, tmp_path):
    group = rebound_scene.rebound
    group.samples = 2
    before = picture(render(rebound_scene, tmp_path / "before.exr"))
    group.viewport_indirect, group.viewport_split, group.viewport_split_place = False, True, 0.25
    group.viewport_stats, group.viewport_show = True, "VARIANCE"
    np.testing.assert_array_equal(picture(render(rebound_scene, tmp_path / "after.exr")), before)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"), check_existing=False)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    group = bpy.context.scene.rebound
    assert (group.viewport_indirect, group.viewport_split, group.viewport_split_place) == (False, True, 0.25)


def keys_of(data):
    """(keymap, key, shift, ctrl, alt) of one of Blender's own keymaps that react to a key that is pressed."""
    for name, _parameters, content in data:
        for _operator, key, _properties in content.get("items", ()):
            if key["value"] in ("PRESS", "ANY", "CLICK"):
                every = key.get("any", False)
                yield name, key["type"], *(every or bool(key.get(word)) for word in ("shift", "ctrl", "alt"))


def test_shortcut_is_registered_once_and_free(rebound_scene, monkeypatch):
    items = bpy.context.window_manager.keyconfigs.addon.keymaps[keymap.KEYMAP].keymap_items
    assert [item.idname for item in items].count("rebound.toggle_indirect") == 1
    rebound.register()  # once more
    assert [item.idname for item in items].count("rebound.toggle_indirect") == 1
    presets = Path(bpy.utils.system_resource("SCRIPTS")) / "presets" / "keyconfig"
    monkeypatch.syspath_prepend(str(presets))
    for name in ("blender_default", "industry_compatible_data"):
        module = __import__(f"keymap_data.{name}", fromlist=["Params"])
        used = [found for found in keys_of(module.generate_keymaps(module.Params())) if found[1] == "B"]
        assert len(used) > 3, "the keymap is read as it was"
        assert not [found for found in used if found[2:] == (True, False, True)], name
    for loaded in [loaded for loaded in sys.modules if loaded.startswith("keymap_data")]:
        monkeypatch.delitem(sys.modules, loaded)
    rebound.unregister()
    left = bpy.context.window_manager.keyconfigs.addon.keymaps[keymap.KEYMAP].keymap_items
    assert "rebound.toggle_indirect" not in [item.idname for item in left]


# --- the split view --------------------------------------------------------------------------------------------------


def test_split_shows_both_pictures_of_one_accumulation(view):
    whole = view.finish()
    view.scene.rebound.viewport_indirect = False
    without = view.finish()
    view.scene.rebound.viewport_indirect = view.scene.rebound.viewport_split = True
    shown = view.finish()
    half = shown.shape[1] // 2
    np.testing.assert_allclose(shown[:, :half], without[:, :half], rtol=1e-5, atol=1e-6)
    assert (shown[:, half:, :3].sum() > without[:, half:, :3].sum()) and shown.shape == whole.shape
    first = view.picture
    view.scene.rebound.viewport_split_place = 0.0
    moved = view.draw()
    assert view.picture is first and view.picture.samples == 2, "to drag the line costs no sample"
    assert moved[:, :half, :3].sum() > shown[:, :half, :3].sum()
    np.testing.assert_array_equal(moved[:, half:], shown[:, half:])


def test_line_is_there_where_it_divides_something(rebound_scene):
    group, context = rebound_scene.rebound, in_viewport(rebound_scene)
    assert not split.shows_split(context)
    group.viewport_split = True
    assert split.shows_split(context) and split.REBOUND_GGT_split.poll(context)
    group.viewport_show = "NORMALS"
    assert not split.shows_split(context)
    group.viewport_show, group.viewport_indirect = "PICTURE", False
    assert not split.shows_split(context)
    group.viewport_indirect = True
    assert not split.shows_split(in_viewport(rebound_scene, "SOLID"))
    rebound_scene.render.engine = "CYCLES"
    assert not split.shows_split(in_viewport(rebound_scene))


def test_line_is_taken_near_it_and_stays_in_the_region():
    assert split.line_is_near(0.5, 200, 105, 1.0) and not split.line_is_near(0.5, 200, 120, 1.0)
    assert split.line_is_near(0.5, 200, 114, 2.0), "the reach grows with the interface"
    assert [split.place_of(x, 200) for x in (-5, 0, 50, 200, 300)] == [0.0, 0.0, 0.25, 1.0, 1.0]


# --- views -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("method", "shown"), [*OF_ALL, *OF_ONE], ids=str)
def test_view_is_drawn(view, method, shown):
    view.scene.rebound.method, view.scene.rebound.viewport_show = method, shown
    pixels = view.finish()
    assert not view.viewport.error and np.isfinite(pixels).all()
    assert view.picture.samples == 2
    if (method, shown) not in (("NONE", "INDIRECT"), ("VPL", "VPL_BOUND")):
        assert pixels[..., :3].max() > 0.04


def test_view_that_fails_says_so_and_the_picture_comes_back(view, monkeypatch, caplog):
    view.finish()
    with monkeypatch.context() as patch:
        patch.setattr("rebound.gpu_shaders.vpl.Vpl.view", lambda *_: 1 / 0)
        view.scene.rebound.viewport_show = "VPL_VOXELS"
        view.draw()
        assert "ZeroDivisionError" in view.viewport.error and caplog.records
    view.scene.rebound.viewport_show = "PICTURE"
    assert view.finish()[..., :3].max() > 0.1 and not view.viewport.error


def test_maps_are_those_of_the_active_light(view):
    other = bpy.data.objects["Spot"].copy()
    other.name = "Another"
    other.location.x = -2.5
    bpy.context.scene.collection.objects.link(other)
    view.scene.rebound.viewport_show = "VPL_MAP_POSITION"
    view.update()
    found = {}
    for name in ("Spot", "Another", "Box"):
        bpy.context.view_layer.objects.active = bpy.data.objects[name]
        view.update()
        found[name] = view.finish()
    assert (found["Spot"] != found["Another"]).any()
    names = [light.name for light in view.viewport.session.scene.lights]
    np.testing.assert_array_equal(found["Box"], found[names[0]], err_msg="no light is active: the first")
    view.scene.rebound.show_light = names.index("Another") + 1
    np.testing.assert_array_equal(view.finish(), found["Another"])


def test_another_active_object_does_not_begin_the_picture_anew(view):
    view.finish()
    first = view.picture
    bpy.context.view_layer.objects.active = bpy.data.objects["Spot"]
    view.update()
    view.draw()
    assert view.picture is first


# --- the overlay -----------------------------------------------------------------------------------------------------


def test_statistics_tell_times_only_while_they_are_shown(view):
    view.finish()
    status = view.viewport.session.status
    assert not status.seconds and status.statistics["lights"] == 1
    view.scene.rebound.viewport_stats = True
    view.scene.rebound.seed = 1  # another picture
    view.finish()
    assert {"surfaces", "direct light", "gather", "sum"} <= status.seconds.keys()
    assert SESSIONS.status_of(view.context.region.as_pointer()) is status
    text = "\n".join(overlay.overlay_lines(view.scene, status))
    for word in ("ms", "1 light, ", "1 shadow maps (0 redrawn", "virtual lights of", "triangles", "MiB"):
        assert word in text, text
    view.scene.rebound.viewport_stats = False
    assert not overlay.overlay_lines(view.scene, status)


def test_redrawn_maps_are_counted_for_the_picture(view):
    view.finish()
    status = view.viewport.session.status
    assert status.redrawn["shadow_maps_drawn"] == 1
    bpy.data.objects["Spot"].location.x = -1
    view.update()
    view.finish()
    assert (status.redrawn["shadow_maps_drawn"], status.redrawn["light_maps_drawn"]) == (1, 1)
    view.scene.rebound.seed = 3
    view.finish()
    assert (status.redrawn["shadow_maps_drawn"], status.redrawn["light_maps_drawn"]) == (0, 0)


@pytest.mark.parametrize(("method", "shown"), [*OF_ALL, *OF_ONE], ids=str)
def test_legend_is_the_views_own_text(method, shown):
    text = overlay.legend(Settings.defaults(method=method, show=shown))
    every = {v.key: v for v in (*VIEWS, *(v for technique in TECHNIQUES for v in technique.views))}
    assert text == f"{every[shown].label}: {every[shown].description}"


def test_legend_says_which_method_has_a_view():
    assert overlay.legend(Settings.defaults()) == ""
    text = overlay.legend(Settings.defaults(method="NONE", show="VPL_VOXELS"))
    assert "picture is shown" in text and "Virtual Point Lights" in text


def test_overlay_says_that_bounce_is_off(rebound_scene):
    rebound_scene.rebound.viewport_indirect = False
    assert overlay.overlay_lines(rebound_scene, Status()) == ["Indirect light is off"]


def test_fault_in_the_overlay_is_logged_once_and_ends_it(rebound_scene, monkeypatch, caplog):
    monkeypatch.setattr(overlay, "draw_overlay", lambda: 1 / 0)
    removals = []
    monkeypatch.setattr(bpy.app.timers, "register", removals.append)
    overlay.HANDLER._draw()
    assert removals == [overlay.HANDLER.remove]
    assert [r.exc_info[0] for r in caplog.records if r.exc_info] == [ZeroDivisionError]
    monkeypatch.undo()
    overlay.HANDLER.remove()
    overlay.HANDLER._draw()  # as Blender may call it once more


@pytest.mark.parametrize("draw", [overlay.draw_header, overlay.draw_overlay_popover])
def test_buttons_are_drawn_in_our_viewports_only(rebound_scene, draw):
    for shading, ours in (("RENDERED", True), ("SOLID", False)):
        panel = SimpleNamespace(layout=Header())
        draw(panel, in_viewport(rebound_scene, shading))
        assert bool(panel.layout.drawn) == ours
    rebound_scene.render.engine = "CYCLES"
    panel = SimpleNamespace(layout=Header())
    draw(panel, in_viewport(rebound_scene))
    assert not panel.layout.drawn


def test_popover_has_every_tool(rebound_scene):
    panel = SimpleNamespace(layout=Header())
    overlay.REBOUND_PT_viewport.draw(panel, in_viewport(rebound_scene))
    wanted = {"REBOUND_MT_viewport_show", "show_light", "viewport_indirect", "viewport_split", "viewport_stats"}
    assert wanted <= set(panel.layout.drawn)


class Header(Layout):
    """A header's layout: icons and popovers must exist."""

    def operator(self, name, **options):
        assert options.pop("icon") in ICONS
        super().operator(name, **options)

    def popover(self, name, **_options):
        assert hasattr(bpy.types, name)
        self.drawn.append(name)


ICONS = bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items.keys()
