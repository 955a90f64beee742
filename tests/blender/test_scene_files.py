"""Every shared scene file converts on every Blender, quickly, and the same way twice."""

import logging
import time
from pathlib import Path

import bpy
import numpy as np
import pytest

from rebound.scene.changes import Changes
from rebound.tests.support.blender_build import convert

pytestmark = pytest.mark.usefixtures("clean_scene")

LOG = logging.getLogger(__name__)  # shown by --log-cli-level=INFO
SECONDS = 15.0  # the largest takes 2.5 on one core; the rest is for a busy machine

# The folders are listed here so that a missing file is a skip with its name.
FILES = [
    "anim_gltf/RobotExpressive",
    "basic/cornell_spot",
    "basic/divider",
    "basic/emissive_sky",
    "basic/glossy_metals",
    "basic/many_lights",
    "basic/offscreen_bounce",
    "basic/sunlit_room",
    "classroom/classroom",
    "cornell_box/cornell_box",
    "gi_hall_13_areas/gi_hall_13_areas",
    "instancing/armory_instancing",
    "instancing/armory_particle_hair",
    "instancing/io_01_multiple_collection_instances",
    "instancing/io_22_simple_GN",
    "instancing/io_32_gpu_instancing_with_instancing",
    "instancing/io_gn_nested_instances",
    "kitchen/kitchen",
    "living_room/living_room",
    "material_batch/material_batch",
    "nodes/io_19_sheen",
    "nodes/io_20_specular",
    "nodes/io_22_node_groups",
    "nodes/io_24_vertex_colors",
    "nodes/sample_materials",
    "nodes/templates",
    "race_track/race_track",
    "spot_point_lights/lights",
    "wooden_staircase/wooden_staircase",
]


@pytest.mark.parametrize("name", FILES)
def test_shared_scene_converts(name, shared_dir):
    path = Path(shared_dir) / "scenes" / f"{name}.blend"
    if not path.is_file():
        pytest.skip(f"no {path}")
    bpy.ops.wm.open_mainfile(filepath=str(path))
    bpy.context.evaluated_depsgraph_get()  # Blender's own work is not ours to time
    start = time.perf_counter()
    scene = convert()
    seconds = time.perf_counter() - start
    triangles = sum(scene.meshes[instance.mesh].triangle_count for instance in scene.instances)
    LOG.info("%s: %d triangles in %d instances, %.2f s", name, triangles, len(scene.instances), seconds)
    assert seconds < SECONDS
    for mesh in scene.meshes.values():
        assert np.isfinite(mesh.positions).all() and np.isfinite(mesh.normals).all()
    assert all(np.isfinite(image.pixels).all() for image in scene.images.values())
    assert len({instance.key for instance in scene.instances}) == len(scene.instances)
    again = convert(previous=scene)
    assert not Changes.between(scene, again).any
    assert again.warnings == scene.warnings
