"""Points on surfaces: spread evenly by world area or emission, whatever the instances' scales."""

import time

import numpy as np
import pytest

from rebound.scene.data import Material, Mesh
from rebound.scene.surface_points import Part, SurfaceSampler, emission_density
from rebound.tests.support.render_scenes import box, place, quad, sphere, triangles

TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
SHEAR = np.array([[1.0, 0.7, 0, 3], [0, 1, -0.4, 0], [0, 0.2, 1, 1], [0, 0, 0, 1]])
PLACES = {
    "as_it_is": np.eye(4),
    "moved": place((5, -3, 2), TURN),
    "scaled": place((1, 2, 3), TURN, (3, 3, 3)),
    "stretched": place((0, 0, 1), TURN, (4, 1, 0.1)),
    "mirrored": place((0, 0, 1), TURN, (-2, 1, 0.5)),
    "sheared": SHEAR,
    "flat": place((0, 0, 0), TURN, (2, 1, 0)),
    "tiny": place((0, 0, 0), TURN, (1e-4, 2e-4, 1e-4)),
}


def parts_of(meshes, counts=None, densities=None, materials=None):
    """One part a mesh, placed ``counts`` times."""
    parts, first = [], 0
    for i, mesh in enumerate(meshes):
        count = counts[i] if counts else 1
        density = densities[i] if densities else 1.0
        parts.append(Part(mesh, 0, mesh.triangle_count, first, count, materials[i] if materials else i, (), density))
        first += count
    return parts


def world_corners(mesh, matrix):
    return (mesh.positions.reshape(-1, 3, 3).astype(np.float64) @ matrix[:3, :3].T) + matrix[:3, 3]


def world_areas(mesh, matrix):
    a, b, c = world_corners(mesh, matrix).swapaxes(0, 1)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def sample(meshes, matrices, count, seed=0, **given):
    return SurfaceSampler().sample(parts_of(meshes, **given), np.array(matrices).reshape(-1, 4, 4), count, seed)


def triangles_hit(points, mesh):
    """The triangle of one mesh that each point lies in, by barycentric coordinates in object space."""
    a, b, c = mesh.positions.reshape(-1, 3, 3).astype(np.float64).swapaxes(0, 1)
    hit = np.full(len(points), -1)
    for number, (p, q, r) in enumerate(zip(a, b, c, strict=True)):
        normal = np.cross(q - p, r - p)
        size = np.linalg.norm(normal)
        offset = points.positions - p
        u = np.cross(q - p, offset) @ normal / size**2
        v = np.cross(offset, r - p) @ normal / size**2
        inside = (u >= -1e-6) & (v >= -1e-6) & (u + v <= 1 + 1e-6)
        hit[inside & (np.abs(offset @ normal) < 1e-6 * size)] = number
    return hit


@pytest.mark.parametrize("name", PLACES)
@pytest.mark.parametrize("mesh", [box("box", (0, 0, 0), (1, 2, 3)), sphere("sphere", rings=24)], ids=["box", "sphere"])
def test_weights_add_up_to_the_world_area(mesh, name):
    points = sample([mesh], [PLACES[name]], 4096)
    assert points.weights.sum() == pytest.approx(world_areas(mesh, PLACES[name]).sum(), rel=0.01)
    assert len(points) == 4096 and (points.weights >= 0).all()


@pytest.mark.parametrize("name", ["as_it_is", "stretched", "mirrored", "sheared"])
def test_every_triangle_gets_points_by_its_world_area(name):
    mesh = triangles(
        "mixed", np.concatenate([box("b", (0, 0, 0), (1, 2, 3)).positions, quad("q", u=(3, 0, 1)).positions])
    )
    points = sample([mesh], [PLACES[name]], 8192)
    hit = triangles_hit(points, mesh)
    assert (hit >= 0).all()
    expected = world_areas(mesh, PLACES[name])
    expected *= 8192 / expected.sum()
    # A random draw would differ by the square root of what is expected; this one is far more even, as long as cells
    # hold one direction each. The tilted quad shares its cell with other directions where the shear brings that about.
    standing_for = np.bincount(hit, points.weights, mesh.triangle_count)
    np.testing.assert_allclose(standing_for, world_areas(mesh, PLACES[name]), rtol=0.02, atol=0.01)
    counts = np.bincount(hit, minlength=mesh.triangle_count)
    assert ((counts - expected) ** 2 / expected).sum() < 0.3 * mesh.triangle_count


def test_area_decides_between_instances_and_meshes():
    meshes = [box("a", (0, 0, 0), (1, 1, 1)), sphere("b")]
    matrices = [np.eye(4), place((9, 0, 0), TURN, (2, 2, 2)), place((0, 9, 0), None, (1, 1, 3)), PLACES["moved"]]
    points = sample(meshes, matrices, 10000, counts=[3, 1])
    areas = np.array([world_areas(meshes[m], x).sum() for m, x in zip((0, 0, 0, 1), matrices, strict=True)])
    counts = np.bincount(points.instances, minlength=4)
    np.testing.assert_allclose(counts, 10000 * areas / areas.sum(), atol=5)
    np.testing.assert_array_equal(points.materials, (points.instances == 3).astype(int))
    np.testing.assert_allclose(points.weights, areas.sum() / 10000, rtol=1e-6)


def test_curved_and_stretched_surface_is_dense_within_a_cells_spread_and_weighted_right():
    mesh, matrix = sphere("sphere", rings=32), place((0, 0, 0), TURN, (1, 1, 10))
    points = sample([mesh], [matrix], 16384)
    ratio = points.weights / points.weights.mean()
    assert ratio.max() < 2.5
    half = points.positions[:, 2] > 0.8  # a cap
    expected = world_areas(mesh, matrix)[mesh.positions.reshape(-1, 3, 3).mean(1)[:, 2] > 0.8].sum()
    assert points.weights[half].sum() == pytest.approx(expected, rel=0.05)  # triangles straddle the cap's edge


@pytest.mark.parametrize("part", [2, 3, 4, 7, 16])
def test_every_run_is_as_even_as_all_of_them(part):
    mesh, count = box("box", (0, 0, 0), (2, 2, 2)), 16384
    points = sample([mesh], [np.eye(4)], count)
    length = count // part
    for start in range(0, count - length + 1, length):
        run = slice(start, start + length)
        position, normal = points.positions[run], points.geometric_normals[run]
        side = 2 * np.abs(normal).argmax(1) + (
            np.take_along_axis(position, np.abs(normal).argmax(1)[:, None], 1)[:, 0] > 1
        )
        quarter = (np.delete(position[i], np.abs(n).argmax()) > 1 for i, n in enumerate(normal))
        cell = 4 * side + np.array([2 * q[0] + q[1] for q in quarter])
        counts = np.bincount(cell, minlength=24)
        expected = length / 24
        # Random points: 1 on average.
        assert ((counts - expected) ** 2 / expected).mean() < 0.35
        outward = (normal * (position - 1)).sum(1) > 0
        assert outward.mean() == pytest.approx(0.5, abs=0.01)


def test_density_is_what_gets_points_and_weights_make_it_good():
    meshes = [quad("dim"), quad("bright", u=(2, 0, 0))]
    points = sample(meshes, [np.eye(4)] * 2, 4096, densities=[1.0, 8.0])
    counts = np.bincount(points.instances)
    np.testing.assert_allclose(counts, 4096 * np.array([4, 64]) / 68, atol=3)
    np.testing.assert_allclose(np.bincount(points.instances, points.weights), [4, 8], rtol=0.01)


@pytest.mark.parametrize("size", [3.0, 5.0, 100.0])
def test_huge_ground_leaves_points_to_the_rest(size):
    meshes = [quad("ground", u=(size, 0, 0), v=(0, size, 0)), quad("table")]
    parts, matrices = parts_of(meshes), np.tile(np.eye(4), (2, 1, 1))
    points = SurfaceSampler().sample(parts, matrices, 4096, huge_share=0.75)
    share = size**2 / (1 + size**2) if size**2 < 32 else 0.75
    np.testing.assert_allclose(np.bincount(points.instances), 4096 * np.array([share, 1 - share]), atol=3)
    np.testing.assert_allclose(np.bincount(points.instances, points.weights), [4 * size**2, 4], rtol=0.01)
    alone = SurfaceSampler().sample(parts[:1], matrices, 64, huge_share=0.75)
    assert alone.weights.sum() == pytest.approx(4 * size**2)


def test_huge_ground_has_half_its_points_around_the_rest():
    """Each side's points stand for all of its area, and come by turns."""
    meshes = [quad("ground", u=(100, 0, 0), v=(0, 100, 0)), quad("table")]
    focus = np.array([[-20.0, -20, -1], [20, 20, 1]])
    parts, matrices = parts_of(meshes), np.tile(np.eye(4), (2, 1, 1))
    points = SurfaceSampler().sample(parts, matrices, 4096, huge_share=0.5, focus=focus)
    ground = points.instances == 0
    near = (np.abs(points.positions[:, :2]) <= 20).all(1)
    assert ground.sum() == pytest.approx(2048, abs=1) and (ground & near).sum() == pytest.approx(1024, abs=1)
    np.testing.assert_allclose(points.weights[ground & near].sum(), 40**2, rtol=0.02)
    np.testing.assert_allclose(points.weights[ground].sum(), 200**2, rtol=1e-3)
    assert (ground & near)[:512].sum() == pytest.approx(128, abs=8)


def test_points_are_interpolated_from_their_triangle():
    mesh = quad("quad", u=(2, 0, 0), v=(0, 1, 0))
    uvs = {"a": mesh.positions[:, :2] * 0.5 + 3, "b": mesh.positions[:, 1::-1]}
    tilted = mesh.positions + np.float32(4)
    mesh = Mesh(mesh.key, mesh.positions, tilted, uvs, "a", ((0, 0, 2),), mesh.bounds)
    points = SurfaceSampler().sample([Part(mesh, 0, 2, 0, 1, 0, (("uv", ""), ("uv", "b")))], np.eye(4)[None], 256)
    side = points.geometric_normals[:, 2]
    np.testing.assert_allclose(np.abs(side), 1)
    assert set(side) == {-1.0, 1.0}
    np.testing.assert_allclose(points.attributes[:, 0, :2], points.positions[:, :2] * 0.5 + 3, atol=1e-5)
    np.testing.assert_allclose(points.attributes[:, 1, :2], points.positions[:, 1::-1], atol=1e-5)
    np.testing.assert_allclose(points.normals, (points.positions + 4) * side[:, None], atol=1e-5)
    assert (np.abs(points.positions) <= [2, 1, 0]).all()


def test_only_a_parts_own_triangles_are_used():
    mesh = triangles("two", np.concatenate([quad("a").positions, quad("b", (0, 0, 5)).positions]))
    parts = [Part(mesh, 2, 2, 0, 1, 7)]
    points = SurfaceSampler().sample(parts, np.eye(4)[None], 64)
    np.testing.assert_allclose(points.positions[:, 2], 5)
    assert (points.materials == 7).all()
    assert points.weights.sum() == pytest.approx(4)


def test_same_seed_same_points_other_seed_others():
    mesh = sphere("sphere")
    first, again, other = (sample([mesh], [np.eye(4)], 100, seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.positions, again.positions)
    assert (first.positions != other.positions).any(1).all()


def test_rotation_changes_no_point():
    mesh = box("box", (0, 0, 0), (1, 2, 3))
    first, turned = (sample([mesh], [m], 500) for m in (np.eye(4), PLACES["moved"]))
    np.testing.assert_allclose(first.positions, turned.positions, atol=1e-9)


def test_mesh_that_is_stretched_after_all_is_sorted_by_direction():
    """As long as it is scaled evenly its triangles are one cell, whose share of the points would then be estimated."""
    mesh, sampler = box("box", (-1, -1, -1), (1, 1, 1)), SurfaceSampler()
    for name in ("scaled", "stretched", "as_it_is"):
        matrices = np.array([PLACES[name]])
        points = sampler.sample(parts_of([mesh]), matrices, 4096)
        again = SurfaceSampler().sample(parts_of([mesh]), matrices, 4096)
        np.testing.assert_array_equal(points.positions, again.positions)
        areas = world_areas(mesh, PLACES[name])
        counts = np.bincount(triangles_hit(points, mesh), minlength=len(areas))
        np.testing.assert_allclose(counts / counts.sum(), areas / areas.sum(), atol=0.01)


def degenerate():
    line = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], np.float32)
    return np.concatenate([line, np.zeros((3, 3), np.float32)])


def test_triangles_without_an_area_get_no_points():
    corners = np.concatenate([degenerate(), quad("q").positions, degenerate()])
    normals = np.tile(np.float32([0, 0, 1]), (len(corners), 1))
    mesh = triangles("partly", corners, normals)
    points = sample([mesh], [np.eye(4)], 1000)
    assert (np.abs(points.positions[:, :2]) <= 1).all() and (points.positions[:, :2] < 0).any()
    np.testing.assert_allclose(np.abs(points.geometric_normals[:, 2]), 1)
    assert points.weights.sum() == pytest.approx(4)


@pytest.mark.parametrize("meshes", [[], [triangles("flat", degenerate(), np.ones((6, 3)))]], ids=["none", "degenerate"])
def test_nothing_with_an_area_gives_no_points(meshes):
    points = sample(meshes, [np.eye(4)] * len(meshes), 64)
    assert len(points) == 0 and points.positions.shape == (0, 3)


def test_instance_that_is_not_finite_or_has_no_size_gets_no_points():
    matrices = [np.full((4, 4), np.nan), place(scale=(0, 0, 0)), np.eye(4)]
    points = sample([quad("quad")], matrices, 64, counts=[3])
    assert (points.instances == 2).all()


def test_emission_density_is_luminance():
    assert emission_density(Material("lit", emission=(1.0, 2.0, 3.0))) == pytest.approx(
        0.2126 + 2 * 0.7152 + 3 * 0.0722
    )
    assert emission_density(Material("dark")) == 0


def test_million_triangles_are_sorted_once_and_then_quick():
    corners = np.random.default_rng(0).normal(size=(3_000_000, 3)).astype(np.float32)
    mesh = Mesh("big", corners, corners, {}, "", ((0, 0, 1_000_000),), np.float32([[-5] * 3, [5] * 3]))
    sampler, parts, times = SurfaceSampler(), parts_of([mesh]), []
    for number in range(4):
        start = time.perf_counter()
        points = sampler.sample(parts, place(scale=(1, 1 + number, 1))[None], 16384)
        times.append(time.perf_counter() - start)
    report = f"first {1000 * times[0]:.0f} ms, then {1000 * min(times[1:]):.1f} ms"
    assert min(times[1:]) < 0.1 and times[0] < 3, report  # several times what a machine of its own takes
    assert points.weights.sum() == pytest.approx(world_areas(mesh, place(scale=(1, 4, 1))).sum(), rel=0.02)


def test_many_instances_are_quick():
    rng = np.random.default_rng(0)
    matrices = np.tile(np.eye(4), (50_000, 1, 1))
    matrices[:, :3, :3] = rng.normal(size=(50_000, 3, 3))
    sampler, parts = SurfaceSampler(), parts_of([sphere("sphere")], counts=[50_000])
    start = time.perf_counter()
    points = sampler.sample(parts, matrices, 16384)
    assert time.perf_counter() - start < 2
    assert len(np.unique(points.instances)) > 10_000
