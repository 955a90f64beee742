"""Drawing the scene: the one loop over draws that the camera and every light map share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...device.interface import Device, DrawState, Target
from ...device.shader import Shader
from ...scene.data import Visibility

if TYPE_CHECKING:
    from ...gpu_scene import Draw, GpuScene

OPAQUE = DrawState(depth_test="LESS_EQUAL", depth_write=True)
ADD = DrawState(blend="ADDITIVE")


def visible_draws(gpu_scene: GpuScene, visibility: Visibility, seen=None) -> list[Draw]:
    """The draws that take part in any of ``visibility`` and that ``seen``, a test of (n, 2, 3) boxes, lets through."""
    draws = [draw for draw in gpu_scene.draws if draw.visibility & visibility]
    if seen is None or not draws:
        return draws
    return [draw for draw, inside in zip(draws, seen(np.array([d.bounds for d in draws])), strict=True) if inside]


def draw_shaded(
    device: Device, gpu_scene: GpuScene, shader: Shader, target: Target, draws: list[Draw], viewport=None, **shared
) -> None:
    """Draw with materials: ``shader`` reads the material table and the two image samplers."""
    tables = {"instance_tx": gpu_scene.instance_table, "material_tx": gpu_scene.material_table}
    with device.drawing(shader, target, state=OPAQUE, viewport=viewport, **tables, **shared) as draw_call:
        for draw in draws:
            draw_call(
                draw.vertices,
                first=draw.first_vertex,
                count=draw.vertex_count,
                instances=draw.instance_count,
                pc_first_instance=draw.first_instance,
                pc_material=draw.material,
                **_flag(shader, draw),
                **gpu_scene.textures_of(draw.material),
            )


def draw_depth(
    device: Device, gpu_scene: GpuScene, shader: Shader, target: Target, draws: list[Draw], viewport=None, **shared
) -> None:
    """Draw shapes only."""
    tables = {"instance_tx": gpu_scene.instance_table}
    with device.drawing(shader, target, state=OPAQUE, viewport=viewport, **tables, **shared) as draw_call:
        for draw in draws:
            draw_call(
                draw.vertices,
                first=draw.first_vertex,
                count=draw.vertex_count,
                instances=draw.instance_count,
                pc_first_instance=draw.first_instance,
            )


def _flag(shader: Shader, draw: Draw) -> dict[str, int]:
    """The one bit a shader wants to know of a draw's visibility."""
    if "pc_holdout" in shader.constants:
        return {"pc_holdout": int(bool(draw.visibility & Visibility.HOLDOUT))}
    return {"pc_reflects": int(bool(draw.visibility & Visibility.BOUNCE))}
