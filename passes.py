"""The render passes: one list that names them, registers them with Blender and says how each is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Mean = Callable[[str], np.ndarray]  # name of an accumulated picture -> (h, w, 4) float32, its mean over the samples


@dataclass(frozen=True)
class RenderPass:
    """``channels`` are Blender's: RGBA, RGB, XYZ or Z. ``read`` gives (h, w, len(channels)) float32."""

    key: str
    label: str
    channels: str
    read: Callable[[Mean], np.ndarray]


def _first(name: str, count: int) -> Callable[[Mean], np.ndarray]:
    return lambda mean: np.ascontiguousarray(mean(name)[..., :count])


def _per_color(name: str) -> Callable[[Mean], np.ndarray]:
    """Light without its surface's colour: the mean of light times colour over the mean colour, 0 where that is 0."""

    def read(mean: Mean) -> np.ndarray:
        color = mean("diffuse_color")[..., :3]
        return np.divide(mean(name)[..., :3], color, out=np.zeros_like(color), where=color > 0)

    return read


PASSES = (
    RenderPass("combined", "Combined", "RGBA", _first("combined", 4)),
    RenderPass("depth", "Depth", "Z", lambda mean: np.ascontiguousarray(mean("position_depth")[..., 3:])),
    RenderPass("normal", "Normal", "XYZ", _first("normal", 3)),
    RenderPass("position", "Position", "XYZ", _first("position_depth", 3)),
    RenderPass("diffuse_direct", "Diffuse Direct", "RGB", _per_color("diffuse_direct")),
    RenderPass("diffuse_indirect", "Diffuse Indirect", "RGB", _per_color("diffuse_indirect")),
    RenderPass("diffuse_color", "Diffuse Color", "RGB", _first("diffuse_color", 3)),
    RenderPass("emission", "Emission", "RGB", _first("emission", 3)),
    RenderPass("environment", "Environment", "RGB", _first("environment", 3)),
)
