"""Rebound's own panels in the Properties editor."""

from __future__ import annotations

import bpy

from .. import ENGINE_ID
from ..gpu_shaders import TECHNIQUES
from ..gpu_shaders.technique import Setting
from ..passes import PASSES
from ..session import SESSIONS
from ..settings import named_settings

SAMPLING = ("samples", "seed")
SHADOWS = ("shadow_resolution", "soft_shadows")
DEBUG = ("show",)


class ReboundPanel:
    """Mixin: a panel of the Properties editor that is shown with Rebound only."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE_ID}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES


def _draw_settings(layout, group, settings: list[tuple[str, Setting]]) -> None:
    """One row for each setting, and a "Viewport" row under those that have a value of their own there."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    for name, setting in settings:
        column = layout.column(align=True)
        column.prop(group, name)
        if setting.viewport_default is not None:
            column.prop(group, f"viewport_{name}", text="Viewport")


def _named(names: tuple[str, ...]) -> list[tuple[str, Setting]]:
    return [(name, setting) for name, setting in named_settings() if name in names]


class REBOUND_PT_sampling(ReboundPanel, bpy.types.Panel):
    bl_label = "Sampling"

    def draw(self, context):
        _draw_settings(self.layout, context.scene.rebound, _named(SAMPLING))


class REBOUND_PT_indirect(ReboundPanel, bpy.types.Panel):
    bl_label = "Indirect Light"

    def draw(self, context):
        group = context.scene.rebound
        _draw_settings(self.layout, group, _named(("method",)))
        for technique in TECHNIQUES:
            if technique.id.upper() == group.method:
                _draw_settings(self.layout, group, [(f"{technique.id}_{s.name}", s) for s in technique.settings])


class REBOUND_PT_shadows(ReboundPanel, bpy.types.Panel):
    bl_label = "Shadows"

    def draw(self, context):
        _draw_settings(self.layout, context.scene.rebound, _named(SHADOWS))


class REBOUND_PT_film(ReboundPanel, bpy.types.Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.scene.render, "filter_size")
        layout.prop(context.scene.render, "film_transparent", text="Transparent")


class REBOUND_PT_status(ReboundPanel, bpy.types.Panel):
    """What the newest picture was made with, and what could not be shown in it."""

    bl_label = "Status"

    def draw(self, context):
        layout, status = self.layout, SESSIONS.newest
        layout.label(text=status.device or "Nothing was rendered yet")
        if status.error:
            layout.label(text=status.error, icon="ERROR")
        for line in status.warnings:
            layout.label(text=line, icon="INFO")
        column = layout.column(align=True)
        column.scale_y = 0.8
        for name, value in status.statistics.items():
            column.label(text=f"{name.replace('_', ' ').capitalize()}: {value:,.0f}")


class REBOUND_PT_debug(ReboundPanel, bpy.types.Panel):
    bl_label = "Debug"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        _draw_settings(self.layout, context.scene.rebound, _named(DEBUG))
        self.layout.operator("rebound.save_rsm_buffers")


class REBOUND_PT_light_shadow(ReboundPanel, bpy.types.Panel):
    bl_label = "Influence"
    bl_context = "data"
    bl_parent_id = "DATA_PT_EEVEE_light"

    @classmethod
    def poll(cls, context):
        return context.light is not None and super().poll(context)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.light, "use_shadow", text="Casts Shadow")
        layout.prop(context.light, "diffuse_factor", text="Diffuse")
        layout.prop(context.light, "specular_factor", text="Specular")


class REBOUND_PT_object_visibility(ReboundPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_context = "object"
    bl_parent_id = "OBJECT_PT_visibility"

    @classmethod
    def poll(cls, context):
        kinds = {"MESH", "CURVE", "SURFACE", "META", "FONT"}
        return context.object is not None and context.object.type in kinds and super().poll(context)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.object, "visible_camera", text="Camera")
        layout.prop(context.object, "visible_diffuse", text="Bounce")
        layout.prop(context.object, "visible_shadow", text="Shadow")


class REBOUND_PT_passes(ReboundPanel, bpy.types.Panel):
    """The passes that Rebound fills, and no other."""

    bl_label = "Include"
    bl_context = "view_layer"
    bl_parent_id = "VIEWLAYER_PT_layer_passes"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(align=True)
        for p in PASSES:
            column.prop(context.view_layer, p.view_layer_property, text=p.label)


CLASSES = (
    REBOUND_PT_sampling,
    REBOUND_PT_indirect,
    REBOUND_PT_shadows,
    REBOUND_PT_film,
    REBOUND_PT_status,
    REBOUND_PT_debug,
    REBOUND_PT_light_shadow,
    REBOUND_PT_object_visibility,
    REBOUND_PT_passes,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        if cls.is_registered:
            bpy.utils.unregister_class(cls)
