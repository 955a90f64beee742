"""Which voxels of the scene are occupied, one bit each, for rays that only ask whether something is in between.

Every triangle is drawn along all three axes, and each pixel marks the voxel in which the surface crosses the pixel's
centre line. A path from voxel to neighbouring voxel that crosses a surface then meets a marked one: of the two voxels
on both sides, the line between their centres is crossed, and half of it belongs to each (Laine 2013, A Topological
Approach to Voxelization). So no ray passes a surface, and one along the axes is one voxel thick.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ...device.interface import Device, Target, Texture
from ...scene.data import Visibility
from .batches import Batch
from .draws import ADD, draw_batches, visible_draws
from .structs import CHUNK_TRIANGLES
from .voxel_grids import VoxelGrid, grid_bounds, nested_grids, pack_grids, volume_size
from .voxel_shaders import VOXEL_DRAW, VOXEL_GRID, VOXEL_SAMPLERS

if TYPE_CHECKING:
    from ...gpu_scene import Draw, GpuScene

__all__ = ["VOXEL_GRID", "VOXEL_SAMPLERS", "VoxelGrid", "Voxels", "grid_bounds"]

# Bounded pieces of work: a millisecond of a GPU, a tenth of a second in software.
PIECE_TRIANGLES = 300_000
# A voxel blocks all light or none: what lets more pass than this blocks none.
MOST_PASSING = 0.5


def _blocks(draw: Draw, gpu_scene: GpuScene) -> bool:
    return gpu_scene.scene.materials[draw.material].passing <= MOST_PASSING


class Voxels:
    """The occupied voxels of one scene; ``built`` counts how often they were made."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.built = 0
        self.grid: VoxelGrid | None = None  # around the scene but its huge objects
        self.grids: tuple[VoxelGrid, ...] = ()  # the same, and what is around it
        self._block = np.zeros(0)  # the uniform block VOXEL_GRID
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
        self._allocate(nested_grids(gpu_scene.boxes, resolution))
        for index in range(len(self.grids)):
            seen = self.grids[0].reached_from_outside if index else None
            draws = [d for d in visible_draws(gpu_scene, Visibility.SHADOW, seen) if _blocks(d, gpu_scene)]
            batches = gpu_scene.batches.of(gpu_scene, VOXEL_DRAW, draws, gpu_scene.lets_pass)
            work = list(product(_pieces(batches), range(3)))
            for done, (piece, axis) in enumerate(work, 1):
                self._draw(gpu_scene, index, axis, piece)
                yield (index + done / len(work)) / len(self.grids)
        self.built += 1
        self._holds = resolution, gpu_scene.revision

    def bindings(self) -> dict[str, Any]:
        """What a shader with VOXEL_SAMPLERS and the uniform block ``voxel_grid`` is given."""
        assert self.grid is not None and self._holds is not None
        return {"voxel_tx": self._volume, "voxel_grid": self._block}

    def free(self) -> None:
        for resource in (self._canvas, *(self._canvas.colors if self._canvas else ()), self._volume):
            self.device.free(resource)
        self._canvas = self._volume = self.grid = self._holds = None
        self.grids = ()

    def _is_good(self, gpu_scene: GpuScene, resolution: int) -> bool:
        if self._holds is None or self._holds[0] != resolution:
            return False
        moved = gpu_scene.moved_since(self._holds[1], shapes_only=True)
        return moved is not None and not len(moved)

    def _allocate(self, grids: tuple[VoxelGrid, ...]) -> None:
        """A volume of zeros: a new one, which every backend fills quickest."""
        self.free()
        self.grid, self.grids, self._block = grids[0], grids, pack_grids(grids)
        self._volume = self.device.texture(volume_size(grids), "R32UI")
        side = max(int(grid.size.max()) for grid in grids)
        self._canvas = self.device.target([self.device.texture((side, side), "R8")])

    def _draw(self, gpu_scene: GpuScene, index: int, axis: int, batches: Sequence[Batch]) -> None:
        assert self._canvas is not None
        grid = self.grids[index]
        draw_batches(
            self.device,
            gpu_scene,
            self._canvas,
            batches,
            viewport=grid.viewport(axis),
            # Blended, though nothing is added: where an opaque triangle covers a whole tile of the canvas, Mesa's
            # software renderer leaves out what was drawn there before, and what it would have marked.
            state=ADD,
            voxel_img=self._volume,
            voxel_grid=self._block,
            pc_clip_from_world=grid.clip_from_world(axis),
            pc_grid=index,
            pc_axis=axis,
        )


def _pieces(batches: Sequence[Batch]) -> Iterator[list[Batch]]:
    """Runs of draw calls with about PIECE_TRIANGLES each; long ones in parts."""
    piece, triangles = [], 0
    for batch in batches:
        longest = max(PIECE_TRIANGLES // (CHUNK_TRIANGLES * batch.instances), 1)
        for first in range(0, batch.chunk_count, longest):
            count = min(longest, batch.chunk_count - first)
            part = replace(batch, first_chunk=batch.first_chunk + first, chunk_count=count)
            piece.append(part)
            triangles += part.triangles
            if triangles >= PIECE_TRIANGLES:
                yield piece
                piece, triangles = [], 0
    if piece:
        yield piece
