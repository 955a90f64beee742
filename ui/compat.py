"""Which of Blender's own panels are shown with Rebound: those for any engine, and what is plain in EEVEE's.

Panels differ from version to version, so they are chosen by rule where a rule will do and by name where it will not;
a name that a version does not have is passed over.
"""

from __future__ import annotations

import bpy

from .. import ENGINE_ID

# Panels of every engine whose contents Rebound does not read.
EXCLUDED = frozenset({
    "DATA_PT_distance", "DATA_PT_light", "DATA_PT_lightprobe", "DATA_PT_lightprobe_display",
    "DATA_PT_lightprobe_parallax", "DATA_PT_lightprobe_visibility", "DATA_PT_falloff_curve",
    "DATA_PT_volume_render", "MATERIAL_PT_freestyle_line", "NODE_DATA_PT_light", "OBJECT_PT_shading",
    "RENDER_PT_freestyle", "RENDER_PT_stereoscopy", "RENDER_PT_output_views", "DATA_PT_camera_stereoscopy",
})  # fmt: skip
EXCLUDED_PREFIXES = ("VIEWLAYER_PT_freestyle",)

# Panels of EEVEE that show plain Blender data: material and world nodes, light power and size, the world's sun.
INCLUDED = frozenset({
    "DATA_PT_EEVEE_light", "NODE_DATA_PT_EEVEE_light", "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface", "EEVEE_WORLD_PT_surface", "EEVEE_WORLD_PT_settings", "EEVEE_WORLD_PT_sun",
    "MATERIAL_PT_preview", "VIEWLAYER_PT_layer_passes",
    "VIEWLAYER_PT_override",
})  # fmt: skip


def compatible_panels() -> list[type]:
    """Blender's panels that Rebound shows, whatever is registered at this moment."""
    return [p for p in _all_panels() if p.__name__ in INCLUDED or _is_for_any_engine(p)]


def _is_for_any_engine(panel: type) -> bool:
    name = panel.__name__
    if name in EXCLUDED or name.startswith(EXCLUDED_PREFIXES):
        return False
    return "BLENDER_RENDER" in panel.COMPAT_ENGINES


def _all_panels() -> list[type]:
    return [p for p in bpy.types.Panel.__subclasses__() if hasattr(p, "COMPAT_ENGINES")]


def register() -> None:
    for panel in compatible_panels():
        panel.COMPAT_ENGINES.add(ENGINE_ID)


def unregister() -> None:
    for panel in _all_panels():
        if not panel.__module__.startswith(__package__ or ""):
            panel.COMPAT_ENGINES.discard(ENGINE_ID)
