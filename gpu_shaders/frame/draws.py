"""Drawing the scene: the one loop over draw calls that the camera and every light map share."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

from ...device.interface import Device, DrawState, Target, Viewport
from ...device.shader import Shader
from ...scene.data import Visibility
from .batches import Batch, Passes
from .structs import CHUNK_CORNERS

if TYPE_CHECKING:
    from ...gpu_scene import Draw, GpuScene

OPAQUE = DrawState(depth_test="LESS_EQUAL", depth_write=True)
ADD = DrawState(blend="ADDITIVE")


def visible_draws(gpu_scene: GpuScene, visibility: Visibility, seen=None) -> Sequence[Draw]:
    """The draws that take part in any of ``visibility`` and that ``seen``, a test of (n, 2, 3) boxes, lets through."""
    draws, bounds = gpu_scene.visible(visibility)
    if seen is None or not draws:
        return draws
    inside = seen(bounds)
    return draws if inside.all() else [draw for draw, is_in in zip(draws, inside.tolist(), strict=True) if is_in]


def draw_scene(
    device: Device,
    gpu_scene: GpuScene,
    shader: Shader,
    target: Target,
    draws: Sequence[Draw],
    lets_pass: Passes | None = None,
    **given: Any,
) -> None:
    """Draw. ``lets_pass``: what light goes through, by the material's index; all that is transparent if not given.

    What else is ``given`` is told by ``draw_batches``.
    """
    batches = gpu_scene.batches.of(gpu_scene, shader, draws, lets_pass or gpu_scene.lets_pass)
    draw_batches(device, gpu_scene, target, batches, **given)


def draw_batches(
    device: Device,
    gpu_scene: GpuScene,
    target: Target,
    batches: Sequence[Batch],
    viewport: Viewport | None = None,
    state: DrawState = OPAQUE,
    **shared: Any,
) -> None:
    """Draw what was put together, with depth test unless ``state`` says otherwise.

    ``shared``: what the shader wants beside instances, materials and what the batches themselves give.
    """
    shared["instance_tx"] = gpu_scene.instance_table
    for program, members in groupby(batches, lambda batch: batch.program):
        common = shared
        if "material_tx" in program.samplers:
            common = shared | gpu_scene.material_inputs(program)
        with device.drawing(program, target, state=state, viewport=viewport, **common) as draw_call:
            for batch in members:
                draw_call(
                    None,
                    count=CHUNK_CORNERS * batch.chunk_count,
                    instances=batch.instances,
                    paired=batch.paired,
                    pc_first_chunk=batch.first_chunk,
                    **batch.given,
                )
