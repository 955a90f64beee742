"""One bounce from reflective shadow maps, against integrals over the lit surfaces in numpy."""

import math

import numpy as np
import pytest

from rebound.gpu_shaders.frame.coarse_grid import STRIDES
from rebound.gpu_shaders.frame.maps import light_faces
from rebound.scene.data import Visibility
from rebound.settings import Settings
from rebound.tests.support.light_reference import irradiance
from rebound.tests.support.render_scenes import Studio, box, light, ortho, quad, scene

DEGREES = math.pi / 180
ALBEDO = 0.5


@pytest.fixture(scope="module")
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


def buffers(studio, picture, resolution=128):
    """(face name, layers) of every map of the scene."""
    studio.show(picture)
    settings = Settings.defaults(rsm_resolution=resolution)
    return [(b.face, b.layers) for b in studio.renderer.rsm_buffers(studio.gpu_scene, settings)]


def bounce(studio, picture, view, samples=1, **settings):
    """Indirect irradiance in W/m² of a grey scene, (h, w), and the positions."""
    settings = {"estimator": "ALL_TEXELS", "resolution": 64, **settings}
    values = {f"rsm_{name}": value for name, value in settings.items()}
    found = studio.render(picture, view, samples, ["diffuse_indirect", "position"], method="RSM", **values)
    return math.pi * found["diffuse_indirect"][..., 0], found["position"]


def room(lamp, albedo=ALBEDO):
    return scene([box("room", (-1, -1, -1), (1, 1, 1), inward=True)], [lamp], albedo, filter_width=1e-3)


# --- what the maps hold ----------------------------------------------------------------------------------------------

FLOOR = quad("floor", u=(4, 0, 0), v=(0, 4, 0))


def cone_share(angle, blend, steps=20000):
    """The part of a point light's power in the cone of a spot, by its smoothstep."""
    cosine = 1 - (1 - math.cos(angle / 2)) * (np.arange(steps) + 0.5) / steps
    x = np.clip((cosine - math.cos(angle / 2)) / ((1 - math.cos(angle / 2)) * max(blend, 1e-9)), 0, 1)
    return float((x * x * (3 - 2 * x)).mean() * (1 - math.cos(angle / 2)) / 2)


def ellipse_share(x, y, steps=2000):
    """The part of all directions in the elliptic cone with these tangents of its half angles."""
    line = (np.arange(steps) + 0.5) / steps * 2 - 1
    u, v = np.meshgrid(line, line)
    inside = u * u + v * v < 1
    return float((inside / (1 + (x * u) ** 2 + (y * v) ** 2) ** 1.5).sum() * 4 * x * y / steps**2 / (4 * math.pi))


FLUX = {
    "spot": (scene([FLOOR], [light("SPOT")], ALBEDO), 100 * cone_share(60 * DEGREES, 0)),
    "spot_blend": (scene([FLOOR], [light("SPOT", spot_blend=0.6)], ALBEDO), 100 * cone_share(60 * DEGREES, 0.6)),
    "spot_widest": (room(light("SPOT", (0, 0, 0.9), spot_angle=math.pi)), 50),
    "spot_scaled": (
        # Tangents 4 tan 15 and tan 15 along X and Y.
        scene([FLOOR], [light("SPOT", spot_angle=30 * DEGREES, scale=(2, 0.5, 0.5))], ALBEDO),
        100 * ellipse_share(4 * math.tan(15 * DEGREES), math.tan(15 * DEGREES)),
    ),
    "sun": (scene([FLOOR], [light("SUN", (1, 0.4, 2), power=3)], ALBEDO), 3 * 64 * 2 / math.sqrt(1 + 0.16 + 4)),
    "sun_near_and_far": (
        scene(
            [quad("ground", u=(50, 0, 0), v=(0, 50, 0)), box("box", (-1, -1, 0), (1, 1, 2))],
            [light("SUN", (0, 0, 1), power=3)],
            ALBEDO,
        ),
        3 * 100**2,
    ),
    "point": (room(light("POINT", (0.3, -0.2, 0.5))), 100),
    "area": (room(light("AREA", (0.3, -0.2, 0.5), (0.3, -0.2, 0), area_size=(0.01, 0.01))), 100),
    "area_spread": (
        room(light("AREA", (0.3, -0.2, 0.5), (0.6, 0, 0), area_size=(0.01, 0.01), area_spread=90 * DEGREES)),
        100,
    ),
}


@pytest.mark.parametrize("name", FLUX)
def test_reflected_flux_of_all_faces_is_the_light_times_albedo(studio, name):
    picture, incident = FLUX[name]
    found = sum(layers["flux"].astype(np.float64).sum((0, 1)) for _, layers in buffers(studio, picture, 256))
    # Texels that a cone's or an object's edge crosses count whole or not at all.
    np.testing.assert_allclose(found, incident * ALBEDO, rtol=0.005)


def test_flux_is_coloured_by_light_and_surface(studio):
    lamp = light("POINT", (0, 0, 0), power=(10.0, 20.0, 30.0))
    found = sum(layers["flux"].sum((0, 1)) for _, layers in buffers(studio, room(lamp, (0.1, 0.5, 0.9)), 64))
    np.testing.assert_allclose(found, [1, 10, 27], rtol=0.005)


def test_what_does_not_reflect_blocks_without_flux(studio):
    meshes = [FLOOR, quad("veil", (0, 0, 1), u=(2, 0, 0), v=(0, 2, 0))]
    visibility = {"veil": Visibility.CAMERA | Visibility.SHADOW}
    for _, layers in buffers(studio, scene(meshes, [light("SPOT")], ALBEDO, visibility=visibility), 32):
        assert not layers["flux"].any()
        np.testing.assert_allclose(layers["depth"], 1.0, rtol=1e-5)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_position_depth_and_normal_are_where_the_texels_ray_hits(studio, size):
    lamp = light("POINT", np.array((0.3, -0.2, 0.5)) * size)
    picture = scene([box("room", (-size,) * 3, (size,) * 3, inward=True)], [lamp])
    studio.show(picture)
    faces = {face.name: face for face in light_faces(lamp, studio.gpu_scene.boxes)}
    found = buffers(studio, picture, 32)
    assert len(found) == 6
    for name, layers in found:
        face = faces[name]
        height, width = layers["depth"].shape[:2]
        x, y = np.meshgrid((2 * np.arange(width) + 1) / width - 1, (2 * np.arange(height) + 1) / height - 1)
        ray = np.stack((x / face.scale[0], y / face.scale[1], np.ones_like(x)), -1) @ face.face_from_world[:3, :3]
        origin = lamp.world_from_light[:3, 3]
        distance = ((np.sign(ray) * size - origin) / ray).min(-1)
        expected = origin + distance[..., None] * ray
        # float32 of coordinates, interpolated by a rasteriser that keeps 8 bits below the pixel.
        np.testing.assert_allclose(layers["position"], expected, atol=2e-4 * size)
        np.testing.assert_allclose(layers["depth"][..., 0], distance, atol=2e-4 * size)
        side = np.abs(expected / size)
        inner = np.sort(side, -1)[..., 1] < 0.99  # away from the room's edges, where a rounding picks the other wall
        normal = -np.sign(expected) * (side == side.max(-1, keepdims=True))
        np.testing.assert_allclose(layers["normal"][inner], normal[inner], atol=1e-3)


# --- gathering -------------------------------------------------------------------------------------------------------

PATCH = quad("patch", (0, 0, 0), u=(0.5, 0, 0), v=(0, 0.5, 0))
WALL = quad("wall", (1.5, 0, 1.5), u=(0, 0, 0.75), v=(0, 0.75, 0))  # faces -X, to the patch
WALL_VIEW = ortho(8, 8, 1.4, (-5, 0, 1.5), (1.5, 0, 1.5), up=(0, 0, 1))
LAMPS = {
    "spot": light("SPOT", (0, 0, 2), spot_angle=50 * DEGREES, spot_blend=0.4),
    "point": light("POINT", (0.2, 0.1, 1.5)),
    "sun": light("SUN", (-0.2, 0.1, 1.0), power=5.0),
    "area": light("AREA", (0, 0, 2), area_size=(0.01, 0.01)),
}


def gathered(lamp, points, normal, steps=120, albedo=ALBEDO):
    """Irradiance at points with one normal from the lit patch: its exitance integrated by a grid."""
    line = ((np.arange(steps) + 0.5) / steps - 0.5) * 1.0
    x, y = np.meshgrid(line, line)
    patch = np.stack((x, y, np.zeros_like(x)), -1).reshape(-1, 3)
    up = np.broadcast_to((0.0, 0.0, 1.0), patch.shape)
    radiance = irradiance(lamp, patch, up, 1)[:, 0] * albedo / math.pi
    d = patch[None] - points.reshape(-1, 1, 3)
    squared = (d * d).sum(-1)
    form = np.maximum(d @ np.asarray(normal, float), 0) * np.maximum(-d[..., 2], 0) / squared**2
    return (form @ radiance / steps**2).reshape(points.shape[:-1])


@pytest.mark.parametrize("estimator", ["ALL_TEXELS", "DISC_EXACT"])
@pytest.mark.parametrize("name", LAMPS)
def test_wall_gathers_what_the_lit_patch_sends(studio, name, estimator):
    lamp = LAMPS[name]
    picture = scene([PATCH, WALL], [lamp], ALBEDO, filter_width=1e-3)
    noisy = estimator != "ALL_TEXELS"
    found, points = bounce(
        studio, picture, WALL_VIEW, 24 if noisy else 1, estimator=estimator, resolution=256, gathers=512
    )
    expected = gathered(lamp, points, (-1, 0, 0))
    if noisy:  # the noise that is left in a pixel is about 3 %
        found, expected = found.mean(), expected.mean()
    # The patch's edge crosses texels, which count whole or not at all: at most 1 % of each of its widths.
    np.testing.assert_allclose(found, expected, rtol=0.02)


def test_light_of_a_closed_room_lands_on_its_walls_once(studio):
    lamp = light("POINT", (0.3, -0.2, 0.4))
    picture, received = room(lamp), 0.0
    for axis in range(3):
        for sign in (-1, 1):
            target, up = np.eye(3)[axis] * sign, np.eye(3)[(axis + 1) % 3]
            found, _ = bounce(studio, picture, ortho(16, 16, 2.0, (0, 0, 0), target, up=up), resolution=32)
            received += found.mean() * 4
    # No light is lost but what the bounded form takes from texels that touch, 2 % at 32 texels; none is made.
    assert 0.97 * 100 * ALBEDO < received < 1.003 * 100 * ALBEDO


def corner(element_height, depth, width):
    """Form factor from an element of a wall at this height to the floor before it, ``width`` to either side."""
    c = np.asarray(element_height)
    x, y = depth / width, c / width
    root = np.sqrt(x * x + y * y)
    return (np.arctan(1 / y) - y / root * np.arctan(1 / root)) / math.pi


def test_touching_surfaces_stay_bounded_and_converge(studio):
    sun = light("SUN", (0, 0, 5), power=math.pi)
    floor, wall = quad("floor", (1, 0, 0), (1, 0, 0), (0, 2, 0)), quad("wall", (0, 0, 1), (0, 2, 0), (0, 0, 1))
    picture = scene([floor, wall], [sun], ALBEDO, filter_width=1e-3)
    view = ortho(2, 64, 0.5, (5, 0, 0.25), (0, 0, 0.25), up=(0, 0, 1))
    errors = []
    for resolution in (32, 128, 256):
        found, points = bounce(studio, picture, view, resolution=resolution)
        expected = ALBEDO * math.pi * corner(points[..., 2], 2.0, 2.0)
        assert found.max() <= 0.5 * ALBEDO * math.pi * 1.01  # half of what the eye sees is floor
        errors.append(np.abs(found / expected - 1).mean())
    assert errors[0] > errors[1] > errors[2]
    # The lowest pixels lie within a texel of the corner; the error is about a texel's width over the height.
    assert errors[2] < 0.02


# --- the level does not depend on the settings -----------------------------------------------------------------------

CORNER = scene(
    [quad("floor", (0, 0, 0), (1, 0, 0), (0, 1, 0)), quad("wall", (0, 1, 1), (1, 0, 0), (0, 0, 1))],
    [light("SPOT", (-0.2, -0.4, 1.6), (0.1, 0.6, 0.1), spot_angle=55 * DEGREES, spot_blend=0.5)],
    ALBEDO,
    filter_width=1e-3,
)


def corner_view(size):
    return ortho(size, size, 1.8, (0, -4, 4), (0, 0.5, 0.5), up=(0, 0, 1))


@pytest.fixture(scope="module")
def truth(studio):
    """The mean irradiance over the corner from all texels of a fine map."""
    return bounce(studio, CORNER, corner_view(24), resolution=256)[0].mean()


EXACT = {
    "map 64": dict(resolution=64),
    "map 512": dict(resolution=512),
    "gathers 8": dict(gathers=8),
    "gathers 256": dict(gathers=256),
    "radius 0.1": dict(radius=0.1),
    "radius 1": dict(radius=1.0),
    "image 64": dict(size=64),
    "image 256": dict(size=256, samples=2),
    "all texels, map 64": dict(estimator="ALL_TEXELS", resolution=64),
    "interpolation 2": dict(interpolation="HALF"),
    "interpolation 4": dict(interpolation="QUARTER", size=64),
    "interpolation 8": dict(interpolation="EIGHTH", size=64),
}


@pytest.mark.parametrize("name", EXACT)
def test_exact_estimators_keep_their_level(studio, truth, name):
    changed = {"estimator": "DISC_EXACT", "gathers": 64, "resolution": 128, "size": 24, "samples": 32, **EXACT[name]}
    size = changed.pop("size")
    samples = 1 if changed["estimator"] == "ALL_TEXELS" else changed.pop("samples")
    changed.pop("samples", None)
    found = bounce(studio, CORNER, corner_view(size), samples, **changed)[0].mean()
    # Noise of the mean is 0.3 %; maps of 64 texels blur the corner by about 1 %.
    assert found == pytest.approx(truth, rel=0.02)


@pytest.mark.parametrize(
    "changed", [dict(resolution=64), dict(resolution=512), dict(gathers=16), dict(size=64)], ids=str
)
def test_published_estimator_keeps_its_level(studio, changed):
    def level(size=32, **settings):
        values = {"estimator": "DISC_PUBLISHED", "gathers": 256, "resolution": 128, **settings}
        return bounce(studio, CORNER, corner_view(size), 16, **values)[0].mean()

    assert level(**changed) == pytest.approx(level(), rel=0.02)  # noise of both means: 0.5 %


@pytest.mark.parametrize("stride", ["HALF", "QUARTER", "EIGHTH"])
def test_interpolation_follows_the_full_gather(studio, stride):
    full, points = bounce(studio, CORNER, corner_view(48), resolution=32)
    found, _ = bounce(studio, CORNER, corner_view(48), resolution=32, interpolation=stride)
    from_crease = np.maximum(1 - points[..., 1], points[..., 2]) / (1.8 / 48 * math.sqrt(2))
    smooth = from_crease > 1.5 * STRIDES[stride]
    # No noise: what differs is the curvature of the irradiance between coarse pixels, strong beside the crease.
    bound = {"HALF": 0.01, "QUARTER": 0.02, "EIGHTH": 0.05}[stride] * full.mean()
    assert np.sqrt(np.mean((found - full)[smooth] ** 2)) < bound
    assert np.abs(found - full).max() < 0.8 * full.max()
    assert found.mean() == pytest.approx(full.mean(), rel=0.08)  # one place of the coarse grid


def test_smaller_parts_of_a_light_bounce_as_one(studio):
    lamp = CORNER.lights[0]
    count = 5
    parts = [
        light(
            "SPOT",
            (-0.2, -0.4, 1.6),
            (0.1, 0.6, 0.1),
            100 / count,
            f"part {i}",
            spot_angle=55 * DEGREES,
            spot_blend=0.5,
        )
        for i in range(count)
    ]
    assert lamp.power[0] == sum(p.power[0] for p in parts)
    several = scene(list(CORNER.meshes.values()), parts, ALBEDO, filter_width=1e-3)
    one, _ = bounce(studio, CORNER, corner_view(16), resolution=32)
    found, _ = bounce(studio, several, corner_view(16), resolution=32)
    np.testing.assert_allclose(found, one, rtol=1e-4, atol=1e-6)  # float32 sums in another order


# --- nothing out of nothing ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("estimator", ["ALL_TEXELS", "DISC_EXACT", "DISC_PUBLISHED"])
def test_black_walls_and_no_lights_give_no_bounce(studio, estimator):
    black = bounce(studio, room(light("POINT", (0, 0, 0)), 0.0), ortho(5, 5, 1), estimator=estimator)[0]
    assert not black.any()
    dark = bounce(studio, scene([FLOOR], [], ALBEDO), ortho(5, 5, 1), estimator=estimator)[0]
    assert not dark.any()


def test_pixel_at_the_origin_of_a_map_with_empty_texels_is_finite(studio):
    picture = scene([quad("floor", u=(0.3, 0, 0), v=(0, 0.3, 0))], [light("SPOT")], ALBEDO, filter_width=1e-3)
    found, points = bounce(studio, picture, ortho(3, 3, 0.3))
    assert np.abs(points[1, 1]).max() < 1e-6
    assert np.isfinite(found).all() and not found.any()


# --- large scenes ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA"])
def test_object_at_the_horizon_changes_no_bounce(studio, kind):
    meshes = [FLOOR, box("block", (-0.4, -0.4, 0), (0.4, 0.4, 0.8))]
    lamp = light(kind, (1.2, -1.0, 2.4), (0, 0, 0.3), spot_angle=1.2)
    stray = box("stray", (30000, 0, 0), (30000.1, 0.1, 0.1))
    view = ortho(24, 24, 2.0, (2, -3, 2), (0, 0, 0.3))
    alone, _ = bounce(studio, scene(meshes, [lamp]), view)
    found, _ = bounce(studio, scene([*meshes, stray], [lamp]), view)
    assert alone.mean() > 0
    np.testing.assert_allclose(found, alone, rtol=2e-3, atol=2e-3 * alone.max())


@pytest.mark.parametrize("half", [300.0, 10000.0])
def test_ground_to_the_horizon_bounces_as_a_small_one_does(studio, half):
    """A sun's cascades keep texels small beside a block; what lies beyond 40 m gives it next to nothing."""
    block = box("block", (-0.5, -0.5, 0), (0.5, 0.5, 1))
    sun = light("SUN", (1.0, -1.5, 2.0), power=3.0)
    view = ortho(24, 24, 1.2, (2, -3, 1.5), (0, 0, 0.5))
    on_side = None
    means = []
    for size in (40.0, half):
        ground = quad("ground", u=(size, 0, 0), v=(0, size, 0))
        found, points = bounce(studio, scene([ground, block], [sun]), view, resolution=128)
        on_side = (points[..., 2] > 0.05) & (points[..., 2] < 0.95)
        means.append(found[on_side].mean())
    assert on_side is not None and on_side.sum() > 50
    # A wall sees h / sqrt(h² + D²) of an endless ground's light from beyond D: 1.2 % at half a metre and 40 m.
    assert means[1] == pytest.approx(1.012 * means[0], rel=0.01)
