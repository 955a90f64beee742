"""Tables on the GPU (device.structs)."""

from __future__ import annotations

import numpy as np

from ...device.interface import Device, Texture
from ...device.structs import table_texels
from ..materials import VALUE_WIDTH


def replace_texels(device: Device, texels: np.ndarray, old: Texture | None) -> Texture:
    """Upload (n, 4) numbers, VALUE_WIDTH of them a row, in place of ``old``, which is freed."""
    device.free(old)
    height = max(-(-len(texels) // VALUE_WIDTH), 1)
    rows = np.zeros((height, VALUE_WIDTH, 4), np.float32)
    rows.reshape(-1, 4)[: len(texels)] = texels
    return device.texture((VALUE_WIDTH, height), "RGBA32F", rows)


def replace_table(device: Device, packed: np.ndarray, old: Texture | None) -> Texture:
    """Upload what ``Struct.pack`` made, (n, texels, 4) float32, in place of ``old``, which is freed."""
    if old is not None:
        device.free(old)
    texels = table_texels(packed)
    return device.texture((texels.shape[1], texels.shape[0]), "RGBA32F", texels)
