"""Where the grids of voxels lie: one around the scene, ever wider ones around it where huge objects are left out."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .maps import MOST_HUGE_OBJECTS, WORTHWHILE_SHRINK
from .voxel_shaders import MOST_OUTER_GRIDS, VOXEL_GRID

# One more huge object is left out where that makes the box so many times smaller again.
FURTHER_SHRINK = 2.0
# Voxels around the scene's box: its faces, often walls, lie well inside a voxel, and their rims cover its centre.
MARGIN = 0.49
SMALLEST_EDGE = 1e-6  # metres: of a scene that is a point
# Voxels along the longest side of an outer grid.
OUTER_RESOLUTION = 128
# How many times wider than the one inside it an outer grid is, where MOST_OUTER_GRIDS of them then hold everything.
OUTER_STEP = 4.0
# In voxels of an outer grid: how deep in its voxel a huge plane lies, seen from the scene. So its layer blocks as early
# as the plane does, and rays that leave a grid just over the plane are over the next one's layer. Well above rounding
# (VOXEL_NUDGE of voxel_draw_frag.glsl), and so small that VOXEL_FLUSH_START of voxel_lib.glsl clears the next grid's.
FLUSH = 0.01


class VoxelGrid:
    """Where the voxels lie: cubes of ``edge`` metres, ``size`` of them along each axis from ``origin``."""

    def __init__(self, bounds: np.ndarray, resolution: int) -> None:
        extent = bounds[1] - bounds[0]
        self.edge = max(float(extent.max()) / (resolution - 2 * MARGIN), SMALLEST_EDGE)
        self.origin = bounds[0] - MARGIN * self.edge
        self.size = np.minimum(np.ceil(extent / self.edge + 2 * MARGIN - 1e-6).astype(int), resolution)

    @property
    def bounds(self) -> np.ndarray:
        """(2, 3) corners of the box."""
        return np.stack([self.origin, self.origin + self.size * self.edge])

    @property
    def bricks(self) -> list[np.ndarray]:
        """(3,) each, by level."""
        return [-(-self.size // 4**level) for level in (1, 2, 3)]

    @property
    def slices(self) -> int:
        """Of the volume, for all levels."""
        return int(sum(bricks[2] for bricks in self.bricks))

    def reached_from_outside(self, boxes: np.ndarray) -> np.ndarray:
        """Which of the boxes (n, 2, 3) are not wholly inside: (n,) bool."""
        low, high = self.bounds
        return ((boxes[:, 0] < low) | (boxes[:, 1] > high)).any(1)

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


class OuterGrid(VoxelGrid):
    """Around ``bounds`` with voxels of ``edge`` metres, their layers where ``planes`` of huge objects lie.

    ``planes``: (3, 2), by axis where one lies, NaN for none, and at which part of its voxel.
    """

    def __init__(self, bounds: np.ndarray, edge: float, planes: np.ndarray) -> None:
        self.edge = edge
        at, part = planes.T
        low = bounds[0] - FLUSH * edge
        flush = at - (np.ceil((at - low) / edge - part) + part) * edge
        self.origin = np.where(np.isnan(at), bounds[0] - MARGIN * edge, flush)
        self.size = np.ceil((bounds[1] - self.origin) / edge + FLUSH).astype(int)


# A huge object this flat is a ground; any other may be the room around what is left, which is worth voxels as long as
# it is not so many times larger still.
FLAT, SHELL = 0.1, 4.0


def grid_bounds(boxes: np.ndarray) -> np.ndarray:
    """(2, 3) around the boxes (n, 2, 3), without a few huge ones that would take nearly all voxels."""
    extents = boxes[:, 1] - boxes[:, 0]
    order = np.argsort(extents.max(1))
    bounds, shrink = _around(boxes), math.sqrt(WORTHWHILE_SHRINK)
    for left_out in range(1, min(MOST_HUGE_OBJECTS, len(order) - 1) + 1):
        kept = _around(boxes[order[:-left_out]])
        flat = extents[order[-left_out]].min() < FLAT * extents[order[-left_out]].max()
        if _longest(bounds) > (shrink if flat else shrink * SHELL) * _longest(kept) > 0.0:
            bounds, shrink = kept, FURTHER_SHRINK
    return bounds


def nested_grids(boxes: np.ndarray, resolution: int) -> tuple[VoxelGrid, ...]:
    """The grid around the boxes (n, 2, 3) but huge ones, outer ones up to everything; each holds those before it."""
    inner = VoxelGrid(grid_bounds(boxes), resolution)
    huge = boxes[inner.reached_from_outside(boxes)]
    if not len(huge):
        return (inner,)
    everything = _around(np.concatenate([boxes, inner.bounds[None]]))
    width, widest = _longest(inner.bounds), _longest(everything)
    step = max((widest / width) ** (1 / MOST_OUTER_GRIDS), OUTER_STEP)
    count = max(math.ceil(math.log(widest / width, step) - 1e-6), 1)
    center = inner.bounds.mean(0)
    planes = _planes(huge, center)
    grids = [inner]
    for number in range(1, count + 1):
        width = widest if number == count else width * step
        around = np.clip(np.stack([center - 0.5 * width, center + 0.5 * width]), *everything)
        bounds = everything if number == count else around
        holds = _around(np.stack([bounds, grids[-1].bounds]))
        grids.append(OuterGrid(holds, width / OUTER_RESOLUTION, planes))
    return tuple(grids)


def volume_size(grids: Sequence[VoxelGrid]) -> tuple[int, int, int]:
    """Texels of the volume with all levels of all grids, one above the other."""
    x, y = np.max([grid.bricks[0][:2] for grid in grids], axis=0)
    return 2 * int(x), int(y), sum(grid.slices for grid in grids)


def pack_grids(grids: Sequence[VoxelGrid]) -> np.ndarray:
    """The uniform block VOXEL_GRID."""
    inner = grids[0]
    first, second, _ = (int(bricks[2]) for bricks in inner.bricks)
    row = {"origin": inner.origin, "edge": inner.edge, "size": inner.size}
    row |= {"slice_1": first, "slice_2": first + second, "outer_count": len(grids) - 1}
    for number in range(1, MOST_OUTER_GRIDS + 1):
        place, size = np.zeros(4), np.zeros(4)
        if number < len(grids):
            grid = grids[number]
            place = np.array([*grid.origin, grid.edge])
            size = np.array([*grid.size, sum(inside.slices for inside in grids[:number])])
        row |= {f"place_{number}": place, f"size_{number}": size}
    return VOXEL_GRID.pack([row], for_uniform=True)


def _planes(huge: np.ndarray, center: np.ndarray) -> np.ndarray:
    """(3, 2): where the huge boxes (n, 2, 3) have the face nearest to the scene, and its part of an outer voxel."""
    planes = np.full((3, 2), np.nan)
    for axis in range(3):
        low, high = huge[:, 0, axis], huge[:, 1, axis]
        below, above = high[high <= center[axis]].max(initial=-np.inf), low[low >= center[axis]].min(initial=np.inf)
        if np.isfinite(below) and center[axis] - below <= above - center[axis]:
            planes[axis] = below, 1.0 - FLUSH
        elif np.isfinite(above):
            planes[axis] = above, FLUSH
    return planes


def _around(boxes: np.ndarray) -> np.ndarray:
    return np.stack([boxes[:, 0].min(0), boxes[:, 1].max(0)])


def _longest(bounds: np.ndarray) -> float:
    return float((bounds[1] - bounds[0]).max())
