"""What the G-buffer and the maps are drawn from: matrices, slots, textures; and what all of it leaves in memory."""

from dataclasses import replace

import numpy as np
import pytest

from rebound.scene.data import Image, Instance, Material, Mesh, World
from rebound.settings import Settings
from rebound.tests.support.graphs import image_material, pane
from rebound.tests.support.render_scenes import (
    EVERYTHING,
    QUICK,
    Studio,
    light,
    ortho,
    place,
    quad,
    scene,
    sphere,
    triangles,
)

PASSES = ["combined", "normal", "position", "diffuse_direct", "diffuse_indirect", "diffuse_color"]
FLOOR = quad("floor", u=(2, 0, 0), v=(0, 2, 0))
LAMP = light("POINT", (1.5, -1.0, 2.0), radius=0.0)
VIEW = ortho(24, 24, 4, (-3, -4, 5), (0, 0, 0.4), up=(0, 0, 1))


@pytest.fixture
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


def baked(mesh: Mesh, matrix) -> Mesh:
    """The mesh with its matrix in its corners; a mirrored one is wound the other way round, as Blender does."""
    normals = mesh.normals @ np.linalg.inv(matrix[:3, :3])
    positions = mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
    return triangles("ball", positions, normals / np.linalg.norm(normals, axis=1, keepdims=True))


@pytest.mark.parametrize("scale", [(1, 1, 1), (0.5, 1.0, 0.3), (-0.5, 1.0, 0.3), (-0.5, -1.0, -0.3)], ids=str)
def test_matrix_of_an_instance_equals_its_geometry_moved(studio, scale):
    ball = sphere("ball", radius=0.6, rings=6, smooth=False)  # between smooth corners both ways differ, as in Cycles
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    matrix = place((0.2, 0.1, 0.7), turn * np.sign(np.linalg.det(turn)), scale)
    values = {"rsm_estimator": "ALL_TEXELS", "rsm_resolution": 16}
    moved = studio.render(scene([FLOOR, ball], [LAMP], matrices={"ball": matrix}), VIEW, 1, PASSES, **values)
    still = studio.render(scene([FLOOR, baked(ball, matrix)], [LAMP]), VIEW, 1, PASSES, **values)
    for name in PASSES:
        # float32 of two ways to the same place may put an edge into another pixel.
        apart = np.abs(moved[name] - still[name]).max(-1) > 1e-3 * (1 + np.abs(still[name]).max(-1))
        assert apart.mean() < 0.01, name
    assert moved["normal"][..., 2].min() < 0.5 < moved["normal"][..., 2].max()


def test_many_instances_of_one_mesh_and_several_slots(studio):
    """A strip of two squares, one a slot, placed nine times in two ways of wearing materials."""
    left, right = (
        quad("left", (-0.25, 0, 0), (0.25, 0, 0), (0, 0.4, 0)),
        quad("r", (0.25, 0, 0), (0.25, 0, 0), (0, 0.4, 0)),
    )
    strip = triangles("strip", np.concatenate([left.positions, right.positions]))
    strip = replace(strip, slots=((0, 0, 2), (1, 2, 2)))
    colors = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    instances = [
        Instance((i, j), strip.key, (0, 1 + (i == j)), place((i - 1, j - 1, 0)), EVERYTHING)
        for i in range(3)
        for j in range(3)
    ]
    shown = replace(
        scene([]),
        meshes={strip.key: strip},
        instances=tuple(instances),
        materials=tuple(Material("", c) for c in colors),
    )
    found = studio.render(replace(shown, filter_width=1e-3), ortho(6, 6, 3), 1, ["diffuse_color", "combined"])
    for i in range(3):
        for j in range(3):
            # The strip is as wide as the distance between two, and covers the centres of both pixels of its height.
            assert found["diffuse_color"][2 * j : 2 * j + 2, 2 * i].tolist() == [list(colors[0])] * 2
            assert found["diffuse_color"][2 * j : 2 * j + 2, 2 * i + 1].tolist() == [list(colors[1 + (i == j)])] * 2


def textured(closest, repeat, uv_map=""):
    pixels = np.random.default_rng(4).random((4, 4, 4)).astype(np.float32)
    corners = FLOOR.positions[:, :2] / 4 + 0.5  # the image once over the floor
    mesh = replace(FLOOR, uvs={"first": corners, "second": corners[:, ::-1]}, active_uv="first")
    image = Image("image", "Image", pixels)
    material = image_material("Picture", image, 2.0, uv_map=uv_map, repeat=repeat, closest=closest)
    shown = scene([mesh], [], materials=[material], filter_width=1e-3)
    return replace(shown, images={"image": image}), pixels[..., :3].astype(np.float64)


def test_texture_lies_where_its_uv_map_says(studio):
    view = ortho(4, 4, 4)
    shown, pixels = textured(closest=True, repeat=True)
    found = studio.render(shown, view, 1, ["diffuse_color", "emission"])
    np.testing.assert_allclose(found["diffuse_color"], pixels, atol=1e-3)  # kept in 16 bits
    np.testing.assert_allclose(found["emission"], 2 * pixels, atol=2e-3)
    shown, pixels = textured(closest=False, repeat=True, uv_map="second")
    found = studio.render(shown, view, 1, ["diffuse_color"])
    np.testing.assert_allclose(found["diffuse_color"], pixels.transpose(1, 0, 2), atol=1e-3)


@pytest.mark.parametrize("behind", ["world", "surface"])
def test_panes_colour_what_is_seen_through_them(studio, behind):
    """Two of them, one before the other: each lets its colour of the light pass, on average over samples."""
    panes = [quad(f"pane {k}", (0, 0, 1.0 + k)) for k in range(2)]
    lamp = Material("Lamp", (0, 0, 0), emission=(1.0, 2.0, 4.0))
    meshes, worn = [*panes], [pane("Red", (0.9, 0.5, 0.1)), pane("Blue", (0.2, 0.4, 0.9))]
    if behind == "surface":
        meshes, worn = [*meshes, quad("lamp", u=(2, 0, 0), v=(0, 2, 0))], [*worn, lamp]
    shown = scene(meshes, [], materials=worn, world=World((1.0, 2.0, 4.0)), filter_width=1e-3)
    found = studio.render(shown, ortho(16, 16, 0.5), 64, ["combined"])["combined"][..., :3]
    expected = np.array([0.9, 0.5, 0.1]) * [0.2, 0.4, 0.9] * [1.0, 2.0, 4.0]
    np.testing.assert_allclose(found.mean((0, 1)), expected, rtol=0.05)  # noise: 1.5 %


def test_material_is_shown_by_its_constants_until_it_is_compiled(studio):
    """One program at a time when there is no time at all; what is ready has the maps drawn anew that see it."""
    shown, _ = textured(closest=True, repeat=True)
    image = shown.images["image"]
    other = image_material("Other", image, closest=False)  # another graph
    both = scene([shown.meshes[FLOOR.key], sphere("ball")], [], materials=[*shown.materials, other])
    both = replace(both, images=shown.images)
    studio.show(both)
    gpu_scene = studio.gpu_scene

    def ready():
        return [gpu_scene.code_of(material) is not None for material in (0, 1)]

    assert not gpu_scene.compile(0.0) and gpu_scene.waits and sum(ready()) == 1  # nothing was shown before
    studio.render(both, ortho(4, 4, 4), 1)
    before = gpu_scene.revision
    assert gpu_scene.compile(0.0) and not gpu_scene.waits and all(ready())
    moved = gpu_scene.moved_since(before)
    assert moved is not None and len(moved) == 1 and not gpu_scene.compile(0.0)


def test_bounce_takes_the_texture(studio):
    shown, pixels = textured(closest=True, repeat=True)
    shown = replace(shown, lights=(light("SUN", (0, 0, 1), power=2.0),))
    studio.show(shown)
    buffers = studio.renderer.rsm_buffers(studio.gpu_scene, Settings.defaults(rsm_resolution=128))
    # Of an image that is 4 x 4 m: the mean reflectance; the maps' edge is 0.1 % wider.
    np.testing.assert_allclose(buffers[0].layers["flux"].sum((0, 1)), 2 * 16 * pixels.mean((0, 1)), rtol=0.005)


def test_restarted_frame_is_as_good_as_a_new_one(studio):
    settings = Settings.defaults(**QUICK, vpl_coarser_in_motion=False)  # no sample in haste, that is left out
    first, second = scene([FLOOR], [LAMP]), scene([sphere("ball")], [LAMP])
    expected = studio.render(second, VIEW, 2, PASSES)
    studio.show(first)
    frame = studio.renderer.begin(VIEW)
    list(studio.renderer.sample(frame, studio.gpu_scene, VIEW, settings))
    studio.show(second)
    studio.renderer.restart(frame)
    for _ in range(2):
        list(studio.renderer.sample(frame, studio.gpu_scene, VIEW, settings))
    for name in PASSES:
        np.testing.assert_array_equal(studio.renderer.read(frame, name), expected[name].astype(np.float32))


def test_edits_and_frames_leave_no_memory_behind(headless_device):
    before = headless_device.allocated_bytes
    studio = Studio(headless_device)
    sizes = []
    for turn in range(6):
        for count in (1, 5, 2):
            lamps = [light("POINT", (k, turn * 0.1, 2), key=f"{turn} {k}") for k in range(count)]
            meshes = [FLOOR, sphere("ball", (0, 0, 0.1 * turn), rings=3)]
            for interpolation in ("OFF", "QUARTER"):
                shown = scene(meshes, lamps, 0.1 + 0.1 * turn)
                studio.render(shown, ortho(8 + count, 8, 4), 1, rsm_interpolation=interpolation)
            studio.render(textured(True, True)[0], VIEW, 1, method="NONE")
        sizes.append(headless_device.allocated_bytes)
    assert sizes[1] == sizes[-1]
    studio.free()
    assert headless_device.allocated_bytes == before
