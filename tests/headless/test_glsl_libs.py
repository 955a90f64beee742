"""The functions of the GLSL libraries against their twins in numpy."""

import math

import numpy as np
import pytest

from rebound.gpu_shaders.frame.lights import light_row
from rebound.gpu_shaders.frame.maps import Atlas, face_row, light_faces
from rebound.gpu_shaders.frame.structs import LIGHT, MAP_FACE
from rebound.tests.support.glsl_functions import evaluate
from rebound.tests.support.light_reference import irradiance, spread_factor
from rebound.tests.support.render_scenes import light, place

RNG = np.random.default_rng(1)
DEGREES = math.pi / 180


@pytest.fixture(scope="module")
def call(headless_device):
    return lambda *args, **given: evaluate(headless_device, *args, **given)


def directions(count):
    """Random unit vectors, and those where encodings have their seams."""
    v = RNG.normal(size=(count, 3))
    grid = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), -1).reshape(-1, 3)
    v = np.concatenate([v, grid[np.any(grid != 0, 1)]])
    return v / np.linalg.norm(v, axis=1, keepdims=True)


# --- lib/ ------------------------------------------------------------------------------------------------------------


def test_octahedron_is_a_bijection_within_its_square(call):
    n = directions(500)
    code = call(["lib/octahedron_lib.glsl"], "vec4(octahedron_encode(n.xyz), 0, 0)", {"n": n})[:, :2]
    assert np.abs(code).max() <= 1
    back = call(["lib/octahedron_lib.glsl"], "vec4(octahedron_decode(octahedron_encode(n.xyz)), 0)", {"n": n})
    np.testing.assert_allclose(back[:, :3], n, atol=3e-7)
    p = n[:, :2] / np.abs(n).sum(1, keepdims=True)
    lower = n[:, 2] < 0
    p[lower] = (1 - np.abs(p[lower][:, ::-1])) * np.where(p[lower] >= 0, 1, -1)
    np.testing.assert_allclose(code, p, atol=3e-7)


def pcg3d(v):
    """Jarzynski & Olano 2020, in uint32."""
    v = v.astype(np.uint32) * np.uint32(1664525) + np.uint32(1013904223)
    x, y, z = v.T.copy()
    for _ in range(2):
        x += y * z
        y += z * x
        z += x * y
        if _ == 0:
            x, y, z = x ^ x >> np.uint32(16), y ^ y >> np.uint32(16), z ^ z >> np.uint32(16)
    return np.stack((x, y, z), 1)


def test_hash_is_pcg3d_and_even(call):
    pixel = RNG.integers(0, 4096, (2000, 2))
    seed = RNG.integers(0, 2**22, (2000, 1))
    found = call(
        ["lib/sampling_lib.glsl"], "vec4(sampling_hash(ivec2(k.xy), int(k.z)), 0, 0)", {"k": np.hstack([pixel, seed])}
    )
    expected = (pcg3d(np.hstack([pixel, seed]))[:, :2] >> 8) / 2.0**24
    np.testing.assert_array_equal(found[:, :2], expected)
    assert found.max() < 1
    np.testing.assert_allclose(found[:, :2].mean(0), 0.5, atol=0.02)


def test_r2_is_the_sequence_however_far_it_runs(call):
    index = np.array([0, 1, 2, 1000, 2**20, 2**24 - 1])
    found = call(
        ["lib/sampling_lib.glsl"],
        "vec4(sampling_r2(int(k.x), k.yz), 0, 0)",
        {"k": np.stack([index, index * 0 + 0.25, index * 0], 1)},
    )
    g = 1.32471795724474602596
    expected = (np.array([0.25, 0]) + index[:, None] * np.array([1 / g, 1 / g**2])) % 1
    # The constants are right to 1/2 of 2^-32, which grows with the index.
    assert np.abs((found[:, :2] - expected + 0.5) % 1 - 0.5).max() < 2e-3
    np.testing.assert_allclose(found[:4, :2], expected[:4], atol=1e-6)


def test_vogel_disc_has_equal_areas(call):
    count = 16
    found = call(
        ["lib/sampling_lib.glsl"],
        "vec4(sampling_vogel_disc(int(k.x), 16, k.y), 0, 0)",
        {"k": np.stack([np.arange(count), np.full(count, 0.3)], 1)},
    )
    radius = np.linalg.norm(found[:, :2], axis=1)
    np.testing.assert_allclose(radius**2, (np.arange(count) + 0.5) / count, rtol=1e-5)
    assert np.linalg.norm(found[:, :2].mean(0)) < 0.05


def image_twin(pixels, uv, closest, extend):
    height, width = pixels.shape[:2]

    def at(x, y):
        x, y = (np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)) if extend else (x % width, y % height)
        return pixels[y, x]

    x, y = uv[:, 0] * width, uv[:, 1] * height
    if closest:
        return at(np.floor(x).astype(int), np.floor(y).astype(int))
    x, y = x - 0.5, y - 0.5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    a, b = (x - i)[:, None], (y - j)[:, None]
    return (at(i, j) * (1 - a) + at(i + 1, j) * a) * (1 - b) + (at(i, j + 1) * (1 - a) + at(i + 1, j + 1) * a) * b


@pytest.mark.parametrize("size", [(1, 1), (5, 3), (16, 16)])
@pytest.mark.parametrize("mode", range(4))
def test_image_is_wrapped_and_filtered(call, headless_device, mode, size):
    pixels = RNG.random((size[1], size[0], 4)).astype(np.float32)
    texture = headless_device.texture(size, "RGBA32F", pixels)
    uv = RNG.random((600, 2)) * 7 - 3
    uv[:100] = RNG.integers(-6, 7, (100, 2)) / 2  # the seams
    if mode & 1:
        place_in_texel = (uv * np.array(size)) % 1
        uv = uv[(np.abs(place_in_texel - 0.5) < 0.49).all(1)]  # no texel's edge, which may round either way
    found = call(
        ["materials/texture_lib.glsl"],
        f"texture_sample(image_tx, at.xy, {mode & 1}, {mode >> 1}, 0, false)",
        {"at": uv},
        textures=["image_tx"],
        image_tx=texture,
    )
    expected = image_twin(pixels.astype(np.float64), uv, bool(mode & 1), bool(mode & 2))
    np.testing.assert_allclose(found, expected, atol=2e-5)  # float32 places within up to 16 texels


@pytest.mark.parametrize("scale", [(1, 1, 1), (2, 0.5, 3), (-1, 1, 1), (-2, -0.5, -3), (1e-3, 1e-3, 1e-3), (1, 1, 0)])
def test_normal_stays_on_its_side_and_perpendicular(call, scale):
    q, _ = np.linalg.qr(RNG.normal(size=(3, 3)))
    matrix = place((1, 2, 3), q * np.sign(np.linalg.det(q)), scale)
    n = directions(200)
    columns = ", ".join(f"vec4({', '.join(repr(float(np.float32(x))) for x in matrix[:, k])})" for k in range(4))
    found = call(["lib/instance_lib.glsl"], f"vec4(instance_normal(mat4({columns}), n.xyz), 0)", {"n": n})[:, :3]
    if scale[2] == 0:  # flattened: the normals of what is left, or 0
        assert np.isfinite(found).all()
        return
    expected = n @ np.linalg.inv(matrix[:3, :3])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    found = found / np.linalg.norm(found, axis=1, keepdims=True)
    # A mirrored object's faces look outward as before: the inverse transpose has the sign right, no winding counts.
    np.testing.assert_allclose(found, expected, atol=1e-5)


# --- light_lib -------------------------------------------------------------------------------------------------------

LIB = ["frame/light_lib.glsl"]


def row(lamp, source=None, filtered=False):
    return light_row(lamp, None if filtered else np.zeros(3) if source is None else source, 0, 0)


@pytest.mark.parametrize("scale", [(1, 1, 1), (2, 0.7, 1.3)])
@pytest.mark.parametrize("blend", [0, 0.4, 1])
def test_spot_cone_and_intensity_follow_the_reference(call, blend, scale):
    lamp = light(
        "SPOT", (0, 0, 0), (1, 2, -3), (4.0, 8.0, 12.0), spot_angle=70 * DEGREES, spot_blend=blend, scale=scale
    )
    away = directions(1000)
    local = away @ np.linalg.inv(lamp.world_from_light[:3, :3]).T
    near_edge = np.abs(-local[:, 2] / np.linalg.norm(local, axis=1) - math.cos(35 * DEGREES)) < 1e-5
    away = away[~near_edge]
    found = call(
        LIB,
        "vec4(light_intensity(light_fetch(light_tx, 0), d.xyz), light_spot_cone(light_fetch(light_tx, 0), d.xyz))",
        {"d": away},
        tables=[LIGHT],
        light_tx=[row(lamp)],
    )
    # A receiver 1 m away that faces the light gets its intensity.
    expected = irradiance(lamp, away, -away)
    np.testing.assert_allclose(found[:, :3], expected, atol=1e-4 * expected.max())
    np.testing.assert_allclose(found[:, 3], expected[:, 0] * math.pi, atol=1e-4)


@pytest.mark.parametrize("spread", [180, 90, 20, 1])
def test_spread_keeps_the_power(call, spread):
    lamp = light("AREA", (0, 0, 0), (0, 0, -1), math.pi, area_spread=spread * DEGREES)
    half = min(spread / 2, 89.99) * DEGREES
    theta = (np.arange(2000) + 0.5) / 2000 * half
    d = np.stack((np.sin(theta), 0 * theta, -np.cos(theta)), 1)
    found = call(
        LIB, "vec4(light_area_spread(light_fetch(light_tx, 0), d.xyz))", {"d": d}, tables=[LIGHT], light_tx=[row(lamp)]
    )[:, 0]
    expected = spread_factor(spread * DEGREES, np.cos(theta))
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=2e-4 * expected.max())
    power = (found * np.sin(theta) * np.cos(theta)).sum() * half / 2000 * 2
    assert power == pytest.approx(1, rel=2e-3)


@pytest.mark.parametrize("filtered", [False, True])
@pytest.mark.parametrize("soft_falloff", [False, True])
@pytest.mark.parametrize("kind", ["POINT", "SUN"])
def test_unshadowed_light_of_a_round_emitter(call, kind, soft_falloff, filtered):
    """Receivers of every tilt, the emitter cut by their horizon or not, and inside the sphere."""
    size = {"radius": 0.6} if kind == "POINT" else {"angle": 50 * DEGREES}
    lamp = light(kind, (0, 0, 2), (0, 0, 0), (1.0, 2.0, 3.0), soft_falloff=soft_falloff, **size)
    points = np.concatenate([np.zeros((100, 3)), RNG.normal(size=(100, 3)), [[0, 0, 1.7]]])
    if soft_falloff:
        points = points[:-1]
    normals = directions(len(points) - 26)
    expected = irradiance(lamp, points, normals, 4096) / math.pi
    sources = [np.zeros(3)]
    if not filtered:
        sources = emitter_points(lamp, 256)
    rows = [row(lamp, source, filtered) for source in sources]
    expression = "light_unshadowed(light_fetch(light_tx, i), p.xyz, n.xyz, light_fetch(light_tx, i).source)"
    total = f"vec4(0); for (int i = 0; i < {len(rows)}; i++) out_value.rgb += {expression}"
    found = call(LIB, total, {"p": points, "n": normals}, tables=[LIGHT], light_tx=rows)[:, :3] / len(rows)
    # The closed form is exact; 256 points of the emitter leave 1 % of what a facing receiver gets.
    facing = np.linalg.norm(expected, axis=1).max()
    np.testing.assert_allclose(found, expected, rtol=0.01, atol=(0.001 if filtered else 0.01) * facing)


def emitter_points(lamp, count):
    from rebound.gpu_shaders.frame.lights import emitter_sample  # noqa: PLC0415

    return [emitter_sample(lamp, i, np.array([0.1, 0.5, 0.9])) for i in range(count)]


# --- map_lib ---------------------------------------------------------------------------------------------------------

MAP = ["frame/map_lib.glsl"]
BOXES = np.array([[[-3.0, -2.0, -1.0], [2.0, 3.0, 4.0]]])
LAMPS = {
    "point": light("POINT", (0.5, 0.2, 1.0), (1, 2, 3)),
    "spot": light("SPOT", (0.5, 0.2, 3.0), (1, 0, 0), scale=(2, 1, 1)),
    "area": light("AREA", (0.5, 0.2, 3.0), (1, 0, 0)),
    "sun": light("SUN", (0.5, 0.2, 3.0), (1, 0, 0)),
}


@pytest.mark.parametrize("name", LAMPS)
def test_map_coordinates_and_planes_agree_with_the_clip_matrix(call, name):
    faces = light_faces(LAMPS[name], BOXES)
    atlas = Atlas(len(faces), 64, 3)
    rows = [face_row(face, atlas, k) for k, face in enumerate(faces)]
    points = RNG.uniform(BOXES[0, 0], BOXES[0, 1], (300, 3))
    normals = directions(300)[:300]
    for k, face in enumerate(faces):
        clip = np.hstack([points, np.ones((300, 1))]) @ face.clip_from_world.T
        before = clip[:, 3] > 0.05 * face.far if face.perspective else np.ones(300, bool)
        uv = 0.5 + 0.5 * clip[:, :2] / clip[:, 3:]
        fetch = f"map_face_fetch(map_face_tx, {k})"
        position = f"map_position({fetch}, p.xyz)"
        found = call(
            MAP,
            f"vec4(map_uv({fetch}, {position}), map_holds({fetch}, {position}) ? 1 : 0, {position}.z)",
            {"p": points},
            tables=[MAP_FACE],
            map_face_tx=rows,
        )
        np.testing.assert_allclose(found[before, :2], uv[before], rtol=1e-4, atol=1e-4)
        sure = np.abs(np.abs(2 * uv - 1) - 1).min(1) > 1e-3
        inside = (np.abs(2 * uv - 1) < 1).all(1) & (clip[:, 3] > 0)
        np.testing.assert_array_equal(found[sure & before, 2], inside[sure & before])
        # A second point of the plane through p: the plane's closeness at its place is its own.
        side = np.cross(normals, directions(300)[:300])
        other = points + 0.2 * side
        local = other @ face.face_from_world[:3, :3].T + face.face_from_world[:3, 3]
        steep = np.abs(
            np.einsum(
                "ij,ij->i",
                normals @ face.face_from_world[:3, :3].T,
                local if face.perspective else np.broadcast_to((0, 0, 1.0), local.shape),
            )
        )
        good = before & (steep > 0.2) & ((local[:, 2] > 0.1 * face.far) | (not face.perspective))
        there = f"map_uv({fetch}, map_position({fetch}, q.xyz))"
        plane = f"map_plane_closeness({fetch}, {position}, mat3({fetch}.face_from_world) * n.xyz, {there})"
        found = call(
            MAP, f"vec4({plane})", {"p": points, "n": normals, "q": other}, tables=[MAP_FACE], map_face_tx=rows
        )[:, 0]
        expected = face.far / local[:, 2] if face.perspective else -local[:, 2] / face.far
        np.testing.assert_allclose(found[good], expected[good], rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("name", ["point", "area"])
def test_chosen_face_of_a_cube_holds_the_point(call, name):
    lamp = LAMPS[name]
    faces = light_faces(lamp, BOXES)
    points = RNG.uniform(BOXES[0, 0], BOXES[0, 1], (500, 3))
    local = (points - lamp.world_from_light[:3, 3]) @ lamp.world_from_light[:3, :3]
    keep = np.abs(local).max(1) > 0.05
    if name == "area":
        keep &= local[:, 2] < 0
    found = call(
        MAP,
        f"vec4(map_face_of({len(faces)}, map_position(map_face_fetch(map_face_tx, 0), p.xyz)))",
        {"p": points[keep]},
        tables=[MAP_FACE],
        map_face_tx=[face_row(faces[0], Atlas(1, 64, 1), 0)],
    )
    for point, index in zip(points[keep], found[:, 0].astype(int), strict=True):
        clip = faces[index].clip_from_world @ [*point, 1]
        assert (np.abs(clip[:2]) <= clip[3] * 1.0001).all()
