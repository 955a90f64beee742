"""Shadows against rays in numpy: no specks on lit surfaces, no light under what stands on the floor, at any scale."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rebound.scene.data import LightKind, Visibility
from rebound.tests.support.render_scenes import (
    Studio,
    box,
    light,
    ortho,
    perspective,
    quad,
    scaled,
    scene,
    sphere,
)

DEGREES = math.pi / 180
RESOLUTION = 256


@pytest.fixture(scope="module")
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


# --- which pixels must be lit or dark --------------------------------------------------------------------------------


def blocked(points, targets, meshes):
    """Whether a triangle lies between each point and its target, both (n, 3)."""
    result = np.zeros(len(points), bool)
    direction = targets - points
    for mesh in meshes:
        for a, b, c in mesh.positions.astype(np.float64).reshape(-1, 3, 3):
            u, v = b - a, c - a
            h = np.cross(direction, v)
            det = h @ u
            with np.errstate(divide="ignore", invalid="ignore"):
                inverse = 1 / det
                s = points - a
                x = (s * h).sum(1) * inverse
                q = np.cross(s, u)
                y = (direction * q).sum(1) * inverse
                t = (q @ v) * inverse
                # 1e-4 of the way off the surface itself.
                result |= (x >= 0) & (y >= 0) & (x + y <= 1) & (t > 1e-4) & (t < 1 - 1e-4) & (det != 0)
    return result


def emitter_points(lamp, points, reach):
    """Targets of shadow rays, (k, n, 3): the light's centre and points a little beyond its edge."""
    axes = lamp.world_from_light[:3, :3]
    center = lamp.world_from_light[:3, 3]
    rim = [(0.0, 0.0)] + [(math.cos(a), math.sin(a)) for a in np.arange(8) * math.pi / 4]
    if lamp.kind is LightKind.SUN:
        size = math.tan(lamp.angle / 2)
        return [points + reach * (axes[:, 2] + 1.1 * size * (x * axes[:, 0] + y * axes[:, 1])) for x, y in rim]
    if lamp.kind is LightKind.AREA:
        u, v = (0.5 * math.sqrt(2) * lamp.area_size[k] * axes[:, k] for k in range(2))
        return [np.broadcast_to(center + x * u + y * v, points.shape) for x, y in rim]
    offsets = np.array([x * axes[:, 0] + y * axes[:, 1] for x, y in rim] + [axes[:, 2], -axes[:, 2]])
    return [np.broadcast_to(center + 1.1 * lamp.radius * o, points.shape) for o in offsets]


def certain(lamp, meshes, points, normals, footprint, reach):
    """(lit, dark): pixels where every ray from the point and from around it agrees. ``footprint`` is in metres."""
    shape, points, normals = points.shape[:-1], points.reshape(-1, 3), normals.reshape(-1, 3)
    side = np.cross(normals, np.eye(3)[np.argmin(np.abs(normals), 1)])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(normals, side)
    f = footprint.reshape(-1, 1)
    around = [points, points + f * side, points - f * side, points + f * other, points - f * other]
    answers = []
    for place in around:
        answers += [
            blocked(place + 1e-4 * f * normals, target, meshes) for target in emitter_points(lamp, place, reach)
        ]
    answers = np.array(answers)
    return ~answers.any(0).reshape(shape), answers.all(0).reshape(shape)


def check(studio, meshes, lamp, view, size, mode, samples=4):
    """Render with and without shadows; returns the number of wrong specks and of pixels that were certain."""
    views = {"filter_width": 1e-3, "albedo": 0.5}
    values = {"method": "NONE", "soft_shadows": mode, "shadow_resolution": RESOLUTION}
    passes = ["diffuse_direct", "position", "depth"]
    found = studio.render(scene(meshes, [lamp], **views), view, samples, passes, **values)
    open_lamp = replace(lamp, casts_shadow=False)
    unshadowed = studio.render(scene(meshes, [open_lamp], **views), view, samples, ["diffuse_direct"], **values)
    full = unshadowed["diffuse_direct"][..., 0]
    points = found["position"]
    normals = geometric_normals(points, meshes, view)
    center = lamp.world_from_light[:3, 3]
    to_light = np.broadcast_to(lamp.world_from_light[:3, 2], points.shape)
    if lamp.kind is not LightKind.SUN:
        to_light = center - points
    distance = np.linalg.norm(to_light, axis=-1)
    cosine = (to_light * normals).sum(-1) / distance
    # The side of a texel, with the widest face there is: 90 degrees, for a sun the scene.
    wide = 10 * size if lamp.kind is LightKind.SUN else 2 * math.sqrt(3) * distance
    footprint = 1.5 * wide / RESOLUTION / np.maximum(cosine, 0.05)
    seen = (found["depth"][..., 0] < 1e9) & (full > 1e-3 * full.max()) & (cosine > 0.05)
    lit, dark = certain(lamp, meshes, points, normals, footprint, 20 * size)
    visibility = np.divide(found["diffuse_direct"][..., 0], full, out=np.zeros_like(full), where=full > 0)
    specks = int((seen & lit & (visibility < 0.98)).sum())
    leaks = int((seen & dark & (visibility > 0.02)).sum())
    return specks, leaks, int((seen & lit).sum()), int((seen & dark).sum())


def geometric_normals(points, meshes, view):
    """The normal of the triangle that each point lies on, on the viewer's side."""
    corners = np.concatenate([m.positions for m in meshes]).astype(np.float64).reshape(-1, 3, 3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    best, result = np.full(points.shape[:-1], np.inf), np.zeros(points.shape)
    for (a, b, c), n in zip(corners, normal, strict=True):
        middle = (a + b + c) / 3
        inside = np.zeros(points.shape[:-1])
        for p, q in ((a, b), (b, c), (c, a)):
            edge = np.cross(n, q - p)
            inside = np.maximum(inside, -((points - p) @ edge) / np.linalg.norm(edge))
        distance = np.maximum(np.abs((points - middle) @ n), inside)
        nearer = distance < best
        best, result[nearer] = np.where(nearer, distance, best), n
    eye = np.linalg.inv(view.view_from_world)
    to_eye = eye[:3, 3] - points if view.is_perspective else np.broadcast_to(eye[:3, 2], points.shape)
    return np.where(((result * to_eye).sum(-1) < 0)[..., None], -result, result)


LAMPS = {
    "point": light("POINT", (1.6, -1.2, 2.6)),
    "spot": light("SPOT", (1.6, -1.2, 2.6), (0, 0, 0.3), spot_angle=75 * DEGREES),
    "sun": light("SUN", (1.6, -1.2, 2.6), power=3.0),
    "low sun": light("SUN", (3.0, -1.2, 0.8), power=3.0),
    "sized point": light("POINT", (1.6, -1.2, 2.6), radius=0.15),
    "wide sun": light("SUN", (1.6, -1.2, 2.6), power=3.0, angle=10 * DEGREES),
    "area": light("AREA", (1.6, -1.2, 2.6), area_size=(0.4, 0.4)),
}
EYE = np.array((-2.6, -3.6, 3.2))  # sees lit and dark sides
EYES = {"box": EYE, "sphere": EYE, "walls": (2.6, -2.8, 2.2)}
GROUND = quad("floor", u=(3, 0, 0), v=(0, 3, 0))
SCENES = {
    "box": [GROUND, box("box", (-0.5, -0.5, 0), (0.5, 0.5, 1))],
    "sphere": [GROUND, sphere("ball", (0, 0, 0.7), 0.7, rings=6)],
    "walls": [GROUND, quad("wall", (-1, 0, 1), (0, 3, 0), (0, 0, 1)), quad("end", (0, 2, 1), (3, 0, 0), (0, 0, 1))],
}


# A light without size has but one mode.
SIZED = ("sized point", "wide sun", "area")
MODES = [(name, "FILTERED") for name in LAMPS] + [(name, "SAMPLED") for name in SIZED]


@pytest.mark.parametrize(("name", "mode"), MODES)
@pytest.mark.parametrize("shape", SCENES)
def test_lit_surfaces_have_no_specks_and_dark_ones_no_light(studio, shape, name, mode):
    view = perspective(40, 40, 55, EYES[shape], (0, 0, 0.3))
    specks, leaks, lit, dark = check(studio, SCENES[shape], LAMPS[name], view, 1.0, mode)
    assert lit > 200
    assert dark > 10 or shape == "walls"
    assert (specks, leaks) == (0, 0)


@pytest.mark.parametrize("size", [1e-3, 1e3])
@pytest.mark.parametrize("name", ["point", "spot", "sun", "area"])
def test_scale_of_the_scene_changes_nothing(studio, name, size):
    meshes = [scaled(mesh, size) for mesh in SCENES["box"]]
    view = perspective(40, 40, 55, EYE * size, (0, 0, 0.3 * size), near=0.01 * size, far=100 * size)
    specks, leaks, lit, dark = check(studio, meshes, scaled(LAMPS[name], size), view, size, "FILTERED")
    assert lit > 200 and dark > 20
    assert (specks, leaks) == (0, 0)


def test_room_far_from_the_origin_has_no_specks(studio):
    shift = np.array((2000.0, -1000.0, 500.0))
    meshes = [box("room", shift + (-1, -1, -1), shift + (1, 1, 1), inward=True)]
    lamp = light("POINT", shift + (0.3, 0.2, 0.5))
    for target in np.eye(3):
        view = perspective(32, 32, 100, shift - 0.7 * target, shift + 0.9 * target + (0.05, 0.02, 0.01))
        specks, _, lit, _ = check(studio, meshes, lamp, view, 1.0, "FILTERED")
        assert lit > 100
        assert specks == 0


@pytest.mark.parametrize("name", ["point", "spot", "sun"])
def test_shadow_begins_at_the_contact(studio, name):
    """A close look at the foot of the box on its dark side: darkness begins within a texel and a half of it."""
    view = ortho(48, 48, 0.5, (-2.5, 0.3, 2.0), (-0.6, 0.2, 0.0), up=(0, 0, 1))
    specks, leaks, _, dark = check(studio, SCENES["box"], LAMPS[name], view, 1.0, "FILTERED")
    assert dark > 100
    assert (specks, leaks) == (0, 0)


@pytest.mark.parametrize("place", [(0.13, 0.31, 0.15), (0, 0, 0.1), (0.7, 0.2, 0.1), (0.2, 0, 0.02)], ids=str)
def test_lamp_just_above_a_floor_leaves_it_lit(studio, place):
    """The floor passes below the lamp and behind it: its triangles are cut where depth is known least."""
    lamp = light("POINT", place, (*place[:2], 0))
    lights = [lamp, replace(lamp, casts_shadow=False)]
    view = ortho(96, 96, 5)
    values = {"method": "NONE", "shadow_resolution": RESOLUTION}
    found, full = (
        studio.render(scene([GROUND], [one]), view, 2, ["diffuse_direct"], **values)["diffuse_direct"] for one in lights
    )
    np.testing.assert_allclose(found, full, rtol=1e-5)


@pytest.mark.parametrize("mode", ["SAMPLED", "FILTERED"])
def test_sized_spot_leaks_nowhere_at_the_edge_of_its_cone(studio, mode):
    """Points of the emitter reach beyond the cone of its centre, from which the filtered map was drawn."""
    lamp = light("SPOT", (0, 0, 2.5), spot_angle=50 * DEGREES, radius=0.3)
    meshes = [GROUND, quad("blocker", (0, 0, 0.5), (2.5, 0, 0), (0, 2.5, 0))]
    view = ortho(32, 32, 4)
    visibility = {"blocker": Visibility.SHADOW}
    values = {"method": "NONE", "soft_shadows": mode, "shadow_resolution": RESOLUTION}
    found = studio.render(scene(meshes, [lamp], visibility=visibility), view, 8, ["diffuse_direct"], **values)
    assert not found["diffuse_direct"].any()


# --- penumbrae -------------------------------------------------------------------------------------------------------


def edge_profile(studio, lamp, mode, samples):
    """Visibility on the floor along X under a half plane x < 0 at z = 1, and where: x in metres."""
    half_plane = quad("half", (-2, 0, 1), (2, 0, 0), (0, 4, 0))
    visibility = {"half": Visibility.SHADOW}
    picture = scene([GROUND, half_plane], [lamp], visibility=visibility, filter_width=1e-3)
    view = ortho(96, 2, 0.03, (0, 0, 10), (0, 0, 0))
    values = {"method": "NONE", "soft_shadows": mode, "shadow_resolution": 512}
    found = studio.render(picture, view, samples, ["diffuse_direct", "position"], **values)
    open_picture = replace(picture, lights=(replace(lamp, casts_shadow=False),))
    full = studio.render(open_picture, view, samples, ["diffuse_direct"], **values)
    ratio = (found["diffuse_direct"] / full["diffuse_direct"])[..., 0].mean(0)
    return ratio, found["position"][0, :, 0]


def width_between(profile, x, low=0.1, high=0.9):
    """Distance between the places where the visibility passes ``low`` and ``high``."""
    return np.interp(high, profile, x) - np.interp(low, profile, x)


def disc_part(t):
    """The part of a disc of radius 1 that lies at x < t."""
    t = np.clip(t, -1, 1)
    return 1 - (np.arccos(t) - t * np.sqrt(1 - t * t)) / math.pi


# Light, and the visibility at x of the floor: the part of the emitter on the open side of the edge, 1 m up.
PENUMBRAE = {
    "square": (light("AREA", (0, 0, 3), area_size=(0.8, 0.8)), lambda x: np.clip(0.5 + x / 0.4, 0, 1)),
    "disk": (light("AREA", (0, 0, 3), area_shape="DISK", area_size=(0.8, 0.8)), lambda x: disc_part(x / 0.2)),
    "point": (light("POINT", (0, 0, 3), radius=0.3), lambda x: disc_part(x / 0.15)),
    "sphere": (light("POINT", (0, 0, 3), radius=0.3, soft_falloff=False), lambda x: disc_part(x / 0.15)),
    "sun": (light("SUN", (0, 0, 3), power=3, angle=20 * DEGREES), lambda x: disc_part(x / math.tan(10 * DEGREES))),
}


@pytest.mark.parametrize("name", PENUMBRAE)
def test_sampled_penumbra_is_the_emitters_part(studio, name):
    lamp, part = PENUMBRAE[name]
    found, x = edge_profile(studio, lamp, "SAMPLED", 64)
    # 64 emitter points; the closed form takes the emitter for far away, right to (r / d)^2 = 0.02.
    np.testing.assert_allclose(found, part(x), atol=0.04)
    assert width_between(found, x) == pytest.approx(width_between(part(x), x), rel=0.06)


@pytest.mark.parametrize("name", PENUMBRAE)
def test_filtered_penumbra_is_about_as_wide(studio, name):
    lamp, part = PENUMBRAE[name]
    found, x = edge_profile(studio, lamp, "FILTERED", 64)
    assert width_between(np.maximum.accumulate(found), x) == pytest.approx(width_between(part(x), x), rel=0.2)
    assert np.interp(0.5, np.maximum.accumulate(found), x) == pytest.approx(0, abs=0.03)


@pytest.mark.parametrize("name", ["point", "spot", "area"])
def test_object_at_the_horizon_changes_no_shadow(studio, name):
    """Depth reaches to the farthest object there is, and is as fine beside the lamp as without it."""
    stray = box("stray", (30000, 0, 0), (30000.1, 0.1, 0.1))
    view = perspective(40, 40, 55, EYES["box"], (0, 0, 0.3))
    specks, leaks, lit, dark = check(studio, [*SCENES["box"], stray], LAMPS[name], view, 1.0, "FILTERED")
    assert lit > 200 and dark > 20
    assert (specks, leaks) == (0, 0)
