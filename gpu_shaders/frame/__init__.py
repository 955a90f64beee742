"""The passes that every frame has: what the camera sees, direct light with its shadows, and the sum of samples."""

from .reflective_shaders import REFLECT
from .shaders import DISPLAY
from .shaders import SHADERS as FRAME_SHADERS

SHADERS = (*FRAME_SHADERS, REFLECT)

__all__ = ["DISPLAY", "SHADERS"]
