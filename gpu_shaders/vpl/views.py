"""Views of what virtual point lights do; drawn from what the passes left, which they do not touch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...device.clear import clear_shader
from ...device.interface import Device, DrawState, Target
from ..frame.draws import ADD
from ..frame.inputs import FrameInputs
from ..frame.map_views import map_views
from ..frame.voxels import Voxels
from ..technique import DebugView
from .pool import Pool
from .shaders import VIEW_OCCLUSION, VIEW_POOL, VIEW_VOXELS

VIEWS = (
    DebugView(
        "VPL_BOUND",
        "Bound",
        "Light that is lost because virtual lights are discs, not points: black where nothing is",
        averaged=True,
    ),
    DebugView(
        "VPL_VOXELS",
        "Voxels",
        "The voxels that block bounced light, as the camera sees them: each in a grey of its own, darker with distance",
        averaged=True,
    ),
    DebugView(
        "VPL_OCCLUSION",
        "Occlusion",
        "How open the voxels leave the half space above a surface: white nothing within a tenth of the scene's size, "
        "black all of it close by",
        averaged=True,
    ),
    DebugView(
        "VPL_HISTORY",
        "Sample Count",
        "How many samples the bounced light of a pixel is the mean of: red one, green 24 or more. Black without Reuse",
    ),
    DebugView(
        "VPL_RESOLUTION",
        "Bounce Resolution",
        "White: pixels that gather bounced light for themselves. The others take it from the four around: green where "
        "all lie on the same surface, red where none does",
    ),
    DebugView(
        "VPL_POOL",
        "Virtual Lights",
        "The virtual lights chosen for the newest sample, over the darkened picture: in the colour of their light, the "
        "larger the more light they stand for (those of the sky are all alike); faint where something hides them",
        over_picture=True,
    ),
    *map_views("VPL"),
)
# The occlusion's rays go so far, in parts of the scene's longest side.
OCCLUSION_REACH = 0.1
# How much of the picture is left under the virtual lights.
DARKENED = 0.25


def view_voxels(device: Device, voxels: Voxels, inputs: FrameInputs, target: Target) -> None:
    world_from_clip = np.linalg.inv(inputs.clip_from_world)
    device.fullscreen(VIEW_VOXELS, target, **voxels.bindings(), pc_world_from_clip=world_from_clip)


def view_occlusion(device: Device, voxels: Voxels, inputs: FrameInputs, target: Target) -> None:
    boxes = inputs.gpu_scene.boxes
    longest = float((boxes[:, 1].max(0) - boxes[:, 0].min(0)).max())
    device.fullscreen(
        VIEW_OCCLUSION,
        target,
        **voxels.bindings(),
        position_tx=inputs.gbuffer.position,
        normal_tx=inputs.gbuffer.normal,
        pc_eye=inputs.eye,
        pc_reach=max(OCCLUSION_REACH * longest, 1e-6),
        pc_sample=inputs.sample,
        pc_seed=inputs.noise_seed(3),
    )


def view_pool(device: Device, pool: Pool, count: int, tiles: int, inputs: FrameInputs, target: Target) -> None:
    """``count``: entries of the pool; ``tiles``: of the atlas that they are from."""
    black = (0.0, 0.0, 0.0, 1.0 - DARKENED)
    device.fullscreen(clear_shader(("FLOAT",), False), target, state=DrawState(blend="ALPHA_PREMULT"), pc_color_0=black)
    bindings: Mapping[str, Any] = pool.bindings()
    common = {
        "position_tx": inputs.gbuffer.position,
        "pc_clip_from_world": inputs.clip_from_world,
        "pc_eye": inputs.eye,
        "pc_tiles": tiles,
        "pc_pixel": (1.0 / target.size[0], 1.0 / target.size[1]),
    }
    with device.drawing(VIEW_POOL, target, state=ADD, **bindings, **common) as draw:
        draw(count=6 * count)
