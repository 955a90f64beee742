"""After an edit matrices alone are read where only things moved, and what is found is what a whole reading finds."""

import bpy
import numpy as np
import pytest

from rebound.scene.changes import Changes
from rebound.scene.convert import SceneReader, convert_scene
from rebound.scene.follow import SceneFollower
from rebound.tests.support.blender_build import CUBE, collection, link, material, mesh, scatter_nodes

pytestmark = pytest.mark.usefixtures("clean_scene")


class Follow:
    """Follows the open scene as a viewport does: from a handler, where Blender says what it updated."""

    def __init__(self, monkeypatch):
        self.follower, self.whole, self.error = SceneFollower(), 0, None
        self.shows = ()
        original = SceneReader.add_all

        def counted(reader):
            self.whole += 1
            original(reader)

        self._patch = monkeypatch
        monkeypatch.setattr(SceneReader, "add_all", counted)
        self._handler = lambda _scene, depsgraph: self._sync(depsgraph)
        bpy.app.handlers.depsgraph_update_post.append(self._handler)
        bpy.app.handlers.frame_change_post.append(self._handler)
        self._sync(bpy.context.evaluated_depsgraph_get())

    def _sync(self, depsgraph):
        try:
            self.follower.read(depsgraph, for_viewport=True, shows=self.shows)
        except Exception as error:  # noqa: BLE001  a handler's exceptions are only printed: kept for `after`
            self.error = error

    def after(self, edit) -> tuple[int, Changes]:
        """How often the scene was read as a whole for an edit, and what changed; it must be what is really there."""
        before, count = self.follower.scene, self.whole
        edit()
        bpy.context.view_layer.update()
        if self.error:
            raise self.error
        count = self.whole - count
        there = convert_scene(bpy.context.evaluated_depsgraph_get(), for_viewport=True)
        assert not Changes.between(self.follower.scene, there).any
        return count, Changes.between(before, self.follower.scene)

    def stop(self):
        bpy.app.handlers.depsgraph_update_post.remove(self._handler)
        bpy.app.handlers.frame_change_post.remove(self._handler)


@pytest.fixture
def follow(monkeypatch):
    shape = mesh("Cube", CUBE)
    shape.materials.append(material("Red", (0.8, 0.1, 0.1)))
    for number in range(5):
        link(f"Cube {number}", shape, location=(3 * number, 0, 0))
    link("Lamp", bpy.data.lights.new("Lamp", "AREA"), location=(0, 0, 5))
    link("Camera", bpy.data.cameras.new("Camera"))
    made = Follow(monkeypatch)
    yield made
    made.stop()


def shift(name, x=1.0):
    return lambda: setattr(bpy.data.objects[name].location, "x", bpy.data.objects[name].location.x + x)


def test_moved_object_is_followed_without_reading_the_scene(follow):
    for _ in range(3):
        whole, changes = follow.after(shift("Cube 1"))
        assert whole == 0 and changes.instances and not changes.meshes_added
        assert len(changes.moved_bounds) == 2


def test_moved_light_and_camera_are_followed(follow):
    whole, changes = follow.after(shift("Lamp"))
    assert whole == 0 and len(changes.lights) == 1 and not changes.geometry
    whole, changes = follow.after(shift("Camera"))
    assert whole == 0 and not changes.any


def test_scaled_area_light_is_read_anew(follow):
    whole, changes = follow.after(lambda: setattr(bpy.data.objects["Lamp"], "scale", (2, 2, 2)))
    assert whole == 0 and len(changes.lights) == 1


def test_viewport_that_shows_other_objects_reads_the_scene(follow):
    for shows, whole in (((True,), 1), ((True,), 0), (None, 1), (None, 1), ((), 1), ((), 0)):
        follow.shows = shows
        assert follow.after(shift("Cube 1"))[0] == whole


def test_child_moves_with_its_parent(follow):
    follow.after(lambda: setattr(bpy.data.objects["Cube 2"], "parent", bpy.data.objects["Cube 1"]))
    whole, changes = follow.after(shift("Cube 1"))
    assert whole == 0 and len(changes.moved_bounds) == 4


def test_member_of_an_instanced_collection_moves_everywhere(follow):
    things = collection("Things", bpy.data.meshes["Cube"])
    for x in (0, 10):
        link("Instancer", None, instance_type="COLLECTION", instance_collection=things, location=(x, 9, 0))
    follow.after(lambda: None)
    _, changes = follow.after(lambda: setattr(things.objects[0].location, "z", 2))
    assert len(changes.moved_bounds) == 4 and not changes.meshes_added


def test_moved_instancer_moves_what_it_places(follow):
    scatter_nodes(bpy.data.objects["Cube 3"])
    follow.after(lambda: None)
    _, changes = follow.after(shift("Cube 3"))
    assert len(changes.moved_bounds) == 8 and not changes.meshes_added


EDITS = {
    "hidden": lambda: bpy.data.objects["Cube 1"].hide_set(True),
    "moved and unseen": lambda: (shift("Cube 1")(), setattr(bpy.data.objects["Cube 1"], "visible_camera", False)),
    "deleted": lambda: bpy.data.objects.remove(bpy.data.objects["Cube 1"]),
    "added": lambda: link("New", bpy.data.meshes["Cube"], location=(0, 7, 0)),
    "other mesh": lambda: (shift("Cube 1")(), setattr(bpy.data.objects["Cube 1"], "data", mesh("Quad"))),
    "other material": lambda: (
        shift("Cube 1")(),
        setattr(bpy.data.objects["Cube 1"].material_slots[0], "material", material("Blue", (0, 0, 1))),
    ),
    "recoloured": lambda: (
        shift("Cube 1")(),
        bpy.data.materials["Red"]
        .node_tree.nodes["Principled BSDF"]
        .inputs["Roughness"]
        .__setattr__("default_value", 0.1),
    ),
    "brighter": lambda: setattr(bpy.data.lights["Lamp"], "energy", 99),
    "lost": lambda: setattr(bpy.data.objects["Cube 1"].location, "x", float("inf")),
    "world": lambda: setattr(bpy.context.scene, "world", bpy.data.worlds.new("World")),
}


@pytest.mark.parametrize("edit", EDITS)
def test_other_edits_read_the_scene(follow, edit):
    whole, changes = follow.after(EDITS[edit])
    assert whole >= 1 and changes.any


def test_lost_object_comes_back(follow):
    follow.after(EDITS["lost"])
    _, changes = follow.after(lambda: setattr(bpy.data.objects["Cube 1"].location, "x", 1.0))
    assert len(changes.moved_bounds) == 1


def test_row_of_random_edits_is_followed(follow):
    rng = np.random.default_rng(3)
    for number in range(12):
        names = [obj.name for obj in bpy.data.objects if obj.name.startswith("Cube")]
        name = names[rng.integers(len(names))]
        kind = rng.integers(4)
        follow.after(
            [
                shift(name),
                lambda name=name, number=number: bpy.data.objects[name].hide_set(bool(number % 2)),
                lambda name=name: setattr(bpy.data.objects[name], "rotation_euler", rng.random(3)),
                lambda number=number: link(f"Cube new {number}", bpy.data.meshes["Cube"], location=(number, 5, 0)),
            ][kind]
        )


def test_frames_of_an_animation_are_followed(follow):
    obj = bpy.data.objects["Cube 1"]
    for frame, x in ((1, 0.0), (5, 8.0)):
        obj.location.x = x
        obj.keyframe_insert("location", frame=frame)
    follow.after(lambda: bpy.context.scene.frame_set(1))
    _, changes = follow.after(lambda: bpy.context.scene.frame_set(3))
    assert len(changes.moved_bounds) == 2 and not changes.meshes_added
