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
    the one of bpy.types.ViewLayer that asks for it. ``needs`` names the pictures that ``read`` takes the mean of.
    """

    key: str
    label: str
    old_name: str
    view_layer_property: str
    channels: str
    needs: tuple[str, ...]
    read: Callable[[Mean], np.ndarray]


def _first(name: str, count: int) -> Callable[[Mean], np.ndarray]:
    return lambda mean: np.ascontiguousarray(mean(name)[..., :count])


def _depth(mean: Mean) -> np.ndarray:
    return np.ascontiguousarray(mean("position_depth")[..., 3:])


def _per_color(name: str, color_name: str) -> Callable[[Mean], np.ndarray]:
    """Light without its surface's colour: the mean of light times colour over the mean colour, 0 where that is 0."""

    def read(mean: Mean) -> np.ndarray:
        color = mean(color_name)[..., :3]
        return np.divide(mean(name)[..., :3], color, out=np.zeros_like(color), where=color > 0)

    return read


def _plain(key: str, label: str, old_name: str, view_layer_property: str, channels: str) -> RenderPass:
    """A pass that is one picture as it is."""
    return RenderPass(key, label, old_name, view_layer_property, channels, (key,), _first(key, len(channels)))


def _lit(kind: str, old_kind: str, light: str) -> RenderPass:
    """Direct or indirect light of one kind of reflection."""
    key, color, label = f"{kind}_{light}", f"{kind}_color", f"{kind.title()} {light.title()}"
    old_name, needs = old_kind + light.title()[:3], (key, color)
    return RenderPass(key, label, old_name, f"use_pass_{key}", "RGB", needs, _per_color(key, color))


PASSES = (
    _plain("combined", "Combined", "Combined", "use_pass_combined", "RGBA"),
    RenderPass("depth", "Depth", "Depth", "use_pass_z", "Z", ("position_depth",), _depth),
    _plain("normal", "Normal", "Normal", "use_pass_normal", "XYZ"),
    RenderPass("position", "Position", "Position", "use_pass_position", "XYZ", ("position_depth",),
               _first("position_depth", 3)),
    _lit("diffuse", "Diff", "direct"),
    _lit("diffuse", "Diff", "indirect"),
    _plain("diffuse_color", "Diffuse Color", "DiffCol", "use_pass_diffuse_color", "RGB"),
    _lit("glossy", "Gloss", "direct"),
    _lit("glossy", "Gloss", "indirect"),
    _plain("glossy_color", "Glossy Color", "GlossCol", "use_pass_glossy_color", "RGB"),
    _lit("transmission", "Trans", "direct"),
    _lit("transmission", "Trans", "indirect"),
    _plain("transmission_color", "Transmission Color", "TransCol", "use_pass_transmission_color", "RGB"),
    _plain("emission", "Emission", "Emit", "use_pass_emit", "RGB"),
    _plain("environment", "Environment", "Env", "use_pass_environment", "RGB"),
)  # fmt: skip
