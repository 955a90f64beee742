"""Every shared scene renders: small, few samples, on every Blender and backend the suite runs on."""

import bpy
import numpy as np
import pytest

from rebound.tests.support.engine_build import picture, render

BASIC = ["cornell_spot", "divider", "emissive_sky", "glossy_metals", "many_lights", "offscreen_bounce", "sunlit_room"]
REAL = ["classroom", "cornell_box", "kitchen", "living_room", "wooden_staircase"]


@pytest.mark.parametrize("path", [*(f"basic/{name}" for name in BASIC), *(f"{name}/{name}" for name in REAL)])
def test_shared_scene_renders(registered, shared_dir, tmp_path, path, caplog):
    bpy.ops.wm.open_mainfile(filepath=str(shared_dir / "scenes" / f"{path}.blend"))
    scene = bpy.context.scene
    scene.render.engine = "REBOUND"
    scene.render.use_compositing = scene.render.use_sequencer = False
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 160, 90, 100
    scene.rebound.samples = 1
    scene.rebound.shadow_resolution = 512
    if not path.startswith("basic/"):  # the others show that many bounces work, and they are slow in software
        scene.rebound.vpl_bounces = "ONE"
    image = picture(render(scene, tmp_path / "scene.exr"), scene.view_layers[0].name)
    assert image.shape == (90, 160, 4)
    assert np.isfinite(image).all()
    assert not [record for record in caplog.records if record.levelname == "ERROR"]
    assert (image[..., :3].max(-1) > 0).mean() > 0.1, "the picture is dark"
