"""The passes that every frame has: what the camera sees, direct light with its shadows, and the sum of samples."""

from .shaders import DISPLAY, SHADERS

__all__ = ["DISPLAY", "SHADERS"]
