"""What materials do to light, in pictures of a sheet and what is behind it."""

import bpy
import numpy as np
import pytest

from rebound.tests.support.blender_build import link, material, mesh
from rebound.tests.support.engine_build import picture, render


@pytest.fixture
def sheet(registered):
    """The material of a sheet that lies between a sun and a floor; the camera sees the floor alone."""
    scene = registered
    scene.render.engine = "REBOUND"
    scene.render.resolution_x = scene.render.resolution_y = 32
    scene.rebound.samples, scene.rebound.shadow_resolution, scene.rebound.method = 8, 256, "RSM"
    link("Floor", mesh("Floor"), scale=(4, 4, 4))
    above = link("Sheet", mesh("Sheet"), scale=(4, 4, 4), location=(0, 0, 3))
    above.data.materials.append(material("Sheet", (0, 0, 0)))
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = np.pi, 0.0
    link("Sun", sun)
    scene.camera = link("Camera", bpy.data.cameras.new("Camera"), location=(0, 0, 2))
    return above.data.materials[0]


@pytest.mark.parametrize(("passes", "wanted"), [(True, 0.75), (False, 0.0)])
def test_transparent_shadows_are_the_materials_choice(sheet, tmp_path, passes, wanted):
    sheet.node_tree.nodes["Principled BSDF"].inputs["Alpha"].default_value = 0.25
    sheet.use_transparent_shadow = passes
    found = picture(render(bpy.context.scene, tmp_path / "sheet.exr"))
    assert found[..., :3].mean() == pytest.approx(0.8 * wanted, abs=0.02)  # the floor's colour, of a sun of pi W/m2
