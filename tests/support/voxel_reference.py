"""What the grid of voxels must hold and what a ray through it must meet, in numpy."""

from __future__ import annotations

import numpy as np

from rebound.device import Shader
from rebound.gpu_shaders.frame.voxels import VOXEL_GRID, VOXEL_SAMPLERS, VoxelGrid

WIDTH = 64


def unpack(volume: np.ndarray, grid: VoxelGrid, level: int = 0) -> np.ndarray:
    """(x, y, z) bool of a level's cells from the volume as read, (d, h, w, 1) uint32."""
    bx, by, bz = (int(n) for n in grid.bricks[level])
    first = int(sum(bricks[2] for bricks in grid.bricks[:level]))
    words = volume[first : first + bz, :by, : 2 * bx, 0].reshape(bz, by, bx, 2)
    bits = words[..., None] >> np.arange(32, dtype=np.uint32) & 1
    cells = bits.reshape(bz, by, bx, 2, 2, 4, 4).transpose(0, 3, 4, 1, 5, 2, 6).reshape(4 * bz, 4 * by, 4 * bx)
    return cells.transpose(2, 1, 0).astype(bool)


def pack(cells: list[np.ndarray], grid: VoxelGrid) -> np.ndarray:
    """The inverse of ``unpack``: all levels in one volume, (d, h, w, 1) uint32."""
    width, height, depth = grid.volume_size
    volume = np.zeros((depth, height, width, 1), np.uint32)
    first = 0
    for level, bricks in enumerate(grid.bricks):
        bx, by, bz = (int(n) for n in bricks)
        bits = cells[level].transpose(2, 1, 0).reshape(bz, 2, 2, by, 4, bx, 4).transpose(0, 3, 5, 1, 2, 4, 6)
        words = (bits.reshape(bz, by, bx, 2, 32).astype(np.uint64) << np.arange(32, dtype=np.uint64)).sum(-1)
        volume[first : first + bz, :by, : 2 * bx, 0] = words.reshape(bz, by, 2 * bx)
        first += bz
    return volume


def coarser(cells: np.ndarray, bricks: np.ndarray) -> np.ndarray:
    """(4 bricks) bool: which cells of the next level have anything in them."""
    x, y, z = (n // 4 for n in cells.shape)
    any_inside = cells.reshape(x, 4, y, 4, z, 4).any((1, 3, 5))
    room = np.zeros(4 * bricks, bool)
    room[:x, :y, :z] = any_inside
    return room


def first_hits(voxels: np.ndarray, grid: VoxelGrid, origins, directions, reach: float) -> np.ndarray:
    """(n,) metres to where each ray enters the first occupied voxel, inf without one: every voxel asked, one by one."""
    low = grid.origin + np.argwhere(voxels) * grid.edge
    nearest = np.full(len(origins), np.inf)
    for number, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (low - origin) / direction, (low + grid.edge - origin) / direction
        parallel = direction == 0
        outside = ((origin < low) | (origin > low + grid.edge))[:, parallel].any(1)
        enter = np.where(parallel, -np.inf, np.minimum(a, b)).max(1).clip(0)
        leave = np.where(parallel, np.inf, np.maximum(a, b)).min(1)
        meets = (enter <= leave) & (enter < reach) & ~outside
        nearest[number] = enter[meets].min(initial=np.inf)
    return nearest


def ask(device, voxels, expression: str, **inputs: np.ndarray) -> np.ndarray:
    """``expression``, a float, of the vec3 ``inputs`` (n, 3) by the functions of voxel_lib.glsl: (n,)."""
    count = len(next(iter(inputs.values())))
    height = -(-count // WIDTH)
    sent = {}
    for name, values in inputs.items():
        texels = np.zeros((height * WIDTH, 4), np.float32)
        texels[:count, :3] = values
        sent[f"{name}_in_tx"] = device.texture((WIDTH, height), "RGBA32F", texels.reshape(height, WIDTH, 4))
    text = '#include "frame/voxel_lib.glsl"\nvoid main()\n{\n  ivec2 pixel = ivec2(gl_FragCoord.xy);\n'
    text += "".join(f"  vec3 {name} = texelFetch({name}_in_tx, pixel, 0).xyz;\n" for name in inputs)
    shader = Shader(
        "ask_voxels",
        fragment="test/ask_voxels_frag.glsl",
        files={"test/ask_voxels_frag.glsl": text + f"  out_value = vec4({expression});\n}}\n"},
        outputs={"out_value": "VEC4"},
        samplers={**dict.fromkeys(sent, "FLOAT_2D"), **VOXEL_SAMPLERS},
        uniforms={"voxel_grid": VOXEL_GRID},
    )
    result = device.texture((WIDTH, height), "RGBA32F")
    device.fullscreen(shader, device.target([result]), **sent, **voxels.bindings())
    return device.read(result).reshape(-1, 4)[:count, 0].astype(np.float64)
