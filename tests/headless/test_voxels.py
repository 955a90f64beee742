"""The grid of voxels: what is in it, that no ray passes a surface, and that none is stopped by its own."""

from dataclasses import replace

import numpy as np
import pytest

from rebound.gpu_shaders.frame.voxels import grid_bounds
from rebound.scene.data import Scene, Visibility
from rebound.tests.support.render_scenes import (
    EVERYTHING,
    box,
    light,
    place,
    quad,
    quad_corners,
    scene,
    sphere,
    triangles,
)
from rebound.tests.support.voxel_reference import Room, coarser, first_hits

TRACE = "voxel_trace(start, direction, 1e6)"
FRAME = box("frame", (-1, -1, -1), (1, 1, 1))  # gives the grid its place


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def speckled(rng, count=300):
    """Tiny triangles at random, in a box whose corners hold one each."""
    centers = np.concatenate([rng.uniform(-1, 1, (count, 3)), [(-1, -1, -1), (1, 1, 1)]])
    corners = centers[:, None] + rng.normal(0, 0.02, (len(centers), 3, 3))
    return triangles("dust", corners.reshape(-1, 3))


# --- what is in it ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("at", [-1.0, -0.3141, 0.0, 8 / 63, 0.5, 0.99, 1.0])
def test_plane_along_the_axes_is_one_voxel_thick_anywhere(room, axis, at):
    u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
    corner = triangles("corners", [(-1, -1, -1)] * 3 + [(1, 1, 1)] * 3, np.ones((6, 3)))  # no area, only bounds
    cells = room(scene([corner, quad("wall", at * np.eye(3)[axis], u, v)])).level(0)
    layers = np.unique(np.argwhere(cells)[:, axis])
    assert len(layers) == 1
    assert cells.take(layers[0], axis).sum() == 64 * 64
    assert layers[0] == int((at + 1) / 2 * 63.02 + 0.49)


def test_coarse_levels_say_where_fine_ones_have_anything(room):
    dust = room(scene([speckled(np.random.default_rng(1))]), resolution=192)
    for level in (1, 2):
        bricks = dust.voxels.grid.bricks[level]
        np.testing.assert_array_equal(dust.level(level), coarser(dust.level(level - 1), bricks))
    assert 0 < dust.level(0).sum() < 3000


@pytest.mark.parametrize("order", [1, -1])
def test_surfaces_behind_one_another_are_all_kept(room, order):
    """Each fills many of a software rasterizer's tiles, which forgets what an opaque surface covers."""
    walls = [quad(f"wall {axis} {at}", at * n, u, v) for axis in range(3) for at in (-1, -0.4, 0.2, 1)
             for n, u, v in [np.roll(np.eye(3), -axis, 0)]]  # fmt: skip
    cells = room(scene(walls[::order]), resolution=256).level(0)
    for axis in range(3):
        layers = cells.all(tuple({0, 1, 2} - {axis}))
        assert layers[[0, 255]].all() and layers.sum() == 4


@pytest.mark.parametrize("resolution", [64, 128, 320, 512])
def test_voxels_lie_on_the_surface_and_fill_it(room, resolution):
    ball = room(scene([sphere("ball", (5, 0, 0), 2.0, rings=64)]), resolution=resolution)
    grid = ball.voxels.grid
    centers = grid.origin + (np.argwhere(ball.level(0)) + 0.5) * grid.edge
    off = abs(np.linalg.norm(centers - (5, 0, 0), axis=1) - 2.0) / grid.edge
    flat = 2.0 * (1 - np.cos(np.pi / 128)) / grid.edge  # how far a polyhedron is inside its sphere
    assert off.max() <= 0.5 * np.sqrt(3) + 2 * flat
    # A plane fills one voxel of each column along the axis that it faces most, and none beside.
    normals = unit(np.random.default_rng(0).normal(size=(100000, 3)))
    per_area = abs(normals).max(1).mean()
    assert len(centers) == pytest.approx(per_area * 4 * np.pi * (2.0 / grid.edge) ** 2, rel=0.02)
    assert ball.voxels.edge == pytest.approx(4 / (resolution - 0.98), rel=1e-3)


def test_what_casts_no_shadow_is_left_out(room):
    hidden = {"wall": Visibility.CAMERA | Visibility.BOUNCE}
    cells = room(scene([FRAME, quad("wall")], visibility=hidden)).level(0)
    assert cells[[0, 63]].all() and not cells[1:63, 1:63, 1:63].any()


def test_empty_scene_and_a_single_plane_work(room):
    rays = {"start": np.array([(0.1, 0.2, 1.0)]), "direction": np.array([(0.0, 0.0, -1.0)])}
    assert room(Scene()).ask(TRACE, **rays) == -1
    flat = room(scene([quad("floor")]))
    assert flat.ask(TRACE, **rays) == pytest.approx(1.0, abs=flat.voxels.edge)
    assert flat.voxels.grid.size.tolist() == [64, 64, 1]


def test_a_huge_ground_does_not_take_the_voxels(room):
    meshes = [quad("ground", (0, 0, -1), (5000, 0, 0), (0, 5000, 0)), FRAME]
    shown = room(scene(meshes))
    assert shown.voxels.edge == pytest.approx(2 / 63.02)
    down = shown.ask(TRACE, start=np.array([(0.0, 0.0, 0.5), (40.0, 0.0, 0.5)]), direction=np.array([(0, 0, -1.0)] * 2))
    assert down[0] == pytest.approx(1.5, abs=shown.voxels.edge) and down[1] == pytest.approx(1.5, abs=0.1)


def test_huge_objects_are_left_out_of_the_box_only_where_that_gains_much():
    def boxes(*sizes, flat=True):
        height = 0.04 if flat else 1.0
        corners = [np.array((size, size, height * size)) for size in sizes]
        return np.array([(-corner, corner) for corner in corners], np.float64)

    assert grid_bounds(boxes(1, 1, 1, 5.9))[1, 0] == 5.9
    assert grid_bounds(boxes(1, 1, 1, 6.1))[1, 0] == 1
    assert grid_bounds(boxes(1, 1, 5, 100))[1, 0] == 1  # one step makes the next worthwhile
    assert grid_bounds(boxes(1, 1, 1.9, 100))[1, 0] == 1.9
    assert grid_bounds(boxes(1, 20, 20, 20, 20, 20))[1, 0] == 20
    assert grid_bounds(boxes(0))[1, 0] == 0
    # What is not flat may be the room around the rest.
    assert grid_bounds(boxes(1, 1, 23, flat=False))[1, 0] == 23
    assert grid_bounds(boxes(1, 1, 25, flat=False))[1, 0] == 1


# --- rays ------------------------------------------------------------------------------------------------------------


def rays_of(kind, grid, rng, count=150):
    """(origins, unit directions) in a grid's box, somewhat around it, or where rounding is hardest."""
    extent = grid.size * grid.edge
    if kind == "from outside":
        origins = grid.origin + extent * rng.uniform(-1, 2, (count, 3))
        return origins, unit(grid.origin + extent * rng.uniform(0, 1, (count, 3)) - origins)
    origins = grid.origin + extent * rng.uniform(0, 1, (count, 3))
    if kind == "along the axes":
        return origins, np.eye(3)[rng.integers(0, 3, count)] * rng.choice([-1, 1], (count, 1))
    if kind == "in a plane of the axes":
        directions = rng.normal(size=(count, 3))
        directions[np.arange(count), rng.integers(0, 3, count)] = 0
        return origins, unit(directions)
    return origins, unit(rng.normal(size=(count, 3)))


@pytest.mark.parametrize("kind", ["from inside", "from outside", "along the axes", "in a plane of the axes"])
@pytest.mark.parametrize(("resolution", "count"), [(64, 1500), (330, 9000)])
def test_ray_meets_what_a_test_of_every_voxel_finds(room, kind, resolution, count):
    rng = np.random.default_rng(7)
    dust = room(scene([speckled(rng, count)]), resolution=resolution)
    grid = dust.voxels.grid
    origins, directions = (a.astype(np.float32).astype(np.float64) for a in rays_of(kind, grid, rng))
    expected = first_hits(dust.level(0), grid, origins, directions, 1e6)
    found = dust.ask(TRACE, start=origins, direction=directions)
    found = np.where(found < 0, np.inf, found)
    assert np.isfinite(expected).mean() > 0.1
    # A ray that touches a voxel within rounding may meet it or not.
    different = ~np.isclose(found, expected, atol=1e-3 * grid.edge)
    assert different.sum() <= 1


def test_exact_corners_and_edges_do_not_stop_or_loop(room):
    filled = room(scene([FRAME]))
    grid = filled.voxels.grid
    lattice = grid.origin + grid.edge * np.array([(8, 8, 8), (16, 32, 48), (4, 4, 5), (62, 62, 62)], np.float64)
    directions = unit(np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z]))
    start, direction = np.repeat(lattice, len(directions), 0), np.tile(directions, (len(lattice), 1))
    found = filled.ask(TRACE, start=start, direction=direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        walls = (np.sign(direction) * (1 - 0.51 * grid.edge) - start) / direction
    expected = np.where(direction == 0, np.inf, walls).min(1).clip(0)
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_reach_ends_a_ray(room):
    filled = room(scene([FRAME]))
    start, direction = np.zeros((3, 3)), np.array([(1.0, 0, 0)] * 3)
    wall = 1 - 0.51 * filled.voxels.edge
    reach = np.array([(wall - 1e-3, 0, 0), (wall + 1e-3, 0, 0), (9, 0, 0)])
    found = filled.ask("voxel_trace(start, direction, reach.x)", start=start, direction=direction, reach=reach)
    np.testing.assert_allclose(found, [-1, wall, wall], atol=1e-4)


# --- no holes --------------------------------------------------------------------------------------------------------


def grid_mesh(name, corners, n):
    """A parallelogram (origin, u, v) as n x n x 2 triangles."""
    origin, u, v = corners
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    a = np.stack([i, j], -1).reshape(-1, 1, 2)
    steps = np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)])
    st = ((a + steps) / n).reshape(-1, 2)
    return triangles(name, origin + st[:, :1] * u + st[:, 1:] * v)


def rotations(rng, count):
    q, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    return q


@pytest.mark.parametrize("pieces", [1, 150])
def test_no_ray_passes_a_wall_however_it_stands(room, pieces):
    rng = np.random.default_rng(3)
    for turn in rotations(rng, 5):
        u, v, n = turn
        wall = grid_mesh("wall", (-(u + v), 2 * u, 2 * v), pieces)
        shown = room(scene([wall]), resolution=96)
        edge = shown.voxels.edge
        # Across the inside of the wall: not past its rim where the ray is as near to it as its voxels.
        through = rng.uniform(-0.95, 0.95, (12000, 2)) @ np.stack([u, v])
        direction = unit(rng.normal(size=(12000, 3)))
        direction = direction[abs(direction @ n) > 0.02]
        through = through[: len(direction)]
        approach = direction * 1.6 * edge / abs(direction @ n)[:, None]
        start = through - approach
        inside = (
            np.abs(np.concatenate([start, through + approach], 1).reshape(-1, 2, 3) @ turn[:2].T).max((1, 2)) < 0.97
        )
        start, direction = start[inside], direction[inside]
        found = shown.ask("voxel_trace(start, direction, 1e6)", start=start, direction=direction)
        assert len(start) > 4000 and (found >= 0).all()


def test_no_ray_leaves_a_closed_ball(room):
    rng = np.random.default_rng(4)
    for rings, resolution in ((8, 64), (150, 64), (40, 256)):
        shown = room(scene([sphere("ball", (0.1, 0.2, 0.3), 1.0, rings=rings)]), resolution=resolution)
        start = np.array([0.1, 0.2, 0.3]) + 0.5 * unit(rng.normal(size=(20000, 3)))
        found = shown.ask(TRACE, start=start, direction=unit(rng.normal(size=(20000, 3))))
        assert (found > 0).all()


# --- own surface -----------------------------------------------------------------------------------------------------


def test_surface_does_not_stop_its_own_rays(room):
    rng = np.random.default_rng(5)
    sine = np.sin(np.radians(3.0))
    for turn in (*rotations(rng, 12), np.eye(3), unit(np.array([(1, -1, 0), (1, 1, -2), (1, 1, 1.0)]))):
        u, v, n = turn
        shown = room(scene([triangles("plane", quad_corners((0, 0, 0), u, v))]), resolution=128)
        points = rng.uniform(-0.9, 0.9, (2000, 2)) @ np.stack([u, v])
        angle = rng.uniform(0, 2 * np.pi, 2000)
        rise = rng.uniform(sine, 0.5, 2000)
        flat = np.sqrt(1 - rise**2)[:, None]
        direction = rise[:, None] * n + flat * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v)
        found = shown.ask(
            "voxel_trace(voxel_start(P, normal), direction, 1e6)",
            P=points, normal=np.broadcast_to(n, points.shape), direction=direction,
        )  # fmt: skip
        assert (found < 0).all()


def test_points_see_each_other_unless_a_wall_is_between(room):
    rng = np.random.default_rng(6)
    low, high = quad("low", (0, 0, 0)), quad("high", (0, 0, 1))
    P = np.concatenate([rng.uniform(-0.9, 0.9, (3000, 2)), np.zeros((3000, 1))], 1)
    Q = np.concatenate([rng.uniform(-0.9, 0.9, (3000, 2)), np.ones((3000, 1))], 1)
    seen = "voxel_clear(voxel_start(P, vec3(0.0, 0.0, 1.0)), voxel_start(Q, vec3(0.0, 0.0, -1.0)))"
    assert (room(scene([low, high])).ask(seen, P=P, Q=Q) == 1).all()
    walled = room(scene([low, high, quad("wall", (0.0123, 0, 0.5), (0, 1, 0), (0, 0, 0.5))]))
    edge = walled.voxels.edge
    clear = (abs(P[:, 0] - 0.0123) > 2 * edge) & (abs(Q[:, 0] - 0.0123) > 2 * edge)
    between = (P[:, 0] < 0.0123) != (Q[:, 0] < 0.0123)
    found = walled.ask(seen, P=P, Q=Q)
    np.testing.assert_array_equal(found[clear], ~between[clear])
    assert between[clear].any() and not between[clear].all()


def test_point_beside_a_wall_sees_its_own_side_only(room):
    """On a floor that goes on below the wall, nearer to the wall than its voxels reach."""
    rng = np.random.default_rng(8)
    shown = room(scene([quad("floor"), quad("wall", (0.0123, 0, 0.5), (0, 1, 0), (0, 0, 0.5))]), resolution=128)
    edge, count = shown.voxels.edge, 2000
    side = rng.choice([-1, 1], (count, 1))
    x = 0.0123 + side * edge * rng.uniform(0.02, 1.0, (count, 1))
    P = np.concatenate([x, rng.uniform(-0.5, 0.5, (count, 1)), np.zeros((count, 1))], 1)
    end = np.concatenate([rng.choice([-1, 1], (count, 1)) * 0.6, rng.uniform(-0.5, 0.5, (count, 1)), 0 * x + 0.7], 1)
    eye = unit(np.concatenate([0.5 * side, rng.uniform(-0.5, 0.5, (count, 1)), 0 * x + 1.0], 1))
    up = "vec3(0.0, 0.0, 1.0)"
    found = shown.ask(f"voxel_clear(voxel_start_seen(P, {up}, eye), end)", P=P, eye=eye, end=end)
    np.testing.assert_array_equal(found, (np.sign(end[:, :1]) == side)[:, 0])
    assert shown.ask(f"voxel_occupied(voxel_place_at(P), voxel_start(P, {up}))", P=P).mean() > 0.3


# --- work ------------------------------------------------------------------------------------------------------------


def test_only_moved_shapes_and_another_resolution_build_again(room):
    lamp = light("POINT", (0, 0, 0.5), key="lamp")
    ball = sphere("ball", radius=0.3)
    first = scene([FRAME, ball], [lamp])
    shown = room(first)
    assert shown.voxels.built == 1
    moved_lamp = replace(lamp, world_from_light=place((0.2, 0, 0)))
    assert shown.show(scene([FRAME, ball], [moved_lamp])) == 0
    assert shown.show(scene([FRAME, ball], [moved_lamp], albedo=0.1)) == 0
    moved = scene([FRAME, ball], [moved_lamp], matrices={"ball": place((0.2, 0, 0))})
    assert shown.show(moved) == 1 and shown.show(moved) == 0
    assert shown.show(scene([FRAME, ball], visibility={"ball": EVERYTHING & ~Visibility.SHADOW})) == 1
    shown.resolution = 128
    assert shown.show(first) == 1 and shown.show(first) == 0


def test_update_that_was_stopped_begins_anew(room):
    shown = room(scene([FRAME]))
    expected = shown.level(0)
    shown.resolution = 128
    pieces = shown.voxels.update(shown.gpu_scene, 128)
    next(pieces)
    pieces.close()
    shown.resolution = 64
    assert shown.show(scene([FRAME])) == 1
    np.testing.assert_array_equal(shown.level(0), expected)


def test_memory_is_counted_and_given_back(headless_device):
    before = headless_device.allocated_bytes
    shown = Room(headless_device, scene([FRAME]), 512)
    assert 16 << 20 <= headless_device.allocated_bytes - before < 23 << 20
    shown.free()
    shown.voxels.free()
    assert headless_device.allocated_bytes == before


def test_same_scene_gives_the_same_bits(room):
    dust = scene([speckled(np.random.default_rng(2))])
    np.testing.assert_array_equal(room(dust).level(0), room(dust).level(0))
