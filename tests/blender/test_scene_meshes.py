"""Every kind of object becomes triangles with the right corners, normals, UVs and slots; bad ones are harmless."""

import math

import bpy
import numpy as np
import pytest

from rebound.scene.changes import Changes
from rebound.tests.support.blender_build import CUBE, QUAD, convert, link, material, mesh, scatter_nodes

pytestmark = pytest.mark.usefixtures("clean_scene")


def only_mesh(scene):
    assert len(scene.instances) == 1
    return scene.meshes[scene.instances[0].mesh]


def area(found):
    a, b, c = found.positions.reshape(-1, 3, 3).transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def check(found):
    """What every Mesh promises."""
    count = len(found.positions)
    assert count == 3 * found.triangle_count and count > 0
    assert found.positions.dtype == found.normals.dtype == np.float32
    assert found.positions.flags.c_contiguous and found.normals.flags.c_contiguous
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1, atol=1e-3)
    assert all(uv.shape == (count, 2) and uv.dtype == np.float32 for uv in found.uvs.values())
    assert [slot for slot, _, _ in found.slots] == sorted({slot for slot, _, _ in found.slots})
    assert [first for _, first, _ in found.slots] == list(np.cumsum([0] + [n for _, _, n in found.slots])[:-1])
    assert sum(n for _, _, n in found.slots) == found.triangle_count
    np.testing.assert_array_equal(found.bounds, [found.positions.min(axis=0), found.positions.max(axis=0)])


def closed_curve():
    curve = bpy.data.curves.new("Curve", "CURVE")
    spline = curve.splines.new("POLY")
    spline.points.add(3)
    for point, co in zip(spline.points, QUAD[0], strict=True):
        point.co = (*co, 1)
    spline.use_cyclic_u = True
    return curve


def filled_curve():
    curve = closed_curve()
    curve.dimensions, curve.fill_mode = "2D", "BOTH"
    return curve


def bevelled_curve():
    curve = closed_curve()
    curve.dimensions, curve.bevel_depth = "3D", 0.1
    return curve


def text():
    data = bpy.data.curves.new("Text", "FONT")
    data.body = "GI"
    return data


def metaball():
    ball = bpy.data.metaballs.new("Ball")
    ball.resolution = ball.render_resolution = 0.5
    ball.elements.new()
    return ball


def surface_object():
    """A patch: rows of NURBS points are joined by an operator only."""
    bpy.ops.surface.primitive_nurbs_surface_surface_add()
    return bpy.context.object


def test_mesh_keeps_positions_and_area():
    link("Cube", mesh(shape=CUBE))
    found = only_mesh(convert())
    check(found)
    assert found.triangle_count == 12 and area(found) == pytest.approx(24)


@pytest.mark.parametrize("kind", ["filled curve", "bevelled curve", "text", "metaball", "surface"])
def test_objects_that_evaluate_to_a_mesh_are_read_once(kind):
    if kind == "surface":
        surface_object()
    else:
        makers = {"filled curve": filled_curve, "bevelled curve": bevelled_curve, "text": text, "metaball": metaball}
        link("Object", makers[kind]())
    scene = convert()
    found = only_mesh(scene)
    check(found)
    if kind == "filled curve":
        assert area(found) == pytest.approx(4)
    assert not Changes.between(scene, convert(previous=scene)).any


def test_metaball_family_is_one_mesh():
    """Metaballs of one family melt together into the base object."""
    link("Ball", metaball())
    link("Ball.001", metaball(), location=(1.5, 0, 0))
    found = only_mesh(convert())
    assert found.bounds[1, 0] > 2


def test_curve_without_faces_is_nothing():
    curve = bpy.data.curves.new("Path", "CURVE")
    curve.splines.new("POLY").points.add(1)
    link("Path", curve)
    assert convert().instances == ()


def test_unshown_object_types_are_named():
    link("Fog", bpy.data.volumes.new("Fog"))
    assert any("'Fog'" in line for line in convert().warnings)


def test_modifiers_are_applied():
    obj = link("Quad", mesh())
    obj.modifiers.new("Array", "ARRAY").count = 3
    assert area(only_mesh(convert())) == pytest.approx(12)


def test_render_and_viewport_take_their_own_modifier_settings():
    obj = link("Cube", mesh(shape=CUBE))
    subdivision = obj.modifiers.new("Subdivision", "SUBSURF")
    subdivision.levels, subdivision.render_levels = 0, 2
    assert only_mesh(convert(for_viewport=True)).triangle_count == 12  # the context's depsgraph is the viewport's


def test_flat_and_smooth_normals():
    data = mesh(shape=CUBE)
    link("Cube", data)
    flat = only_mesh(convert())
    assert np.abs(flat.normals).max(axis=1) == pytest.approx(1, abs=1e-3)
    data.shade_smooth()
    smooth = only_mesh(convert())
    np.testing.assert_allclose(smooth.normals, smooth.positions / math.sqrt(3), atol=2e-3)


def test_sharp_edges_split_normals():
    data = mesh(shape=CUBE)
    data.shade_smooth()
    for edge in data.edges:
        edge.use_edge_sharp = True
    data.update()
    link("Cube", data)
    assert np.abs(only_mesh(convert()).normals).max(axis=1) == pytest.approx(1, abs=1e-3)


def test_custom_normals_are_kept():
    data = mesh()
    data.normals_split_custom_set([(0.6, 0, 0.8)] * 4)
    link("Quad", data)
    np.testing.assert_allclose(only_mesh(convert()).normals, [(0.6, 0, 0.8)] * 6, atol=1e-3)


def test_transform_is_kept_as_it_is():
    link("Quad", mesh(), scale=(-2, 3, 0.5), location=(1, 2, 3))
    matrix = convert().instances[0].world_from_object
    np.testing.assert_allclose(matrix, [[-2, 0, 0, 1], [0, 3, 0, 2], [0, 0, 0.5, 3], [0, 0, 0, 1]], atol=1e-6)
    assert matrix.dtype == np.float64


def test_uv_maps_and_the_one_marked_for_render():
    data = mesh()
    for number, name in enumerate(("First", "Second")):
        layer = data.uv_layers.new(name=name)
        for corner, entry in enumerate(layer.uv):
            entry.vector = (corner, number)
    data.uv_layers["Second"].active_render = True
    link("Quad", data)
    found = only_mesh(convert())
    check(found)
    assert set(found.uvs) == {"First", "Second"} and found.active_uv == "Second"
    corner_of = {tuple(co): i for i, co in enumerate(np.array(QUAD[0], np.float32).tolist())}
    expected = [(corner_of[tuple(co)], 1) for co in found.positions.tolist()]
    np.testing.assert_array_equal(found.uvs["Second"], expected)


def test_mesh_without_uv_has_no_active_one():
    link("Quad", mesh())
    found = only_mesh(convert())
    assert found.uvs == {} and found.active_uv == ""


def slotted(indices):
    data = mesh(shape=CUBE)
    for name in "AB":
        data.materials.append(material(name))
    data.polygons.foreach_set("material_index", indices)
    data.update()
    return data


def test_triangles_are_sorted_by_slot():
    link("Cube", slotted([1, 0, 1, 0, 1, 1]))
    scene = convert()
    found = only_mesh(scene)
    check(found)
    assert found.slots == ((0, 0, 4), (1, 4, 8))
    assert [scene.materials[i].name for i in scene.instances[0].materials] == ["A", "B"]
    # Faces 1 and 3 of CUBE lie at x = 1 and y = 1.
    assert np.all((found.positions[:12, 0] == 1) | (found.positions[:12, 1] == 1))


def test_index_beyond_the_slots_is_the_last_slot():
    link("Cube", slotted([0, 0, 0, 0, 7, 1]))
    assert only_mesh(convert()).slots == ((0, 0, 8), (1, 8, 4))


def test_slot_linked_to_the_object_overrides_the_mesh():
    data = slotted([0, 0, 0, 1, 1, 1])
    link("Data", data)
    other = link("Object", data)
    other.material_slots[1].link = "OBJECT"
    other.material_slots[1].material = material("Own")
    scene = convert()
    assert len(scene.meshes) == 1
    names = [[scene.materials[i].name for i in instance.materials] for instance in scene.instances]
    assert names == [["A", "B"], ["A", "Own"]]


def test_empty_slot_and_no_slot_wear_the_default():
    data = mesh()
    data.materials.append(None)
    link("Empty slot", data)
    link("No slot", mesh())
    scene = convert()
    assert [instance.materials for instance in scene.instances] == [(0,), (0,)]
    assert scene.materials[0].base_color == (0.8, 0.8, 0.8)


def test_zero_area_faces_are_dropped():
    shape = ([*QUAD[0], (5, 0, 0), (6, 0, 0), (7, 0, 0)], [*QUAD[1], (4, 5, 6)])
    link("Quad", mesh(shape=shape))
    scene = convert()
    assert only_mesh(scene).triangle_count == 2 and scene.warnings == ()


def test_only_degenerate_faces_make_no_instance():
    link("Line", mesh(shape=([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])))
    link("Cloud", mesh(shape=([(0, 0, 0)], [])))
    scene = convert()
    assert scene.instances == () and scene.meshes == {}


def test_tiny_and_huge_objects_keep_their_faces():
    for scale in (1e-6, 1e6):
        shape = ([tuple(scale * c for c in co) for co in QUAD[0]], QUAD[1])
        link(f"Quad {scale}", mesh(shape=shape))
    assert [found.triangle_count for found in convert().meshes.values()] == [2, 2]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_vertices_that_are_not_finite_drop_their_triangles(bad):
    data = mesh(shape=CUBE)
    data.vertices[7].co.x = bad
    link("Broken", data)
    scene = convert()
    check(only_mesh(scene))
    assert 0 < only_mesh(scene).triangle_count < 12
    assert len(scene.warnings) == 1 and "'Broken'" in scene.warnings[0]


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_transform_that_is_not_finite_leaves_the_object_out(bad):
    link("Broken", mesh(), location=(bad, 0, 0))
    link("Good", mesh())
    scene = convert()
    assert len(scene.instances) == 1
    assert len(scene.warnings) == 1 and "'Broken'" in scene.warnings[0]


def test_unchanged_meshes_are_the_same_objects():
    data = mesh(shape=CUBE)
    link("Cube", data)
    link("Copy", data, location=(3, 0, 0))
    other = link("Quad", mesh())
    link("Text", bpy.data.curves.new("Text", "FONT")).data.body = "A"
    first = convert()
    assert len(first.meshes) == 3 and len(first.instances) == 4

    other.location.x = 2
    second = convert(previous=first)
    assert all(second.meshes[key] is first.meshes[key] for key in first.meshes)
    changes = Changes.between(first, second)
    assert changes.instances and not changes.meshes_added and len(changes.moved_bounds) == 2

    data.vertices[0].co.x = -5
    data.update()
    third = convert(previous=second)
    changes = Changes.between(second, third)
    assert len(changes.meshes_added) == len(changes.meshes_removed) == 1
    assert len(changes.moved_bounds) == 4  # both users of the edited mesh, before and after


def test_changed_render_uv_map_makes_a_new_mesh():
    data = mesh()
    data.uv_layers.new(name="A")
    data.uv_layers.new(name="B")
    link("Quad", data)
    first = convert()
    data.uv_layers["B"].active_render = True
    data.update_tag()
    second = convert(previous=first)
    assert only_mesh(first).active_uv == "A" and only_mesh(second).active_uv == "B"


def test_mesh_in_edit_mode_is_followed():
    data = mesh()
    obj = link("Quad", data)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        first = convert()
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.transform.resize(value=(2, 1, 1))
        second = convert(previous=first)
        assert area(only_mesh(first)) == pytest.approx(4) and area(only_mesh(second)) == pytest.approx(8)
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")


def test_realized_geometry_nodes_are_one_mesh():
    obj = link("Host", mesh())
    scatter_nodes(obj, realize=True)
    assert only_mesh(convert()).triangle_count == 48


def test_reading_leaves_the_file_as_it_was():
    link("Cube", slotted([0, 1, 0, 1, 0, 1]))
    link("Ball", metaball())
    bpy.context.evaluated_depsgraph_get().update()
    names = [name for name in dir(bpy.data) if isinstance(getattr(bpy.data, name), bpy.types.bpy_prop_collection)]
    before = {name: len(getattr(bpy.data, name)) for name in names}
    convert()
    assert before == {name: len(getattr(bpy.data, name)) for name in names}
