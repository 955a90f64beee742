"""Every kind of edit uploads what it changed and nothing else."""

import bmesh
import bpy
import numpy as np
import pytest

from rebound.session import Session
from rebound.tests.support.blender_build import CUBE, link, material, mesh, scatter_nodes

NOTHING = {}
PLACES = {"instances": 1}
LOOK = {"materials": 1}


class Watch:
    """A session that follows the open scene as a viewport does; ``uploads`` counts what one edit sends to the GPU."""

    def __init__(self):
        self.session = Session()
        self.uploads()

    def uploads(self, edit=lambda: None) -> dict[str, int]:
        """What is uploaded for an edit, and what for the same scene again: nothing."""
        edit()
        found = self._once()
        assert self._once() == {}
        return found

    def _once(self) -> dict[str, int]:
        gpu = self.session._ready()
        before = gpu.scene.uploads.copy()
        self.session.sync(bpy.context.evaluated_depsgraph_get(), for_viewport=True)
        gpu.upload(self.session.scene)
        return dict(gpu.scene.uploads - before)

    def changes_light(self, edit) -> bool:
        """Whether the picture is begun anew though nothing is uploaded."""
        revision = self.session._ready().scene.revision
        assert self.uploads(edit) == {}
        return self.session._ready().scene.revision > revision


@pytest.fixture
def watch(registered):
    """Three cubes of one mesh, a textured quad, a lamp, a world."""
    cube = mesh("Cube", CUBE)
    cube.materials.append(material("Red", (0.8, 0.1, 0.1)))
    for number in range(3):
        link(f"Cube {number}", cube, location=(3 * number, 0, 0))
    quad = mesh("Quad")
    quad.uv_layers.new(name="UVMap")
    quad.materials.append(textured())
    link("Quad", quad, location=(0, 5, 0))
    link("Lamp", bpy.data.lights.new("Lamp", "POINT"), location=(0, 0, 5))
    registered.world = bpy.data.worlds.new("World")
    made = Watch()
    yield made
    made.session.free()


def textured():
    made = material("Textured")
    node = made.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("Painted", 8, 8)
    made.node_tree.links.new(node.outputs["Color"], made.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    return made


def cube(number=0):
    return bpy.data.objects[f"Cube {number}"]


def activate(obj):
    bpy.context.view_layer.objects.active = obj
    for other in bpy.context.view_layer.objects:
        other.select_set(other == obj)


def mode(name):
    assert bpy.ops.object.mode_set(mode=name) == {"FINISHED"}


def push(data, amount=0.5):
    """Moves a mesh's first vertex, as a stroke of a brush does."""
    data.vertices[0].co.x += amount
    data.update()


def socket(name, value):
    bpy.data.materials["Red"].node_tree.nodes["Principled BSDF"].inputs[name].default_value = value


def paint():
    image = bpy.data.images["Painted"]
    image.pixels[0] = 1.0 - image.pixels[0]
    image.update()


def at_frame(frame):
    return lambda: bpy.context.scene.frame_set(frame)


def animate(owner, path, values, index=-1):
    """Keys at frames 1 and 11."""
    for frame, value in zip((1, 11), values, strict=True):
        if index >= 0:
            getattr(owner, path)[index] = value
        else:
            setattr(owner, path, value)
        owner.keyframe_insert(path, index=index, frame=frame)
    bpy.context.scene.frame_set(1)


# --- one edit of each kind -------------------------------------------------------------------------------------------

EDITS = {
    "nothing": (lambda: None, NOTHING),
    "selected": (lambda: activate(cube(1)), NOTHING),
    "renamed": (lambda: setattr(cube(), "name", "Other"), NOTHING),
    "moved": (lambda: setattr(cube().location, "x", 0.5), PLACES),
    "scaled": (lambda: setattr(cube(), "scale", (1, 1, 2)), PLACES),
    "mesh edited": (lambda: push(cube().data), {"meshes": 1, **PLACES}),
    "object added": (lambda: link("New", cube().data, location=(0, 9, 0)), PLACES),
    "object deleted": (lambda: bpy.data.objects.remove(cube(2)), PLACES),
    "object of a new mesh": (lambda: link("New", mesh("New")), {"meshes": 1, **PLACES}),
    "hidden": (lambda: cube(1).hide_set(True), PLACES),
    "unseen by the camera": (lambda: setattr(cube(1), "visible_camera", False), PLACES),
    "roughness": (lambda: socket("Roughness", 0.1), LOOK),
    "color": (lambda: socket("Base Color", (0, 1, 0, 1)), LOOK),
    "image painted": (paint, {"images": 1, **LOOK}),
    "image's colour space": (
        lambda: setattr(bpy.data.images["Painted"].colorspace_settings, "name", "Non-Color"),
        {"images": 1, **LOOK},
    ),
}


@pytest.mark.parametrize("name", EDITS)
def test_edit_uploads_what_it_changed(watch, name):
    edit, wanted = EDITS[name]
    assert watch.uploads(edit) == wanted


LIGHT_EDITS = {
    "lamp moved": lambda: setattr(bpy.data.objects["Lamp"].location, "x", 2),
    "lamp brighter": lambda: setattr(bpy.data.lights["Lamp"], "energy", 99),
    "lamp larger": lambda: setattr(bpy.data.lights["Lamp"], "shadow_soft_size", 2),
    "lamp hidden": lambda: bpy.data.objects["Lamp"].hide_set(True),
    "world's colour": lambda: (
        setattr(bpy.data.worlds["World"].node_tree.nodes["Background"].inputs["Strength"], "default_value", 3)
        if bpy.data.worlds["World"].node_tree
        else setattr(bpy.data.worlds["World"], "color", (1, 0, 0))
    ),
    "film": lambda: setattr(bpy.context.scene.render, "film_transparent", True),
}


@pytest.mark.parametrize("name", LIGHT_EDITS)
def test_light_begins_the_picture_anew_and_uploads_nothing(watch, name):
    assert watch.changes_light(LIGHT_EDITS[name])


# --- undo, modes -----------------------------------------------------------------------------------------------------


def test_undo_and_redo_of_a_move_upload_places_only(watch):
    bpy.ops.ed.undo_push(message="before")
    cube().location.x = 4
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="moved")
    assert watch.uploads() == PLACES
    bpy.ops.ed.undo()
    assert cube().location.x == 0
    assert watch.uploads() == PLACES
    bpy.ops.ed.redo()
    assert watch.uploads() == PLACES


def test_undo_of_an_edited_mesh_uploads_that_mesh(watch):
    bpy.ops.ed.undo_push(message="before")
    push(cube().data)
    bpy.ops.ed.undo_push(message="edited")
    assert watch.uploads() == {"meshes": 1, **PLACES}
    bpy.ops.ed.undo()
    assert watch.uploads() == {"meshes": 1, **PLACES}


def test_edit_mode_uploads_its_mesh_when_it_changes(watch):
    activate(cube())
    watch.uploads(lambda: mode("EDIT"))
    assert watch.uploads() == NOTHING

    def extrude():
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.extrude_faces_move(TRANSFORM_OT_shrink_fatten={"value": 0.3})

    assert watch.uploads(extrude) == {"meshes": 1, **PLACES}

    def by_script():
        made = bmesh.from_edit_mesh(cube().data)
        made.verts.ensure_lookup_table()
        made.verts[0].co.z += 1
        bmesh.update_edit_mesh(cube().data)

    assert watch.uploads(by_script) == {"meshes": 1, **PLACES}
    assert watch.uploads(lambda: bpy.ops.mesh.select_all(action="DESELECT")) == NOTHING
    mode("OBJECT")


@pytest.mark.parametrize("name", ["SCULPT", "WEIGHT_PAINT", "VERTEX_PAINT", "TEXTURE_PAINT"])
def test_mode_and_back_leave_the_other_meshes(watch, name):
    activate(bpy.data.objects["Quad"])
    for wanted in (name, "OBJECT"):
        assert watch.uploads(lambda wanted=wanted: mode(wanted)).get("meshes", 0) <= 1
        assert watch.uploads() == NOTHING


def test_sculpting_uploads_the_sculpted_mesh(watch):
    activate(cube())
    mode("SCULPT")
    watch.uploads()
    for _ in range(3):
        assert watch.uploads(lambda: push(cube().data)) == {"meshes": 1, **PLACES}
    mode("OBJECT")


# --- frames ----------------------------------------------------------------------------------------------------------


def test_still_scene_uploads_nothing_for_another_frame(watch):
    assert watch.uploads(at_frame(7)) == NOTHING


def test_keyed_object_uploads_its_place(watch):
    animate(cube(), "location", (0, 5), index=0)
    watch.uploads()
    for frame in (4, 9, 1):
        assert watch.uploads(at_frame(frame)) == PLACES


def test_driven_object_uploads_its_place(watch):
    curve = cube(1).driver_add("location", 2)
    curve.driver.expression = "frame / 10"
    watch.uploads()
    assert watch.uploads(at_frame(5)) == PLACES


def test_animated_material_uploads_materials(watch):
    tree = bpy.data.materials["Red"].node_tree
    animate(tree.nodes["Principled BSDF"].inputs["Roughness"], "default_value", (0.1, 0.9))
    watch.uploads()
    assert watch.uploads(at_frame(6)) == LOOK


def test_shape_key_uploads_its_mesh(watch):
    key = cube().shape_key_add(name="Basis") and cube().shape_key_add(name="Tall")
    for point in key.data:
        point.co.z *= 3
    animate(key, "value", (0, 1))
    watch.uploads()
    for frame in (3, 8):
        # The key is the mesh's, which all three cubes have: one upload.
        assert watch.uploads(at_frame(frame)) == {"meshes": 1, **PLACES}
    heights = [np.ptp(m.positions[:, 2]) for m in watch.session.scene.meshes.values()]
    assert max(heights) == pytest.approx(2 + 4 * cube().data.shape_keys.key_blocks["Tall"].value, rel=1e-4)


def test_armature_uploads_the_mesh_that_it_bends(watch):
    skeleton = bpy.data.armatures.new("Skeleton")
    rig = link("Rig", skeleton)
    activate(rig)
    mode("EDIT")
    bone = skeleton.edit_bones.new("Bone")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    mode("OBJECT")
    cube().data = cube().data.copy()
    cube().vertex_groups.new(name="Bone").add(range(8), 1.0, "REPLACE")
    modifier = cube().modifiers.new("Armature", "ARMATURE")
    modifier.object = rig
    pose = rig.pose.bones["Bone"]
    animate(pose, "location", (0, 4), index=1)
    watch.uploads()
    assert watch.uploads(at_frame(11)) == {"meshes": 1, **PLACES}
    tops = [mesh.positions[:, 2].max() for mesh in watch.session.scene.meshes.values()]
    assert max(tops) == pytest.approx(5, abs=1e-4)


def test_geometry_nodes_upload_places_or_meshes(watch):
    tree = scatter_nodes(cube(2))
    grid = next(node for node in tree.nodes if node.bl_idname == "GeometryNodeMeshGrid")
    animate(grid.inputs["Size X"], "default_value", (1, 3))
    watch.uploads()
    moved = watch.uploads(at_frame(6))
    # The nodes make their cube anew in each evaluation: Blender gives it another name.
    assert moved.get("meshes", 0) <= 1 and moved["instances"] == 1
    places = {round(float(i.world_from_object[0, 3]) - 6, 3) for i in watch.session.scene.instances}
    assert {-1.0, 1.0} & places


def test_physics_cache_plays_back(watch):
    cube().data = cube().data.copy()
    cube().modifiers.new("Cloth", "CLOTH")
    watch.uploads()
    tops = []
    for frame in (2, 3, 4):
        assert watch.uploads(at_frame(frame)) == {"meshes": 1, **PLACES}
        tops.append(min(float(m.positions[:, 2].min()) for m in watch.session.scene.meshes.values()))
    assert tops[2] < tops[1] < tops[0]
