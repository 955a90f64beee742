"""Changes.between names exactly what differs, so that nothing else is uploaded or redrawn."""

from dataclasses import replace

import numpy as np

from rebound.scene.changes import Changes, world_bounds
from rebound.scene.data import Image, Instance, Light, LightKind, Material, Mesh, Scene, Visibility, World

EVERYTHING = Visibility.CAMERA | Visibility.SHADOW | Visibility.BOUNCE


def mesh(key="cube"):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 3]], np.float32)
    bounds = np.stack((points.min(axis=0), points.max(axis=0)))
    return Mesh(key, points, np.zeros_like(points), {}, "", ((0, 0, 1),), bounds)


def at(x=0.0, y=0.0, z=0.0):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def instance(key="a", x=0.0, mesh_key="cube", materials=(0,), visibility=EVERYTHING):
    return Instance(key, mesh_key, materials, at(x), visibility)


def light(key="lamp", power=(1.0, 1.0, 1.0), x=0.0):
    return Light(key, "Lamp", LightKind.POINT, power, at(x))


def scene(*instances, **fields):
    return Scene(meshes={"cube": mesh()}, instances=instances or (instance(),), **fields)


def test_equal_scenes_differ_in_nothing():
    changes = Changes.between(scene(lights=(light(),)), scene(lights=(light(),)))
    assert not changes.any
    assert not changes.geometry
    assert changes.moved_bounds.shape == (0, 2, 3)


def test_first_scene_is_all_new():
    picture = Image("image", "image", np.zeros((1, 1, 4), np.float32))
    changes = Changes.between(None, scene(lights=(light(),), images={"image": picture}))
    assert changes.meshes_added == {"cube"}
    assert changes.images_added == {"image"}
    assert changes.lights == {"lamp"}
    assert changes.instances and changes.materials and changes.world and changes.film
    assert len(changes.moved_bounds) == 1


def test_first_empty_scene_is_something():
    assert Changes.between(None, Scene()).any


def test_moved_instance_gives_its_old_and_new_box():
    changes = Changes.between(scene(instance(x=0)), scene(instance(x=5)))
    assert changes.instances and changes.geometry
    assert not (changes.meshes_added or changes.meshes_removed or changes.materials or changes.lights)
    np.testing.assert_allclose(changes.moved_bounds, [[[0, 0, 0], [1, 2, 3]], [[5, 0, 0], [6, 2, 3]]])


def test_only_the_moved_instance_is_in_the_boxes():
    old = scene(instance("a"), instance("b", x=9))
    new = scene(instance("a"), instance("b", x=10))
    assert [box[0, 0] for box in Changes.between(old, new).moved_bounds] == [9, 10]


def test_added_and_removed_instances_give_one_box_each():
    one, two = scene(instance("a")), scene(instance("a"), instance("b", x=3))
    for changes in (Changes.between(one, two), Changes.between(two, one)):
        assert changes.instances
        np.testing.assert_allclose(changes.moved_bounds[:, 0], [[3, 0, 0]])


def test_edited_mesh_is_one_added_and_one_removed():
    new = Scene(meshes={"cube2": mesh("cube2")}, instances=(instance(mesh_key="cube2"),))
    changes = Changes.between(scene(), new)
    assert changes.meshes_added == {"cube2"} and changes.meshes_removed == {"cube"}
    assert changes.geometry and len(changes.moved_bounds) == 2


def test_visibility_change_is_an_instance_change():
    changes = Changes.between(scene(), scene(instance(visibility=Visibility.SHADOW)))
    assert changes.instances and len(changes.moved_bounds) == 2


def test_recoloured_material_marks_who_wears_it():
    old = scene(
        instance("a", materials=(0,)), instance("b", x=7, materials=(1,)), materials=(Material("X"), Material("Y"))
    )
    red = replace(Material("Y"), base_color=(1.0, 0.0, 0.0))
    new = scene(instance("a", materials=(0,)), instance("b", x=7, materials=(1,)), materials=(Material("X"), red))
    changes = Changes.between(old, new)
    assert changes.materials and not changes.geometry
    assert {box[0, 0] for box in changes.moved_bounds} == {7.0}


def test_a_material_that_lamps_see_one_side_of_blocks_light_otherwise():
    plain, culled = Material("m"), Material("m", culled_by_lamps=True)
    for old, new, count in ((plain, culled, 2), (culled, plain, 2), (plain, replace(plain, culled=True), 0)):
        changes = Changes.between(scene(materials=(old,)), scene(materials=(new,)))
        assert changes.materials and len(changes.moved_bounds) == 2
        assert len(changes.shape_bounds) == count


def test_renumbered_materials_change_instances_but_no_picture():
    old = scene(instance(materials=(0,)), materials=(Material("X"), Material("Y")))
    new = scene(instance(materials=(1,)), materials=(Material("Y"), Material("X")))
    changes = Changes.between(old, new)
    assert changes.instances and changes.materials
    assert len(changes.moved_bounds) == 0  # no light map is redrawn because a material was added before it


def test_light_edit_names_that_light_only():
    old = scene(lights=(light("a"), light("b"), light("gone")))
    new = scene(lights=(light("a"), light("b", power=(2.0, 1.0, 1.0)), light("new")))
    changes = Changes.between(old, new)
    assert changes.lights == {"b", "gone", "new"}
    assert not changes.geometry and len(changes.moved_bounds) == 0


def test_moved_light_is_named():
    assert Changes.between(scene(lights=(light(),)), scene(lights=(light(x=1),))).lights == {"lamp"}


def test_world_and_film_are_named():
    changes = Changes.between(scene(), scene(world=World((1, 1, 1))))
    assert changes.world and not changes.film
    changes = Changes.between(scene(), scene(film_transparent=True))
    assert changes.film and not changes.world
    assert Changes.between(scene(), scene(filter_width=2.0)).film


def test_warnings_alone_change_nothing():
    assert not Changes.between(scene(), scene(warnings=("hello",))).any


def test_reordered_instances_are_a_change():
    """The GPU's instance table is in the scene's order."""
    a, b = instance("a"), instance("b", x=2)
    changes = Changes.between(scene(a, b), scene(b, a))
    assert changes.instances and len(changes.moved_bounds) == 0


def test_world_bounds_follow_rotation_and_mirroring():
    matrix = at(1, 2, 3)
    matrix[:3, :3] = [[0, -2, 0], [1, 0, 0], [0, 0, -1]]
    box = world_bounds(Instance("a", "cube", (0,), matrix, EVERYTHING), scene())
    np.testing.assert_allclose(box, [[-3, 2, 0], [1, 3, 3]])
