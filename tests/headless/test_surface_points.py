"""Points of surfaces in a tile: where they are, how they face, what they emit and reflect, and when they are new."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rebound.gpu_shaders.frame.reflective_shaders import SourceKind
from rebound.gpu_shaders.frame.surface_points import SIDES, SurfacePoints
from rebound.scene.data import Image, Material, Mesh, Visibility
from rebound.tests.support.graphs import image_material
from rebound.tests.support.render_scenes import Studio, aimed, box, place, quad, scene, sphere, triangles

SIDE = 32
FORMATS = ("RGBA32F", "RGBA16F", "RGBA32F", "RGBA16F")
NAMES = ("position_area", "normal", "flux", "reflectance")
TILE = (8, 40, SIDE, SIDE)

FLOOR, LAMP = quad("floor", u=(3, 0, 0), v=(0, 2, 0)), quad("lamp", (0, 0, 2), (0.5, 0, 0), (0, 0.25, 0))
BALL = sphere("ball", radius=0.5)
MATERIALS = (
    Material("grey", (0.5, 0.25, 0.125)),
    Material("lamp", (0.0, 0.0, 0.0), emission=(8.0, 4.0, 2.0)),
    Material("ball", (1.0, 0.5, 2.0), emission=(1.0, 1.0, 1.0)),
)
TURN = aimed((0, 0, 0), (1, 2, 3))


def picture(materials=MATERIALS, ball=None, **fields):
    matrices = {"ball": place((0, 0, 1)) if ball is None else ball, "floor": place((0, 0, -1), None, (1, 1.5, 1))}
    return scene([FLOOR, LAMP, BALL], materials=list(materials), matrices=matrices, **fields)


class Tile:
    """Points of one kind in a tile of larger textures, which hold ones elsewhere."""

    def __init__(self, device, kind):
        self.studio, self.device = Studio(device), device
        self.points = SurfacePoints(device, kind)
        size = (TILE[0] + SIDE + 5, TILE[1] + SIDE + 3)
        self.colors = [device.texture(size, name) for name in FORMATS]
        self.depth = device.texture(size, "DEPTH32F")
        self.target = device.target(self.colors, self.depth)
        device.clear(self.target, (1.0, 1.0, 1.0, 1.0), depth=0.25)

    def update(self, shown, seed=0):
        self.studio.show(shown)
        return self.points.update(self.studio.gpu_scene, SIDE, seed)

    def draw(self, shown):
        """What the four textures hold of each point, (n, 4) float64 by name."""
        self.update(shown)
        self.points.draw(self.studio.gpu_scene, self.target, TILE)
        x, y, w, h = TILE
        found = {}
        for name, texture in zip(NAMES, self.colors, strict=True):
            whole = self.device.read(texture)
            found[name] = whole[y : y + h, x : x + w].reshape(-1, 4).astype(np.float64)
            whole[y : y + h, x : x + w] = 1.0
            assert (whole == 1.0).all()
        assert self.device.error == "GL_NO_ERROR"
        return found

    def free(self):
        self.points.free()
        for resource in (self.target, *self.colors, self.depth):
            self.device.free(resource)
        self.studio.free()


@pytest.fixture(params=["AREA", "EMISSION"])
def either(request, headless_device):
    tile = Tile(headless_device, request.param)
    yield tile
    tile.free()


@pytest.fixture
def area(headless_device):
    tile = Tile(headless_device, "AREA")
    yield tile
    tile.free()


@pytest.fixture
def emission(headless_device):
    tile = Tile(headless_device, "EMISSION")
    yield tile
    tile.free()


def ball_area(matrix=None):
    a, b, c = BALL.positions.reshape(-1, 3, 3).astype(np.float64).swapaxes(0, 1)
    linear = np.eye(3) if matrix is None else matrix[:3, :3]
    return 0.5 * np.linalg.norm(np.cross((b - a) @ linear.T, (c - a) @ linear.T), axis=1).sum()


FLOOR_AREA, LAMP_AREA = 36.0, 0.5


def test_area_points_lie_on_surfaces_with_their_reflectance(area):
    found = area.draw(picture())
    position, weight = found["position_area"][:, :3], found["position_area"][:, 3]
    on_floor = np.abs(position[:, 2] + 1) < 1e-6
    on_lamp = np.abs(position[:, 2] - 2) < 1e-6
    on_ball = ~on_floor & ~on_lamp
    total = FLOOR_AREA + LAMP_AREA + ball_area()
    assert area.points.count == SIDE**2
    assert area.points.total_area == pytest.approx(total, rel=0.01)
    for mask, size, color in (
        (on_floor, FLOOR_AREA, (0.5, 0.25, 0.125)),
        (on_lamp, LAMP_AREA, (0, 0, 0)),
        (on_ball, ball_area(), (1, 0.5, 1)),
    ):
        assert weight[mask].sum() == pytest.approx(SIDES * size, abs=SIDES * 3 * total / SIDE**2)
        np.testing.assert_allclose(found["reflectance"][mask], np.broadcast_to((*color, 1), (mask.sum(), 4)), atol=1e-3)
    assert (np.abs(position[on_floor][:, :2]) <= (3, 3)).all() and np.abs(position[on_floor][:, 1]).max() > 2.9
    np.testing.assert_allclose(np.linalg.norm(position[on_ball] - (0, 0, 1), axis=1), 0.5, atol=0.01)
    assert (found["flux"] == (0, 0, 0, 1)).all()


def test_normals_are_unit_and_on_both_sides(either):
    found = either.draw(picture())
    normal, position = found["normal"], found["position_area"][:, :3]
    np.testing.assert_allclose(np.linalg.norm(normal[:, :3], axis=1), 1, atol=2e-3)
    assert (normal[:, 3] == (SourceKind.CACHE if either.points.kind == "AREA" else SourceKind.EMISSION)).all()
    ball = (position[:, 2] > -0.9) & (position[:, 2] < 1.9)
    outward = ((position - (0, 0, 1))[ball] / 0.5 * normal[ball, :3]).sum(1)
    # A facet's own normal is a few degrees off the sphere's.
    np.testing.assert_allclose(np.abs(outward), 1, atol=0.01)
    assert np.sign(outward).mean() == pytest.approx(0, abs=0.1)


def test_area_has_the_shading_and_emission_the_geometric_normal(either):
    tilted = triangles("tilted", LAMP.positions, np.tile(np.float32([0.6, 0, 0.8]), (6, 1)))
    found = either.draw(scene([tilted], materials=[MATERIALS[1]], matrices={"tilted": place((1, 2, 3), TURN)}))
    local = found["normal"][:, :3] @ TURN
    expected = np.array([0.6, 0, 0.8] if either.points.kind == "AREA" else [0, 0, 1])
    np.testing.assert_allclose(local, np.sign(local[:, 2:]) * expected, atol=2e-3)


@pytest.mark.parametrize("scale", [(1, 1, 1), (3, 3, 3), (0.1, 1, 4), (-1, 2, 1)], ids=str)
def test_flux_is_pi_times_radiance_times_both_sides(emission, scale):
    matrix = place((0, 0, 1), TURN, scale)
    found = emission.draw(picture(ball=matrix))
    lamp = LAMP_AREA * np.array([8.0, 4.0, 2.0])
    expected = math.pi * SIDES * (lamp + ball_area(matrix))
    np.testing.assert_allclose(found["flux"][:, :3].sum(0), expected, rtol=0.01)
    assert emission.points.total_area == pytest.approx(LAMP_AREA + ball_area(matrix), rel=0.03)
    assert not found["reflectance"].any()
    on_lamp = np.abs(found["position_area"][:, 2] - 2) < 1e-6
    flat = on_lamp & (np.abs(found["position_area"][:, :2]) <= (0.5, 0.25)).all(1)
    radiance = found["flux"][flat, :3] / (math.pi * found["position_area"][flat, 3:])
    np.testing.assert_allclose(radiance, np.broadcast_to((8, 4, 2), radiance.shape), rtol=1e-5)


def test_emitters_share_points_by_what_they_emit(emission):
    found = emission.draw(picture())
    on_lamp = np.abs(found["position_area"][:, 2] - 2) < 1e-6
    lamp = LAMP_AREA * (8 * 0.2126 + 4 * 0.7152 + 2 * 0.0722)
    assert on_lamp.mean() == pytest.approx(lamp / (lamp + ball_area()), abs=0.005)


def textured(emits):
    """A quad whose left half has a red and whose right half a blue texel, and a brown second image nobody uses."""
    pixels = np.ones((1, 2, 4), np.float32)
    pixels[0, :, :3] = (1, 0, 0), (0, 0, 0.5)
    image = Image("image", "image", pixels)
    uvs = {"uv": (LAMP.positions[:, :2] / (1.0, 0.5) + 0.5).astype(np.float32)}
    mesh = Mesh("textured", LAMP.positions, LAMP.normals, uvs, "uv", ((0, 0, 2),), LAMP.bounds)
    material = image_material("shown", image, 4.0 if emits else 0.0, closest=True)
    return replace(scene([replace(mesh, key=("textured", 0))], materials=[material]), images={"image": image})


def test_texture_colours_what_is_emitted(emission):
    found = emission.draw(textured(True))
    left = found["position_area"][:, 0] < 0
    assert (found["flux"][left, 0] > 0).all() and not found["flux"][left, 2].any()
    assert (found["flux"][~left, 2] > 0).all() and not found["flux"][~left, 0].any()
    expected = math.pi * SIDES * 0.25 * np.array([4, 0, 2])
    np.testing.assert_allclose(found["flux"][:, :3].sum(0), expected, rtol=0.01)


def test_texture_colours_what_is_reflected(area):
    found = area.draw(textured(False))
    left = found["position_area"][:, :1] < 0
    np.testing.assert_allclose(found["reflectance"][:, :3], np.where(left, (1, 0, 0), (0, 0, 0.5)), atol=1e-3)


def test_rigid_move_makes_no_new_points_but_moves_them(either):
    before = either.draw(picture())
    table = either.points._table
    moved = place((3, 1, 4), TURN)
    assert either.update(picture(ball=moved)) is True
    after = either.draw(picture(ball=moved))
    assert either.points._table is table
    still = (np.abs(before["position_area"][:, 2, None] - (-1, 2)) < 1e-6).any(1)
    np.testing.assert_array_equal(before["position_area"][still], after["position_area"][still])
    expected = (before["position_area"][~still, :3] - (0, 0, 1)) @ TURN.T + (3, 1, 4)
    np.testing.assert_allclose(after["position_area"][~still, :3], expected, atol=1e-5)
    np.testing.assert_allclose(after["normal"][~still, :3], before["normal"][~still, :3] @ TURN.T, atol=3e-3)
    np.testing.assert_array_equal(after["position_area"][:, 3], before["position_area"][:, 3])


def test_points_are_drawn_anew_only_for_what_has_points(either):
    assert either.update(picture()) is True
    assert either.update(picture()) is False
    table = either.points._table
    hidden = {"floor": Visibility.CAMERA | Visibility.SHADOW}
    assert either.update(picture(visibility=hidden)) is (either.points.kind == "AREA")
    either.update(picture())
    painted = (replace(MATERIALS[0], base_color=(0.1, 0.1, 0.1)), *MATERIALS[1:])
    table = either.points._table
    assert either.update(picture(painted)) is (either.points.kind == "AREA")
    dimmed = (painted[0], *(replace(m, emission=tuple(0.5 * c for c in m.emission)) for m in MATERIALS[1:]))
    assert either.update(picture(dimmed)) is True
    assert either.points._table is table
    assert either.update(picture(dimmed, ball=place((0, 0, 1), None, (2, 2, 2)))) is True
    assert either.points._table is not table
    assert either.update(picture(dimmed, ball=place((0, 0, 1), None, (2, 2, 2))), seed=1) is True


def test_slow_growth_is_noticed(area):
    for step in range(200):
        area.update(picture(ball=place((0, 0, 1), None, (1 + 2e-6 * step,) * 3)))
    grown = place((0, 0, 1), None, (1 + 2e-6 * 199,) * 3)
    expected = FLOOR_AREA + LAMP_AREA + ball_area(grown)
    weights = area.points.total_area
    fresh = Tile(area.device, "AREA")
    fresh.update(picture(ball=grown))
    assert weights == pytest.approx(fresh.points.total_area, rel=2e-6) == pytest.approx(expected, rel=0.01)
    fresh.free()


def test_kept_points_equal_new_ones(either):
    for ball in (place((0, 0, 1), None, (2, 1, 1)), place((4, 0, 1)), None):
        kept = either.draw(picture(ball=ball))
    fresh = Tile(either.device, either.points.kind)
    for name, texels in fresh.draw(picture()).items():
        np.testing.assert_array_equal(texels, kept[name], err_msg=name)
    fresh.free()


@pytest.mark.parametrize(
    "shown",
    [
        scene([]),
        picture(visibility=dict.fromkeys(("floor", "lamp", "ball"), Visibility.CAMERA)),
        picture([replace(m, emission=(0.0, 0.0, 0.0)) for m in MATERIALS]),
    ],
    ids=["empty", "nothing_bounces", "dark"],
)
def test_no_points_leave_an_empty_tile(either, shown):
    either.draw(picture())
    found = either.draw(shown)
    if either.points.kind == "AREA" and shown.instances and shown.instances[0].visibility & Visibility.BOUNCE:
        assert either.points.count == SIDE**2
        return
    assert either.points.count == 0 and either.points.total_area == 0
    assert not any(texels.any() for texels in found.values())


def test_every_texel_has_its_own_point_in_order(area):
    """Contiguous rows are a subset as even as the whole."""
    room = scene([box("room", (0, 0, 0), (2, 2, 2))])
    position = area.draw(room)["position_area"]
    assert len(np.unique(position[:, :3], axis=0)) == SIDE**2
    for rows in (2, 4, 8):
        for part in position.reshape(rows, -1, 4):
            on_side = [(np.abs(part[:, axis] - level) < 1e-6).sum() for axis in range(3) for level in (0, 2)]
            np.testing.assert_allclose(on_side, len(part) / 6, atol=4)
