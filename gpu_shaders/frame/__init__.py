"""The passes that every frame has: what the camera sees, direct light with its shadows, and the sum of samples."""

from .reflective_shaders import REFLECT
from .shaders import DISPLAY
from .shaders import SHADERS as FRAME_SHADERS
from .surface_points import SURFACE_POINT_DRAW
from .voxel_shaders import VOXEL_DRAW

SHADERS = (*FRAME_SHADERS, REFLECT, VOXEL_DRAW, SURFACE_POINT_DRAW)

__all__ = ["DISPLAY", "SHADERS"]
