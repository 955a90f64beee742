"""Meshes on pages and draws put together: few calls, the same picture, and edits that upload one mesh."""

import re
from dataclasses import replace

import numpy as np
import pytest

from rebound.device.interface import DrawState
from rebound.device.source import SHADER_ROOT
from rebound.gpu_shaders.frame import batches, mesh_pages
from rebound.gpu_shaders.frame.draws import draw_scene, visible_draws
from rebound.gpu_shaders.frame.mesh_pages import MOST_SMALL, pack_normals
from rebound.gpu_shaders.frame.shaders import GBUFFER
from rebound.gpu_shaders.prt.shaders import DRAW, PRT_DRAW, Look
from rebound.scene.data import Instance, Material, Visibility
from rebound.tests.support.glsl_functions import evaluate
from rebound.tests.support.render_scenes import (
    EVERYTHING,
    Studio,
    light,
    ortho,
    perspective,
    place,
    quad,
    scene,
    sphere,
)

SIDE = 6
VIEW = ortho(48, 48, 2 * SIDE, (SIDE - 1, SIDE - 1, 10), (SIDE - 1, SIDE - 1, 0))
LAMP = light("SPOT", (3, 4, 9), (5, 5, 0), 5000.0, spot_angle=2.0)
PASSES = ["combined", "normal", "diffuse_color"]
COLORS = [Material(f"color {k}", (0.1 + 0.1 * k, 0.5, 0.9 - 0.1 * k)) for k in range(5)]


@pytest.fixture
def studio(headless_device):
    studio = Studio(headless_device)
    yield studio
    studio.free()


def ball(number, rings=4):
    """No two are alike, and none has whole chunks."""
    return sphere(f"ball {number}", radius=0.5 + 0.01 * number, rings=rings, smooth=number % 2 == 0)


def field(meshes):
    """Instances of them in a square, in five colours."""
    instances = tuple(
        Instance(
            k, meshes[k % len(meshes)].key, (k % len(COLORS),), place((k % SIDE * 2, k // SIDE * 2, 0)), EVERYTHING
        )
        for k in range(SIDE * SIDE)
    )
    return replace(scene([], [LAMP]), meshes={m.key: m for m in meshes}, instances=instances, materials=tuple(COLORS))


def calls(studio, monkeypatch, shown, **settings):
    """(draw calls of the G-buffer, the passes) of a sample."""
    drawn = []
    original = studio.device._draw

    def counted(program, *rest):
        drawn.append(program.shader.name)
        original(program, *rest)

    monkeypatch.setattr(studio.device, "_draw", counted)
    found = studio.render(shown, VIEW, 1, PASSES, **settings)
    monkeypatch.undo()
    return drawn.count("frame_gbuffer"), found


def test_quadrilaterals_share_corners_and_look_the_same(studio, monkeypatch):
    """Round balls are quadrilaterals but for their poles; the sides of the others are not flat, and no pairs."""
    shown = field([sphere(f"ball {k}", radius=0.8, rings=15 + k, smooth=k < 2) for k in range(3)])
    pairs = []
    original = studio.device._draw

    def counted(program, vertices, count, instances, paired):
        pairs.append((program.shader.name, paired, count))
        original(program, vertices, count, instances, paired)

    monkeypatch.setattr(studio.device, "_draw", counted)
    found = studio.render(shown, VIEW, 1, PASSES)
    corners = {paired: sum(n for name, p, n in pairs if name == "frame_gbuffer" and p == paired) for paired in (0, 1)}
    assert corners[1] > corners[0] > 0
    monkeypatch.setattr(batches, "LEAST_PAIRED", 1 << 30)
    pairs.clear()
    other = Studio(studio.device)
    assert_same(found, other.render(shown, VIEW, 1, PASSES))
    assert not any(paired for _, paired, _ in pairs)
    other.free()


def assert_same(a, b):
    for name in PASSES:
        np.testing.assert_array_equal(a[name], b[name], name)


def test_meshes_of_all_colours_are_one_call_and_the_picture_of_one_each(studio, monkeypatch):
    shown = field([ball(k) for k in range(9)])
    together, picture = calls(studio, monkeypatch, shown)
    assert together == 1
    assert len(np.unique(picture["diffuse_color"].reshape(-1, 3), axis=0)) > len(COLORS)
    alone = Studio(studio.device)
    monkeypatch.setattr(batches, "MOST_ROWS", 0)
    monkeypatch.setattr(mesh_pages, "PAGE_TRIANGLES", 1)
    each, same = calls(alone, monkeypatch, shown)
    alone.free()
    assert each == 9  # pages
    assert_same(picture, same)


def test_instanced_calls_show_what_chunks_for_each_instance_do(studio, monkeypatch):
    shown = field([ball(0), ball(1)])
    shown = replace(shown, instances=tuple(replace(i, materials=(0,)) for i in shown.instances))
    together, picture = calls(studio, monkeypatch, shown)
    monkeypatch.setattr(batches, "MOST_ROWS", 0)
    alone = Studio(studio.device)
    instanced, same = calls(alone, monkeypatch, shown)
    alone.free()
    assert (together, instanced) == (1, 2)
    assert_same(picture, same)


def test_an_edited_mesh_is_uploaded_alone_and_the_rest_stays(studio):
    meshes = [ball(k) for k in range(9)]
    studio.render(field(meshes), VIEW)
    for edit in range(3 * MOST_SMALL):
        meshes[edit % 9] = replace(ball(edit % 9, 5 + edit % 3), key=("edited", edit))
        shown = field(meshes)
        studio.gpu_scene.uploads.clear()
        found = studio.render(shown, VIEW, 1, PASSES)
        assert studio.gpu_scene.uploads["meshes"] == 1
        fresh = Studio(studio.device)
        assert_same(found, fresh.render(shown, VIEW, 1, PASSES))
        fresh.free()
        assert len({draw.page for draw in studio.gpu_scene.draws}) <= MOST_SMALL + 1


def test_what_moved_is_not_put_together_anew(studio, monkeypatch):
    shown = field([ball(k) for k in range(9)])
    studio.render(shown, VIEW)
    monkeypatch.setattr(studio.gpu_scene.batches, "_put_together", None)
    instances = (replace(shown.instances[0], world_from_object=place((0, 0, 1))), *shown.instances[1:])
    studio.gpu_scene.uploads.clear()
    studio.render(replace(shown, instances=instances), VIEW)
    assert dict(studio.gpu_scene.uploads) == {"instances": 1}


def test_thirds_are_exact_however_long_a_call_is(headless_device):
    """A call's corners run to its chunks times 48: a few large meshes on one page are beyond what floats hold."""
    function = re.search(r"int mesh_third\(.*?\n}\n", (SHADER_ROOT / "frame/mesh_lib.glsl").read_text(), re.DOTALL)
    numbers = np.concatenate([[0, 1 << 24, 1 << 25, 3 << 24, 1 << 28], [(1 << 31) - 4001]])[:, None] + np.arange(4000)
    numbers = numbers.ravel()
    third = "mesh_third(int(k.x) * 4096 + int(k.y))"
    found = evaluate(
        headless_device,
        ["test/third.glsl"],
        f"vec4({third} >> 12, {third} & 4095, 0.0, 0.0)",
        {"k": np.stack([numbers >> 12, numbers & 4095], 1)},
        files={"test/third.glsl": function[0]},
    )
    np.testing.assert_array_equal(found[:, 0] * 4096 + found[:, 1], numbers // 3)


def test_packed_normals_are_exact_along_axes_and_close_elsewhere(studio):
    axes = np.concatenate([np.eye(3), -np.eye(3), np.zeros((1, 3))]).astype(np.float32)
    turned = np.random.default_rng(2).normal(size=(5000, 3))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    stored = np.zeros(len(turned), np.float32)
    pack_normals(turned.astype(np.float32), stored)
    assert np.abs(np.degrees(np.linalg.norm(_unpacked(stored) - turned, axis=1))).max() < 0.008
    assert np.isfinite(stored).all() and np.abs(stored).min() > np.finfo(np.float32).tiny
    stored = np.zeros(len(axes), np.float32)
    pack_normals(axes, stored)
    np.testing.assert_array_equal(_unpacked(stored[:-1]), axes[:-1])
    assert stored[-1] == 0.0


def _unpacked(stored):
    """What mesh_normal() in mesh_lib.glsl computes."""
    bits = stored.view(np.uint32)
    p = np.stack((bits & 0x7FFF, (bits >> 15 & 0x3FFF) | (bits >> 31) << 14), 1) / 16383.0 - 1.0
    z = 1.0 - np.abs(p).sum(1)
    n = np.column_stack((np.where(z[:, None] < 0, (1 - np.abs(p[:, ::-1])) * np.where(p >= 0, 1, -1), p), z))
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def test_passes_over_the_g_buffer_have_its_depths_to_the_bit(studio):
    """What a baked object passes on is drawn by another program, where its depth equals the G-buffer's."""
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    matrix = place((0.3, -0.2, 0.1), turn, (0.7, 1.3, -0.9))
    round_one = sphere("ball", rings=24)
    shown = scene([round_one, quad("floor", (0, 0, -2), (9, 0, 0), (0, 9, 0))], matrices={"ball": matrix})
    studio.show(shown)
    device, view = studio.device, perspective(160, 120, 50, (1.3, -4.1, 2.2))
    size, clip = (view.width, view.height), view.clip_from_view @ view.view_from_world
    studio.gpu_scene.look_from(view)
    depth = device.texture(size, "DEPTH32F")
    surfaces = device.target([device.texture(size, "RGBA32F") for _ in range(5)], depth)
    device.clear(surfaces)
    given = {"pc_clip_from_world": clip, "pc_eye": (1.3, -4.1, 2.2, 1.0), "pc_dither": 0}
    draws = visible_draws(studio.gpu_scene, Visibility.CAMERA)
    draw_scene(device, studio.gpu_scene, GBUFFER, surfaces, draws, **given)
    over = device.target([device.texture(size, "RGBA32F") for _ in range(3)], depth)
    corners = np.arange(len(round_one.positions), dtype=np.int32).reshape(-1, 3)
    vertices = device.vertices({"in_position": round_one.positions, "in_triangle": np.repeat(corners, 3, axis=0)})
    light_texture = device.texture((2048, 4), "RGBA32F", np.ones((4, 2048, 4), np.float32))
    block = {
        "clip_from_world": clip, "world_from_object": matrix, "local_from_world": np.eye(4),
        "eye": given["pc_eye"], "has": 1, "row": 2048, "texels": 1, "coefficients": 1, "least_roughness": 0.0,
    }  # fmt: skip
    packed = PRT_DRAW.pack([block], for_uniform=True)
    state = DrawState(depth_test="EQUAL")
    device.draw(DRAW[Look.MATT, False], vertices, over, state=state, light_tx=light_texture, prt_draw=packed)
    is_ball = device.read(surfaces.colors[2])[..., 2] > -1.9
    is_ball &= device.read(surfaces.colors[0])[..., 3] > 0.0
    is_hit = device.read(over.colors[1])[..., 0] > 0.0
    assert is_ball.sum() > 2000
    np.testing.assert_array_equal(is_hit, is_ball)
