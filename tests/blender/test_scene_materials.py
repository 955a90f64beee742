"""The common shaders are read exactly; what is not read gives one line and something visible."""

import bpy
import numpy as np
import pytest

from rebound.scene.data import Material
from rebound.tests.support.blender_build import convert, link, material, mesh, scatter_nodes, shader_material

pytestmark = pytest.mark.usefixtures("clean_scene")


def read(made):
    """The Material and the warnings of a bpy material on a quad."""
    data = mesh()
    data.materials.append(made)
    link("Quad", data)
    scene = convert()
    return scene.materials[scene.instances[0].materials[0]], scene.warnings


def rgb(*values):
    return pytest.approx(values, abs=1e-6)


def group_of(tree, *nodes_type):
    """An empty node group, placed in a tree; returns (group tree, its node in the tree)."""
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    return group, node


def test_principled_base_color_and_emission():
    made = material("Paint", (0.1, 0.2, 0.3))
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Emission Color"].default_value = (1, 0.5, 0.25, 1)
    shader.inputs["Emission Strength"].default_value = 4
    found, warnings = read(made)
    assert found.name == "Paint" and warnings == ()
    assert found.base_color == rgb(0.1, 0.2, 0.3) and found.emission == rgb(4, 2, 1)


def test_principled_does_not_emit_by_default():
    assert read(material("Plain"))[0].emission == (0, 0, 0)


def test_diffuse_and_emission_shaders():
    made, _ = shader_material("Diffuse", "ShaderNodeBsdfDiffuse", Color=(0.3, 0.2, 0.1, 1))
    assert read(made)[0] == Material(
        "Diffuse", base_color=made.node_tree.nodes["Diffuse BSDF"].inputs[0].default_value[:3]
    )
    made, _ = shader_material("Lamp", "ShaderNodeEmission", Color=(1, 0.5, 0, 1), Strength=3.0)
    found = convert_second(made)
    assert found.base_color == (0, 0, 0) and found.emission == rgb(3, 1.5, 0)


def convert_second(made):
    bpy.data.objects["Quad"].data.materials[0] = made
    scene = convert()
    return scene.materials[scene.instances[0].materials[0]]


def test_material_without_a_surface_is_black():
    made = material("Nothing")
    made.node_tree.links.clear()
    assert read(made)[0].base_color == (0, 0, 0)


@pytest.mark.skipif(bpy.app.version >= (5, 0, 0), reason="Blender 5.0 and later always use the nodes")
def test_material_without_nodes_shows_its_viewport_color():
    made = bpy.data.materials.new("Old")
    made.diffuse_color = (0.25, 0.5, 0.75, 1)
    assert read(made)[0].base_color == rgb(0.25, 0.5, 0.75)


@pytest.mark.parametrize("factor", [0.0, 0.25, 1.0])
def test_mix_shader_is_a_weighted_average(factor):
    made, mix = shader_material("Mixed", "ShaderNodeMixShader", Fac=factor)
    tree = made.node_tree
    diffuse, emission = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeEmission")
    diffuse.inputs["Color"].default_value = (0.8, 0.4, 0.2, 1)
    emission.inputs["Strength"].default_value = 2
    emission.inputs["Color"].default_value = (1, 1, 1, 1)
    tree.links.new(diffuse.outputs[0], mix.inputs[1])
    tree.links.new(emission.outputs[0], mix.inputs[2])
    found, warnings = read(made)
    assert found.base_color == rgb(*((1 - factor) * c for c in (0.8, 0.4, 0.2)))
    assert found.emission == rgb(*(2 * factor,) * 3) and warnings == ()


def test_add_shader_sums():
    made, add = shader_material("Sum", "ShaderNodeAddShader")
    tree = made.node_tree
    for slot, color in enumerate([(0.3, 0.1, 0, 1), (0.2, 0.2, 0, 1)]):
        node = tree.nodes.new("ShaderNodeBsdfDiffuse")
        node.inputs["Color"].default_value = color
        tree.links.new(node.outputs[0], add.inputs[slot])
    assert read(made)[0].base_color == rgb(0.5, 0.3, 0)


def test_constants_come_through_reroutes_and_value_nodes():
    made, shader = shader_material("Routed", "ShaderNodeEmission")
    tree = made.node_tree
    color, reroute, value = (tree.nodes.new(t) for t in ("ShaderNodeRGB", "NodeReroute", "ShaderNodeValue"))
    color.outputs[0].default_value = (0.5, 0.25, 0.125, 1)
    value.outputs[0].default_value = 8
    tree.links.new(color.outputs[0], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], shader.inputs["Color"])
    tree.links.new(value.outputs[0], shader.inputs["Strength"])
    found, warnings = read(made)
    assert found.emission == rgb(4, 2, 1) and warnings == ()


def test_shader_and_constant_in_a_group_are_followed():
    made = material("Grouped")
    tree = made.node_tree
    output = tree.nodes["Material Output"]
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    group, node = group_of(tree)
    group.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    inside, diffuse, outside = (
        group.nodes.new(t) for t in ("NodeGroupInput", "ShaderNodeBsdfDiffuse", "NodeGroupOutput")
    )
    group.links.new(inside.outputs["Tint"], diffuse.inputs["Color"])
    group.links.new(diffuse.outputs[0], outside.inputs["Shader"])
    node.inputs["Tint"].default_value = (0.1, 0.6, 0.2, 1)
    tree.links.new(node.outputs["Shader"], output.inputs["Surface"])
    found, warnings = read(made)
    assert found.base_color == rgb(0.1, 0.6, 0.2) and warnings == ()


def test_muted_node_is_passed_by():
    made = material("Muted", (0.2, 0.2, 0.2))
    tree = made.node_tree
    gamma, color = tree.nodes.new("ShaderNodeGamma"), tree.nodes.new("ShaderNodeRGB")
    color.outputs[0].default_value = (0.7, 0.1, 0.1, 1)
    tree.links.new(color.outputs[0], gamma.inputs["Color"])
    tree.links.new(gamma.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    gamma.mute = True
    found, warnings = read(made)
    assert found.base_color == rgb(0.7, 0.1, 0.1) and warnings == ()


def test_what_a_node_makes_is_drawn_by_the_graph():
    """The constants are a guess then: for what is not drawn, and never nothing where there may be something."""
    made = material("Checked", (0.2, 0.3, 0.4))
    tree = made.node_tree
    checker, shader = tree.nodes.new("ShaderNodeTexChecker"), tree.nodes["Principled BSDF"]
    shader.inputs["Emission Strength"].default_value = 2
    tree.links.new(checker.outputs[0], shader.inputs["Base Color"])
    tree.links.new(checker.outputs["Fac"], shader.inputs["Emission Color"])
    tree.links.new(checker.outputs["Fac"], shader.inputs["Metallic"])
    found, warnings = read(made)
    assert found.graph is not None and found.base_color == rgb(0.5, 0.5, 0.5) and warnings == ()
    assert found.emission == rgb(1, 1, 1) and 0 < found.metallic < 1 and found.passing == 0


def test_what_is_the_same_all_over_needs_no_graph():
    assert read(material("Plain"))[0].graph is None


def test_glossy_shader_reflects_its_colour_on_average():
    made, _ = shader_material("Mirror", "ShaderNodeBsdfAnisotropic", Color=(0.9, 0.8, 0.1, 1), Roughness=0.2)
    found, warnings = read(made)
    mean = [f0 + (1 - f0) / 21 for f0 in found.base_color]  # of Schlick's term over all directions
    assert mean == rgb(0.9, 0.8, 0.1) and found.metallic == 1
    assert found.roughness == pytest.approx(0.2) and warnings == ()


@pytest.mark.skipif(bpy.app.version < (5, 0, 0), reason="Blender 4.5 has another node of that name or none")
def test_metallic_shader_reflects_what_its_complex_ior_says():
    made, node = shader_material("Silver", "ShaderNodeBsdfMetallic", Roughness=0.1)
    node.fresnel_type = "PHYSICAL_CONDUCTOR"
    node.inputs["IOR"].default_value = (0.2, 1.0, 2.0)
    node.inputs["Extinction"].default_value = (3.0, 2.0, 0.0)
    found, warnings = read(made)
    assert found.base_color == rgb(9.64 / 10.44, 4 / 8, 1 / 9) and found.metallic == 1 and warnings == ()


def test_principled_reads_its_lobe():
    made = material("Shiny", (0.1, 0.2, 0.3))
    inputs = made.node_tree.nodes["Principled BSDF"].inputs
    for name, value in (("Metallic", 0.25), ("Roughness", 0.125), ("IOR", 2.0), ("Specular IOR Level", 0.25)):
        inputs[name].default_value = value
    inputs["Specular Tint"].default_value = (1, 0.5, 0, 1)
    found, warnings = read(made)
    assert (found.metallic, found.roughness, found.layered) == (0.25, 0.125, 1.0) and warnings == ()
    assert found.specular == rgb(1 / 18, 1 / 36, 0)  # ((2 - 1) / (2 + 1))^2 times twice the level


def test_roughness_image_is_known_by_its_mean():
    made = material("Worn")
    image = bpy.data.images.new("Rough", 2, 1, float_buffer=True, is_data=True)
    image.pixels = (0.2, 0.2, 0.2, 1, 0.6, 0.6, 0.6, 1)
    tree = made.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Roughness"])
    found, warnings = read(made)
    assert found.graph is not None and found.roughness == pytest.approx(0.4) and warnings == ()


def test_mix_of_diffuse_and_metal_keeps_the_level_of_both():
    made, mix = shader_material("Mixed", "ShaderNodeMixShader", Fac=0.25)
    tree = made.node_tree
    diffuse, metal = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeBsdfPrincipled")
    diffuse.inputs["Color"].default_value = (0.8, 0.4, 0.2, 1)
    metal.inputs["Base Color"].default_value = (0.4, 0.8, 0.8, 1)
    metal.inputs["Metallic"].default_value, metal.inputs["Roughness"].default_value = 1, 0.1
    tree.links.new(diffuse.outputs[0], mix.inputs[1])
    tree.links.new(metal.outputs[0], mix.inputs[2])
    found, warnings = read(made)
    assert found.base_color == rgb(0.6, 0.3, 0.15) and found.specular == rgb(0.1, 0.2, 0.2)
    assert (found.metallic, found.layered) == (0, 0) and found.roughness == pytest.approx(0.1) and warnings == ()
    assert found.graph is not None  # one lobe cannot stand for two


def test_unknown_shader_is_diffuse_with_one_line():
    made, shader = shader_material("Hairy", "ShaderNodeBsdfHairPrincipled")
    found, warnings = read(made)
    assert found.base_color == rgb(*shader.inputs["Color"].default_value[:3])
    assert warnings == (f"Material 'Hairy': node '{shader.name}' is not supported, it is shown as diffuse",)


@pytest.mark.parametrize(
    ("socket", "line"),
    [
        ("Transmission Weight", "what is refracted passes straight on"),
        ("Sheen Weight", "sheen is shown as diffuse, without its rim"),
        ("Coat Weight", "a coat and what it covers share one lobe"),
    ],
)
def test_approximations_are_counted_in_one_line(socket, line):
    for number in range(2):
        made = material(f"Linked {number}")
        made.node_tree.nodes["Principled BSDF"].inputs[socket].default_value = 0.5
        _, warnings = read(made)
    assert warnings == (f"2 materials ('Linked 0', 'Linked 1'): {line}",)


@pytest.mark.parametrize(
    ("kind", "settings", "line"),
    [
        ("ShaderNodeBsdfTranslucent", {}, "translucent light is shown as diffuse"),
        ("ShaderNodeBsdfAnisotropic", {"distribution": "BECKMANN"}, "highlights have GGX's tails"),
        ("ShaderNodeBsdfAnisotropic", {"distribution": "GGX"}, None),
    ],
)
def test_shaders_that_are_approximated_say_so(kind, settings, line):
    made, node = shader_material("Approximated", kind)
    for name, value in settings.items():
        setattr(node, name, value)
    _, warnings = read(made)
    assert len(warnings) == (1 if line else 0) and all(line in found for found in warnings)


def test_an_output_that_is_approximated_says_so():
    made, node = shader_material("Worn", "ShaderNodeBsdfDiffuse")
    geometry = made.node_tree.nodes.new("ShaderNodeNewGeometry")
    made.node_tree.links.new(geometry.outputs["Pointiness"], node.inputs["Color"])
    assert read(made)[1] == ("1 material ('Worn'): pointiness is that of a flat place",)


def test_alpha_lets_light_pass():
    made = material("Leaf")
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Alpha"].default_value = 0.25
    found, warnings = read(made)
    assert found.passing == pytest.approx(0.75) and found.graph is not None and warnings == ()


def test_transparent_shader_lets_its_colour_pass():
    made, _ = shader_material("Pane", "ShaderNodeBsdfTransparent", Color=(0.25, 0.5, 0.75, 1))
    assert read(made)[0].passing == pytest.approx(0.5)


def test_displacement_is_a_bump_and_said_so():
    made, _ = shader_material("Rough", "ShaderNodeBsdfDiffuse")
    tree = made.node_tree
    noise, displacement = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeDisplacement")
    output = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    tree.links.new(noise.outputs[0], displacement.inputs["Height"])
    tree.links.new(displacement.outputs[0], output.inputs["Displacement"])
    made.displacement_method = "DISPLACEMENT"
    found, warnings = read(made)
    assert [node.kind for node in found.graph.graph.nodes][-2:] == ["ShaderNodeBump", "ShaderNodeBsdfDiffuse"]
    assert warnings == ("1 material ('Rough'): displacement is shown as a bump",)


def test_value_that_is_not_finite_is_zero():
    made, shader = shader_material("Broken", "ShaderNodeEmission")
    value = made.node_tree.nodes.new("ShaderNodeValue")
    value.outputs[0].default_value = float("nan")
    made.node_tree.links.new(value.outputs[0], shader.inputs["Strength"])
    assert read(made)[0].emission == (0, 0, 0)


def test_infinite_emission_is_cut():
    """Blender stores 3.4e38 for it, of which any product is infinite in single precision."""
    made, shader = shader_material("Nova", "ShaderNodeEmission", Color=(1, 1, 1, 1), Strength=float("inf"))
    assert np.isfinite(np.float32(read(made)[0].emission)).all()


def test_shared_material_is_read_once():
    made = material("Shared")
    read(made)
    read(made)
    assert [found.name for found in convert().materials] == ["Default", "Shared"]


def test_output_for_all_renderers_is_preferred():
    made = material("Two outputs", (0.5, 0, 0))
    tree = made.node_tree
    special, emission = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeEmission")
    special.target = "CYCLES"
    tree.links.new(emission.outputs[0], special.inputs["Surface"])
    assert read(made)[0].base_color == rgb(0.5, 0, 0)


def test_material_set_by_geometry_nodes_is_worn_by_the_instances():
    tree = scatter_nodes(link("Host", mesh()))
    cube, scatter = (next(n for n in tree.nodes if n.bl_idname.endswith(end)) for end in ("MeshCube", "OnPoints"))
    setter = tree.nodes.new("GeometryNodeSetMaterial")
    setter.inputs["Material"].default_value = material("Set", (0.1, 0.2, 0.3))
    tree.links.new(cube.outputs[0], setter.inputs[0])
    tree.links.new(setter.outputs[0], scatter.inputs["Instance"])
    scene = convert()
    worn = {
        scene.materials[instance.materials[slot]].name
        for instance in scene.instances
        for slot, _, _ in scene.meshes[instance.mesh].slots
    }
    assert len(scene.instances) == 4 and worn == {"Set"}


# World


def world(strength=1.0, color=(0.1, 0.2, 0.3)):
    made = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0, 0):
        made.use_nodes = True
    background = made.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*color, 1)
    background.inputs["Strength"].default_value = strength
    return made


def test_world_color_times_strength():
    world(strength=3)
    scene = convert()
    assert scene.world.color == rgb(0.3, 0.6, 0.9) and scene.warnings == ()


def test_black_world_has_no_line():
    world(strength=0)
    assert convert().warnings == ()


def test_no_world_is_black():
    bpy.context.scene.world = None
    assert convert().world.color == (0, 0, 0)


def test_film_settings_are_read():
    render = bpy.context.scene.render
    render.film_transparent, render.filter_size = True, 2.25
    scene = convert()
    assert scene.film_transparent is True and scene.filter_width == pytest.approx(2.25)
