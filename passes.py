"""The render passes: one list that names them, here and in Blender, and says how each is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Mean = Callable[[str], np.ndarray]  # name of an accumulated picture -> (h, w, 4) float32, its mean over the samples


@dataclass(frozen=True)
class RenderPass:
    """``channels`` are Blender's: RGBA, RGB, XYZ or Z. ``read`` gives (h, w, len(channels)) float32.

    ``label`` is the pass's name in Blender too, but before 5.0, where that was ``old_name``. ``view_layer_property`` is
    the one of bpy.types.ViewLayer that asks for it.
    """

    key: str
    label: str
    old_name: str
    view_layer_property: str
    channels: str
    read: Callable[[Mean], np.ndarray]


def _first(name: str, count: int) -> Callable[[Mean], np.ndarray]:
    return lambda mean: np.ascontiguousarray(mean(name)[..., :count])


def _depth(mean: Mean) -> np.ndarray:
    return np.ascontiguousarray(mean("position_depth")[..., 3:])


def _per_color(name: str) -> Callable[[Mean], np.ndarray]:
    """Light without its surface's colour: the mean of light times colour over the mean colour, 0 where that is 0."""

    def read(mean: Mean) -> np.ndarray:
        color = mean("diffuse_color")[..., :3]
        return np.divide(mean(name)[..., :3], color, out=np.zeros_like(color), where=color > 0)

    return read


PASSES = (
    RenderPass("combined", "Combined", "Combined", "use_pass_combined", "RGBA", _first("combined", 4)),
    RenderPass("depth", "Depth", "Depth", "use_pass_z", "Z", _depth),
    RenderPass("normal", "Normal", "Normal", "use_pass_normal", "XYZ", _first("normal", 3)),
    RenderPass("position", "Position", "Position", "use_pass_position", "XYZ", _first("position_depth", 3)),
    RenderPass("diffuse_direct", "Diffuse Direct", "DiffDir", "use_pass_diffuse_direct", "RGB",
               _per_color("diffuse_direct")),
    RenderPass("diffuse_indirect", "Diffuse Indirect", "DiffInd", "use_pass_diffuse_indirect", "RGB",
               _per_color("diffuse_indirect")),
    RenderPass("diffuse_color", "Diffuse Color", "DiffCol", "use_pass_diffuse_color", "RGB",
               _first("diffuse_color", 3)),
    RenderPass("emission", "Emission", "Emit", "use_pass_emit", "RGB", _first("emission", 3)),
    RenderPass("environment", "Environment", "Env", "use_pass_environment", "RGB", _first("environment", 3)),
)  # fmt: skip
