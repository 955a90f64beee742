"""``scene.rebound``, ``light.rebound`` and ``object.rebound``: settings as Blender properties, generated from their one
declaration.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..bake_settings import BAKE_SETTINGS
from ..gpu_shaders.technique import Setting, Value
from ..settings import (
    DISPLAY_SETTINGS,
    LIGHT_SETTINGS,
    OBJECT_SETTINGS,
    VIEWPORT_SETTINGS,
    choice_number,
    named_settings,
)
from .versions import VERSION


def _edited(group, context) -> None:
    """Number the settings as this Rebound's; and a changed custom property does not reach the viewports by itself."""
    if isinstance(group, ReboundSceneSettings) and group.version < VERSION:
        group.version = VERSION
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _property(name: str, setting: Setting, default: Value, label: str, where: str = ""):
    """Blender's deferred property for one setting. Its tooltip gets no last period: Blender adds one."""
    description = where + setting.description + (f". Unit: {setting.unit}" if setting.unit else "")
    common = {"name": label, "description": description, "default": default, "update": _edited}
    if setting.kind == "ENUM":
        items = [(i.key, i.label, i.description, "NONE", choice_number(name, i.key)) for i in setting.items]
        return bpy.props.EnumProperty(items=items, **common)
    if setting.kind == "BOOL":
        return bpy.props.BoolProperty(**common)
    if setting.kind == "INT":
        return bpy.props.IntProperty(min=int(setting.minimum), max=int(setting.maximum), **common)
    soft = setting.maximum if setting.soft_maximum is None else setting.soft_maximum
    return bpy.props.FloatProperty(min=setting.minimum, max=setting.maximum, soft_max=soft, **common)


def _annotations(settings: Iterable[tuple[str, Setting]]) -> dict[str, object]:
    """Every setting by its full name, and once more where the viewport has a value of its own."""
    result = {}
    for name, setting in settings:
        result[name] = _property(name, setting, setting.default, setting.label)
        if setting.viewport_default is not None:
            label = f"Viewport {setting.label}"
            result[f"viewport_{name}"] = _property(name, setting, setting.viewport_default, label, "In the viewport: ")
    return result


class ReboundSceneSettings(bpy.types.PropertyGroup):
    """Settings of the engine and of every technique, for final renders and (viewport_…) for viewports."""


class ReboundLightSettings(bpy.types.PropertyGroup):
    """What Rebound makes of one light's bounce."""


class ReboundObjectSettings(bpy.types.PropertyGroup):
    """What of Rebound's light one object takes part in, beside Blender's own ray visibility."""


class ReboundBakeProgress(bpy.types.PropertyGroup):
    """How far the bake under way is; nothing of it is saved."""

    bake_line: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Bake", description="What the bake under way is doing; empty while there is none"
    )
    bake_part: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Progress", description="How far the bake under way is", min=0.0, max=1.0, subtype="FACTOR"
    )
    bake_cancel: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Cancel", description="End the bake under way; bakes of before stay"
    )


ReboundSceneSettings.__annotations__ = {
    # 0: never saved by a Rebound that numbered its settings (versions.py).
    "version": bpy.props.IntProperty(
        name="Settings Version",
        description="Which Rebound's settings the file holds; written when the file is saved",
        options={"HIDDEN"},
    ),
    **_annotations(named_settings()),
    **{f"viewport_{s.name}": _property(s.name, s, s.default, s.label) for s in (*VIEWPORT_SETTINGS, *DISPLAY_SETTINGS)},
    **_annotations((s.name, s) for s in BAKE_SETTINGS),
}
ReboundLightSettings.__annotations__ = _annotations((s.name, s) for s in LIGHT_SETTINGS)
ReboundObjectSettings.__annotations__ = {
    **_annotations((s.name, s) for s in OBJECT_SETTINGS),
    # Where the object's bake is: an image that packs the file goes before the file.
    "transfer_file": bpy.props.StringProperty(
        name="Bake",
        description="The file with this object's baked light transfer; empty: none, and live light",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        update=_edited,
    ),
    "transfer_image": bpy.props.PointerProperty(
        type=bpy.types.Image, name="Packed Bake", description="This object's baked light transfer, kept in the .blend"
    ),
}

OWNERS = (
    (bpy.types.Scene, ReboundSceneSettings),
    (bpy.types.Light, ReboundLightSettings),
    (bpy.types.Object, ReboundObjectSettings),
    (bpy.types.WindowManager, ReboundBakeProgress),
)


def register() -> None:
    for owner, group in OWNERS:
        bpy.utils.register_class(group)
        owner.rebound = bpy.props.PointerProperty(type=group, name="Rebound")


def unregister() -> None:
    for owner, group in OWNERS:
        if hasattr(owner, "rebound"):
            del owner.rebound
        if group.is_registered:
            bpy.utils.unregister_class(group)
