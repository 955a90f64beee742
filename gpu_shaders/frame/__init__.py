"""The passes that every frame has: what the camera sees, direct light with its shadows, and the sum of samples."""

from .environment_light import SHADERS as ENVIRONMENT_LIGHT_SHADERS
from .environment_shaders import SHADERS as ENVIRONMENT_SHADERS
from .map_views import MAP_VIEW
from .reflective_shaders import REFLECT
from .shaders import DISPLAY, SPLIT
from .shaders import SHADERS as FRAME_SHADERS
from .surface_points import SURFACE_POINT_DRAW
from .views import VIEW_SHADERS
from .voxel_shaders import VOXEL_DRAW

SHADERS = (
    *FRAME_SHADERS,
    REFLECT,
    VOXEL_DRAW,
    SURFACE_POINT_DRAW,
    MAP_VIEW,
    *ENVIRONMENT_SHADERS,
    *ENVIRONMENT_LIGHT_SHADERS,
    *VIEW_SHADERS,
)

__all__ = ["DISPLAY", "SHADERS", "SPLIT"]
