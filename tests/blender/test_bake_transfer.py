"""Baking light transfer of Blender's objects: the operator, its modal, files, what is stale, and the command line."""

import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from rebound import baking
from rebound.bake.file import read_bake
from rebound.bake.job import BakeSettings, Kind
from rebound.bake.process import Outcome
from rebound.operators import bake_command
from rebound.operators.bake_transfer import REBOUND_OT_bake_transfer
from rebound.scene.errors import SceneError
from rebound.session import SESSIONS, Session
from rebound.tests.support.blender_build import convert, link
from rebound.tests.support.engine_build import picture, rebound_scene, render
from rebound.ui.transfer_panels import state_lines

__all__ = ["rebound_scene"]

QUICK = BakeSettings(directions=64, bounces=1)
# Long enough to be cancelled at any time.
LONG = BakeSettings(directions=65536, bounces=8)


@pytest.fixture
def saved(rebound_scene, tmp_path):
    """The scene in a file, with quick settings for bakes."""
    rebound_scene.rebound.bake_directions, rebound_scene.rebound.bake_points = 64, 0
    for name in ("Floor", "Box"):
        bpy.data.objects[name].select_set(True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"), check_existing=False)
    return bpy.context.scene


def floor():
    return bpy.data.objects["Floor"]


def state(obj):
    return baking.state_of(obj, convert().bakes)


def test_operator_bakes_the_selected_into_files_beside_the_blend(saved, tmp_path):
    bpy.data.objects["Box"].select_set(False)
    assert bpy.ops.rebound.bake_transfer() == {"FINISHED"}
    assert floor().rebound.transfer_file == "//a.bakes/Floor.transfer.exr"
    assert not baking.has_bake(bpy.data.objects["Box"])
    found = read_bake(tmp_path / "a.bakes" / "Floor.transfer.exr")
    assert found.about["settings"]["directions"] == 64
    assert found.arrays["diffuse"].shape == (4, 3, 25)


def test_folder_that_cannot_be_made_is_named_with_what_to_do(saved, tmp_path):
    (tmp_path / "a.bakes").write_text("a file is in the way")
    with pytest.raises(RuntimeError, match=r"(?s)a\.bakes' \(.*turn on Pack"):
        bpy.ops.rebound.bake_transfer()
    assert not baking.has_bake(floor())


def test_coarse_mesh_is_warned_of(saved):
    lines = baking.bake([floor(), bpy.data.objects["Box"]], QUICK)
    assert len(lines) == 1 and "'Floor' has 4 vertices" in lines[0] and "subdivide" in lines[0]


def test_metal_smoother_than_its_bands_is_warned_of(saved):
    """Of the kind that shows it softer, and named with what it is shown as."""
    shader = bpy.data.materials["Red"].node_tree.nodes["Principled BSDF"]
    shader.inputs["Metallic"].default_value, shader.inputs["Roughness"].default_value = 1.0, 0.3
    settings = replace(QUICK, kind=Kind.GLOSSY, bands=5, result_bands=6)
    lines = [line for line in baking.bake([floor()], settings) if "roughness" in line]
    assert len(lines) == 1
    assert "'Floor' has a roughness of 0.30, smoother than 5 bands hold" in lines[0] and "0.57" in lines[0]
    assert "Holds reflections of roughness 0.57 and more" in [text for text, _ in state_lines(floor())]
    shader.inputs["Roughness"].default_value = 0.6
    assert not any("roughness" in line for line in baking.bake([floor()], settings))


def test_points_inside_triangles_show_the_shadow_on_a_square(saved, tmp_path):
    """The box hangs over the floor's middle, far from its corners."""
    baking.bake([floor()], QUICK)
    seen = {0: picture(render(saved, tmp_path / "a.exr"))}
    saved.rebound.bake_points, saved.rebound.bake_detail = 200, 0.02
    assert baking.bake([floor()]) == [], "no warning of four vertices"
    seen[200] = picture(render(saved, tmp_path / "b.exr"))
    found = read_bake(tmp_path / "a.bakes" / "Floor.transfer.exr")
    assert 20 < found.about["points"] <= 200
    assert len(found.arrays["diffuse"]) == 4 + found.about["points"]
    assert state(floor()).unused == ""
    assert any("points inside triangles" in line for line in baking.facts(state(floor()).about, 0))
    darker = seen[200][..., 0] - seen[0][..., 0]
    assert darker.min() < -0.006, "of 0.04, the floor's red under Blender's dark grey world"


def test_bake_lights_the_instance_of_its_object(saved):
    bpy.ops.rebound.bake_transfer(objects="ALL")
    scene = convert()
    assert not scene.warnings and len(scene.transfers) == 2
    for instance in scene.instances:
        transfer = scene.transfers[instance.transfer]
        count = len(
            np.unique(np.hstack([scene.meshes[instance.mesh].positions, scene.meshes[instance.mesh].normals]), axis=0)
        )
        assert len(transfer.arrays["diffuse"]) == count
    again = convert(previous=scene)
    assert again.transfers[again.instances[0].transfer] is scene.transfers[scene.instances[0].transfer], (
        "not read twice"
    )


def test_bake_of_the_newest_file_is_used(saved):
    """A second bake has the same path: it is the file's contents that count."""
    baking.bake([floor()], QUICK)
    before = convert()
    baking.bake([floor()], BakeSettings(bands=3, directions=64))
    after = convert(previous=before)
    (transfer,) = after.transfers.values()
    assert transfer.about["settings"]["bands"] == 3


def test_packed_bake_needs_no_file(saved, tmp_path):
    saved.rebound.bake_pack = True
    bpy.ops.rebound.bake_transfer(objects="ALL")
    assert not (tmp_path / "a.bakes").exists() and not floor().rebound.transfer_file
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert state(floor()).unused == ""
    image = floor().rebound.transfer_image.name
    baking.bake([floor()], QUICK, pack=False)
    assert image not in bpy.data.images, "the packed one is gone"
    assert state(floor()).unused == ""


def test_stale_bakes_are_said_and_not_used(saved):
    bpy.ops.rebound.bake_transfer(objects="ALL")
    box = bpy.data.objects["Box"]
    box.location.z += 0.1
    scene = convert()
    assert [i.transfer for i in scene.instances] == [None, None]
    assert len([line for line in scene.warnings if "what stands around the object" in line]) == 2
    box.location.z -= 0.1
    assert state(floor()).unused == ""
    floor().data.vertices[0].co.z = 0.2
    assert "the mesh has changed" in state(floor()).unused
    assert "around the object" in state(box).unused


def test_rigid_motion_of_all_keeps_the_bakes(saved):
    bpy.ops.rebound.bake_transfer(objects="ALL")
    parent = link("All", None)
    for name in ("Floor", "Box"):
        bpy.data.objects[name].parent = parent
    parent.location, parent.rotation_euler = (3, -2, 1), (0.3, 0.2, 1.0)
    scene = convert()
    assert all(i.transfer for i in scene.instances), scene.warnings


@pytest.mark.parametrize("harm", ["damaged", "foreign", "missing"])
def test_file_that_is_no_bake_is_refused_with_its_reason(saved, tmp_path, harm):
    baking.bake([floor()], QUICK)
    path = tmp_path / "a.bakes" / "Floor.transfer.exr"
    data = bytearray(path.read_bytes())
    if harm == "damaged":
        data[-3] ^= 255  # in the pixels: not every byte of an EXR's header says something
        path.write_bytes(data)
    elif harm == "foreign":
        path.write_text("a letter")
    else:
        path.unlink()
    found = state(floor())
    assert {"damaged": "damaged", "foreign": "no EXR file", "missing": "missing"}[harm] in found.unused
    assert "Floor" in next(line for line in convert().warnings if "bake again" in line)


def test_panel_says_what_a_bake_is_and_whether_it_is_used(saved):
    assert state_lines(floor()) == [("No bake: the sky's light is live", "NONE")]
    bpy.ops.rebound.bake_transfer(objects="ALL")
    assert "Not looked at" in state_lines(floor())[0][0] and "5 bands" in state_lines(floor())[1][0]
    session = Session()
    SESSIONS.newest = session.status
    session.sync(bpy.context.evaluated_depsgraph_get(), for_viewport=True)
    assert state_lines(floor())[0] == ("In use", "CHECKMARK")
    floor().location.x = 1
    session.sync(bpy.context.evaluated_depsgraph_get(), for_viewport=True)
    assert state_lines(floor())[0][1] == "ERROR"
    session.free()


# --- the modal -------------------------------------------------------------------------------------------------------


class Manager:
    """Stands for the window manager, which has no window in background."""

    def __init__(self):
        self.rebound, self.windows = bpy.context.window_manager.rebound, ()
        self.timer, self.shown = None, []

    def event_timer_add(self, _seconds, window):
        self.timer = object()
        return self.timer

    def event_timer_remove(self, timer):
        assert timer is self.timer
        self.timer = None

    def progress_begin(self, _low, _high):
        pass

    def progress_update(self, value):
        self.shown.append(value)

    def progress_end(self):
        pass

    def modal_handler_add(self, _operator):
        pass


class Modal:
    """The operator with hands of our own on its timer."""

    def __init__(self, settings):
        self.manager, self.said, self.status = Manager(), [], []
        self.context = SimpleNamespace(
            scene=bpy.context.scene,
            selected_objects=bpy.context.selected_objects,
            evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get,
            window=None,
            window_manager=self.manager,
            workspace=SimpleNamespace(status_text_set=self.status.append),
        )
        kind = REBOUND_OT_bake_transfer
        self.operator = SimpleNamespace(objects="SELECTED", report=lambda how, text: self.said.append((*how, text)))
        for name in ("_tell", "_end", "_fail"):
            setattr(self.operator, name, getattr(kind, name).__get__(self.operator))
        group = bpy.context.scene.rebound
        group.bake_directions, group.bake_bounces = settings.directions, settings.bounces
        self.answer = kind.invoke(self.operator, self.context, None)

    def event(self, kind, value="PRESS"):
        event = SimpleNamespace(type=kind, value=value)
        self.answer = REBOUND_OT_bake_transfer.modal(self.operator, self.context, event)
        return self.answer

    def until_it_ends(self):
        end = time.monotonic() + 60
        while "RUNNING_MODAL" in self.answer and time.monotonic() < end:
            self.event("TIMER")
            time.sleep(0.02)
        return self.answer


def test_modal_bakes_while_the_interface_lives(saved):
    modal = Modal(QUICK)
    assert modal.answer == {"RUNNING_MODAL"}
    assert modal.event("LEFTMOUSE") == {"PASS_THROUGH", "RUNNING_MODAL"}
    assert not bpy.ops.rebound.bake_transfer.poll(), "one at a time"
    assert modal.until_it_ends() == {"FINISHED"}
    assert "Baked" in modal.said[-1][1] and "rays by" in modal.said[-1][1]
    assert modal.manager.timer is None and modal.status[-1] is None
    assert bpy.context.window_manager.rebound.bake_line == ""
    assert state(floor()).unused == ""


def test_escape_cancels_and_leaves_the_bake_before(saved, tmp_path):
    baking.bake([floor()], QUICK)
    before = (tmp_path / "a.bakes" / "Floor.transfer.exr").read_bytes()
    modal = Modal(LONG)
    while not modal.operator._bake.process.device:
        modal.event("TIMER")
        time.sleep(0.02)
    modal.event("ESC")
    start = time.monotonic()
    assert modal.until_it_ends() == {"CANCELLED"}
    assert time.monotonic() - start < 20
    assert (tmp_path / "a.bakes" / "Floor.transfer.exr").read_bytes() == before
    assert state(floor()).unused == "" and not baking.has_bake(bpy.data.objects["Box"])
    assert list(tmp_path.glob("a.bakes/*.part")) == []


def test_another_file_ends_the_bake(saved):
    modal = Modal(LONG)
    process = modal.operator._bake.process
    REBOUND_OT_bake_transfer.cancel(modal.operator, modal.context)
    assert process._process.poll() is not None and not process._folder.exists()


def test_failed_bake_says_why_and_leaves_the_bake_before(saved, tmp_path):
    baking.bake([floor()], QUICK)
    path = tmp_path / "a.bakes" / "Floor.transfer.exr"
    before = path.read_bytes()
    modal = Modal(LONG)
    modal.operator._bake.process._process.kill()
    assert modal.until_it_ends() == {"CANCELLED"}
    assert modal.said[-1][0] == "ERROR" and "bakes of before are as they were" in modal.said[-1][1]
    assert path.read_bytes() == before and state(floor()).unused == ""


def test_object_that_went_away_during_the_bake_is_passed_over(saved):
    work = baking.TransferBake(
        bpy.context.evaluated_depsgraph_get(), [floor(), bpy.data.objects["Box"]], QUICK, pack=False
    )
    bpy.data.objects.remove(floor())
    bpy.data.objects["Box"].name = "Crate"
    work.process.wait()
    assert work.step() is Outcome.DONE
    work.close()
    assert bpy.data.objects["Crate"].rebound.transfer_file.endswith("Box.transfer.exr")


# --- what cannot be baked --------------------------------------------------------------------------------------------


def test_reasons_not_to_bake_are_said(rebound_scene, tmp_path):
    with pytest.raises(SceneError, match="Save the .blend first"):
        baking.bake([floor()], QUICK)
    with pytest.raises(SceneError, match="No object to bake"):
        baking.bake([], QUICK, pack=True)
    floor().hide_viewport = True
    with pytest.raises(SceneError, match="'Floor' has no surface that is shown"):
        baking.bake([floor()], QUICK, pack=True)
    rebound_scene.rebound.bake_kind = "GLOSSY"
    rebound_scene.rebound.bake_bands = rebound_scene.rebound.bake_result_bands = 6
    assert baking.settings_of(rebound_scene.rebound).bands == 6
    rebound_scene.rebound.bake_pack = True
    with pytest.raises(RuntimeError, match="No object to bake"):
        bpy.ops.rebound.bake_transfer()


# --- the command line ------------------------------------------------------------------------------------------------


def test_command_bakes_a_file_and_saves_it(saved, tmp_path):
    path = str(tmp_path / "a.blend")
    bpy.ops.wm.read_homefile(use_empty=True)
    words = [
        "bake",
        path,
        "--objects",
        "Floor",
        "--bands",
        "3",
        "--directions",
        "64",
        "--save-as",
        str(tmp_path / "b.blend"),
    ]
    assert bake_command.run(words) == 0
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "b.blend"))
    found = state(floor())
    assert found.unused == "" and found.about["settings"]["bands"] == 3
    assert not baking.has_bake(bpy.data.objects["Box"])
    assert Path(bpy.path.abspath(floor().rebound.transfer_file)).parent == tmp_path / "b.bakes"
    assert not (tmp_path / "a.bakes").exists()
    assert bake_command.run(["bake", path, "--objects", "Nobody", "--save-as", str(tmp_path / "b.blend")]) == 1
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "b.blend"))
    assert state(floor()).unused == "", "a bake that failed leaves the file of before"


@pytest.mark.parametrize(
    ("words", "status"),
    [
        (["bake", "nowhere.blend"], 1),
        (["bake"], 2),
        (["bake", "{}/a.blend", "--objects", "Nobody"], 1),
        (["--help"], 0),
    ],
)
def test_command_ends_with_a_status(saved, tmp_path, words, status):
    assert bake_command.run([word.format(tmp_path) for word in words]) == status


# --- in the picture --------------------------------------------------------------------------------------------------


def test_baked_objects_are_lit_by_their_bakes(saved, tmp_path):
    """A grey world alone. The floor's four corners know nothing of the box in its middle: a tenth too bright there."""
    bpy.data.lights["Spot"].energy = 0
    saved.rebound.samples, saved.rebound.bake_directions = 4, 1024
    live = picture(render(saved, tmp_path / "live.exr"))
    bpy.ops.rebound.bake_transfer(objects="ALL")
    saved.rebound.method = "NONE"
    found = picture(render(saved, tmp_path / "baked.exr"))
    assert abs(found - live)[..., :3].mean() < 0.1 * live[..., :3].mean()
    saved.rebound.transfer_use = False
    dark = picture(render(saved, tmp_path / "dark.exr"))
    assert dark[..., :3].mean() < 0.5 * found[..., :3].mean()


def test_glossy_bakes_reflect_the_world(saved, tmp_path):
    """A rough metal floor: what it mirrors of a grey world is as bright baked as live."""
    bpy.data.lights["Spot"].energy = 0
    shader = bpy.data.materials["Red"].node_tree.nodes["Principled BSDF"]
    shader.inputs["Metallic"].default_value, shader.inputs["Roughness"].default_value = 1.0, 0.8
    saved.rebound.samples, saved.rebound.bake_directions, saved.rebound.bake_kind = 8, 256, "GLOSSY"
    live = picture(render(saved, tmp_path / "live.exr"))[..., :3]
    bpy.ops.rebound.bake_transfer(objects="ALL")
    saved.rebound.method = "NONE"
    found = picture(render(saved, tmp_path / "baked.exr"))[..., :3]
    assert abs(found - live).mean() < 0.15 * live.mean()
