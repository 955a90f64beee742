"""Rebound's passes in Blender's terms: names by version, registration, and filling a RenderResult."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy
import numpy as np

from .passes import PASSES, RenderPass

_KIND = {"RGBA": "COLOR", "RGB": "COLOR", "XYZ": "VECTOR", "Z": "VALUE"}


def _blender_name(render_pass: RenderPass) -> str:
    """The pass's name in this Blender."""
    return render_pass.label if bpy.app.version >= (5, 0) else render_pass.old_name


def wanted_passes(view_layer) -> list[RenderPass]:
    """The passes that a view layer asks for. Combined is always one: Blender has no picture without it."""
    return [p for p in PASSES if p.key == "combined" or getattr(view_layer, p.view_layer_property)]


def register_passes(engine, scene, view_layer) -> None:
    """Tell Blender (the compositor's Render Layers node, the passes' menus) which passes a render will have."""
    for p in wanted_passes(view_layer):
        engine.register_pass(scene, view_layer, _blender_name(p), len(p.channels), p.channels, _KIND[p.channels])


def add_passes(engine, view_layer) -> None:
    """Make room in the engine's open result for the passes that the view layer asks for."""
    for p in wanted_passes(view_layer):
        if p.key != "combined":
            engine.add_pass(_blender_name(p), len(p.channels), p.channels, layer=view_layer.name)


def fill(result, passes: Sequence[RenderPass], read: Callable[[str], np.ndarray]) -> None:
    """Copy ``read(key)``, (h, w, channels) float32, of each pass into the first layer of a render result."""
    targets = {target.name: target for target in result.layers[0].passes}
    for p in passes:
        target = targets[_blender_name(p)]
        # foreach_set takes milliseconds for what an assignment to rect takes seconds.
        target.rect.foreach_set(np.ascontiguousarray(read(p.key), np.float32).ravel())
