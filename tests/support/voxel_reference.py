"""A scene with its voxels on any device; what they must hold and what a ray must meet, in numpy."""

from __future__ import annotations

import numpy as np

from rebound.device import Shader
from rebound.gpu_scene import GpuScene
from rebound.gpu_shaders.frame.voxels import VOXEL_GRID, VOXEL_SAMPLERS, VoxelGrid, Voxels
from rebound.scene.changes import Changes
from rebound.scene.data import Scene

WIDTH = 64


class Room:
    """A scene and its voxels on one device."""

    def __init__(self, device, shown: Scene, resolution: int = 64):
        self.device, self.gpu_scene, self.voxels = device, GpuScene(device), Voxels(device)
        self._holds: Scene | None = None
        self.resolution = resolution
        self.show(shown)

    def show(self, shown: Scene) -> int:
        """How often the voxels were built for it."""
        before = self.voxels.built
        self.gpu_scene.update(shown, Changes.between(self._holds, shown))
        self._holds = shown
        for _ in self.voxels.update(self.gpu_scene, self.resolution):
            pass
        return self.voxels.built - before

    def level(self, level: int, number: int = 0) -> np.ndarray:
        """(x, y, z) bool; of an outer grid by its number."""
        grids = self.voxels.grids
        assert self.voxels._volume is not None
        first = sum(grid.slices for grid in grids[:number])
        return unpack(self.device.read(self.voxels._volume)[first:], grids[number], level)

    def ask(self, expression: str, **inputs) -> np.ndarray:
        return ask(self.device, self.voxels, expression, **inputs)

    def free(self) -> None:
        self.voxels.free()
        self.gpu_scene.free()


def unpack(volume: np.ndarray, grid: VoxelGrid, level: int = 0) -> np.ndarray:
    """(x, y, z) bool of a level's cells from the volume as read, (d, h, w, 1) uint32."""
    bx, by, bz = (int(n) for n in grid.bricks[level])
    first = int(sum(bricks[2] for bricks in grid.bricks[:level]))
    words = volume[first : first + bz, :by, : 2 * bx, 0].reshape(bz, by, bx, 2)
    bits = words[..., None] >> np.arange(32, dtype=np.uint32) & 1
    cells = bits.reshape(bz, by, bx, 2, 2, 4, 4).transpose(0, 3, 4, 1, 5, 2, 6).reshape(4 * bz, 4 * by, 4 * bx)
    return cells.transpose(2, 1, 0).astype(bool)


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
