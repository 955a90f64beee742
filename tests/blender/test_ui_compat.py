"""Which of Blender's own panels are shown with Rebound, name by name: a new version's new panel is to be looked at."""

import bpy
import numpy as np
import pytest

from rebound.tests.support.blender_build import link
from rebound.tests.support.engine_build import picture, rebound_scene, render
from rebound.ui import compat, panels

__all__ = ["rebound_scene"]

# By tab of the Properties editor. What is in it is read, or Blender's own business (animation, custom properties).
SHOWN = {
    "data": """
        DATA_PT_CURVES_attributes DATA_PT_EEVEE_light DATA_PT_camera DATA_PT_camera_animation
        DATA_PT_camera_background_image DATA_PT_camera_display DATA_PT_camera_display_composition_guides
        DATA_PT_camera_safe_areas DATA_PT_camera_safe_areas_center_cut DATA_PT_cone DATA_PT_context_camera
        DATA_PT_context_curves DATA_PT_context_light DATA_PT_context_lightprobe DATA_PT_context_mesh
        DATA_PT_context_pointcloud DATA_PT_context_speaker DATA_PT_context_volume DATA_PT_curves_animation
        DATA_PT_curves_surface DATA_PT_custom_props_camera DATA_PT_custom_props_curves DATA_PT_custom_props_light
        DATA_PT_custom_props_mesh DATA_PT_custom_props_pointcloud DATA_PT_custom_props_speaker
        DATA_PT_custom_props_volume DATA_PT_customdata DATA_PT_lens DATA_PT_light_animation DATA_PT_mesh_animation
        DATA_PT_mesh_attributes DATA_PT_pointcloud_attributes DATA_PT_preview DATA_PT_remesh DATA_PT_shape_keys
        DATA_PT_speaker DATA_PT_speaker_animation DATA_PT_spot DATA_PT_texture_space DATA_PT_uv_texture
        DATA_PT_vertex_colors DATA_PT_vertex_groups DATA_PT_volume_animation DATA_PT_volume_file
        DATA_PT_volume_grids DATA_PT_volume_viewport_display DATA_PT_volume_viewport_display_slicing
    """,
    "material": """
        EEVEE_MATERIAL_PT_context_material EEVEE_MATERIAL_PT_surface EEVEE_MATERIAL_PT_viewport_settings
        MATERIAL_PT_animation MATERIAL_PT_custom_props MATERIAL_PT_preview
    """,
    "object": """
        OBJECT_PT_custom_props OBJECT_PT_visibility
    """,
    "output": """
        RENDER_PT_encoding RENDER_PT_encoding_audio RENDER_PT_encoding_video RENDER_PT_format RENDER_PT_frame_range
        RENDER_PT_output RENDER_PT_output_color_management RENDER_PT_output_pixel_density RENDER_PT_post_processing
        RENDER_PT_stamp RENDER_PT_stamp_burn RENDER_PT_stamp_note RENDER_PT_time_stretching
    """,
    "render": """
        RENDER_PT_color_management RENDER_PT_color_management_curves RENDER_PT_color_management_white_balance
        RENDER_PT_gpencil RENDER_PT_grease_pencil_render RENDER_PT_grease_pencil_viewport RENDER_PT_simplify
        RENDER_PT_simplify_greasepencil RENDER_PT_simplify_render RENDER_PT_simplify_viewport
    """,
    "view_layer": """
        VIEWLAYER_PT_layer VIEWLAYER_PT_layer_passes
    """,
    "world": """
        EEVEE_WORLD_PT_settings EEVEE_WORLD_PT_sun EEVEE_WORLD_PT_surface WORLD_PT_animation WORLD_PT_context_world
        WORLD_PT_custom_props
    """,
}
ONLY = {
    (4, 5): {"RENDER_PT_color_management_display_settings"},
    (5, 0): {
        "RENDER_PT_color_management_advanced", "RENDER_PT_color_management_working_space",
        "VIEWLAYER_PT_context_layer", "VIEWLAYER_PT_override",
    },
}  # fmt: skip
ONLY[5, 1] = ONLY[5, 2] = ONLY[5, 0]
# Simulation and painting: all of them, whatever they are. And those of editors beside the Properties editor.
WHOLE = ("PARTICLE_PT_", "PHYSICS_PT_", "TEXTURE_PT_", "CAMERA_PT_", "NODE_", "SEQUENCER_PT_", "STRIP_PT_")
# What an artist would take for working, and is not read.
UNREAD = """
    DATA_PT_camera_dof DATA_PT_camera_dof_aperture CYCLES_CAMERA_PT_dof DATA_PT_camera_stereoscopy DATA_PT_lightprobe
    DATA_PT_EEVEE_light_shadow DATA_PT_EEVEE_light_distance EEVEE_MATERIAL_PT_volume EEVEE_MATERIAL_PT_displacement
    EEVEE_MATERIAL_PT_thickness EEVEE_MATERIAL_PT_settings EEVEE_WORLD_PT_volume EEVEE_WORLD_PT_mist
    EEVEE_WORLD_PT_lightprobe
    RENDER_PT_eevee_raytracing RENDER_PT_eevee_next_raytracing RENDER_PT_eevee_motion_blur RENDER_PT_freestyle
    RENDER_PT_eevee_next_motion_blur RENDER_PT_eevee_film RENDER_PT_eevee_next_film RENDER_PT_eevee_depth_of_field
    RENDER_PT_stereoscopy RENDER_PT_output_views VIEWLAYER_PT_filter VIEWLAYER_PT_layer_passes_cryptomatte
    VIEWLAYER_PT_layer_passes_aov VIEWLAYER_PT_layer_passes_lightgroups OBJECT_PT_shading OBJECT_PT_shadow_terminator
"""


def shown_now():
    """Blender's panels that have Rebound on their list, by name."""
    own = {panel.__name__ for panel in panels.PANELS}
    return {p.__name__ for p in compat._all_panels() if "REBOUND" in p.COMPAT_ENGINES} - own


def test_shown_panels_are_those_of_the_list(rebound_scene):
    wanted = {name for names in SHOWN.values() for name in names.split()} | ONLY[bpy.app.version[:2]]
    found = {name for name in shown_now() if not name.startswith(WHOLE)}
    assert found - wanted == set(), "new: read what they show, or add them to EXCLUDED"
    assert wanted - found == set(), "gone: no longer in Blender, or no longer shown"


@pytest.mark.parametrize("tab", SHOWN)
def test_panels_stand_in_the_tab_that_the_list_says(rebound_scene, tab):
    for name in SHOWN[tab].split():
        assert getattr(bpy.types, name).bl_context == tab, name


def test_panels_of_what_is_not_read_are_not_shown(rebound_scene):
    assert not shown_now() & set(UNREAD.split())
    # Typing mistakes would pass: each name is one of some version's.
    lacking = {name for name in UNREAD.split() if not hasattr(bpy.types, name)}
    assert all("eevee" in name for name in lacking)


def test_parents_of_shown_panels_are_shown(rebound_scene):
    """Blender draws no child of a panel that it does not draw."""
    shown = shown_now()
    for name in filter(lambda name: hasattr(bpy.types, name), shown):
        parent = getattr(getattr(bpy.types, name), "bl_parent_id", "")
        engines = getattr(getattr(bpy.types, parent, None), "COMPAT_ENGINES", {"REBOUND"})
        assert not parent or "REBOUND" in engines, name


def test_every_name_in_the_panel_lists_exists_in_some_version(rebound_scene):
    """A name is passed over where a version lacks it, so a typing mistake would never show."""
    lacking = [name for name in compat.INCLUDED | compat.EXCLUDED if not hasattr(bpy.types, name)]
    newer_or_older = {"VIEWLAYER_PT_override", "DATA_PT_falloff_curve"}
    assert set(lacking) <= newer_or_older


def test_overrides_have_one_panel_in_every_version(rebound_scene):
    context = type("Context", (), {"engine": "REBOUND"})
    ours = panels.REBOUND_PT_override.poll(context)
    assert ours != ("VIEWLAYER_PT_override" in shown_now())


def test_unregister_hides_blenders_panels_again(rebound_scene):
    compat.unregister()
    assert not shown_now()
    compat.register()


def test_grease_pencil_is_drawn_over_the_picture(rebound_scene, tmp_path):
    """By Blender, which is why its panels are shown and nothing warns of strokes."""
    plain = picture(render(rebound_scene, tmp_path / "plain.exr"))
    strokes = getattr(bpy.data, "grease_pencils_v3", bpy.data.grease_pencils).new("Strokes")
    drawing = strokes.layers.new("Lines").frames.new(1).drawing
    drawing.add_strokes([2])
    for point, x in zip(drawing.strokes[0].points, (-2, 2), strict=True):
        point.position, point.radius, point.opacity = (x, -1, 1), 0.3, 1.0
    ink = bpy.data.materials.new("Ink")
    bpy.data.materials.create_gpencil_data(ink)
    ink.grease_pencil.color = (0, 1, 0, 1)
    strokes.materials.append(ink)
    link("Strokes", strokes)
    drawn = picture(render(rebound_scene, tmp_path / "drawn.exr"))
    green = (drawn[..., 1] > 0.2) & (drawn[..., 0] < 0.05)
    assert green.sum() > 100 and np.abs(drawn - plain)[~green].mean() < 0.02
