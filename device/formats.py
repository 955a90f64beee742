"""Texture formats that every backend creates, fills and reads back rightly, and their numpy side."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .interface import Texture


@dataclass(frozen=True)
class Format:
    """``dtype`` is what reading gives; ``scalar`` ("FLOAT", "INT", "UINT") is what a shader sees.

    ``bytes`` counts those of one texel on the GPU.
    """

    channels: int
    dtype: type
    bytes: int
    scalar: str = "FLOAT"
    is_depth: bool = False

    @property
    def is_8_bit(self) -> bool:
        """Whether it stores bytes that a shader sees as [0, 1]."""
        return self.dtype is np.uint8


FORMATS = {
    "RGBA32F": Format(4, np.float32, 16),
    "RGBA16F": Format(4, np.float32, 8),
    "RG32F": Format(2, np.float32, 8),
    "RG16F": Format(2, np.float32, 4),
    "R32F": Format(1, np.float32, 4),
    "R16F": Format(1, np.float32, 2),
    "RGBA8": Format(4, np.uint8, 4),
    "RG8": Format(2, np.uint8, 2),
    "R8": Format(1, np.uint8, 1),
    "SRGB8_A8": Format(4, np.uint8, 4),  # decoded to linear when sampled; not an image, not a render target
    "R32UI": Format(1, np.uint32, 4, "UINT"),
    "R32I": Format(1, np.int32, 4, "INT"),
    "DEPTH32F": Format(1, np.float32, 4, is_depth=True),  # headless: 24 bit
}


def check_data(texture: "Texture", data: np.ndarray) -> np.ndarray:
    """Data as the backends want it: C-contiguous, shaped as the texture, in the dtype of its format.

    Raises ValueError for a shape or dtype that does not fit.
    """
    info, data = texture.info, np.asarray(data)
    if data.shape != texture.shape and not (info.channels == 1 and data.shape == texture.shape[:-1]):
        raise ValueError(f"{texture}: data must be {texture.shape}, got {data.shape}")
    if info.scalar != "FLOAT" and len(texture.shape) != 3:
        raise ValueError(f"{texture}: integers can be uploaded to 2D textures only")
    if info.is_8_bit and data.dtype.kind == "f":
        data = np.rint(np.clip(np.nan_to_num(data), 0.0, 1.0) * 255.0).astype(np.uint8)
    allowed = ("f",) if info.dtype is np.float32 else (np.dtype(info.dtype).kind,)
    if data.dtype.kind not in allowed or (data.dtype.kind in "iu" and data.dtype != info.dtype):
        raise ValueError(f"{texture}: data must be {np.dtype(info.dtype)}, got {data.dtype}")
    return np.ascontiguousarray(data, info.dtype).reshape(texture.shape)
