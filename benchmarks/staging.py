"""What a file lacks to be rendered: somebody to wear its materials, a camera, a light. Runs inside Blender.

A library of materials has no objects and an exchange file often no camera; every engine is given the same stage.
"""

from __future__ import annotations

import math
from typing import Any

import bpy
from mathutils import Vector

MOST_WORN = 48  # materials of a library that are shown
SPACING = 2.4  # radii between the balls that wear them
TOWARD = Vector((0.6, -1.0, 0.55))  # from what is shown to a camera of ours
SUN_STRENGTH = 3.0  # W/m^2
SHAPES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME"}


def stage(scene) -> None:
    """Give ``scene`` what it lacks. A file with a camera is rendered as it is, but no panorama: Rebound has none."""
    depsgraph: Any = bpy.context.evaluated_depsgraph_get()
    if scene.camera is not None:
        if scene.camera.type == "CAMERA" and scene.camera.data.type == "PANO":
            scene.camera.data.type = "PERSP"
        return
    if not any(instance.object.type in SHAPES for instance in depsgraph.object_instances):
        _wear(scene, [m for m in bpy.data.materials if not m.grease_pencil][:MOST_WORN])
    if not any(obj.type == "LIGHT" for obj in scene.objects):
        _light(scene)
    scene.camera = _camera(scene)


def _wear(scene, materials: list) -> None:
    """A wall of balls, one for each material."""
    columns = max(math.ceil(math.sqrt(len(materials) * 16 / 9)), 1)
    for place, material in enumerate(materials):
        row, column = divmod(place, columns)
        bpy.ops.mesh.primitive_uv_sphere_add(radius=1.0, location=(SPACING * column, 0.0, -SPACING * row))
        ball: Any = bpy.context.object
        bpy.ops.object.shade_smooth()
        ball.data.materials.append(material)


def _light(scene) -> None:
    light: Any = bpy.data.lights.new("Stage", "SUN")
    light.energy, light.angle = SUN_STRENGTH, 0.1
    sun = bpy.data.objects.new("Stage", light)
    sun.rotation_euler = (0.7, 0.2, 0.5)
    scene.collection.objects.link(sun)
    if scene.world is None:
        scene.world = bpy.data.worlds.new("Stage")
        scene.world.color = (0.3, 0.3, 0.3)


def _camera(scene):
    """A camera that sees everything."""
    depsgraph: Any = bpy.context.evaluated_depsgraph_get()
    corners = [
        instance.matrix_world @ Vector(corner)
        for instance in depsgraph.object_instances
        if instance.object.type in SHAPES
        for corner in instance.object.bound_box
    ]
    lens = bpy.data.cameras.new("Stage")
    camera = bpy.data.objects.new("Stage", lens)
    scene.collection.objects.link(camera)
    camera.rotation_euler = TOWARD.to_track_quat("Z", "Y").to_euler()
    bpy.context.view_layer.update()
    flat = [value for corner in corners or [Vector()] for value in corner]
    place, _ = camera.camera_fit_coords(bpy.context.evaluated_depsgraph_get(), flat)
    camera.location = place
    middle = sum(corners, Vector()) / max(len(corners), 1)
    far = max(((place - corner).length for corner in corners), default=1.0)
    lens.clip_start, lens.clip_end = (place - middle).length * 1e-3, 4.0 * far
    return camera
