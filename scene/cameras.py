"""Blender camera or viewport region -> View, and the size and border of a final render."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from .data import Array, View
from .errors import SceneError

Border = tuple[int, int, int, int]  # left, bottom, right, top in pixels of the full picture; right and top excluded


# Metres; Blender clamps infinity to the largest float, and beyond this a squared distance overflows single precision.
FARTHEST = 1e18


def active_camera(depsgraph, engine=None):
    """The evaluated camera that the picture is taken with. Raises SceneError where there is none."""
    scene = depsgraph.scene_eval
    camera = (engine and engine.camera_override) or scene.camera
    if camera is None:
        raise SceneError(
            f"Scene '{scene.name}' has no camera: add one, or choose one in Scene Properties > Scene > Camera"
        )
    if camera.type != "CAMERA":
        raise SceneError(
            f"Scene '{scene.name}' looks through '{camera.name}', which is no camera: "
            "choose one in Scene Properties > Scene > Camera"
        )
    return camera.evaluated_get(depsgraph)


def camera_warnings(camera) -> Iterator[str]:
    """One line for each way in which this camera can only be approximated."""
    kind = camera.data.type
    if kind in {"PANO", "CUSTOM"}:
        yield (
            f"Camera '{camera.name}': type {kind} is not supported; a perspective camera of its focal length stands in"
        )
    if camera.data.dof.use_dof:
        yield f"Camera '{camera.name}': depth of field is not shown yet; everything is sharp"


def border_pixels(render, width: int, height: int) -> Border | None:
    """The render border in whole pixels, rounded as Blender does, or None where the whole picture is rendered."""
    if not render.use_border:
        return None
    sides = (render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y)
    # Blender multiplies in single precision and cuts the fraction off; one ulp more would shift the picture by a pixel.
    x0, y0, x1, y1 = (int(np.float32(s) * np.float32(n)) for s, n in zip(sides, (width, height) * 2, strict=True))
    if x1 <= x0 or y1 <= y0:
        return None
    return x0, y0, x1, y1


def camera_view(camera, depsgraph, engine=None, *, width: int, height: int, border: Border | None = None) -> View:
    """The view through an evaluated camera of a picture of width × height pixels, cut to ``border`` if there is one.

    With an engine its camera matrix is used, which knows the eye of a stereo render. Raises SceneError if the camera's
    transform has no inverse or is not finite.
    """
    render = depsgraph.scene_eval.render
    projection = camera.calc_matrix_camera(
        depsgraph, x=width, y=height, scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y
    )
    world = np.array(engine.camera_model_matrix(camera) if engine else camera.matrix_world, np.float64).reshape(4, 4)
    clip_from_view = np.array(projection, np.float64)
    if border is not None:
        clip_from_view = window_from_full(border, width, height) @ clip_from_view
        width, height = border[2] - border[0], border[3] - border[1]
    return View(_rigid_inverse(world, camera.name), clip_from_view, width, height)


def region_view(region, region_data, border: Border | None = None) -> View:
    """The view of a 3D viewport region (``context.region`` and ``context.region_data``), or of its border only."""
    width, height = max(region.width, 1), max(region.height, 1)
    clip_from_view = np.array(region_data.window_matrix, np.float64)
    if border is not None:
        clip_from_view = window_from_full(border, width, height) @ clip_from_view
        width, height = border[2] - border[0], border[3] - border[1]
    return View(np.array(region_data.view_matrix, np.float64), clip_from_view, width, height)


def region_border(region, region_data, space, scene) -> Border | None:
    """The pixels of a 3D viewport region that its render region leaves, or None where there is none.

    Through the camera that is the scene's border, a part of the camera's frame; elsewhere the viewport's own. What lies
    outside of the region is cut off; a border that has nothing of it keeps one pixel.
    """
    width, height = max(region.width, 1), max(region.height, 1)
    through_camera, render = region_data.view_perspective == "CAMERA", scene.render
    if not (render.use_border if through_camera else space.use_render_border):
        return None
    if through_camera:
        frame = _camera_frame(region_data, space, scene, width, height)
        low, high = (render.border_min_x, render.border_min_y), (render.border_max_x, render.border_max_y)
    else:
        frame = 0.0, 0.0, float(width), float(height)
        low = space.render_border_min_x, space.render_border_min_y
        high = space.render_border_max_x, space.render_border_max_y
    if frame is None:
        return None
    left, bottom, right, top = frame
    x0, x1 = (min(max(int(left + side[0] * (right - left)), 0), width) for side in (low, high))
    y0, y1 = (min(max(int(bottom + side[1] * (top - bottom)), 0), height) for side in (low, high))
    x0, y0 = min(x0, width - 1), min(y0, height - 1)
    return x0, y0, max(x1, x0 + 1), max(y1, y0 + 1)


def _camera_frame(region_data, space, scene, width: int, height: int) -> tuple[float, float, float, float] | None:
    """Left, bottom, right and top of the camera's frame in pixels of the region; None if there is no camera."""
    camera = space.camera if space.use_local_camera else scene.camera
    if camera is None or camera.type != "CAMERA":
        return None
    corners = np.array([(*corner, 1.0) for corner in camera.data.view_frame(scene=scene)])
    # The frame stands before the camera as the region shows it, whatever the camera's scale.
    clip = corners @ np.array(region_data.window_matrix, np.float64).T
    x, y = ((clip[:, axis] / clip[:, 3] * 0.5 + 0.5) * size for axis, size in ((0, width), (1, height)))
    return float(x.min()), float(y.min()), float(x.max()), float(y.max())


def window_from_full(border: Border, width: int, height: int) -> Array:
    """(4, 4) matrix from the clip space of the full picture to that of a part of it."""
    x0, y0, x1, y1 = border
    sx, sy = width / (x1 - x0), height / (y1 - y0)
    matrix = np.diag((sx, sy, 1.0, 1.0))
    matrix[0, 3] = sx - 2.0 * x0 / (x1 - x0) - 1.0
    matrix[1, 3] = sy - 2.0 * y0 / (y1 - y0) - 1.0
    return matrix


def _rigid_inverse(world: Array, name: str) -> Array:
    """The inverse of a camera's world matrix with its scale taken out, as Blender does."""
    scale = np.linalg.norm(world[:3, :3], axis=0)
    if not np.abs(world).max() < FARTHEST or not (scale > 1e-20).all():  # the first is false for NaN
        raise SceneError(f"Camera '{name}' has a zero scale or is not at a finite place: reset its scale and location")
    rigid = world.copy()
    rigid[:3, :3] /= scale
    if math.isclose(float(np.linalg.det(rigid[:3, :3])), 0.0, abs_tol=1e-6):
        raise SceneError(f"Camera '{name}' is squashed flat by its parent's scale: clear the parent's scale")
    return np.linalg.inv(rigid)
