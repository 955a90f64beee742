"""Tables on the GPU: an RGBA32F texture with one row an element (device.structs)."""

from __future__ import annotations

import numpy as np

from ...device.interface import Device, Texture


def replace_table(device: Device, packed: np.ndarray, old: Texture | None) -> Texture:
    """Upload what ``Struct.pack`` made, (n, texels, 4) float32, in place of ``old``, which is freed."""
    if old is not None:
        device.free(old)
    rows, texels = packed.shape[:2]
    if not rows:
        packed, rows = np.zeros((1, texels, 4), np.float32), 1
    return device.texture((texels, rows), "RGBA32F", np.ascontiguousarray(packed))
