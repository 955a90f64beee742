"""Rebound's passes in Blender's terms: names by version, registration, and filling a RenderResult."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from .passes import PASSES, RenderPass

_KIND = {"RGBA": "COLOR", "RGB": "COLOR", "XYZ": "VECTOR", "Z": "VALUE"}


@dataclass(frozen=True)
class _BlenderPass:
    """The property of a view layer that asks for a pass, and the pass's name before and since Blender 5.0."""

    wanted: str
    old_name: str
    new_name: str

    @property
    def name(self) -> str:
        return self.new_name if bpy.app.version >= (5, 0) else self.old_name


_BLENDER_PASSES = {
    "combined": _BlenderPass("use_pass_combined", "Combined", "Combined"),
    "depth": _BlenderPass("use_pass_z", "Depth", "Depth"),
    "normal": _BlenderPass("use_pass_normal", "Normal", "Normal"),
    "position": _BlenderPass("use_pass_position", "Position", "Position"),
    "diffuse_direct": _BlenderPass("use_pass_diffuse_direct", "DiffDir", "Diffuse Direct"),
    "diffuse_indirect": _BlenderPass("use_pass_diffuse_indirect", "DiffInd", "Diffuse Indirect"),
    "diffuse_color": _BlenderPass("use_pass_diffuse_color", "DiffCol", "Diffuse Color"),
    "emission": _BlenderPass("use_pass_emit", "Emit", "Emission"),
    "environment": _BlenderPass("use_pass_environment", "Env", "Environment"),
}


def view_layer_property(render_pass: RenderPass) -> str:
    """The property of bpy.types.ViewLayer that asks for this pass."""
    return _BLENDER_PASSES[render_pass.key].wanted


def wanted_passes(view_layer) -> list[RenderPass]:
    """The passes that a view layer asks for. Combined is always one: Blender has no picture without it."""
    return [p for p in PASSES if p.key == "combined" or getattr(view_layer, view_layer_property(p))]


def register_passes(engine, scene, view_layer) -> None:
    """Tell Blender (the compositor's Render Layers node, the passes' menus) which passes a render will have."""
    for p in wanted_passes(view_layer):
        name = _BLENDER_PASSES[p.key].name
        engine.register_pass(scene, view_layer, name, len(p.channels), p.channels, _KIND[p.channels])


def add_passes(engine, view_layer) -> None:
    """Make room in the engine's open result for the passes that the view layer asks for."""
    for p in wanted_passes(view_layer):
        if p.key != "combined":
            name = _BLENDER_PASSES[p.key].name
            engine.add_pass(name, len(p.channels), p.channels, layer=view_layer.name)


def fill(result, passes: Sequence[RenderPass], read: Callable[[str], np.ndarray]) -> None:
    """Copy ``read(key)``, (h, w, channels) float32, of each pass into the first layer of a render result."""
    targets = {target.name: target for target in result.layers[0].passes}
    for p in passes:
        target = targets[_BLENDER_PASSES[p.key].name]
        # foreach_set takes milliseconds for what an assignment to rect takes seconds.
        target.rect.foreach_set(np.ascontiguousarray(read(p.key), np.float32).ravel())
