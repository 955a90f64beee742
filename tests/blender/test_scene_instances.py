"""Instances of every sort are found where Blender shows them, and take part in what their visibility says."""

import bpy
import numpy as np
import pytest

from rebound.scene.changes import Changes
from rebound.scene.convert import convert_scene
from rebound.scene.data import Visibility
from rebound.tests.support.blender_build import CUBE, collection, convert, link, mesh, scatter_nodes, shader_material
from rebound.tests.support.engine_build import picture, render
from rebound.tests.support.probe_engine import probe_engine

pytestmark = pytest.mark.usefixtures("clean_scene")

EVERYTHING = Visibility.CAMERA | Visibility.SHADOW | Visibility.BOUNCE


def places(scene):
    return sorted(tuple(np.round(instance.world_from_object[:3, 3], 4)) for instance in scene.instances)


def keys(scene):
    return [instance.key for instance in scene.instances]


def checked(scene):
    """The scene, after what holds for all of them: keys are unique and hashable, meshes and materials exist."""
    assert len(set(keys(scene))) == len(scene.instances)
    for instance in scene.instances:
        assert instance.mesh in scene.meshes
        assert max(instance.materials) < len(scene.materials)
        assert len(instance.materials) > scene.meshes[instance.mesh].slots[-1][0]
    return scene


def instancer(made, **settings):
    return link("Instancer", None, instance_type="COLLECTION", instance_collection=made, **settings)


def test_linked_duplicates_share_their_mesh():
    data = mesh()
    link("A", data)
    link("B", data, location=(2, 0, 0))
    scene = checked(convert())
    assert len(scene.meshes) == 1 and places(scene) == [(0, 0, 0), (2, 0, 0)]


def test_collection_instances_are_placed():
    made = collection("Things", mesh("A"), mesh("B", CUBE))
    instancer(made, location=(5, 0, 0))
    instancer(made, location=(0, 5, 0), scale=(-1, 1, 1))
    scene = checked(convert())
    assert len(scene.meshes) == 2 and places(scene) == [(0, 5, 0), (0, 5, 0), (5, 0, 0), (5, 0, 0)]
    assert sorted(np.sign(np.linalg.det(i.world_from_object[:3, :3])) for i in scene.instances) == [-1, -1, 1, 1]


def test_nested_collection_instances_are_placed():
    inner = collection("Inner", mesh())
    outer = bpy.data.collections.new("Outer")
    for x in (0, 1):
        link("Nested", None, outer, instance_type="COLLECTION", instance_collection=inner, location=(x, 0, 0))
    instancer(outer, location=(0, 0, 3))
    assert places(checked(convert())) == [(0, 0, 3), (1, 0, 3)]


def test_lights_in_collection_instances_are_lights():
    lamp = bpy.data.lights.new("Lamp", "POINT")
    instancer(collection("Lamps", lamp), location=(1, 2, 3))
    instancer(bpy.data.collections["Lamps"], location=(4, 5, 6))
    lights = convert().lights
    assert len({light.key for light in lights}) == 2
    assert sorted(tuple(light.world_from_light[:3, 3]) for light in lights) == [(1, 2, 3), (4, 5, 6)]


def test_geometry_nodes_instances_are_placed():
    scatter_nodes(link("Host", mesh(), location=(10, 0, 0)))
    scene = checked(convert())
    assert len(scene.meshes) == 1
    assert places(scene) == [(9.5, -0.5, 0), (9.5, 0.5, 0), (10.5, -0.5, 0), (10.5, 0.5, 0)]


def test_geometry_nodes_instances_of_a_collection_are_placed():
    scatter_nodes(link("Host", mesh()), scattered=collection("Things", mesh("A", CUBE), mesh("B")))
    scene = checked(convert())
    assert len(scene.meshes) == 2 and len(scene.instances) == 8


def test_geometry_nodes_instances_keep_key_and_mesh_while_the_host_moves():
    host = link("Host", mesh())
    scatter_nodes(host)
    first = convert()
    host.location.x = 3
    second = convert(previous=first)
    assert keys(first) == keys(second) and len(first.instances) == 4
    assert all(second.meshes[key] is first.meshes[key] for key in first.meshes)
    assert len(Changes.between(first, second).moved_bounds) == 8


def test_particles_show_their_object():
    emitter = link("Emitter", mesh())
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 7, 1
    settings.render_type = "OBJECT"
    settings.instance_object = link("Leaf", mesh("Leaf", CUBE), location=(50, 0, 0))
    settings.particle_size = 0.1
    emitter.show_instancer_for_viewport = False
    scene = checked(convert(for_viewport=True))
    assert len(scene.instances) == 8  # seven particles and the leaf itself, without the hidden emitter


@pytest.mark.parametrize(("kind", "count"), [("VERTS", 4), ("FACES", 1)])
def test_instancing_on_vertices_and_faces(kind, count):
    parent = link("Parent", mesh())
    child = link("Child", mesh("Child", CUBE))
    child.parent = parent
    parent.instance_type = kind
    scene = checked(convert(for_viewport=True))
    cubes = [i for i in scene.instances if scene.meshes[i.mesh].triangle_count == 12]
    assert len(cubes) == count + 1  # Blender also shows the child itself
    assert len(scene.instances) == count + 2
    parent.show_instancer_for_viewport = False
    assert len(checked(convert(for_viewport=True)).instances) == count + 1


def test_linked_library_objects_are_read(tmp_path):
    path = str(tmp_path / "library.blend")
    made = collection("Shelf", mesh("Book", CUBE))
    bpy.data.libraries.write(path, {made}, fake_user=True)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, target):
        target.collections = ["Shelf"]
    linked = bpy.data.collections["Shelf"]
    assert linked.library
    instancer(linked, location=(1, 1, 1))
    bpy.context.scene.collection.children.link(linked)
    scene = checked(convert())
    assert len(scene.meshes) == 1 and places(scene) == [(0, 0, 0), (1, 1, 1)]


def test_many_objects_share_one_mesh():
    data = mesh()
    for i in range(2000):
        link(f"Quad{i}", data, location=(i, 0, 0))
    scene = checked(convert())
    assert len(scene.instances) == 2000 and len(scene.meshes) == 1


# Visibility


def single(**settings):
    obj = link("Quad", mesh())
    for name, value in settings.items():
        setattr(obj, name, value)
    instances = convert().instances
    return instances[0].visibility if instances else None


def test_plain_object_takes_part_in_everything():
    assert single() == EVERYTHING


@pytest.mark.parametrize(
    ("setting", "missing"),
    [
        ("visible_camera", Visibility.CAMERA),
        ("visible_shadow", Visibility.SHADOW),
        ("visible_diffuse", Visibility.BOUNCE),
    ],
)
def test_ray_visibility_takes_one_part_away(setting, missing):
    assert single(**{setting: False}) == EVERYTHING & ~missing


def test_object_invisible_to_all_is_left_out():
    assert single(visible_camera=False, visible_shadow=False, visible_diffuse=False) is None


def test_instancer_hides_what_it_places():
    instancer(collection("Things", mesh()), visible_camera=False)
    assert convert().instances[0].visibility == EVERYTHING & ~Visibility.CAMERA


def test_hide_flags_follow_the_mode():
    link("Viewport only", mesh(), hide_render=True)
    link("Render only", mesh(), hide_viewport=True, location=(1, 0, 0))
    assert places(convert(for_viewport=True)) == [(0, 0, 0)]  # the context's depsgraph is the viewport's


def test_eye_icon_hides_in_the_viewport():
    link("Quad", mesh()).hide_set(True)
    assert convert(for_viewport=True).instances == ()


def test_bounds_display_is_shown():
    assert single(display_type="BOUNDS") == EVERYTHING


def test_shadow_catcher_is_shown_and_named():
    single(is_shadow_catcher=True)
    (line,) = convert().warnings
    assert "shadow catcher" in line and line.startswith("Object '")


def test_holdout_object():
    assert single(is_holdout=True) == EVERYTHING | Visibility.HOLDOUT


def in_layer_collection():
    made = collection("Layer", mesh())
    bpy.context.scene.collection.children.link(made)
    return bpy.context.view_layer.layer_collection.children["Layer"]


def test_holdout_collection():
    in_layer_collection().holdout = True
    assert convert().instances[0].visibility == EVERYTHING | Visibility.HOLDOUT


def test_indirect_only_collection():
    in_layer_collection().indirect_only = True
    assert convert().instances[0].visibility == Visibility.SHADOW | Visibility.BOUNCE


def test_excluded_collection():
    in_layer_collection().exclude = True
    assert convert().instances == ()


def test_visible_callback_is_asked_about_the_placing_object():
    instancer(collection("Things", mesh()))
    link("Quad", mesh())
    asked = []

    def visible(obj):
        asked.append(obj)
        return obj.name == "Quad"

    scene = convert_scene(bpy.context.evaluated_depsgraph_get(), for_viewport=True, visible=visible)
    assert len(scene.instances) == 1
    assert {obj.name for obj in asked} == {"Instancer", "Quad"}
    assert all(not obj.is_evaluated for obj in asked)


def test_material_override_of_the_view_layer_is_worn_by_all():
    link("Quad", mesh())
    bpy.context.view_layer.material_override = bpy.data.materials.new("Clay")
    scene = convert()
    assert scene.materials[scene.instances[0].materials[0]].name == "Clay"


# Final renders have a depsgraph of their own


def final_scene(**options):
    """What a render engine converts in render()."""
    camera = link("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.camera = camera
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y = 8
    with probe_engine(lambda _, depsgraph: convert_scene(depsgraph, for_viewport=False, **options)) as run:
        return checked(run())


def test_final_render_has_its_own_hidden_objects_and_modifier_levels():
    link("Viewport only", mesh(), hide_render=True)
    shown = link("Render only", mesh(shape=CUBE), hide_viewport=True, location=(1, 0, 0))
    subdivision = shown.modifiers.new("Subdivision", "SUBSURF")
    subdivision.levels, subdivision.render_levels = 0, 2
    scene = final_scene()
    assert places(scene) == [(1, 0, 0)]
    assert scene.meshes[scene.instances[0].mesh].triangle_count == 6 * 16 * 2


def test_final_render_sees_layer_holdout_and_indirect_only():
    in_layer_collection().holdout = True
    other = collection("Other", mesh("Other"))
    bpy.context.scene.collection.children.link(other)
    bpy.context.view_layer.layer_collection.children["Other"].indirect_only = True
    found = {instance.visibility for instance in final_scene().instances}
    assert found == {EVERYTHING | Visibility.HOLDOUT, Visibility.SHADOW | Visibility.BOUNCE}


def test_final_render_follows_the_instancers_own_switch():
    host = link("Host", mesh(), show_instancer_for_render=False)
    host.instance_type = "FACES"
    link("Child", mesh("Child", CUBE)).parent = host
    scene = final_scene()
    assert [found.triangle_count for found in scene.meshes.values()] == [12]


def test_second_final_render_matches_the_first():
    """Each render evaluates anew, so meshes have new keys; the instances keep theirs."""
    scatter_nodes(link("Host", mesh()))
    first, second = final_scene(), final_scene()
    assert keys(first) == keys(second) and places(first) == places(second)


def test_random_numbers_of_objects_are_those_of_cycles(clean_scene, tmp_path):
    """Object Info's Random of an object, by its name, and of an instance."""
    scene = clean_scene
    made, emission = shader_material("Random", "ShaderNodeEmission")
    info = made.node_tree.nodes.new("ShaderNodeObjectInfo")
    made.node_tree.links.new(info.outputs["Random"], emission.inputs["Strength"])
    data = mesh("Random")
    data.materials.append(made)
    cells = [link("Tree.001", data, location=(0, 0, 0)), link("Hütte", data, location=(4, 0, 0))]
    inside = collection("Inside", data)
    cells.append(link("Instancer", None, location=(8, 0, 0), instance_type="COLLECTION", instance_collection=inside))
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", 12
    scene.camera = link("Camera", camera, location=(4, 0, 5))
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 1, False
    scene.render.resolution_x, scene.render.resolution_y = 120, 40
    truth = picture(render(scene, tmp_path / "random.exr"))[20, [20, 60, 100], 0]
    found = sorted(convert().instances, key=lambda i: i.world_from_object[0, 3])
    np.testing.assert_allclose([i.random for i in found], truth, atol=1e-5)
    assert len(set(truth.tolist())) == 3
