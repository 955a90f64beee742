"""Tables on the GPU (device.structs)."""

from __future__ import annotations

import numpy as np

from ...device.interface import Device, Texture
from ...device.structs import table_texels


def replace_table(device: Device, packed: np.ndarray, old: Texture | None) -> Texture:
    """Upload what ``Struct.pack`` made, (n, texels, 4) float32, in place of ``old``, which is freed."""
    if old is not None:
        device.free(old)
    texels = table_texels(packed)
    return device.texture((texels.shape[1], texels.shape[0]), "RGBA32F", texels)
