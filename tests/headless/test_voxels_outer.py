"""Voxels around the scene's own grid: huge objects that it leaves out block rays, near and far."""

import math

import numpy as np
import pytest

from rebound.gpu_shaders.frame.voxel_grids import FLUSH, MOST_OUTER_GRIDS, OUTER_STEP, nested_grids
from rebound.scene.data import World
from rebound.tests.support.render_scenes import Studio, box, light, ortho, quad, scene, triangles
from rebound.tests.support.voxel_reference import Room, coarser
from rebound.tests.support.vpl_scenes import BLACK, GREY, form_factor, gathered, still

TRACE = "voxel_trace(start, direction, 1e6)"
CUBE = box("cube", (-0.5, -0.5, 0), (0.5, 0.5, 1))
HALVES = [5.0, 40.0, 300.0]


def ground(half, z=0.0):
    return quad("ground", (0, 0, z), (half, 0, 0), (0, half, 0))


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def cosine(rng, normals):
    """Directions whose density goes with the cosine to their normals."""
    return unit(unit(rng.normal(size=normals.shape)) + normals)


def cube_sides(rng, count):
    """(points, normals) of the cube's four sides and its top."""
    side = rng.integers(0, 5, count)
    axis, sign = np.array([0, 0, 1, 1, 2])[side], np.array([-1, 1, -1, 1, 1])[side]
    points, normals = rng.uniform(-0.5, 0.5, (count, 3)), np.zeros((count, 3))
    points[np.arange(count), axis] = 0.5 * sign
    normals[np.arange(count), axis] = sign
    return points + (0, 0, 0.5), normals


# --- where they lie --------------------------------------------------------------------------------------------------


def boxes(*sizes):
    return np.array([[(-size,) * 3, (size,) * 3] for size in sizes], np.float64)


def test_there_is_one_grid_where_nothing_is_left_out():
    assert len(nested_grids(boxes(1, 1, 1, 5.9), 64)) == 1
    assert len(nested_grids(boxes(0), 64)) == 1


@pytest.mark.parametrize(("half", "count"), [(6.1, 2), (15.9, 2), (16.5, 3), (300, 5), (5000, 5), (1e6, 5)])
def test_grids_hold_each_other_up_to_everything(half, count):
    grids = nested_grids(np.array([[(-1, -1, 0), (1, 1, 2)], [(-half, -half, 0), (half, half, 0)]], np.float64), 64)
    assert len(grids) == 1 + count and count <= MOST_OUTER_GRIDS
    for inside, around in zip(grids, grids[1:], strict=False):
        assert (around.bounds[0] <= inside.bounds[0]).all() and (around.bounds[1] >= inside.bounds[1]).all()
        assert around.size.max() <= 131
    widths = [np.ptp(grid.bounds, axis=0).max() for grid in grids]
    steps = np.divide(widths[1:], widths[:-1])
    assert (steps < max(OUTER_STEP, (half / 0.9) ** 0.2) * 1.1).all()
    assert (abs(grids[-1].bounds[:, :2]) >= half).all()


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1, 1])
def test_layer_of_a_huge_plane_ends_where_the_plane_does(room, axis, sign):
    n, u, v = np.roll(np.eye(3), -axis, 0)
    at = sign * 1.234
    shown = room(scene([box("cube", (-1.3,) * 3, (1.3,) * 3), quad("plane", at * n, 700 * u, 700 * v)]))
    assert len(shown.voxels.grids) > 4
    for number, grid in enumerate(shown.voxels.grids[1:], 1):
        cells = shown.level(0, number)
        layers = np.unique(np.argwhere(cells)[:, axis])
        assert len(layers) == 1
        face = grid.origin[axis] + grid.edge * (layers[0] + (sign < 0))
        assert abs(face - at) == pytest.approx(FLUSH * grid.edge, rel=0.01)
        for level in (1, 2):
            np.testing.assert_array_equal(
                shown.level(level, number), coarser(shown.level(level - 1, number), grid.bricks[level])
            )


def test_outer_grids_hold_nothing_of_what_the_inner_one_holds(room):
    shown = room(scene([CUBE, ground(40)]))
    for number in range(1, len(shown.voxels.grids)):
        inside, grid = shown.voxels.grids[number - 1], shown.voxels.grids[number]
        voxels = np.argwhere(shown.level(0, number))
        low = grid.origin + grid.edge * voxels
        overlap = (low > inside.bounds[0]) & (low + grid.edge < inside.bounds[1])
        assert len(voxels) > 5000 and not overlap.all(1).any()
        assert len(np.unique(voxels[:, 2])) == 1  # the ground alone


def test_edge_tells_the_grid_of_a_point(room):
    shown = room(scene([CUBE, ground(300)]))
    grids = shown.voxels.grids
    points = np.array([grid.bounds[1] - 0.4 * grid.edge for grid in grids] + [(9e3, 0, 0)])
    expected = [grid.edge for grid in grids] + [grids[-1].edge]
    np.testing.assert_allclose(shown.ask("voxel_edge_at(P)", P=points), expected, rtol=1e-6)


# --- rays ------------------------------------------------------------------------------------------------------------


def nearest_hit(layers, origin, direction):
    """Metres to the first occupied voxel: a grid that the ray starts in is asked up to its end, then the next one."""
    way, met = 0.0, math.inf
    for grid, low in layers:
        a, b = ((bound - origin) / direction for bound in grid.bounds)
        first, last = np.minimum(a, b).max(), min(np.maximum(a, b).min(), met)
        c, d = (low - origin) / direction, (low + grid.edge - origin) / direction
        enter, leave = np.maximum(np.minimum(c, d).max(1), max(first, way)), np.maximum(c, d).min(1)
        met = min(met, enter[(enter < leave) & (enter < last)].min(initial=math.inf))
        if first <= 0:
            way = min(max(last, way), met)
    return met


@pytest.mark.parametrize("spread", [1.0, 30.0])
def test_ray_meets_what_a_test_of_every_voxel_finds(room, spread):
    rng = np.random.default_rng(int(spread))

    def dust(name, size, count):
        centers = np.concatenate([rng.uniform(-size, size, (count, 3)), [(-size,) * 3, (size,) * 3]])
        return triangles(name, (centers[:, None] + rng.normal(0, 0.03 * size, (count + 2, 3, 3))).reshape(-1, 3))

    shown = room(scene([dust("near", 1, 150), dust("far", 30, 1500)]))
    grids = shown.voxels.grids
    assert len(grids) == 4
    layers = [(grid, grid.origin + grid.edge * np.argwhere(shown.level(0, n))) for n, grid in enumerate(grids)]
    start = rng.uniform(-spread, spread, (300, 3)).astype(np.float32).astype(np.float64)
    toward = np.where(rng.random((300, 1)) < 0.5, -start, rng.normal(size=(300, 3))) + rng.normal(0, 0.02, (300, 3))
    direction = unit(toward).astype(np.float32).astype(np.float64)
    found = shown.ask(TRACE, start=start, direction=direction)
    expected = np.array([nearest_hit(layers, *ray) for ray in zip(start, direction, strict=True)])
    found = np.where(found < 0, math.inf, found)
    assert np.isfinite(expected).mean() > 0.2 and (expected > 1.5).any() and not (expected == 0).all()
    # A ray that touches a voxel within rounding may meet it or not.
    assert (~np.isclose(found, expected, rtol=1e-4, atol=1e-3)).sum() <= 3


@pytest.mark.parametrize("half", HALVES)
def test_rays_from_a_cube_meet_the_ground_where_it_is(room, half):
    rng = np.random.default_rng(2)
    shown = room(scene([CUBE, ground(half)]), resolution=128)
    points, normals = cube_sides(rng, 20000)
    points[:, 2] = 0.02 + 0.98 * points[:, 2]  # within two voxels of the ground nothing is told
    direction = cosine(rng, normals)
    found = shown.ask("voxel_trace(voxel_start(P, n), direction, 1e6)", P=points, n=normals, direction=direction)
    away = -points[:, 2] / direction[:, 2]
    meets = (away > 0) & (abs(points + away[:, None] * direction)[:, :2] < half).all(1)
    assert 0.3 < meets.mean() < 0.45
    assert (meets & (found < 0)).mean() < 1e-3 and (~meets & (found >= 0)).mean() < 1e-3
    both = meets & (found >= 0)
    # The layer of a grid ends FLUSH of its edge above the ground, and the ray started a voxel off the cube.
    early = (away - found)[both] * -direction[both, 2]
    assert early.max() < FLUSH * 2 * half / 120 + 1.2 * shown.voxels.edge
    assert np.median(abs(early)) < shown.voxels.edge


@pytest.mark.parametrize("degrees", [1, 10, 45])
def test_tilted_ground_loses_no_ray_and_blocks_few_too_many(room, degrees):
    """Rays that leave the inner grid within an outer voxel of the ground are blocked at once."""
    rng = np.random.default_rng(3)
    a = math.radians(degrees)
    u, v = np.array([math.cos(a), 0, math.sin(a)]), np.array([0.0, 1, 0])
    n, center = np.cross(u, v), np.array([0, 0, 0.5 * math.tan(a)])
    shown = room(scene([CUBE, quad("ground", center, 40 * u, 40 * v)]), resolution=128)
    points, normals = cube_sides(rng, 20000)
    clear = (points - center) @ n > 3 * shown.voxels.edge
    direction = cosine(rng, normals)
    found = shown.ask("voxel_trace(voxel_start(P, n), direction, 1e6)", P=points, n=normals, direction=direction)
    away = -((points - center) @ n) / (direction @ n)
    at = points + away[:, None] * direction - center
    meets = (away > 0) & (abs(at @ u) < 40) & (abs(at @ v) < 40)
    assert (meets & (found < 0))[clear].mean() < 2e-3
    assert (~meets & (found >= 0))[clear].mean() < 0.025


@pytest.mark.parametrize("half", HALVES)
def test_ground_outside_does_not_stop_its_own_rays(room, half):
    rng = np.random.default_rng(4)
    shown = room(scene([CUBE, ground(half)]), resolution=128)
    points = np.concatenate([rng.uniform(-half, half, (5000, 2)), np.zeros((5000, 1))], 1)
    points = points[(abs(points[:, :2]) > 0.6).any(1)]
    toward = unit(points * (1, 1, 0))
    direction = unit(toward + rng.normal(0, 0.3, toward.shape) * (1, 1, 0) + (0, 0, math.tan(math.radians(1))))
    up = "vec3(0.0, 0.0, 1.0)"
    found = shown.ask(f"voxel_trace(voxel_start(P, {up}), direction, 1e6)", P=points, direction=direction)
    assert (found < 0).all()
    # Nor is it left by more than in the inner grid, where its layer allows: contacts stay.
    near = points[(abs(points[:, :2]) < 1.9).all(1)] if half < 40 else np.array([(1.0, 0.3, 0.0), (-0.8, 0.7, 0.0)])
    lift = shown.ask(f"voxel_start(P, {up}).z", P=near)
    assert (lift < 1.1 * shown.voxels.edge).all()


def test_points_of_the_ground_see_the_cube_and_not_through_it(room):
    shown = room(scene([CUBE, ground(40)]), resolution=128)
    clear = "float(voxel_clear(voxel_start(P, vec3(0.0, 0.0, 1.0)), voxel_start(Q, n)))"
    P = np.array([(-3.0, 0.1, 0), (-20.0, 3.0, 0), (3.0, 0.1, 0), (20.0, 3.0, 0), (3.0, 0.1, 0)])
    Q = np.array([(-0.5, 0.1, 0.5)] * 4 + [(-4.0, 0.0, 0)])
    n = np.array([(-1.0, 0, 0)] * 4 + [(0.0, 0, 1)])
    np.testing.assert_array_equal(shown.ask(clear, P=P, Q=Q, n=n), [1, 1, 0, 0, 0])


def test_memory_is_given_back(headless_device):
    before = headless_device.allocated_bytes
    shown = Room(headless_device, scene([CUBE, ground(300)]), 256)
    assert headless_device.allocated_bytes - before < 6 << 20
    shown.free()
    assert headless_device.allocated_bytes == before


# --- light -----------------------------------------------------------------------------------------------------------

FRONT = ortho(16, 16, 0.9, (0, -3, 0.5), (0, 0, 0.5), up=(0, 0, 1))
BLOCK = box("block", (-0.5, 0, 0), (0.5, 1, 1))  # its side at y = 0 is what the camera sees


@pytest.fixture(scope="module")
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


@pytest.mark.parametrize("half", [2.0, *HALVES])
def test_black_ground_hides_its_part_of_the_sky(studio, half):
    shown = still([ground(half), BLOCK], materials=[BLACK, GREY], world=World((1.0, 1.0, 1.0)))
    found, points = gathered(studio, shown, FRONT, 24, "diffuse_direct")
    hidden = form_factor(points, (0, -1, 0), (0, -half / 2, 0), (half, 0, 0), (0, half / 2, 0))
    assert found.mean() == pytest.approx(1 - hidden.mean(), rel=0.05)  # noise of the mean: 1.5 %


@pytest.mark.parametrize("half", HALVES)
def test_sunlit_ground_bounces_up_as_every_texel_of_its_map_does(studio, half):
    shown = still([ground(half), BLOCK], [light("SUN", (0, 0, 5), power=math.pi)])
    found, _ = gathered(studio, shown, FRONT, 48, vpl_resolution=128)
    gather = {"method": "RSM", "rsm_estimator": "ALL_TEXELS", "rsm_resolution": 128}
    expected, _ = gathered(studio, shown, FRONT, 1, **gather)
    assert 0.22 < expected.mean() < 0.25
    assert found.mean() == pytest.approx(expected.mean(), rel=0.03)
    rows = found.mean(1) / expected.mean(1)
    assert abs(rows - 1).max() < 0.08  # noise, and no step where the block's side nears the ground
