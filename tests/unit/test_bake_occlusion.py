"""Surfaces of a scene in world space, and what rays hit on them."""

import logging

import numpy as np
import pytest

from rebound.bake import embree
from rebound.bake.occlusion import EmbreeCaster, NumpyCaster, make_caster
from rebound.bake.surfaces import frame_of, gather, mesh_fingerprint, mesh_vertices
from rebound.scene.data import Image, Instance, Material, Mesh, Scene, Texture
from rebound.tests.support.bake_scenes import EVERYTHING, grid, placed
from rebound.tests.support.render_scenes import box, place, quad, sphere

TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)


def rays(count, seed=0):
    random = np.random.default_rng(seed)
    towards = random.normal(size=(count, 3))
    return random.uniform(-2, 2, (count, 3)), towards / np.linalg.norm(towards, axis=1, keepdims=True)


def rays_at(corners, count):
    """Half of them hit."""
    random = np.random.default_rng(5)
    origins = random.uniform(-2, 2, (count, 3))
    targets = corners[random.integers(len(corners), size=count)]
    towards = np.einsum("kc,kcx->kx", random.dirichlet((1, 1, 1), count) * 2 - 1 / 3, targets) - origins
    return origins, towards / np.linalg.norm(towards, axis=1, keepdims=True)


def soup(count, seed=0):
    random = np.random.default_rng(seed)
    return random.uniform(-1, 1, (count, 1, 3)) + random.normal(0, 0.2, (count, 3, 3))


@pytest.mark.parametrize("count", [1, 3, 5, 700])
def test_numpy_hits_what_embree_hits(count):
    corners = soup(count)
    origins, towards = rays_at(corners, 3000)
    exact, fast = NumpyCaster(corners), EmbreeCaster(corners)
    a, b = exact.hits(origins, towards), fast.hits(origins, towards)
    same = a.triangles == b.triangles
    assert same.mean() > 0.999  # an edge is one triangle's in 64 bits, its neighbour's in 32
    hit = same & (a.triangles >= 0)
    assert 300 < hit.sum() < 3000
    assert np.allclose(a.u[hit], b.u[hit], atol=1e-3)
    assert np.allclose(a.v[hit], b.v[hit], atol=1e-3)
    assert (exact.blocked(origins, towards) == fast.blocked(origins, towards)).mean() > 0.999
    assert (fast.blocked(origins, towards) == (b.triangles >= 0)).mean() > 0.999


@pytest.mark.parametrize("kind", ["embree", "numpy"])
def test_axis_aligned_rays_in_the_plane_of_boxes_hit(kind):
    caster = make_caster(box("box", (-1, -1, -1), (1, 1, 1)).positions.reshape(-1, 3, 3), kind)
    origins = np.array([[-3.0, 0.3, 0.2], [0.25, -3, 0.4], [0.1, 0.3, 3], [0, 0.1, 3]])
    towards = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])
    assert caster.blocked(origins, towards).tolist() == [True, True, True, False]


def test_no_triangles_block_nothing():
    caster = make_caster(np.zeros((0, 3, 3)))
    assert not caster.blocked(*rays(5)).any()


def test_far_from_the_origin_rays_still_hit():
    """Embree counts in 32 bits: a kilometre away a metre has 2^-13 of it left, had the scene not been moved."""
    away = np.array([1e5, -1e5, 3e4])
    corners, (origins, towards) = soup(200), rays(2000)
    near, far = EmbreeCaster(corners), EmbreeCaster(corners + away)
    assert (near.blocked(origins, towards) == far.blocked(origins + away, towards)).mean() > 0.998


def test_missing_embree_is_said(monkeypatch, caplog):
    monkeypatch.setattr(embree, "_files", lambda: iter(()))
    with caplog.at_level(logging.WARNING, "rebound"):
        assert make_caster(soup(3)).name == "numpy"
    assert "without the library of Embree" in caplog.text
    with pytest.raises(ImportError):
        make_caster(soup(3), "embree")


def test_library_that_is_none_of_embree_is_said(monkeypatch, caplog, tmp_path):
    broken = tmp_path / "libembree4.so.4"
    broken.write_bytes(b"not a library")
    monkeypatch.setattr(embree, "_files", lambda: iter([broken]))
    with caplog.at_level(logging.WARNING, "rebound"):
        assert make_caster(soup(3)).name == "numpy"
    assert str(broken) in caplog.text


@pytest.mark.parametrize(
    ("python", "library"),
    [
        ("5.2/python", "lib/libembree4.so.4"),
        ("5.2/python", "blender.shared/embree4.dll"),
        ("Resources/5.2/python", "Resources/lib/libembree4.dylib"),
    ],
)
def test_library_is_found_where_blender_keeps_it(monkeypatch, tmp_path, python, library):
    """As Blender's folders lie on Linux, Windows and macOS."""
    file = tmp_path / library
    file.parent.mkdir(parents=True)
    file.touch()
    (tmp_path / python).mkdir(parents=True)
    monkeypatch.setattr(embree.sys, "prefix", str(tmp_path / python))
    monkeypatch.setattr(embree.importlib.util, "find_spec", lambda name: None)
    assert next(embree._files()) == file


@pytest.mark.parametrize("count", [1, 15, 16, 17, 40000])
def test_embree_answers_any_number_of_rays(count):
    """They are told in packets of 16 and pieces of 32768."""
    caster = EmbreeCaster(soup(50))
    origins, towards = rays(count)
    alone = [caster.hits(origins[i : i + 1], towards[i : i + 1]).triangles[0] for i in range(max(0, count - 40), count)]
    found = caster.hits(origins, towards).triangles
    assert found[-40:].tolist() == alone
    assert np.array_equal(caster.blocked(origins, towards), found >= 0)


def test_corners_with_one_place_and_normal_are_one_vertex():
    first, vertices = mesh_vertices(box("box", (0, 0, 0), (1, 1, 1)))
    assert len(first) == 24
    assert np.unique(vertices).tolist() == list(range(24))
    mesh = sphere("ball", rings=8)
    first, vertices = mesh_vertices(mesh)
    assert np.array_equal(mesh.positions[first][vertices] + 0.0, mesh.positions + 0.0)
    assert np.array_equal(mesh.normals[first][vertices] + 0.0, mesh.normals + 0.0)


def test_fingerprint_follows_the_shape_alone():
    mesh = quad("a")
    assert mesh_fingerprint(mesh) == mesh_fingerprint(quad("b"))
    assert mesh_fingerprint(mesh) != mesh_fingerprint(quad("a", center=(0, 0, 1e-6)))


@pytest.mark.parametrize("scale", [(1, 1, 1), (3, 1, 0.2), (-1, 2, 1), (1, 1, 0)])
def test_frame_is_a_rotation_and_normals_are_at_right_angles(scale):
    matrix = place((1, 2, 3), TURN, scale)
    frame = frame_of(matrix)
    assert np.allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1)
    surfaces = gather(placed(quad("floor"), matrices=[matrix]), frozenset(["floor"]))
    edges = surfaces.corners[:, 1] - surfaces.corners[:, 0]
    assert np.abs(np.einsum("tx,vx->tv", edges, surfaces.normals)).max() < 1e-6
    assert np.allclose(np.linalg.norm(surfaces.normals, axis=1), 1)


def test_frame_of_a_rotation_is_itself():
    assert np.allclose(frame_of(place((1, 2, 3), TURN, (2, 2, 2))), TURN)


def test_outward_normals_stay_outward_when_mirrored():
    matrix = place((0, 0, 0), TURN, (-1, 2, 1))
    surfaces = gather(placed(sphere("ball", rings=8), matrices=[matrix]), frozenset())
    assert ((surfaces.normals * surfaces.positions).sum(axis=1) > 0).all()
    assert ((surfaces.facing * surfaces.corners.mean(axis=1)).sum(axis=1) > 0).all()


def test_texture_is_averaged_over_each_triangle():
    pixels = np.zeros((2, 4, 4), np.float32)
    pixels[:, :2, 0], pixels[:, 2:, 1] = 1.0, 0.5  # left half red, right half green
    corners = quad("floor")
    left = np.array([[0, 0], [0.4, 0], [0.4, 1], [0.6, 0], [0.9, 1], [0.6, 1]], np.float32)
    mesh = Mesh("m", corners.positions, corners.normals, {"UV": left}, "UV", corners.slots, corners.bounds)
    material = Material("Cloth", (1, 1, 1), base_color_texture=Texture("i"))
    scene = Scene(
        {"m": mesh}, (Instance("o", "m", (0,), np.eye(4), EVERYTHING),), (material,), {"i": Image("i", "i", pixels)}
    )
    assert np.allclose(gather(scene, frozenset()).reflectance, [[1, 0, 0], [0, 0.5, 0]])


def test_grey_scene_has_one_channel():
    assert gather(placed(grid("floor"), albedo=0.5), frozenset()).reflectance.shape[1] == 1
    assert gather(placed(grid("floor"), albedo=(0.5, 0.4, 0.5)), frozenset()).reflectance.shape[1] == 3


def test_scene_without_surfaces_is_refused():
    with pytest.raises(ValueError, match="no surface"):
        gather(Scene(), frozenset())


@pytest.mark.parametrize("cuts", [1, 7, 40])
def test_cut_triangles_cover_what_they_did(cuts):
    """Area, normals, colours and what blocks stay; own vertices keep their rows."""
    scene = placed(quad("floor"), sphere("ball", (0, 0, 1), 0.5, rings=6), albedo=(0.1, 0.2, 0.3))
    whole, cut = (gather(scene, frozenset(), c) for c in (0, cuts))

    def areas(surfaces):
        a, b, c = surfaces.corners.swapaxes(0, 1)
        return np.cross(b - a, c - a)

    assert areas(cut)[:, 2].sum() == pytest.approx(areas(whole)[:, 2].sum(), abs=1e-6)
    assert np.linalg.norm(areas(cut), axis=1).sum() == pytest.approx(np.linalg.norm(areas(whole), axis=1).sum())
    own = len(whole.positions)
    assert np.array_equal(cut.positions[:own], whole.positions)
    assert len(cut.positions) - own == (cut.triangle_vertices[:, 0] >= own).sum()
    assert cut.triangle_vertices.max() < len(cut.positions)
    assert np.allclose(np.linalg.norm(cut.normals, axis=1), 1)
    largest = np.linalg.norm(areas(cut), axis=1).max()
    diagonal = np.linalg.norm(np.ptp(whole.corners.reshape(-1, 3), axis=0))
    assert largest <= max((diagonal / cuts) ** 2 * 1.0001, 0)
    origins, towards = rays(500)
    found = [make_caster(s.corners).blocked(origins, towards) for s in (whole, cut)]
    assert (found[0] == found[1]).mean() > 0.995


def test_rays_from_the_corner_of_a_room_stay_in_it():
    """Floor corners lie in the walls' planes; started there, rays would leave by the wall's edge."""
    surfaces = gather(placed(box("room", (-1, -1, -1), (1, 1, 1), inward=True)), frozenset())
    directions = np.random.default_rng(0).normal(size=(2000, 3))
    caster = make_caster(surfaces.corners)
    for position, normal in zip(surfaces.positions, surfaces.normals, strict=True):
        up = directions[directions @ normal > 0]
        assert caster.blocked(np.broadcast_to(position, up.shape), up).mean() > 0.999
