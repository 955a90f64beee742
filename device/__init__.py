"""The only folder that calls the GPU: one shader declaration on Blender's gpu module and on a standalone context.

``BlenderDevice`` is in ``.blender``, ``HeadlessDevice`` in ``.headless``; neither is imported here.
"""

from .interface import Device, DeviceError, DrawState, Target, Texture, Vertices
from .shader import Image, Shader, ShaderError
from .structs import Struct

__all__ = [
    "Device", "DeviceError", "DrawState", "Image", "Shader", "ShaderError", "Struct", "Target", "Texture", "Vertices",
]  # fmt: skip
