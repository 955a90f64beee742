"""Which voxels of the scene are occupied, one bit each, for rays that only ask whether something is in between.

Every triangle is drawn along all three axes, and each pixel marks the voxel in which the surface crosses the pixel's
centre line. A path from voxel to neighbouring voxel that crosses a surface then meets a marked one: of the two voxels
on both sides, the line between their centres is crossed, and half of it belongs to each (Laine 2013, A Topological
Approach to Voxelization). So no ray passes a surface, and one along the axes is one voxel thick.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...device.interface import Device, Target, Texture
from ...scene.data import Visibility
from .draws import ADD, draw_scene, visible_draws
from .maps import MOST_HUGE_OBJECTS, WORTHWHILE_SHRINK
from .voxel_shaders import VOXEL_DRAW, VOXEL_GRID, VOXEL_SAMPLERS

if TYPE_CHECKING:
    from ...gpu_scene import Draw, GpuScene

__all__ = ["VOXEL_GRID", "VOXEL_SAMPLERS", "VoxelGrid", "Voxels"]

# Bounded pieces of work: a millisecond of a GPU, a tenth of a second in software.
PIECE_TRIANGLES = 300_000
# One more huge object is left out where that makes the box so many times smaller again.
FURTHER_SHRINK = 2.0
# Voxels around the scene's box: its faces, often walls, lie well inside a voxel, and their rims cover its centre.
MARGIN = 0.49
SMALLEST_EDGE = 1e-6  # metres: of a scene that is a point


class VoxelGrid:
    """Where the voxels lie: cubes of ``edge`` metres, ``size`` of them along each axis from ``origin``."""

    def __init__(self, bounds: np.ndarray, resolution: int) -> None:
        extent = bounds[1] - bounds[0]
        self.edge = max(float(extent.max()) / (resolution - 2 * MARGIN), SMALLEST_EDGE)
        self.origin = bounds[0] - MARGIN * self.edge
        self.size = np.minimum(np.ceil(extent / self.edge + 2 * MARGIN - 1e-6).astype(int), resolution)
        self.bricks = [-(-self.size // 4**level) for level in (1, 2, 3)]  # by level, (3,) each

    @property
    def volume_size(self) -> tuple[int, int, int]:
        """Texels of the volume with all levels, one above the other."""
        x, y, _ = self.bricks[0]
        return 2 * int(x), int(y), int(sum(bricks[2] for bricks in self.bricks))

    @cached_property
    def block(self) -> np.ndarray:
        """The uniform block VOXEL_GRID."""
        first = int(self.bricks[0][2])
        row = {
            "origin": self.origin,
            "edge": self.edge,
            "size": self.size,
            "slice_1": first,
            "slice_2": first + int(self.bricks[1][2]),
        }
        return VOXEL_GRID.pack([row], for_uniform=True)

    def clip_from_world(self, axis: int) -> np.ndarray:
        """(4, 4) looking along an axis, the next axis to the right and the one after it up; depth 0 at the origin."""
        clip = np.zeros((4, 4))
        for row in range(3):
            k = (axis + 1 + row) % 3
            clip[row, k] = 2.0 / (self.size[k] * self.edge)
            clip[row, 3] = -1.0 - clip[row, k] * self.origin[k]
        clip[3, 3] = 1.0
        return clip

    def viewport(self, axis: int) -> tuple[int, int, int, int]:
        """A pixel a voxel, seen along an axis."""
        return 0, 0, int(self.size[(axis + 1) % 3]), int(self.size[(axis + 2) % 3])


class Voxels:
    """The occupied voxels of one scene; ``built`` counts how often they were made."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.built = 0
        self.grid: VoxelGrid | None = None
        self._volume: Texture | None = None
        self._canvas: Target | None = None
        self._holds: tuple[int, int] | None = None  # resolution, revision of the scene

    @property
    def edge(self) -> float:
        """Metres of one voxel."""
        assert self.grid is not None
        return self.grid.edge

    def update(self, gpu_scene: GpuScene, resolution: int) -> Iterator[float]:
        """Make the voxels good for this scene, ``resolution`` of them along its longest side; yields progress 0..1.

        Nothing may be traced before the last piece is done; stopped earlier, the next update begins anew.
        """
        if self._is_good(gpu_scene, resolution):
            self._holds = resolution, gpu_scene.revision
            return
        self._holds = None
        self._allocate(VoxelGrid(grid_bounds(gpu_scene.boxes), resolution))
        pieces = [(axis, piece) for piece in _pieces(visible_draws(gpu_scene, Visibility.SHADOW)) for axis in range(3)]
        for number, (axis, draws) in enumerate(pieces, 1):
            self._draw(gpu_scene, axis, draws)
            yield number / len(pieces)
        self.built += 1
        self._holds = resolution, gpu_scene.revision

    def bindings(self) -> dict[str, Any]:
        """What a shader with VOXEL_SAMPLERS and the uniform block ``voxel_grid`` is given."""
        assert self.grid is not None and self._holds is not None
        return {"voxel_tx": self._volume, "voxel_grid": self.grid.block}

    def free(self) -> None:
        for resource in (self._canvas, *(self._canvas.colors if self._canvas else ()), self._volume):
            self.device.free(resource)
        self._canvas = self._volume = self.grid = self._holds = None

    def _is_good(self, gpu_scene: GpuScene, resolution: int) -> bool:
        if self._holds is None or self._holds[0] != resolution:
            return False
        moved = gpu_scene.moved_since(self._holds[1], shapes_only=True)
        return moved is not None and not len(moved)

    def _allocate(self, grid: VoxelGrid) -> None:
        """A volume of zeros: a new one, which every backend fills quickest."""
        self.free()
        self.grid = grid
        self._volume = self.device.texture(grid.volume_size, "R32UI")
        side = int(grid.size.max())
        self._canvas = self.device.target([self.device.texture((side, side), "R8")])

    def _draw(self, gpu_scene: GpuScene, axis: int, draws: Sequence[Draw]) -> None:
        assert self.grid is not None and self._canvas is not None
        draw_scene(
            self.device,
            gpu_scene,
            VOXEL_DRAW,
            self._canvas,
            draws,
            viewport=self.grid.viewport(axis),
            # Blended, though nothing is added: where an opaque triangle covers a whole tile of the canvas, Mesa's
            # software renderer leaves out what was drawn there before, and what it would have marked.
            state=ADD,
            voxel_img=self._volume,
            voxel_grid=self.grid.block,
            pc_clip_from_world=self.grid.clip_from_world(axis),
            pc_axis=axis,
        )


def grid_bounds(boxes: np.ndarray) -> np.ndarray:
    """(2, 3) around the boxes (n, 2, 3), without a few huge ones that would take nearly all voxels."""
    order = np.argsort((boxes[:, 1] - boxes[:, 0]).max(1))
    bounds, shrink = _around(boxes), math.sqrt(WORTHWHILE_SHRINK)
    for left_out in range(1, min(MOST_HUGE_OBJECTS, len(order) - 1) + 1):
        kept = _around(boxes[order[:-left_out]])
        if _longest(bounds) > shrink * _longest(kept) > 0.0:
            bounds, shrink = kept, FURTHER_SHRINK
    return bounds


def _around(boxes: np.ndarray) -> np.ndarray:
    return np.stack([boxes[:, 0].min(0), boxes[:, 1].max(0)])


def _longest(bounds: np.ndarray) -> float:
    return float((bounds[1] - bounds[0]).max())


def _pieces(draws: Sequence[Draw]) -> Iterator[list[Draw]]:
    """Runs of draws with about PIECE_TRIANGLES each; large meshes in parts."""
    piece, triangles = [], 0
    for draw in draws:
        longest = 3 * max(PIECE_TRIANGLES // draw.instance_count, 1)
        for first in range(0, draw.vertex_count, longest):
            count = min(longest, draw.vertex_count - first)
            piece.append(replace(draw, first_vertex=draw.first_vertex + first, vertex_count=count))
            triangles += count // 3 * draw.instance_count
            if triangles >= PIECE_TRIANGLES:
                yield piece
                piece, triangles = [], 0
    if piece:
        yield piece
