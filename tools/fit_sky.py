"""Fit Hosek and Wilkie's sky as Cycles shows it, and write scene/sky_daylight.py: `.venv/bin/python tools/fit_sky.py`.

Their model has thousands of coefficients. Here a panorama of it is rendered for each of some suns and turbidities, and
the coefficients and the level of a formula like Perez's are fitted to each channel (Levenberg-Marquardt).
"""

from __future__ import annotations

import itertools
import math
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np

TURBIDITIES = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0)
ELEVATIONS = (0.0, 5.0, 12.0, 20.0, 35.0, 50.0, 70.0, 90.0)
ALBEDOS = (0.0, 1.0)
WIDTH = 64
TARGET = Path(__file__).parents[1] / "scene" / "sky_daylight.py"
HEAD = '''"""Coefficients of Hosek and Wilkie's sky, fitted to Cycles by tools/fit_sky.py, which writes this."""

import numpy as np

TURBIDITIES = {turbidities}
ELEVATIONS = {elevations}  # of the sun, degrees
ALBEDOS = {albedos}  # of the ground

# (albedo, turbidity, elevation, channel, six coefficients and the level), of linear Rec. 709.
FIT = np.array(
    [
{rows}
    ]
).reshape(len(ALBEDOS), len(TURBIDITIES), len(ELEVATIONS), 3, 7)  # fmt: skip
'''


def sky_scene():
    """A scene whose camera sees all of a sky; and the sky's node."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    nodes: Any = scene.world.node_tree
    node: Any = nodes.nodes.new("ShaderNodeTexSky")
    node.sky_type = "HOSEK_WILKIE"
    nodes.links.new(node.outputs[0], nodes.nodes["Background"].inputs[0])
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.panorama_type = "PANO", "EQUIRECTANGULAR"
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.camera.rotation_euler = (math.pi / 2, 0, 0)
    scene.collection.objects.link(scene.camera)
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 1
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, WIDTH // 2
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    return scene, node


def panorama(scene, node, turbidity, elevation, albedo, path) -> np.ndarray:
    """(h, w, 3) linear radiance; the sun stands above +X."""
    up = math.radians(elevation)
    node.turbidity, node.ground_albedo, node.sun_direction = turbidity, albedo, (math.cos(up), 0, math.sin(up))
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    image: Any = bpy.data.images.load(path)
    pixels = np.array(image.pixels[:]).reshape(WIDTH // 2, WIDTH, image.channels)[..., :3]
    bpy.data.images.remove(image)
    return pixels


def directions():
    """Elevation and azimuth (from the sun) of the pixels."""
    across, rows = (np.arange(WIDTH) + 0.5) / WIDTH, (np.arange(WIDTH // 2) + 0.5) / (WIDTH // 2)
    return np.meshgrid((rows - 0.5) * np.pi, (0.75 - across) * 2 * np.pi, indexing="ij")


def perez(p, cosine, gamma):
    """Perez's formula, with a term for the horizon."""
    around = 1 + p[2] * np.exp(p[3] * gamma) + p[4] * np.cos(gamma) ** 2 + p[5] * np.sqrt(cosine)
    return (1 + p[0] * np.exp(p[1] / (cosine + 0.01))) * around


def fitted(level, weights, cosine, gamma) -> tuple[np.ndarray, float]:
    """Coefficients with the level; and the relative root mean square of what is left."""
    scale = 1 / np.sqrt((weights * level**2).sum())

    def left(p):
        shape = perez(p, cosine, gamma)
        factor = (weights * shape * level).sum() / (weights * shape * shape).sum()
        return factor, np.sqrt(weights) * scale * (factor * shape - level)

    p, damping = np.array([-0.9, -0.3, 1.5, -2.5, 0.3, 0.0]), 1e-2
    factor, rest = left(p)
    for _ in range(120):
        steps = 1e-4 * np.maximum(abs(p), 0.1)
        slopes = np.stack([(left(p + np.eye(6)[k] * steps[k])[1] - rest) / steps[k] for k in range(6)], 1)
        normal = slopes.T @ slopes
        new = p + np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-9), -slopes.T @ rest)
        new[1], new[3] = min(new[1], -1e-3), np.clip(new[3], -12, -0.2)
        new_factor, new_rest = left(new)
        if new_rest @ new_rest < rest @ rest:
            p, factor, rest, damping = new, new_factor, new_rest, max(damping / 3, 1e-7)
        else:
            damping *= 4
    return np.array([*p, factor]), float(np.sqrt(rest @ rest))


def main() -> None:
    up, around = directions()
    # Below the horizon there is the horizon's sky, which lights what faces down.
    weights = (np.cos(up) * np.where(up > 0, 1.0, 0.5)).ravel()
    cosine = np.maximum(np.sin(up), 1e-3).ravel()
    rows, worst = [], []
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "sky.exr")
        scene, node = sky_scene()
        for albedo, turbidity, elevation in itertools.product(ALBEDOS, TURBIDITIES, ELEVATIONS):
            sun = math.radians(elevation)
            toward = np.cos(up) * np.cos(around) * math.cos(sun) + np.sin(up) * math.sin(sun)
            gamma = np.arccos(np.clip(toward, -1, 1)).ravel()
            pixels = panorama(scene, node, turbidity, elevation, albedo, path).reshape(-1, 3)
            for channel in range(3):
                numbers, error = fitted(pixels[:, channel], weights, cosine, gamma)
                rows.append("        " + ", ".join(f"{n:.4g}" for n in numbers) + ",")
                worst.append(error)
    TARGET.write_text(
        HEAD.format(
            turbidities=TURBIDITIES,
            elevations=ELEVATIONS,
            albedos=ALBEDOS,
            rows="\n".join(rows),
        )
    )
    errors = np.array(worst)
    print(f"{len(rows)} fits; left over: mean {errors.mean():.3f}, most {errors.max():.3f}")


if __name__ == "__main__":
    main()
