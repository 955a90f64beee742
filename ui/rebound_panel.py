"""What Rebound's panels have in common."""

from __future__ import annotations

from .. import ENGINE_ID
from ..gpu_shaders.technique import Setting


class ReboundPanel:
    """Mixin: a panel of the Properties editor that is shown with Rebound only."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE_ID}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES


def draw_settings(layout, group, settings: list[tuple[str, Setting]]) -> None:
    """One row for each setting, and a "Viewport" row under those that have a value of their own there."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    for name, setting in settings:
        column = layout.column(align=True)
        column.prop(group, name)
        if setting.viewport_default is not None:
            column.prop(group, f"viewport_{name}", text="Viewport")
