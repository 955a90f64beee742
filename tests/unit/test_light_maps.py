"""What lights look through, where on the emitter they look from, and which map lies where: numpy only."""

import dataclasses
import math

import numpy as np
import pytest

from rebound.gpu_shaders.frame.light_maps import LightMaps, MapTile
from rebound.gpu_shaders.frame.lights import emitter_points, emitter_sample
from rebound.gpu_shaders.frame.maps import CASCADE_STEP, Atlas, light_faces, light_frame
from rebound.tests.support.render_scenes import light

RNG = np.random.default_rng(2)
BOXES = np.array([[[-3.0, -2.0, -1.0], [2.0, 3.0, 4.0]], [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]])
DEGREES = math.pi / 180


def directions(count):
    v = RNG.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


# --- faces -----------------------------------------------------------------------------------------------------------


def holds(face, points):
    clip = np.concatenate([points, np.ones((*points.shape[:-1], 1))], -1) @ face.clip_from_world.T
    return (np.abs(clip[..., :3]) <= clip[..., 3:] * (1 + 1e-9)).all(-1)


def test_faces_of_a_point_cover_the_sphere_once():
    lamp = light("POINT", (0.3, 0.1, 0.5), (1, 2, 3))
    faces = light_faces(lamp, BOXES)
    d = directions(2000)
    inside = np.array([holds(face, lamp.world_from_light[:3, 3] + 0.5 * d) for face in faces])
    assert len(faces) == 6 and (inside.sum(0) == 1).all()
    # Solid angles of their texels add up to the sphere's.
    line = (np.arange(64) + 0.5) / 32 - 1
    x, y = np.meshgrid(line, line)
    total = sum(f.texel_measure / 64**2 * (1 / (1 + x * x + y * y) ** 1.5).sum() for f in faces)
    assert total == pytest.approx(4 * math.pi, rel=1e-3)


@pytest.mark.parametrize(
    "lamp",
    [light("AREA", (0.3, 0.1, 0.5), (1, 2, 3)), light("SPOT", (0.3, 0.1, 0.5), (1, 2, 3), spot_angle=175 * DEGREES)],
    ids=["area", "wide spot"],
)
def test_faces_of_a_half_cube_cover_what_is_before_it(lamp):
    faces = light_faces(lamp, BOXES)
    d = directions(2000)
    inside = np.array([holds(face, lamp.world_from_light[:3, 3] + 0.5 * d) for face in faces])
    assert len(faces) == 5 and (inside.sum(0)[-(d @ lamp.world_from_light[:3, 2]) > 0] == 1).all()


@pytest.mark.parametrize("scale", [(1, 1, 1), (2, 0.7, 1.3), (3, 1, 0.2)])
def test_faces_of_a_spot_hold_its_cone(scale):
    lamp = light("SPOT", (0.3, 0.1, 0.5), (1, 2, 3), spot_angle=50 * DEGREES, scale=scale)
    local = directions(4000)
    local = local[-local[:, 2] > math.cos(25 * DEGREES)]
    world = local @ lamp.world_from_light[:3, :3].T
    world /= np.linalg.norm(world, axis=1, keepdims=True)
    inside = np.array([holds(f, lamp.world_from_light[:3, 3] + 0.5 * world) for f in light_faces(lamp, BOXES)])
    assert (inside.sum(0) == 1).all()


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "SUN", "AREA"])
def test_face_sees_every_box_with_a_point_in_its_view(kind):
    lamp = light(kind, (0.3, 0.1, 2.5), (1, -0.5, 0), radius=0.1)
    low = RNG.uniform(-3, 2, (300, 3))
    boxes = np.stack([low, low + RNG.uniform(0, 2, (300, 3)) ** 3], 1)
    samples = boxes[:, :1] + RNG.random((300, 200, 3)) * (boxes[:, 1:] - boxes[:, :1])
    for face in light_faces(lamp, boxes):
        seen = face.sees(boxes)
        assert seen[holds(face, samples).any(1)].all()
        assert kind == "SUN" or 0 < seen.sum() < 300  # and it does leave some out
    assert light_faces(lamp, boxes)[0].sees(np.zeros((0, 2, 3))).shape == (0,)


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA"])
def test_far_end_reaches_the_whole_scene_and_not_much_further(kind):
    lamp = light(kind, (0.3, 0.1, 2.5), (1, -0.5, 0))
    corners = np.array(np.meshgrid(*BOXES[0].T)).reshape(3, -1).T
    farthest = np.linalg.norm(corners - (0.3, 0.1, 2.5), axis=1).max()
    for face in light_faces(lamp, BOXES):
        assert farthest <= face.far <= 1.2 * farthest


def test_sun_is_fitted_tightly_to_the_scene():
    sun = light("SUN", (1, 2, 3), (0.2, 0, 0))
    (face,) = light_faces(sun, BOXES[:1])
    corners = np.array(np.meshgrid(*BOXES[0].T)).reshape(3, -1).T
    clip = np.hstack([corners, np.ones((8, 1))]) @ face.clip_from_world.T
    np.testing.assert_allclose(np.abs(clip[:, :3]).max(0), 1, atol=2e-3)
    np.testing.assert_allclose((clip[:, :3].max(0) + clip[:, :3].min(0)), 0, atol=1e-9)
    assert (np.abs(clip[:, :3]) <= 1).all()


def test_sun_over_a_huge_ground_gets_a_near_map_for_the_rest():
    sun = light("SUN", (1, 2, 3), (0, 0, 0))
    ground = np.array([[-100.0, -100, 0], [100, 100, 0]])
    near, *_, far = faces = light_faces(sun, np.stack([ground, *BOXES]))
    corners = np.array(np.meshgrid(*BOXES[0].T)).reshape(3, -1).T
    assert holds(near, corners).all()
    assert holds(far, np.array([ground[0], ground[1]])).all()
    widths = np.array([2 / np.array(face.scale) for face in faces])
    assert near.texel_measure < far.texel_measure / 36
    assert (widths[1:] <= widths[:-1] * (CASCADE_STEP + 0.01)).all(), "no face is so wide that what it adds is coarse"
    # A blocker of any height over the near part is in its depth: the tower that is as tall as the scene.
    assert (near.far, near.face_from_world[2].tolist()) == (far.far, far.face_from_world[2].tolist())


def test_sun_and_degenerate_scenes_give_finite_faces():
    for boxes in (np.zeros((1, 2, 3)), np.array([[[0, 0, 0], [5, 5, 0]]]), np.array([[[1e6] * 3, [1e6 + 1] * 3]])):
        for kind in ("SUN", "POINT", "SPOT", "AREA"):
            for face in light_faces(light(kind, (0, 0, 1)), boxes):
                assert np.isfinite(face.clip_from_world).all() and face.far > 0


@pytest.mark.parametrize("count", [1, 2, 3, 5, 17, 64, 500])
def test_atlas_fits_its_limits_and_its_tiles_lie_apart(count):
    atlas = Atlas.fitting(count, 2048, 1 << 24, 8192)
    width, height = atlas.size
    assert width * height <= 1 << 24 and max(width, height) <= 8192
    assert atlas.tile == 2048 or (2 * atlas.columns * atlas.tile) ** 2 > 1 << 24
    origins = {atlas.origin(i) for i in range(count)}
    assert len(origins) == count
    assert all(x + atlas.tile <= width and y + atlas.tile <= height for x, y in origins)
    assert Atlas.fitting(1, 8192, 1 << 24, 16384).tile == 8192  # one map may be as large as was asked for


# --- points of the emitter -------------------------------------------------------------------------------------------


def points_of(lamp, count=4096, offset=(0.2, 0.6, 0.4)):
    return np.array([emitter_sample(lamp, i, np.array(offset)) for i in range(count)])


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 0, 0), (0.3, -0.5, 0.8)])
def test_sized_point_looks_like_an_even_disc_from_anywhere(axis):
    lamp = light("POINT", (1, 2, 3), radius=0.5)
    offset = (points_of(lamp) - (1, 2, 3)) / 0.5
    axis = np.array(axis) / np.linalg.norm(axis)
    projected = offset - np.outer(offset @ axis, axis)
    radius = np.linalg.norm(projected, axis=1)
    assert radius.max() <= 1 + 1e-9
    # r² of an even disc is even over 0..1.
    np.testing.assert_allclose(
        np.quantile(radius**2, [0.1, 0.25, 0.5, 0.75, 0.9]), [0.1, 0.25, 0.5, 0.75, 0.9], atol=0.01
    )
    np.testing.assert_allclose(projected.mean(0), 0, atol=0.01)


@pytest.mark.parametrize("shape", ["SQUARE", "RECTANGLE", "DISK", "ELLIPSE"])
def test_points_of_an_area_light_are_even_on_its_face(shape):
    lamp = light("AREA", (1, 2, 3), (0, 0, 0), scale=(2, 0.5, 3), area_shape=shape, area_size=(0.4, 1.6))
    local = (np.linalg.inv(lamp.world_from_light) @ np.hstack([points_of(lamp), np.ones((4096, 1))]).T).T
    size = (0.4, 1.6) if shape in ("RECTANGLE", "ELLIPSE") else (0.4, 0.4)
    xy = local[:, :2] / size * 2
    np.testing.assert_allclose(local[:, 2], 0, atol=1e-9)
    if shape in ("SQUARE", "RECTANGLE"):
        cells = np.histogram2d(xy[:, 0], xy[:, 1], 8, [[-1, 1], [-1, 1]])[0]
        assert cells.min() == cells.max() == 64  # a net: as many in every cell
    else:
        radius = np.linalg.norm(xy, axis=1)
        np.testing.assert_allclose(np.quantile(radius**2, [0.25, 0.5, 0.75]), [0.25, 0.5, 0.75], atol=0.01)
        turn = np.histogram(np.arctan2(xy[:, 1], xy[:, 0]), 8)[0]
        np.testing.assert_allclose(turn, 512, rtol=0.03)


def test_directions_to_a_sun_are_even_over_its_cone():
    lamp = light("SUN", (1, 2, 3), angle=40 * DEGREES)
    d = points_of(lamp)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1)
    height = (1 - d @ lamp.world_from_light[:3, 2]) / (1 - math.cos(20 * DEGREES))
    assert height.max() <= 1 + 1e-9
    np.testing.assert_allclose(np.quantile(height, [0.25, 0.5, 0.75]), [0.25, 0.5, 0.75], atol=0.005)


def test_first_points_are_spread_already():
    """So that a few samples give a soft shadow: 16 points lie one in each of 16 cells."""
    lamp = light("AREA", (0, 0, 2), area_size=(2.0, 2.0))
    xy = points_of(lamp, 16, RNG.random(3))[:, :2]
    assert (np.histogram2d(xy[:, 0], xy[:, 1], 4, [[-1, 1], [-1, 1]])[0] == 1).all()


# --- slots of the atlas ----------------------------------------------------------------------------------------------


class FakeDevice:
    """Counts what LightMaps asks for."""

    max_texture_size = 8192

    def __init__(self):
        self.cleared, self.alive = [], set()

    def texture(self, size, format, data=None):
        return self._new()

    def target(self, colors, depth):
        return self._new()

    def _new(self):
        thing = object()
        self.alive.add(thing)
        return thing

    def clear(self, target, color=(), depth=1.0, viewport=None):
        self.cleared.append(viewport)

    def free(self, thing):
        self.alive.remove(thing)


class FakeScene:
    """A scene of which one box moved at each of these revisions."""

    def __init__(self, revision, moved=()):
        self.revision, self._moved = revision, moved

    def moved_since(self, revision, shapes_only=False):
        boxes = [box for when, box in self._moved if when > revision]
        return np.array(boxes).reshape(-1, 2, 3)


def tiles_of(*names, power=b""):
    """One tile for each name; its light stands at 10 times its number along X and looks down."""
    result = []
    for index, name in enumerate(names):
        x = 10.0 * (ord(name) - ord("a"))
        lamp = light("SPOT", (x, 0, 3), (x, 0, 0))
        result.append(MapTile(name, index, light_faces(lamp, np.array([[[0, -1, 0], [100, 1, 0.0]]]))[0], power))
    return result


def draw(maps, scene):
    """Draw what is stale; returns the owners."""
    stale = maps.stale(scene)
    for tile in stale:
        maps.begin(tile, scene)
    return "".join(sorted(tile.owner for tile in stale))


def test_tiles_keep_their_places_and_are_drawn_when_they_must():
    device = FakeDevice()
    maps = LightMaps(device, ["RG16F"])
    maps.lay_out(tiles_of(*"abcd"), 256)
    assert draw(maps, FakeScene(1)) == "abcd"
    assert draw(maps, FakeScene(1)) == ""
    places = {tile.owner: maps.viewport(tile) for tile in maps.tiles}
    assert len(set(places.values())) == 4

    maps.lay_out(tiles_of(*"abd"), 256)  # one goes: its tile is emptied, the others stay
    assert device.cleared[-1] == places["c"]
    assert draw(maps, FakeScene(2)) == ""
    assert {tile.owner: maps.viewport(tile) for tile in maps.tiles} == {k: v for k, v in places.items() if k != "c"}

    maps.lay_out(tiles_of(*"ebad"), 256)  # another comes, and the order changes
    assert draw(maps, FakeScene(3)) == "e"
    under_b = np.array([[10, 0, 0], [10.1, 0.1, 0.1]])
    assert draw(maps, FakeScene(4, [(4, under_b)])) == "b"
    assert draw(maps, FakeScene(5, [(4, under_b)])) == ""
    maps.lay_out(tiles_of(*"ebad", power=b"other"), 256)
    assert draw(maps, FakeScene(5, [(4, under_b)])) == "abde"

    maps.lay_out(tiles_of(*"ebad"), 128)  # another size: all anew
    assert draw(maps, FakeScene(5)) == "abde"
    assert maps.drawn == 4 + 1 + 1 + 4 + 4
    maps.free()
    assert not device.alive


def test_cancelled_drawing_leaves_the_rest_stale():
    maps = LightMaps(FakeDevice(), [])
    maps.lay_out(tiles_of(*"abc"), 64)
    first, *_ = maps.stale(FakeScene(1))
    maps.begin(first, FakeScene(1))
    assert draw(maps, FakeScene(1)) == "bc"
    under_a = np.array([[0, 0, 0], [0.1, 0.1, 0.1]])
    assert [tile.owner for tile in maps.stale(FakeScene(2, [(2, under_a)]))] == ["a"]
    # Cancelled before it was drawn: it still is out of date, though the scene did not change again.
    assert draw(maps, FakeScene(2, [(2, under_a)])) == "a"


def test_maps_of_a_sheared_light_have_a_frame_at_right_angles():
    sheared = np.eye(4)
    sheared[:3, :3] = [[1.0, 0.5, 0.3], [0.0, 2.0, 0.2], [0.0, 0.0, -0.7]]
    frame = light_frame(dataclasses.replace(light("AREA", (0, 0, 0), (0, 0, -1)), world_from_light=sheared))
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(frame[:, 2], sheared[:3, 2] / np.linalg.norm(sheared[:3, 2]), atol=1e-12)
    assert np.linalg.det(frame) > 0, "maps are not mirrored, whatever the light is"


def test_face_of_a_sheared_spot_holds_its_whole_cone():
    sheared = np.eye(4)
    sheared[:3, :3] = [[1.0, 0.5, 0.3], [0.0, 2.0, 0.2], [0.0, 0.0, 0.7]]
    spot = dataclasses.replace(light("SPOT", (0, 0, 0), (0, 0, -1), spot_angle=50 * DEGREES), world_from_light=sheared)
    (face,) = light_faces(spot, BOXES)
    around = np.linspace(0, 2 * math.pi, 32)
    edge = np.stack([np.cos(around), np.sin(around), np.full(32, -1 / math.tan(25 * DEGREES))], 1)
    assert holds(face, 0.3 * edge @ sheared[:3, :3].T).all()


@pytest.mark.parametrize("size", [(2.0, 0.0, 2.0), (0.0, 0.0, 2.0)], ids=["wall", "pole"])
def test_thin_object_on_a_huge_ground_is_held_by_finite_faces(size):
    """Seen along a sun that stands overhead, a wall has no width and a pole none at all."""
    thin = np.array([np.zeros(3), size])
    ground = np.array([[-100.0, -100, 0], [100, 100, 0]])
    faces = light_faces(light("SUN", (0, 0, 0), (0, 0, -1)), np.stack([thin, ground]))
    assert len(faces) <= 5
    for face in faces:
        assert np.isfinite(face.clip_from_world).all()
        assert holds(face, 0.99 * thin + 0.01 * thin.mean(0)).all()


def test_samples_of_a_sun_agree_on_the_number_of_faces():
    boxes = np.concatenate([BOXES, [[[-9.2, -9.2, 0.0], [9.2, 9.2, 0.0]]]])
    sun = light("SUN", (0, 0, 0), (0.3, 0.2, -1), angle=40 * DEGREES)
    counts = {len(light_faces(sun, boxes, emitter_sample(sun, i, np.zeros(3)))) for i in range(64)}
    assert counts == {len(light_faces(sun, boxes))}


def test_points_of_an_area_light_lie_evenly_on_it():
    def points(most, **fields):
        found = emitter_points(light("AREA", (1, 2, 3), (1, 2, 0), area_size=(4.0, 1.9), **fields), 1.0, most)
        return np.array([(1, 2, 3) if point is None else point for point in found]) - (1, 2, 3)

    sizes = [len(points(most, area_shape="RECTANGLE")) for most in (9, 6, 0)]
    assert sizes == [8, 6, 1]
    assert emitter_points(light("AREA", area_size=(4.0, 4.0)), 0.0, 9) == [None]
    rectangle = points(9, area_shape="RECTANGLE")
    np.testing.assert_allclose(rectangle.mean(0), 0.0, atol=1e-12)
    assert sorted(set(np.abs(rectangle[:, :2]).ravel().round(6))) == [0.475, 0.5, 1.5]
    ellipse = points(9, area_shape="ELLIPSE")
    assert len(ellipse) == 8 and ((ellipse[:, :2] / (2.0, 0.95)) ** 2).sum(1).max() < 1.0
