"""Rebound's own panels in the Properties editor."""

from __future__ import annotations

import bpy
from bl_ui.properties_render import CompositorPerformanceButtonsPanel

from ..gpu_shaders import TECHNIQUES
from ..gpu_shaders.technique import Setting, Technique
from ..passes import PASSES
from ..session import SESSIONS
from ..settings import DISPLAY_SETTINGS, VIEWPORT_SETTINGS, named_settings, views_of
from .quality import REBOUND_PT_presets
from .rebound_panel import ReboundPanel, draw_settings
from .transfer_panels import REBOUND_PT_object_transfer, REBOUND_PT_transfer
from .versions import file_notes

MEGABYTE = 1 << 20

SHADOWS = ("shadow_resolution", "soft_shadows")


def _named(names: tuple[str, ...]) -> list[tuple[str, Setting]]:
    return [(name, setting) for name, setting in named_settings() if name in names]


class REBOUND_PT_sampling(ReboundPanel, bpy.types.Panel):
    bl_label = "Sampling"

    def draw_header_preset(self, _context):
        REBOUND_PT_presets.draw_panel_header(self.layout)

    def draw(self, context):
        draw_settings(self.layout, context.scene.rebound, _named(("samples",)))
        for line in file_notes(context.scene):
            self.layout.label(text=line, icon="ERROR")


class REBOUND_PT_sampling_advanced(ReboundPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = "REBOUND_PT_sampling"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        draw_settings(self.layout, context.scene.rebound, _named(("seed",)))


class REBOUND_PT_indirect(ReboundPanel, bpy.types.Panel):
    """The method and the settings of its own that say the most; the others have sub-panels, closed at first."""

    bl_label = "Global Illumination"

    def draw(self, context):
        group = context.scene.rebound
        draw_settings(self.layout, group, _named(("method",)))
        for technique in TECHNIQUES:
            if technique.id.upper() == group.method:
                draw_settings(self.layout, group, _settings_of(technique, ""))


def _settings_of(technique: type[Technique], panel: str) -> list[tuple[str, Setting]]:
    return [(f"{technique.id}_{s.name}", s) for s in technique.settings if s.panel == panel]


def _sub_panel(technique: type[Technique], title: str) -> type:
    """The closed panel of those of a technique's settings that name it; hidden while another method is chosen."""

    class SubPanel(ReboundPanel, bpy.types.Panel):
        bl_label = title
        bl_parent_id = "REBOUND_PT_indirect"
        bl_options = {"DEFAULT_CLOSED"}

        @classmethod
        def poll(cls, context):
            return super().poll(context) and context.scene.rebound.method == technique.id.upper()

        def draw(self, context):
            draw_settings(self.layout, context.scene.rebound, _settings_of(technique, title))

    SubPanel.__name__ = f"REBOUND_PT_{technique.id}_{title.lower().replace(' ', '_')}"
    return SubPanel


# One for each title that settings name, in the order in which they first do.
SUB_PANELS = tuple(
    _sub_panel(technique, title)
    for technique in TECHNIQUES
    for title in dict.fromkeys(setting.panel for setting in technique.settings if setting.panel)
)


class REBOUND_PT_shadows(ReboundPanel, bpy.types.Panel):
    bl_label = "Shadows"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        draw_settings(self.layout, context.scene.rebound, _named(SHADOWS))


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
        if "gpu_bytes" in status.statistics:
            layout.label(text=f"Memory in use: {status.statistics['gpu_bytes'] / MEGABYTE:,.0f} MB on the GPU")


class REBOUND_PT_statistics(ReboundPanel, bpy.types.Panel):
    bl_label = "Statistics"
    bl_parent_id = "REBOUND_PT_status"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column = self.layout.column(align=True)
        column.scale_y = 0.8
        for name, value in SESSIONS.newest.statistics.items():
            column.label(text=f"{name.replace('_', ' ').capitalize()}: {value:,.0f}")


class REBOUND_MT_show(bpy.types.Menu):
    """The views that the chosen method has. The property holds any, so that a file keeps what it was saved with."""

    bl_label = "Show"

    def draw(self, context):
        _draw_views(self.layout, context.scene.rebound, "show")


class REBOUND_MT_viewport_show(bpy.types.Menu):
    bl_label = "Show in the Viewport"

    def draw(self, context):
        _draw_views(self.layout, context.scene.rebound, "viewport_show")


def _draw_views(layout, group, name: str) -> None:
    for key in views_of(group.method):
        layout.prop_enum(group, name, key)


class REBOUND_PT_performance(ReboundPanel, bpy.types.Panel):
    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        pass


class REBOUND_PT_compositor(CompositorPerformanceButtonsPanel, ReboundPanel, bpy.types.Panel):
    """Blender's own, which it shows with its own engines only: on what its compositor works."""

    bl_parent_id = "REBOUND_PT_performance"


class REBOUND_PT_debug(ReboundPanel, bpy.types.Panel):
    bl_label = "Debug"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        group = context.scene.rebound
        for name, text in (("show", "Show"), ("viewport_show", "Viewport")):
            split = self.layout.split(factor=0.4)
            label = split.row()
            label.alignment = "RIGHT"
            label.label(text=text)
            split.menu(f"REBOUND_MT_{name}", text=shown_label(group, name))
        layout = self.layout
        layout.use_property_split = True
        for name in ("show_light", "show_term", "show_result"):
            layout.prop(group, name)
        column = layout.column(align=True, heading="Viewport")
        for setting in (*VIEWPORT_SETTINGS, *DISPLAY_SETTINGS):
            column.prop(group, f"viewport_{setting.name}")
        self.layout.operator("rebound.save_rsm_buffers")


def shown_label(group, name: str) -> str:
    """The label of what is shown: another method's view shows the picture."""
    key = getattr(group, name)
    key = key if key in views_of(group.method) else "PICTURE"
    return group.bl_rna.properties[name].enum_items[key].name


class LightPanel(ReboundPanel):
    """Mixin: a panel below Blender's own of a light."""

    bl_context = "data"
    bl_parent_id = "DATA_PT_EEVEE_light"

    @classmethod
    def poll(cls, context):
        return context.light is not None and super().poll(context)


class REBOUND_PT_light_shadow(LightPanel, bpy.types.Panel):
    bl_label = "Influence"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.light, "use_shadow", text="Casts Shadow")
        layout.prop(context.light, "diffuse_factor", text="Diffuse")
        layout.prop(context.light, "specular_factor", text="Specular")


class REBOUND_PT_light_bounce(LightPanel, bpy.types.Panel):
    """The switch in the header; what it switches below."""

    bl_label = "Bounce"

    def draw_header(self, context):
        self.layout.prop(context.light.rebound, "use_bounce", text="")

    def draw(self, context):
        layout, group = self.layout, context.light.rebound
        layout.use_property_split = True
        layout.active = group.use_bounce
        layout.prop(group, "bounce_strength", text="Strength")
        layout.prop(group, "map_size")


class REBOUND_PT_object_visibility(ReboundPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_context = "object"
    bl_parent_id = "OBJECT_PT_visibility"

    @classmethod
    def poll(cls, context):
        kinds = {"MESH", "CURVE", "SURFACE", "META", "FONT", "EMPTY"}  # an empty for what it instances
        return context.object is not None and context.object.type in kinds and super().poll(context)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(context.object, "visible_camera", text="Camera")
        layout.prop(context.object, "visible_shadow", text="Shadow")
        layout.prop(context.object, "visible_diffuse", text="Cast Bounce")
        layout.prop(context.object.rebound, "receive_bounce")


class REBOUND_PT_override(ReboundPanel, bpy.types.Panel):
    """Blender's own is for any engine since 5.0 only."""

    bl_label = "Override"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and not hasattr(bpy.types, "VIEWLAYER_PT_override")

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(context.view_layer, "material_override")
        layout.prop(context.view_layer, "world_override")


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
    REBOUND_PT_presets,
    REBOUND_MT_show,
    REBOUND_MT_viewport_show,
    REBOUND_PT_sampling,
    REBOUND_PT_sampling_advanced,
    REBOUND_PT_indirect,
    *SUB_PANELS,
    REBOUND_PT_shadows,
    REBOUND_PT_transfer,
    REBOUND_PT_film,
    REBOUND_PT_status,
    REBOUND_PT_statistics,
    REBOUND_PT_performance,
    REBOUND_PT_compositor,
    REBOUND_PT_debug,
    REBOUND_PT_light_shadow,
    REBOUND_PT_light_bounce,
    REBOUND_PT_object_visibility,
    REBOUND_PT_object_transfer,
    REBOUND_PT_override,
    REBOUND_PT_passes,
)
PANELS = tuple(cls for cls in CLASSES if issubclass(cls, ReboundPanel))


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        if cls.is_registered:
            bpy.utils.unregister_class(cls)
