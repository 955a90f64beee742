"""Color Ramp and curve nodes -> tables of numbers, sampled where Cycles samples them."""

from __future__ import annotations

import numpy as np

from .node_graph import TABLE_SIZE

Rows = tuple[np.ndarray, float, float, bool]  # (TABLE_SIZE, 4), the range of places that they cover, extended beyond?


def curve_rows(node) -> Rows | None:
    """The table of a bpy node; None if it has none."""
    if node.bl_idname == "ShaderNodeValToRGB":
        places = np.linspace(0.0, 1.0, TABLE_SIZE)
        rows = np.array([node.color_ramp.evaluate(place) for place in places], np.float64)
        return rows, 0.0, 1.0, node.color_ramp.interpolation != "CONSTANT"
    if node.bl_idname in {"ShaderNodeRGBCurve", "ShaderNodeVectorCurve", "ShaderNodeFloatCurve"}:
        return _curves(node.mapping)
    return None


def _curves(mapping) -> Rows:
    """Each curve's value in a column; those of a fourth, the combined one, are what the others are asked at."""
    mapping.initialize()
    curves = list(mapping.curves)
    low = min(curve.points[0].location[0] for curve in curves)
    high = max(curve.points[-1].location[0] for curve in curves)
    rows = np.zeros((TABLE_SIZE, 4))
    for row, place in zip(rows, np.linspace(low, high, TABLE_SIZE), strict=True):
        at = mapping.evaluate(curves[3], place) if len(curves) == 4 else place
        row[: min(len(curves), 3)] = [mapping.evaluate(curve, at) for curve in curves[:3]]
    return rows, low, high, mapping.extend == "EXTRAPOLATED"
