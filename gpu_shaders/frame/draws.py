"""Drawing the scene: the one loop over draws that the camera and every light map share."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...device.interface import Device, DrawState, Target, Viewport
from ...device.shader import Shader
from ...scene.data import Visibility
from .material_pass import material_program

if TYPE_CHECKING:
    from ...gpu_scene import Draw, GpuScene

OPAQUE = DrawState(depth_test="LESS_EQUAL", depth_write=True)
ADD = DrawState(blend="ADDITIVE")


def visible_draws(gpu_scene: GpuScene, visibility: Visibility, seen=None) -> list[Draw]:
    """The draws that take part in any of ``visibility`` and that ``seen``, a test of (n, 2, 3) boxes, lets through."""
    wanted = visibility.value  # plain numbers: flags are ten times as slow
    draws = [draw for draw in gpu_scene.draws if draw.visibility.value & wanted]
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
    lets_pass: Callable[[int], bool] | None = None,
    **shared: Any,
) -> None:
    """Draw, with depth test unless ``state`` says otherwise. ``each`` gives what the shader wants to know of a draw
    beside its instances and, if it asks for materials, its material. ``lets_pass``: what light goes through, by the
    material's index; all that is transparent if it is not given.
    """
    shared["instance_tx"] = gpu_scene.instance_table
    asks, passes = "material_tx" in shader.samplers, lets_pass or gpu_scene.lets_pass
    if asks:
        shared["material_tx"] = gpu_scene.material_table
    programs: dict[Shader, list[Draw]] = defaultdict(list)
    for draw in draws:
        code = gpu_scene.code_of(draw.material) if asks else None
        programs[material_program(shader, code, asks and passes(draw.material))].append(draw)
    for program, members in programs.items():
        common = shared | (gpu_scene.material_inputs(program) if asks else {})
        with device.drawing(program, target, state=state, viewport=viewport, **common) as draw_call:
            for draw in members:
                own = gpu_scene.own_inputs(draw.material) if asks else {}
                draw_call(
                    draw.vertices,
                    first=draw.first_vertex,
                    count=draw.vertex_count,
                    instances=draw.instance_count,
                    pc_first_instance=draw.first_instance,
                    **own,
                    **each(draw),
                )
