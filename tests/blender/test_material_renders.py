"""What materials do to light, in pictures of a sheet and what is behind it."""

import bpy
import numpy as np
import pytest

from rebound.passes import PASSES
from rebound.tests.support.blender_build import link, material, mesh
from rebound.tests.support.engine_build import picture, render

_LIT_PASSES = [(p.key, p.label, p.old_name) for p in PASSES if p.key.startswith(("diffuse", "transmission"))]


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


@pytest.mark.parametrize(
    ("turned", "camera", "shadow", "wanted"),
    [(True, False, False, 0.5), (True, True, False, 0.0), (True, True, True, 0.8), (False, True, True, 0.5)],
    ids=["both off", "seen through", "lit through", "from the front"],
)
def test_backs_of_faces_are_culled_as_the_material_says(sheet, tmp_path, turned, camera, shadow, wanted):
    sheet.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.5, 0.5, 0.5, 1.0)
    sheet.node_tree.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value = 0.0
    sheet.use_backface_culling, sheet.use_backface_culling_shadow = camera, shadow
    scene = bpy.context.scene
    bpy.data.objects["Sheet"].rotation_euler.x = np.pi if turned else 0.0
    scene.camera.location.z = 5
    found = picture(render(scene, tmp_path / "sheet.exr"))
    assert found[..., :3].mean() == pytest.approx(wanted, abs=0.02)  # of a sun of pi W/m2


def test_light_that_is_added_to_a_transparent_sheet_is_seen(sheet, tmp_path):
    tree, scene = sheet.node_tree, bpy.context.scene
    tree.nodes.clear()
    made = {kind: tree.nodes.new(f"ShaderNode{kind}") for kind in ("BsdfTransparent", "Emission", "AddShader")}
    made["Emission"].inputs["Strength"].default_value = 0.5
    tree.links.new(made["BsdfTransparent"].outputs[0], made["AddShader"].inputs[0])
    tree.links.new(made["Emission"].outputs[0], made["AddShader"].inputs[1])
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(made["AddShader"].outputs[0], output.inputs["Surface"])
    scene.camera.location.z, scene.rebound.samples = 5, 64
    bpy.data.objects["Sun"].hide_render = True
    found = picture(render(scene, tmp_path / "glow.exr"))
    assert found[..., :3].mean() == pytest.approx(0.5, abs=0.05)


def test_a_volume_without_a_surface_hides_nothing(sheet, tmp_path):
    tree, scene = sheet.node_tree, bpy.context.scene
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(tree.nodes.new("ShaderNodeVolumeAbsorption").outputs[0], output.inputs["Volume"])
    scene.camera.location.z = 5
    found = picture(render(scene, tmp_path / "fog.exr"))
    assert found[..., :3].mean() == pytest.approx(0.8, abs=0.02)


@pytest.mark.parametrize("kind", ["Transparent", "Refraction"])
def test_what_is_seen_through_glass_is_the_glasss_own(sheet, kind, tmp_path):
    tree, scene = sheet.node_tree, bpy.context.scene
    tree.nodes.clear()
    made, output = tree.nodes.new(f"ShaderNodeBsdf{kind}"), tree.nodes.new("ShaderNodeOutputMaterial")
    made.inputs["Color"].default_value = (0.5, 0.5, 0.25, 1.0)
    tree.links.new(made.outputs[0], output.inputs["Surface"])
    scene.camera.location.z = 5
    names = {key: label if bpy.app.version >= (5, 0) else old for key, label, old in _LIT_PASSES}
    for key in names:
        setattr(scene.view_layers[0], f"use_pass_{key}", True)
    found = render(scene, tmp_path / "glass.exr")

    def mean(key):
        return np.array([found[f"ViewLayer.{names[key]}.{c}"].mean() for c in "RGB"])

    tint = np.array([0.5, 0.5, 0.25])
    glass = kind == "Refraction"
    np.testing.assert_allclose(mean("diffuse_color"), 0.0 if glass else 0.8 * tint, atol=0.01)
    np.testing.assert_allclose(mean("transmission_color"), tint if glass else 0.0, atol=0.01)
    light = mean("transmission_color") * (mean("transmission_direct") + mean("transmission_indirect"))
    seen = picture(found)[..., :3].mean(axis=(0, 1))
    assert seen.min() > 0.05
    np.testing.assert_allclose(light + mean("diffuse_color") * mean("diffuse_direct"), seen, atol=0.01)
