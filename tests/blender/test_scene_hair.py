"""Hair curves, particle hair and point clouds are read with their radii, and cover as much as in Cycles."""

import bpy
import numpy as np
import pytest

from rebound.scene.changes import Changes
from rebound.tests.support import engine_build
from rebound.tests.support.blender_build import convert, link, material, mesh

pytestmark = pytest.mark.usefixtures("clean_scene")

SIZE = 96  # pixels of the square picture
CELL = 8


def curves_object(points, sizes, radii=None, name="Hair"):
    """Points (n, 3) of curves with so many points each."""
    data = bpy.data.hair_curves.new(name)
    data.add_curves(list(sizes))
    data.points.foreach_set("position", np.asarray(points, np.float32).ravel())
    if radii is not None:
        attribute = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
        attribute.data.foreach_set("value", np.asarray(radii, np.float32))
    data.update_tag()
    return link(name, data)


def tuft(count=60, points=6, radius=0.02):
    """Bent strands that stand on a square."""
    rng = np.random.default_rng(2)
    roots = np.concatenate([rng.uniform(-1, 1, (count, 1, 2)), np.zeros((count, 1, 1))], 2)
    part = np.linspace(0, 1, points)[None, :, None]
    lean = rng.uniform(-0.6, 0.6, (count, 1, 3)) * [1, 1, 0]
    found = roots + part * [0, 0, 1.5] + part**2 * lean
    radii = radius and (radius * (1 - 0.9 * np.broadcast_to(part, (count, points, 1)))).ravel()
    return curves_object(found.reshape(-1, 3), [points] * count, radii)


def dots(count=200, radius=0.08):
    """A point cloud made by geometry nodes: the only way in every version."""
    host = link("Dots", mesh("Host", (np.random.default_rng(4).uniform(-1, 1, (count, 3)).tolist(), [])))
    tree = bpy.data.node_groups.new("Points", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    start, points, end = (tree.nodes.new(n) for n in ("NodeGroupInput", "GeometryNodeMeshToPoints", "NodeGroupOutput"))
    points.inputs["Radius"].default_value = radius
    tree.links.new(start.outputs[0], points.inputs["Mesh"])
    tree.links.new(points.outputs[0], end.inputs[0])
    host.modifiers.new("Points", "NODES").node_group = tree
    return host


def fur(count=80, children=0):
    """A square with a particle system of hair."""
    emitter = link("Fur", mesh())
    emitter.modifiers.new("Fur", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", count, 1.2
    settings.root_radius, settings.tip_radius, settings.radius_scale = 1.0, 0.2, 0.06
    settings.display_step = settings.render_step = 3
    if children:
        settings.child_type, settings.rendered_child_count = "SIMPLE", children
        settings.child_percent = children
    return emitter


def only(scene):
    (found,) = scene.meshes.values()
    return found


def widths(found):
    return np.ptp(found.positions, axis=0)


def test_hair_has_the_radius_of_its_points():
    curves_object([[0, 0, 0], [0, 0, 1], [0, 0, 2]], [3], [0.2, 0.2, 0.2])
    found = only(convert())
    x, _, z = widths(found)
    assert 0.38 < x < 0.46 and z == pytest.approx(2)


def test_hair_without_radius_has_that_of_cycles():
    curves_object([[0, 0, 0], [0, 0, 1]], [2])
    assert 0.009 < widths(only(convert()))[0] < 0.0115


def test_edited_hair_is_another_mesh_and_moved_hair_is_not():
    obj = tuft(3)
    first = convert()
    obj.location.x = 2
    moved = convert(previous=first)
    assert only(moved) is only(first) and Changes.between(first, moved).instances
    obj.data.points[0].position[2] = -3
    obj.data.update_tag()
    assert only(convert(previous=moved)) is not only(first)


def test_points_are_balls_of_their_radius():
    dots(1, 0.25)
    found = only(convert())
    assert found.triangle_count == 320
    np.testing.assert_allclose(widths(found), 0.5, rtol=0.05)


def test_hair_and_points_wear_their_material():
    tuft(2).data.materials.append(material("Brown", (0.3, 0.2, 0.1)))
    scene = convert()
    assert scene.materials[scene.instances[0].materials[0]].name == "Brown"


def test_particle_hair_grows_on_its_emitter():
    emitter = fur(20)
    emitter.data.uv_layers.new(name="UVMap")
    emitter.location = (5, 0, 0)
    emitter.data.materials.append(material("Skin", (0.8, 0.6, 0.5)))
    scene = convert(for_viewport=True)
    assert len(scene.instances) == 2
    hair = next(m for m in scene.meshes.values() if m.triangle_count > 2)
    low, high = hair.bounds
    assert low[2] > -0.1 and 0.5 < high[2] < 1.6 and np.abs(low[:2]).max() < 1.2
    assert hair.active_uv == "UVMap" and (hair.uvs["UVMap"] >= 0).all() and (hair.uvs["UVMap"] <= 1).all()
    emitter.show_instancer_for_viewport = False
    assert len(convert(for_viewport=True).instances) == 1


def test_volume_is_listed_and_left_out():
    link("Smoke", bpy.data.volumes.new("Smoke"))
    scene = convert()
    assert not scene.instances
    assert scene.warnings == ("Object 'Smoke': volumes are not supported; it is left out",)


# --- against Cycles --------------------------------------------------------------------------------------------------


def alpha(scene, engine, path):
    """Coverage, (h, w)."""
    scene.render.engine = engine
    return engine_build.picture(engine_build.render(scene, path / f"{engine}.exr"))[..., 3]


COVERED = {
    # What is drawn; largest difference of the mean and of a cell, of 1. Cells: Cycles' noise, and a tube's facets.
    "hair": (tuft, 0.03, 0.06),
    "hair of default radius": (lambda: tuft(radius=None), 0.03, 0.06),
    "points": (dots, 0.02, 0.04),
    "fur": (fur, 0.02, 0.06),
    "fur with children": (lambda: fur(20, children=8), 0.02, 0.06),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COVERED)
def test_coverage_is_that_of_cycles(registered, tmp_path, name):
    make, of_mean, of_cell = COVERED[name]
    make()
    scene = registered
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.film_transparent = True
    scene.rebound.method = "NONE"
    scene.rebound.samples = scene.cycles.samples = 32
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    camera = bpy.data.cameras.new("Camera")
    scene.camera = link("Camera", camera, location=(0, -5, 2.2), rotation_euler=(1.25, 0, 0))
    found = {engine: alpha(scene, engine, tmp_path) for engine in ("CYCLES", "REBOUND")}
    cells = {e: a.reshape(SIZE // CELL, CELL, SIZE // CELL, CELL).mean((1, 3)) for e, a in found.items()}
    difference = cells["REBOUND"] - cells["CYCLES"]
    means = {engine: float(a.mean()) for engine, a in found.items()}
    off = float(np.abs(difference).max())
    print(f"{name}: {means['REBOUND']:.4f}, in Cycles {means['CYCLES']:.4f}; cells {off:.3f}")  # noqa: T201  pytest -s
    assert means["CYCLES"] > 0.02
    assert means["REBOUND"] == pytest.approx(means["CYCLES"], rel=of_mean)
    assert off < of_cell
