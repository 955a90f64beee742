"""Voxels on Blender's device, on the backend that the run asked for: atomics of a draw, and the rays that read them."""

import numpy as np

from rebound.device.blender import BlenderDevice
from rebound.tests.support.render_scenes import box, place, quad, scene, sphere
from rebound.tests.support.voxel_reference import Room, coarser, first_hits

FRAME = box("frame", (-1, -1, -1), (1, 1, 1))


def test_rays_meet_what_was_drawn(gpu_backend):
    device = BlenderDevice()
    room = Room(device, scene([FRAME, sphere("ball", radius=0.5)]), 136)
    grid, voxels = room.voxels.grid, room.level(0)
    for axis in range(3):  # more than one tile of a software rasterizer: none may be lost
        assert voxels.take([0, 135], axis).sum() == 2 * 136 * 136
    for level in (1, 2):
        np.testing.assert_array_equal(room.level(level), coarser(room.level(level - 1), grid.bricks[level]))
    rng = np.random.default_rng(1)
    start = rng.uniform(-0.9, 0.9, (100, 3)).astype(np.float32).astype(np.float64)
    direction = rng.normal(size=(100, 3))
    direction = (direction / np.linalg.norm(direction, axis=1, keepdims=True)).astype(np.float32).astype(np.float64)
    found = room.ask("voxel_trace(start, direction, 1e6)", start=start, direction=direction)
    expected = first_hits(voxels, grid, start, direction, 1e6)
    assert np.isfinite(expected).all() and (expected == 0).mean() < 0.1
    assert (~np.isclose(found, expected, atol=1e-3 * grid.edge)).sum() <= 1
    room.free()
    device.close()


def test_moved_object_leaves_no_voxel_behind(gpu_backend):
    device = BlenderDevice()
    corners = [FRAME, quad("wall", u=(0, 0.5, 0), v=(0, 0, 0.5))]
    room = Room(device, scene(corners))
    assert room.level(0)[30:33, 30:33, 30:33].any()
    assert room.show(scene(corners, matrices={"wall": place((0.5, 0, 0))})) == 1
    assert not room.level(0)[30:33, 30:33, 30:33].any()
    room.free()
    device.close()


def test_rays_meet_a_ground_that_goes_on_outside(gpu_backend):
    device = BlenderDevice()
    room = Room(device, scene([FRAME, quad("ground", (0, 0, -1), (300, 0, 0), (0, 300, 0))]))
    assert len(room.voxels.grids) == 6
    start = np.array([(x, 0.5, 2.0) for x in (0.0, 3.0, 20.0, 200.0, 400.0)])
    slanting = np.array([(0.6, 0.0, -0.8)] * 5)
    found = room.ask("voxel_trace(start, direction, 1e6)", start=start, direction=slanting)
    expected = [(2.0 - 1.0) / 0.8, *[3.0 / 0.8] * 3, -1.0]  # the first on the frame's top
    np.testing.assert_allclose(found, expected, atol=0.1)
    room.free()
    device.close()
