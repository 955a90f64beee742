"""Images on a quadrilateral, and what is read of them."""

from __future__ import annotations

import bpy
import numpy as np

from .blender_build import link, material, mesh

RAMP = np.array([[[0, 0.2, 0.4, 1], [0.6, 0.8, 1, 0.4]], [[1, 0, 0, 1], [0, 1, 0, 1]]])


def textured(image, socket="Base Color"):
    """A quad with an image on it; returns the Image Texture node."""
    made = material("Painted", (0.2, 0.3, 0.4))
    tree = made.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs["Color"], tree.nodes["Principled BSDF"].inputs[socket])
    data = mesh()
    data.uv_layers.new(name="UVMap")
    data.materials.append(made)
    link("Quad", data)
    return node


def painted(name="Image", float_buffer=False, size=(2, 2), pixels=None, space=None):
    image = bpy.data.images.new(name, *size, alpha=True, float_buffer=float_buffer)
    if space:
        image.colorspace_settings.name = space
    if pixels is not None:
        image.pixels.foreach_set(np.asarray(pixels, np.float32).ravel())
        image.update()
    return image


def material_of(scene):
    return scene.materials[scene.instances[0].materials[0]]


def pixels_of(scene):
    """Scene-linear pixels of the one image there is."""
    found = image_of(scene).linear()
    assert found.dtype == np.float32 and found.shape[2] == 4
    return found


def image_of(scene):
    return scene.images[material_of(scene).base_color_texture.image]
