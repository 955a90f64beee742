"""Small scenes for virtual point lights, how they are rendered, and the integrals that they must come to."""

from __future__ import annotations

import math

import numpy as np

from rebound.scene.data import Light, Material, Mesh, Scene
from rebound.tests.support.render_scenes import Studio, box, ortho, scene

# As few of everything as the tolerances allow; every pixel gathers for itself.
VPL = {
    "method": "VPL",
    "vpl_scale": "FULL",
    "vpl_resolution": 64,
    "vpl_pool": 1024,
    "vpl_candidates": 8,
    "vpl_voxels": 128,
    "vpl_cache_rows": 16,
    "vpl_bounces": "ONE",
}
GREY = Material("grey", (0.5, 0.5, 0.5))
BLACK = Material("black", (0.0, 0.0, 0.0))
ROOM_AREA = 24.0  # m², of the walls of room()


def emitter(radiance: float) -> Material:
    return Material(f"emitter {radiance}", (0.0, 0.0, 0.0), emission=(radiance,) * 3)


def room() -> Mesh:
    """2 x 2 x 2 m around the origin, seen from inside."""
    return box("room", (-1, -1, -1), (1, 1, 1), inward=True)


def still(meshes, lamps=(), albedo=0.5, **fields) -> Scene:
    """A scene without anti-aliasing: a pixel is a point."""
    return scene(meshes, lamps, albedo, filter_width=1e-3, **fields)


def gathered(studio: Studio, shown: Scene, view, samples=32, name="diffuse_indirect", **settings):
    """One pass's first channel, (h, w), NaN where nothing is seen, and the positions (h, w, 3)."""
    found = studio.render(shown, view, samples, (name, "position", "depth"), **{**VPL, **settings})
    return np.where(found["depth"][..., 0] < 1e9, found[name][..., 0], np.nan), found["position"]


def power_on_walls(studio: Studio, lamp: Light, albedo: float, sides=6, samples=8, **settings) -> float:
    """Watts of bounced light that the walls of a room() receive, from ``sides`` of them: one, if all are alike."""
    means = []
    for side in range(sides):
        axis = side // 2
        target, up = np.eye(3)[axis] * (2 * (side % 2) - 1), np.eye(3)[(axis + 1) % 3]
        view = ortho(16, 16, 2.0, (0, 0, 0), target, up=up)
        means.append(gathered(studio, still([room()], [lamp], albedo), view, samples, **settings)[0].mean())
    return float(np.mean(means)) * math.pi * ROOM_AREA


def form_factor(points: np.ndarray, normal, center, u, v) -> np.ndarray:
    """From elements at ``points`` (..., 3) with one normal to the parallelogram center +- u +- v before them all.

    Lambert's formula (Baum et al. 1989): half of 1 / pi times the sum over edges of their angle and axis.
    """
    middle, u, v = (np.asarray(x, np.float64) for x in (center, u, v))
    corners = np.stack([middle + a * u + b * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    d = corners - points[..., None, :]
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    after = np.roll(d, -1, axis=-2)
    axes = np.cross(d, after)
    sines = np.linalg.norm(axes, axis=-1)
    angles = np.arctan2(sines, (d * after).sum(-1))
    return np.abs((axes @ np.asarray(normal, np.float64) * angles / sines).sum(-1)) / (2 * math.pi)


def seen_part(points: np.ndarray, normal, patch, blocker, steps=100) -> np.ndarray:
    """``form_factor`` to what is seen of ``patch`` (center, u, v) past a rectangle ``blocker``: its grid summed up."""
    line = (np.arange(steps) + 0.5) / steps * 2 - 1
    a, b = (x.reshape(-1, 1) for x in np.meshgrid(line, line))
    center, u, v = (np.asarray(x, np.float64) for x in patch)
    d = center + a * u + b * v - points.reshape(-1, 1, 3)
    squared = (d * d).sum(-1)
    form = np.maximum(d @ np.asarray(normal, np.float64), 0) * np.abs(d @ np.cross(u, v)) / squared**2
    middle, x, y = (np.asarray(side, np.float64) for side in blocker)
    axis = np.cross(x, y)
    t = (middle - points.reshape(-1, 1, 3)) @ axis / (d @ axis)
    at = points.reshape(-1, 1, 3) + t[..., None] * d - middle
    hidden = (abs(at @ x) < x @ x) & (abs(at @ y) < y @ y) & (t > 0) & (t < 1)
    return ((form * ~hidden).sum(-1) * 4 / steps**2 / math.pi).reshape(points.shape[:-1])
