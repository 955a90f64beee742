"""Tubes and balls stand for circles: as wide as them on average, closed around their curves, in any number."""

import numpy as np
import pytest

from rebound.scene import strands
from rebound.scene.strands import Curves, balls, tubes


def curves(points, radii=0.1, offsets=None, **more):
    points = np.asarray(points, np.float32)
    offsets = np.array([0, len(points)] if offsets is None else offsets)
    count = len(offsets) - 1
    flags = {"cyclic": np.zeros(count, bool), "straight": np.zeros(count, bool)} | more
    return Curves(points, np.broadcast_to(np.float32(radii), len(points)), offsets, **flags)


def outline(found, direction):
    """Area of a mesh's outline seen along a direction: half the sum of what its faces show, if it is convex."""
    a, b, c = found.positions.astype(np.float64).reshape(-1, 3, 3).swapaxes(0, 1)
    return 0.25 * np.abs(np.cross(b - a, c - a) @ direction).sum()


def directions(count=400):
    rng = np.random.default_rng(1)
    found = rng.normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@pytest.mark.parametrize("most", [1, 25, 1000])
def test_straight_tube_is_as_wide_as_its_circle_on_average(monkeypatch, most):
    monkeypatch.setattr(strands, "_MOST_TRIANGLES", most)
    found = tubes(curves([[0, 0, 0], [0, 0, 5.0]]))
    turn = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    sides = np.stack([np.cos(turn), np.sin(turn), 0 * turn], -1)
    seen = np.mean([outline(found, side) for side in sides])
    assert seen == pytest.approx(5 * 2 * 0.1, rel=2e-3)
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1, atol=1e-5)


@pytest.mark.parametrize("faces", [8, 20, 80, 320])
def test_ball_is_as_large_as_its_disc_on_average(monkeypatch, faces):
    monkeypatch.setattr(strands, "_MOST_TRIANGLES", faces)
    found = balls(np.zeros((1, 3), np.float32), np.full(1, 0.5, np.float32))
    assert len(found.positions) == 3 * faces
    seen = np.mean([outline(found, direction) for direction in directions()])
    assert seen == pytest.approx(np.pi * 0.25, rel=0.01)


@pytest.mark.parametrize("faces", [8, 20, 80, 320])
def test_faces_of_balls_are_seen_from_outside(monkeypatch, faces):
    monkeypatch.setattr(strands, "_MOST_TRIANGLES", faces)
    found = balls(np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    a, b, c = found.positions.reshape(-1, 3, 3).swapaxes(0, 1)
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a) > 0).all()


def test_curve_goes_through_its_points_and_tapers():
    through = [[0, 0, 0], [1, 1, 0], [2, 0, 0], [3, 1, 0]]
    found = tubes(curves(through, [0.1, 0.1, 0.1, 0.0]))
    for point in through:
        assert np.linalg.norm(found.positions - point, axis=1).min() < 0.12
    tip = found.positions[found.positions[:, 0] > 2.999]
    np.testing.assert_allclose(tip, np.broadcast_to([3, 1, 0], tip.shape), atol=1e-3)


def test_cyclic_curve_closes():
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], -1)
    found = tubes(curves(ring, 0.05, cyclic=np.array([True])))
    angles = np.sort(np.arctan2(found.positions[:, 1], found.positions[:, 0]))
    assert np.diff(angles).max() < 0.2
    distance = np.hypot(np.linalg.norm(found.positions[:, :2], axis=1) - 1, found.positions[:, 2])
    assert distance.max() < 0.07


def test_bezier_follows_its_handles():
    points = np.array([[0, 0, 0], [1, 0, 0]], np.float32)
    handles = points - [0, 1, 0], points + [0, 1, 0]
    found = tubes(curves(points, 0.01, handles=handles, bezier=np.array([True])))
    middle = found.positions[np.abs(found.positions[:, 0] - 0.5) < 0.05]
    assert middle[:, 1].max() > -0.02 and np.abs(found.positions[:, 1]).max() < 0.5


def test_what_cannot_be_drawn_is_left_out():
    points = np.array([[0, 0, 0], [0, 0, 1], [5, 5, 5], [np.nan, 0, 0], [1, 1, 1], [2, 2, 2], [2, 2, 3]], np.float32)
    found = tubes(curves(points, 0.1, [0, 2, 3, 5, 7]))
    assert np.isfinite(found.positions).all() and found.positions.max() < 4
    assert len(tubes(curves(points[:1])).positions) == 0
    assert len(tubes(curves(np.zeros((0, 3)), offsets=[0])).positions) == 0
    assert len(balls(points[3:4], np.ones(1, np.float32)).positions) == 0


def test_neighbours_are_not_joined():
    found = tubes(curves([[0, 0, 0], [0, 0, 1], [9, 0, 0], [9, 0, 1]], 0.1, [0, 2, 4]))
    assert not ((found.positions[:, 0] > 1) & (found.positions[:, 0] < 8)).any()
    low, high = found.positions.reshape(-1, 3, 3)[..., 0].min(1), found.positions.reshape(-1, 3, 3)[..., 0].max(1)
    assert (high - low).max() < 0.3
