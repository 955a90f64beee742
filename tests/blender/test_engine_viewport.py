"""A viewport without a window: its session draws into an off-screen buffer, as it would into a region."""

import bpy
import gpu
import numpy as np
import pytest
from mathutils import Matrix

from rebound import engine
from rebound import viewport as viewport_module
from rebound.main_thread import MAIN_THREAD
from rebound.session import SESSIONS, Picture, Session
from rebound.tests.support.engine_build import rebound_scene
from rebound.tests.support.viewport_build import View
from rebound.viewport import Viewport

__all__ = ["rebound_scene"]


@pytest.fixture
def view(rebound_scene):
    rebound_scene.rebound.viewport_samples = 3
    rebound_scene.rebound.viewport_shadow_resolution = 128
    rebound_scene.rebound.viewport_rsm_resolution = 32
    made = View(rebound_scene)
    made.update()
    yield made
    made.viewport.session.free()


def test_viewport_converges_and_stops(view):
    pixels = view.finish()
    assert view.picture.samples == 3
    assert view.viewport.progress == "Sample 3/3"
    assert pixels[..., 0].max() > 0.1 and (pixels[..., 3] == 1).all()
    np.testing.assert_array_equal(view.draw(), pixels)
    assert view.picture.samples == 3


def test_viewport_shows_what_it_accumulated(view):
    pixels = view.finish()
    np.testing.assert_allclose(pixels, view.picture.read("combined"), rtol=1e-5, atol=1e-6)


def test_orbit_uploads_nothing_and_starts_anew(view):
    view.finish()
    uploads, first = dict(view.viewport.session._gpu.scene.uploads), view.picture
    view.context.region_data.view_matrix = view.context.region_data.view_matrix @ Matrix.Rotation(0.1, 4, "Z")
    view.draw()
    assert view.picture is not first and view.picture.samples == 1
    assert dict(view.viewport.session._gpu.scene.uploads) == uploads


def test_render_region_is_drawn_alone_and_in_its_place(view):
    view.scene.rebound.method = "NONE"  # whose noise is another one in a smaller picture
    whole = view.finish()
    view.set_border((0.25, 0.5), (0.75, 1.0))
    part = view.finish()
    height, width = whole.shape[:2]
    inside = np.s_[height // 2 :, width // 4 : width * 3 // 4]
    # A pixel at the edge of a shadow may fall to the other side of it: its place is rounded otherwise.
    assert (np.abs(part[inside] - whole[inside]) > 0.005).mean() < 0.01
    assert part[..., 3].sum() == part[inside][..., 3].size  # nothing, not even black, beside it
    view.context.space_data.use_render_border = False
    np.testing.assert_array_equal(view.finish(), whole)


def test_line_of_a_split_view_stands_where_it_does_with_a_render_region(view):
    view.scene.rebound.viewport_split, view.scene.rebound.viewport_split_place = True, 0.5
    view.set_border((0.5, 0.0), (1.0, 1.0))
    shown = []
    show = Picture.show
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Picture, "show", lambda self, place: (shown.append(place), show(self, place)))
        view.draw()
        view.set_border((0.25, 0.0), (1.0, 1.0))
        view.draw()
    assert shown == [0.0, pytest.approx(1 / 3)]


def test_viewport_rests_while_a_final_render_works(view, monkeypatch):
    monkeypatch.setattr(MAIN_THREAD, "is_busy", lambda: True)
    view.draw()
    assert view.picture.samples == 1  # something to see there must be
    view.draw()
    assert view.picture.samples == 1 and not view.viewport.unfinished
    monkeypatch.setattr(MAIN_THREAD, "is_busy", lambda: False)
    view.finish()
    assert view.picture.samples == 3


def test_update_without_a_change_goes_on(view):
    view.finish()
    first = view.picture
    view.update()
    view.draw()
    assert view.picture is first


def test_moved_light_uploads_no_mesh(view):
    view.finish()
    before = view.viewport.session._gpu.scene.uploads["meshes"]
    bpy.data.objects["Spot"].location.x = -1
    view.update()
    assert view.draw()[..., 0].max() > 0.1
    assert view.picture.samples == 1
    assert view.viewport.session._gpu.scene.uploads["meshes"] == before


def test_changed_setting_starts_anew_without_an_update(view):
    view.finish()
    view.scene.rebound.method = "NONE"
    view.draw()
    assert view.picture.samples == 1


def test_more_samples_start_anew_and_finish(view):
    view.finish()
    view.scene.rebound.viewport_samples = 5
    view.finish()
    assert view.picture.samples == 5


def test_one_sample_is_not_enough_while_maps_wait_their_turn(view):
    view.scene.rebound.viewport_samples = view.scene.rebound.viewport_vpl_maps_at_once = 1
    view.finish()
    bpy.data.objects["Box"].location.x += 0.5
    view.update()
    view.draw()
    status = view.viewport.session.status
    assert status.statistics["light_maps_pending"] > 0 and view.viewport.unfinished
    view.finish()
    assert status.statistics["light_maps_pending"] == 0 and view.picture.samples == 1


@pytest.mark.parametrize("size", [(1, 1), (7, 3), (129, 65)])
def test_resized_region_gets_a_picture_of_its_size(view, size):
    view.finish()
    view.context.region.width, view.context.region.height = size
    assert view.finish().shape == (size[1], size[0], 4)


def test_film_transparent_shows_through(view):
    view.scene.render.film_transparent = True
    bpy.data.objects["Floor"].hide_viewport = True
    view.update()
    assert view.finish()[..., 3].min() == 0


def test_own_fault_is_shown_once_and_tried_again_after_an_edit(view, monkeypatch, caplog):
    with monkeypatch.context() as patch:
        patch.setattr(Session, "picture", lambda *_: 1 / 0)
        view.draw()
        view.draw()
        assert "ZeroDivisionError" in view.viewport.error
        assert not view.viewport.unfinished
        assert len([r for r in caplog.records if r.exc_info]) == 1, "an error is no reason to fill the console"
    view.draw()
    assert "ZeroDivisionError" in view.viewport.error, "the same is not tried again"
    view.update()
    assert view.finish()[..., 0].max() > 0.1
    assert not view.viewport.error


def test_other_settings_are_a_reason_to_try_again(view, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(Session, "picture", lambda *_: 1 / 0)
        view.draw()
    view.scene.rebound.method = "NONE"
    assert view.finish()[..., 0].max() > 0.1


def test_fault_gives_the_memory_back(view, monkeypatch):
    view.finish()
    monkeypatch.setattr("rebound.session.Picture.advance", lambda *_: 1 / 0)
    view.scene.rebound.method = "NONE"
    view.draw()
    assert view.viewport.error and view.viewport.session._gpu is None


def test_error_is_drawn_as_text(view):
    view.context.region.width, view.context.region.height = 400, 100
    view.viewport.fail("something is wrong")
    target = gpu.types.GPUOffScreen(400, 100, format="RGBA32F")
    with target.bind():
        framebuffer = gpu.state.active_framebuffer_get()
        framebuffer.clear(color=(0, 0, 0, 0))
        view.viewport.draw_error(view.context)
        buffer = framebuffer.read_color(0, 0, 400, 100, 4, 0, "FLOAT")
    buffer.dimensions = 400 * 100 * 4
    assert (np.array(buffer) > 0.5).sum() > 50
    target.free()


def test_settings_are_the_viewports_own(view):
    view.scene.rebound.samples = 99
    view.finish()
    assert view.picture.settings["samples"] == 3


def test_free_all_frees_every_viewport(view):
    view.finish()
    SESSIONS.free_all()
    assert view.viewport.session._gpu is None
    assert view.finish()[..., 0].max() > 0.1, "and it starts again by itself"


def test_draw_before_the_first_update_draws_nothing(rebound_scene):
    made = View(rebound_scene)
    assert made.draw().max() == 0 and not made.viewport.error


def test_time_for_one_redraw_is_bounded(view, monkeypatch):
    """A sample that takes long is continued with the next redraw, once there is a picture."""
    view.finish()
    view.scene.rebound.viewport_samples = 4
    view.draw()
    monkeypatch.setattr(viewport_module, "SECONDS_PER_DRAW", 0.0)
    before = view.picture.samples
    view.draw()
    assert view.picture.samples == before


class EngineObject:
    """A RenderEngine's callbacks on an object that Blender did not make."""

    view_update, view_draw = engine.ReboundEngine.view_update, engine.ReboundEngine.view_draw
    update_render_passes = engine.ReboundEngine.update_render_passes
    _viewport, _show_state = engine.ReboundEngine._viewport, engine.ReboundEngine._show_state
    _fail_view, _fail = engine.ReboundEngine._fail_view, engine.ReboundEngine._fail

    def __init__(self):
        self.reports: list[str] = []

    def report(self, _kind, message):
        self.reports.append(message)

    def update_stats(self, _stats, _info):
        pass


def broken(*_args):
    raise ZeroDivisionError("made by the test")


@pytest.mark.parametrize("what", ["rebound.viewport.Viewport.draw_error", "rebound.viewport.Viewport.draw"])
def test_no_error_gets_past_a_redraw(rebound_scene, monkeypatch, caplog, what):
    made, context = EngineObject(), View(rebound_scene).context
    monkeypatch.setattr(what, broken)
    monkeypatch.setattr(Viewport, "update", lambda *_: None)
    if what.endswith("draw"):
        monkeypatch.setattr(Viewport, "draw_error", lambda *_: None)
    made.view_update(context, bpy.context.evaluated_depsgraph_get())
    made.view_draw(context, bpy.context.evaluated_depsgraph_get())
    assert "ZeroDivisionError" in made._viewport().error
    assert [record.exc_info[0] for record in caplog.records] == [ZeroDivisionError]


def test_no_error_gets_past_statistics_and_making_a_viewport(rebound_scene, monkeypatch):
    made, context = EngineObject(), View(rebound_scene).context
    monkeypatch.setattr(EngineObject, "update_stats", broken)
    made.view_draw(context, bpy.context.evaluated_depsgraph_get())
    assert "ZeroDivisionError" in made._viewport().error
    monkeypatch.setattr(engine, "Viewport", broken)
    unmade = EngineObject()
    unmade.view_update(context, None)
    unmade.view_draw(context, None)
    assert unmade.reports and all("ZeroDivisionError" in line for line in unmade.reports)


def test_no_error_gets_past_the_registration_of_passes(monkeypatch):
    made = EngineObject()
    monkeypatch.setattr(engine, "register_passes", broken)
    made.update_render_passes(None, None)
    assert len(made.reports) == 1 and "ZeroDivisionError" in made.reports[0]
