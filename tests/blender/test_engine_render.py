"""A final render in background: registration, progress, passes, layers, border, failures and what they leave behind."""

import logging
import threading

import bpy
import numpy as np
import pytest

import rebound
from rebound import engine as engine_module
from rebound.passes import PASSES
from rebound.session import SESSIONS, Session
from rebound.tests.support.engine_build import HEIGHT, WIDTH, channels, picture, rebound_scene, render

__all__ = ["rebound_scene"]


OLD_NAMES = ["Combined", "Depth", "Normal", "Position", "DiffDir", "DiffInd", "DiffCol"]
OLD_NAMES += ["GlossDir", "GlossInd", "GlossCol", "TransDir", "TransInd", "TransCol", "Emit", "Env"]
NEW_NAMES = ["Combined", "Depth", "Normal", "Position", "Diffuse Direct", "Diffuse Indirect", "Diffuse Color"]
NEW_NAMES += [f"{kind} {way}" for kind in ("Glossy", "Transmission") for way in ("Direct", "Indirect", "Color")]
NAMES = OLD_NAMES if bpy.app.version < (5, 0) else [*NEW_NAMES, "Emission", "Environment"]


def test_register_twice_and_unregister_twice_leave_nothing(registered):
    rebound.register()
    assert registered.rebound.samples == 64
    rebound.unregister()
    rebound.unregister()
    assert not hasattr(bpy.types.Scene, "rebound")
    assert not hasattr(bpy.types, "ReboundEngine")
    assert not any(h.__module__.startswith("rebound.") for h in bpy.app.handlers.render_init)
    assert not logging.getLogger("rebound").handlers


def test_render_shows_floor_and_box(rebound_scene, tmp_path):
    image = picture(render(rebound_scene, tmp_path / "a.exr"))
    assert image.shape == (HEIGHT, WIDTH, 4)
    assert np.isfinite(image).all() and image[..., 3].min() == 1.0
    red, green = image[..., 0], image[..., 1]
    assert (red > 3 * green).mean() > 0.2, "the floor is red"
    assert (np.abs(red - green) < 0.1 * red).mean() > 0.05, "the box is white"


def test_same_scene_twice_gives_the_same_bits(rebound_scene, tmp_path):
    rebound_scene.rebound.samples = 2
    first = picture(render(rebound_scene, tmp_path / "a.exr"))
    np.testing.assert_array_equal(first, picture(render(rebound_scene, tmp_path / "b.exr")))


def test_only_wanted_passes_are_in_the_file(rebound_scene, tmp_path):
    rebound_scene.view_layers[0].use_pass_z = False
    rebound_scene.view_layers[0].use_pass_normal = True
    found = {name.split(".")[1] for name in render(rebound_scene, tmp_path / "a.exr")}
    assert found == {"Combined", "Normal"}


def test_every_pass_is_filled(rebound_scene, tmp_path):
    for entry in PASSES:
        setattr(rebound_scene.view_layers[0], entry.view_layer_property, True)
    found = render(rebound_scene, tmp_path / "a.exr")
    assert {name.split(".")[1] for name in found} == set(NAMES)
    assert all(np.isfinite(pixels).all() for pixels in found.values())

    def rgb(key):
        name = NAMES[[p.key for p in PASSES].index(key)]
        return np.stack([found[f"ViewLayer.{name}.{c}"] for c in "RGB"], axis=-1)

    light = rgb("diffuse_direct") + rgb("diffuse_indirect")
    glossy = rgb("glossy_direct") + rgb("glossy_indirect")
    sum_of_passes = rgb("diffuse_color") * light + rgb("glossy_color") * glossy
    sum_of_passes += rgb("emission") + rgb("environment")
    # The passes and Combined are read from sums of their own; what is left is their rounding.
    np.testing.assert_allclose(sum_of_passes, picture(found)[..., :3], atol=1e-4, rtol=1e-4)
    assert light.max() > 0.1 and rgb("diffuse_indirect").max() > 1e-3


def test_compositor_knows_the_passes(rebound_scene):
    for entry in PASSES:
        setattr(rebound_scene.view_layers[0], entry.view_layer_property, True)
    if bpy.app.version >= (5, 0):
        tree = rebound_scene.compositing_node_group = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
    else:
        rebound_scene.use_nodes = True
        tree = rebound_scene.node_tree
    node = tree.nodes.new("CompositorNodeRLayers")
    assert {"Depth", "Normal", "Position"} <= {s.name for s in node.outputs if s.enabled}


def test_two_view_layers_render_their_own_objects(rebound_scene, tmp_path):
    second = rebound_scene.view_layers.new("Second")
    hidden = bpy.data.collections.new("Hidden")
    rebound_scene.collection.children.link(hidden)
    box = bpy.data.objects["Box"]
    rebound_scene.collection.objects.unlink(box)
    hidden.objects.link(box)
    second.layer_collection.children["Hidden"].exclude = True
    found = render(rebound_scene, tmp_path / "a.exr")
    first, other = picture(found), picture(found, "Second")
    white = np.abs(first[..., 0] - first[..., 1]) < 0.1 * first[..., 0]
    red = other[..., 0] > 2 * other[..., 1]
    assert (white & red).sum() > 50, "the floor shows where the box was"


@pytest.mark.parametrize("crop", [True, False])
def test_border_shows_the_same_part_of_the_picture(rebound_scene, tmp_path, crop):
    rebound_scene.rebound.method = "NONE"  # which pixels gather the bounce depends on the picture's edges
    whole = picture(render(rebound_scene, tmp_path / "whole.exr"))
    settings = rebound_scene.render
    settings.use_border, settings.use_crop_to_border = True, crop
    settings.border_min_x, settings.border_max_x = 0.25, 0.75
    settings.border_min_y, settings.border_max_y = 0.0, 0.5
    part = picture(render(rebound_scene, tmp_path / "part.exr"))
    wanted = whole[HEIGHT // 2 :, WIDTH // 4 : WIDTH * 3 // 4]
    if not crop:
        assert part.shape == whole.shape
        part = part[HEIGHT // 2 :, WIDTH // 4 : WIDTH * 3 // 4]
    # Noise is seeded by the pixel's place in what is drawn, so only shadows' edges may differ.
    assert (np.abs(part - wanted).max(axis=-1) < 0.02).mean() > 0.9


def test_percentage_and_pixel_aspect_are_followed(rebound_scene, tmp_path):
    rebound_scene.render.resolution_percentage = 50
    rebound_scene.render.pixel_aspect_x = 2.0
    assert picture(render(rebound_scene, tmp_path / "a.exr")).shape == (HEIGHT // 2, WIDTH // 2, 4)


def test_transparent_film_has_no_background(rebound_scene, tmp_path):
    bpy.data.objects["Floor"].hide_render = True
    rebound_scene.render.film_transparent = True
    alpha = picture(render(rebound_scene, tmp_path / "a.exr"))[..., 3]
    assert alpha.min() == 0.0 and alpha.max() == 1.0


def test_frame_alone_equals_the_frame_of_an_animation(rebound_scene, tmp_path):
    box = bpy.data.objects["Box"]
    for frame, x in ((1, -1), (3, 1)):
        box.location.x = x
        box.keyframe_insert("location", frame=frame)
    rebound_scene.frame_set(2)
    alone = picture(render(rebound_scene, tmp_path / "alone.exr"))
    rebound_scene.frame_start, rebound_scene.frame_end = 1, 2
    rebound_scene.render.filepath = str(tmp_path / "film_")
    assert bpy.ops.render.render(animation=True) == {"FINISHED"}
    first, second = (picture(channels(tmp_path / f"film_000{n}.exr")) for n in (1, 2))
    np.testing.assert_array_equal(second, alone)
    assert np.abs(first - second).max() > 0.05


def test_warnings_are_kept_for_the_panel(rebound_scene, tmp_path):
    bpy.data.objects.remove(bpy.data.objects["Spot"])
    rebound_scene.world = None
    render(rebound_scene, tmp_path / "a.exr")
    assert any("no light" in line for line in SESSIONS.newest.warnings)
    assert SESSIONS.newest.samples == 1 and "triangles" in SESSIONS.newest.statistics


def test_progress_is_logged(rebound_scene, tmp_path, caplog):
    with caplog.at_level(logging.INFO, logger="rebound"):
        rebound_scene.rebound.samples = 3
        render(rebound_scene, tmp_path / "a.exr")
    assert any("sample 3/3" in line for line in caplog.messages)


def test_cancel_keeps_the_samples_so_far(rebound_scene, tmp_path, monkeypatch, caplog):
    stopped: list[bool] = []

    class Stopping:
        """The engine, with a user who presses Esc. RNA functions cannot be patched on the class."""

        def __init__(self, engine):
            self.engine = engine

        def __getattr__(self, name):
            return getattr(self.engine, name)

        def update_stats(self, stats, info):
            stopped.extend([True] if info.startswith("Sample 3/") else [])

        def test_break(self):
            return bool(stopped)

    whole = engine_module.render_final
    monkeypatch.setattr(engine_module, "render_final", lambda engine, depsgraph: whole(Stopping(engine), depsgraph))
    rebound_scene.rebound.samples = 50
    with caplog.at_level(logging.INFO, logger="rebound"):
        image = picture(render(rebound_scene, tmp_path / "a.exr"))
    assert any("cancelled after 2 samples" in line for line in caplog.messages)
    rebound_scene.rebound.samples = 2
    monkeypatch.undo()
    np.testing.assert_array_equal(image, picture(render(rebound_scene, tmp_path / "b.exr")))


def test_sync_gets_the_way_to_the_main_thread(rebound_scene, tmp_path, monkeypatch):
    calls, sync = [], Session.sync

    def spy(session, depsgraph, **options):
        calls.append(options["on_main_thread"](threading.current_thread))
        sync(session, depsgraph, **options)

    monkeypatch.setattr(Session, "sync", spy)
    render(rebound_scene, tmp_path / "a.exr")
    assert calls == [threading.main_thread()]


def test_own_fault_is_reported_once_and_writes_no_file(rebound_scene, tmp_path, monkeypatch, caplog):
    def fail(*_args):
        raise ZeroDivisionError("made by the test")

    monkeypatch.setattr("rebound.renderer.Renderer.sample", fail)
    path = tmp_path / "a.exr"
    with pytest.raises(RuntimeError, match="internal error.*ZeroDivisionError: made by the test"):
        render(rebound_scene, path)
    assert not path.exists()
    assert len([r for r in caplog.records if r.exc_info]) == 1


def test_ctrl_c_writes_no_file(rebound_scene, tmp_path, monkeypatch):
    def interrupt(*_args):
        raise KeyboardInterrupt

    monkeypatch.setattr("rebound.renderer.Renderer.sample", interrupt)
    with pytest.raises(RuntimeError, match="interrupted"):
        render(rebound_scene, tmp_path / "a.exr")
    assert not list(tmp_path.iterdir())


def test_render_after_a_failed_one_works(rebound_scene, tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr("rebound.renderer.Renderer.begin", lambda *_: 1 / 0)
        with pytest.raises(RuntimeError):
            render(rebound_scene, tmp_path / "a.exr")
    assert picture(render(rebound_scene, tmp_path / "a.exr")).max() > 0.1


def test_render_frees_its_session(rebound_scene, tmp_path, monkeypatch):
    closed = []
    monkeypatch.setattr("rebound.device.blender.BlenderDevice.close", lambda device: closed.append(device))
    render(rebound_scene, tmp_path / "a.exr")
    assert all(session._gpu is None for session in SESSIONS.alive)
    assert len(closed) == 1, "the device's own buffers go on the same thread"
