"""Drawing the scene: the one loop over draws that the camera and every light map share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...device.interface import Device, DrawState, Target, Viewport
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


def draw_scene(
    device: Device,
    gpu_scene: GpuScene,
    shader: Shader,
    target: Target,
    draws: Sequence[Draw],
    each: Callable[[Draw], Mapping[str, Any]] = lambda draw: {},
    viewport: Viewport | None = None,
    state: DrawState = OPAQUE,
    **shared: Any,
) -> None:
    """Draw, with depth test unless ``state`` says otherwise. ``each`` gives what the shader wants to know of a draw
    beside its instances.
    """
    shared["instance_tx"] = gpu_scene.instance_table
    with device.drawing(shader, target, state=state, viewport=viewport, **shared) as draw_call:
        for draw in draws:
            draw_call(
                draw.vertices,
                first=draw.first_vertex,
                count=draw.vertex_count,
                instances=draw.instance_count,
                pc_first_instance=draw.first_instance,
                **each(draw),
            )


def material_of(gpu_scene: GpuScene, draw: Draw) -> dict[str, Any]:
    """What a shader that evaluates materials wants to know of a draw; it reads the material table as well."""
    return {"pc_material": draw.material, **gpu_scene.textures_of(draw.material)}
