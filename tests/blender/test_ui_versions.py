"""Files of older and newer Rebounds: what is renamed moves, what is unknown stays, and one line says so."""

import logging

import bpy
import pytest

from rebound.session import read_settings
from rebound.tests.blender.test_ui import Context, draw
from rebound.tests.support.engine_build import rebound_scene
from rebound.ui import panels, versions
from rebound.ui.versions import Step, migrate, stored

__all__ = ["rebound_scene"]


@pytest.fixture
def reopen(tmp_path):
    """Write the file, change what it holds of the scene's settings, and open it as if that had been saved."""

    def run(**held):
        path = str(tmp_path / "file.blend")
        versions.unregister()  # so that saving numbers nothing
        put(bpy.context.scene, **held)
        bpy.ops.wm.save_as_mainfile(filepath=path, check_existing=False)
        versions.register()
        bpy.ops.wm.open_mainfile(filepath=path)
        return bpy.context.scene

    return run


def put(scene, **values):
    """Write raw values, of settings that may not exist."""
    for name, value in values.items():
        stored(scene.rebound)[name] = value


def held(scene):
    return dict(stored(scene.rebound).items())


def save_and_open(path):
    bpy.ops.wm.save_as_mainfile(filepath=str(path), check_existing=False)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.context.scene


def test_saved_file_has_the_number_and_its_values(rebound_scene, tmp_path):
    rebound_scene.rebound.samples, rebound_scene.rebound.vpl_bounces = 123, "ONE"
    scene = save_and_open(tmp_path / "a.blend")
    assert scene.rebound.version == versions.VERSION
    assert (scene.rebound.samples, scene.rebound.vpl_bounces) == (123, "ONE")
    assert not versions.file_notes(scene)


def test_scene_that_never_used_rebound_gets_no_number(registered, tmp_path):
    scene = save_and_open(tmp_path / "a.blend")
    assert scene.rebound.version == 0 and "version" not in held(scene)


def test_older_file_is_brought_up_to_date(rebound_scene, reopen):
    """Before the numbers one choice of bounces served renders and viewports."""
    rebound_scene.rebound.vpl_bounces = "MANY"
    rebound_scene.rebound.property_unset("viewport_vpl_bounces")
    rebound_scene.rebound.viewport_samples = 9
    scene = reopen(version=0, vpl_bounces=0)
    assert (scene.rebound.vpl_bounces, scene.rebound.viewport_vpl_bounces) == ("ONE", "ONE")
    assert scene.rebound.viewport_samples == 9
    assert scene.rebound.version == versions.VERSION
    scene.rebound.viewport_vpl_bounces = "MANY"
    again = save_and_open(bpy.data.filepath)
    assert (again.rebound.vpl_bounces, again.rebound.viewport_vpl_bounces) == ("ONE", "MANY"), "once only"


def test_first_release_opens_with_its_method(rebound_scene, reopen):
    """0.1.0 had two methods, and the number 1 was Reflective Shadow Maps."""
    scene = reopen(version=0, method=1)
    assert scene.rebound.method == "RSM"


def test_newer_file_says_so_and_loses_nothing(rebound_scene, reopen, caplog, monkeypatch):
    monkeypatch.setattr(logging.getLogger("rebound"), "propagate", True)
    with caplog.at_level("WARNING", "rebound"):
        scene = reopen(version=versions.VERSION + 1, from_the_future=3.5, samples=17)
    (line,) = [record.getMessage() for record in caplog.records if "newer Rebound" in record.getMessage()]
    assert scene.name in line and "nothing of it is lost" in line
    assert any("newer Rebound" in text for text in draw(panels.REBOUND_PT_sampling, Context(scene)))
    assert scene.rebound.samples == 17
    scene.rebound.samples = 18
    again = save_and_open(bpy.data.filepath)
    assert held(again)["from_the_future"] == 3.5
    assert again.rebound.version == versions.VERSION + 1 and again.rebound.samples == 18


def test_choice_of_the_future_is_kept_and_the_default_used(rebound_scene, reopen):
    scene = reopen(version=versions.VERSION + 1, method=99, vpl_scale=55)
    settings = read_settings(scene, viewport=False)
    assert (settings["method"], settings["vpl_scale"]) == ("VPL", "HALF")
    notes = versions.file_notes(scene)
    assert any("'Method'" in note for note in notes) and any("'Resolution'" in note for note in notes)
    draw(panels.REBOUND_PT_sampling, Context(scene))
    again = save_and_open(bpy.data.filepath)
    assert held(again)["method"] == 99


def test_appended_scene_is_brought_up_to_date_and_others_are_left(rebound_scene, reopen):
    scene = reopen(version=0, vpl_bounces=0)
    path = bpy.data.filepath
    versions.unregister()
    put(scene, version=0, vpl_bounces=0)
    scene.rebound.property_unset("viewport_vpl_bounces")
    bpy.ops.wm.save_mainfile()
    versions.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    here = bpy.context.scene
    here.name = "Here"
    here.rebound.vpl_bounces = "ONE"
    with bpy.data.libraries.load(path) as (there, into):
        into.scenes = there.scenes
    (came,) = into.scenes
    assert came.rebound.viewport_vpl_bounces == "ONE" and came.rebound.version == versions.VERSION
    assert here.rebound.viewport_vpl_bounces == "MANY"


def test_every_step_names_settings_that_exist(rebound_scene):
    properties = rebound_scene.rebound.bl_rna.properties
    for step in versions.STEPS:
        assert 1 <= step.version <= versions.VERSION
        assert all(name in properties for name in step.new)


STEPS = (
    Step(2, "late", ("later",)),
    Step(1, "old", ("new",)),
    Step(1, "gone"),
    Step(1, "halved", ("halved",), lambda value: value / 2),
    Step(1, "split", ("a", "b")),
    Step(1, "strange", ("known",), lambda value: None),
)


def test_steps_rename_remove_split_and_convert():
    file = {"old": 1, "gone": 2, "halved": 8, "split": 3, "strange": 4, "other": 5}
    lines = migrate(file, STEPS, 0)
    assert file == {"new": 1, "halved": 4, "a": 3, "b": 3, "other": 5}
    assert len(lines) == 5 and "'gone' became a default" in lines


def test_steps_that_a_file_has_behind_it_are_not_done_again():
    file = {"old": 1, "late": 2}
    assert migrate(file, STEPS, 1) == ["'late' became 'later'"]
    assert file == {"old": 1, "later": 2}
    assert migrate(file, STEPS, 2) == []


def test_steps_are_done_in_the_order_of_versions():
    steps = (Step(2, "b", ("c",)), Step(1, "a", ("b",)))
    file = {"a": 1}
    migrate(file, steps, 0)
    assert file == {"c": 1}


def test_edit_numbers_the_settings_as_ours(rebound_scene):
    rebound_scene.rebound.samples = 5
    assert rebound_scene.rebound.version == versions.VERSION


def test_handlers_come_and_go(rebound_scene):
    for handlers, call in versions.HANDLERS:
        assert handlers.count(call) == 1
    versions.unregister()
    assert not any(call in handlers for handlers, call in versions.HANDLERS)
    versions.register()
