"""``scene.rebound``: the renderer's settings as Blender properties, generated from their one declaration."""

from __future__ import annotations

import bpy

from ..gpu_shaders.technique import Setting, Value
from ..settings import named_settings


def _redraw(_group, context) -> None:
    """A changed custom property does not reach the viewports by itself."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _property(setting: Setting, default: Value, label: str, where: str = ""):
    """Blender's deferred property for one setting. Its tooltip gets no last period: Blender adds one."""
    description = where + setting.description + (f". Unit: {setting.unit}" if setting.unit else "")
    common = {"name": label, "description": description, "default": default, "update": _redraw}
    if setting.kind == "ENUM":
        return bpy.props.EnumProperty(items=[(i.key, i.label, i.description) for i in setting.items], **common)
    if setting.kind == "BOOL":
        return bpy.props.BoolProperty(**common)
    if setting.kind == "INT":
        return bpy.props.IntProperty(min=int(setting.minimum), max=int(setting.maximum), **common)
    return bpy.props.FloatProperty(min=setting.minimum, max=setting.maximum, **common)


def _annotations() -> dict[str, object]:
    """Every setting by its full name, and once more where the viewport has a value of its own."""
    result = {}
    for name, setting in named_settings():
        result[name] = _property(setting, setting.default, setting.label)
        if setting.viewport_default is not None:
            label = f"Viewport {setting.label}"
            result[f"viewport_{name}"] = _property(setting, setting.viewport_default, label, "In the viewport: ")
    return result


class ReboundSceneSettings(bpy.types.PropertyGroup):
    """Settings of the engine and of every technique, for final renders and (viewport_…) for viewports."""


ReboundSceneSettings.__annotations__ = _annotations()


def register() -> None:
    bpy.utils.register_class(ReboundSceneSettings)
    bpy.types.Scene.rebound = bpy.props.PointerProperty(type=ReboundSceneSettings, name="Rebound")


def unregister() -> None:
    if hasattr(bpy.types.Scene, "rebound"):
        del bpy.types.Scene.rebound
    if ReboundSceneSettings.is_registered:
        bpy.utils.unregister_class(ReboundSceneSettings)
