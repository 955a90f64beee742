"""Quality presets, by Blender's own preset system: the shipped ones, and those that users add and remove.

A preset is a Python file of plain values in a folder ``presets/rebound``: ours lies beside this file and is found by
``register_preset_path``; users' lie in their own scripts folder, to be edited and shared as any of Blender's.
"""

from __future__ import annotations

from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from ..settings import named_settings

SUBDIR = "rebound"
ROOT = str(Path(__file__).parent)
SHIPPED = ("Draft", "Balanced", "High", "Final")  # quickest first
# What is no matter of quality.
NOT_KEPT = {"seed", "show", "show_light", "show_term", "show_result"}
NOT_KEPT |= {"transfer_use", "transfer_bands", "transfer_terms", "transfer_lobe"}
NOT_KEPT |= {"transfer_widen", "transfer_window"}


def shipped_file(name: str) -> Path:
    return Path(ROOT, "presets", SUBDIR, f"{name}.py")


def kept_properties() -> list[str]:
    """The properties of scene.rebound that a preset keeps: all but those of NOT_KEPT, the viewport's own included."""
    names = []
    for name, setting in named_settings():
        if name not in NOT_KEPT:
            names += [name, f"viewport_{name}"] if setting.viewport_default is not None else [name]
    return names


class REBOUND_PT_presets(PresetPanel, bpy.types.Panel):
    """The list behind the icon: ours by quality, then the user's by name."""

    bl_label = "Rebound Presets"
    preset_subdir = SUBDIR
    preset_operator = "script.execute_preset"
    preset_add_operator = "rebound.preset_add"

    def draw(self, context):
        layout = self.layout
        layout.emboss = "PULLDOWN_MENU"
        layout.operator_context = "EXEC_DEFAULT"
        column = layout.column(align=True)
        for name in SHIPPED:
            button = column.operator(self.preset_operator, text=name)
            button.filepath, button.menu_idname = str(shipped_file(name)), type(self).__name__
        layout.separator()
        self.path_menu(
            bpy.utils.preset_paths(SUBDIR),
            self.preset_operator,
            filter_path=is_users,
            add_operator=self.preset_add_operator,
            display_name=lambda path: bpy.path.display_name(path, title_case=False),
        )


def is_users(file_name: str) -> bool:
    """Whether a file of the preset folders is a preset, and none of ours."""
    path = Path(file_name)
    return path.suffix == ".py" and path.stem not in SHIPPED


class REBOUND_OT_preset_add(AddPresetBase, bpy.types.Operator):
    """Keep the render settings as a preset of this name, or remove the one that has it"""

    bl_idname = "rebound.preset_add"
    bl_label = "Add Rebound Preset"
    preset_menu = "REBOUND_PT_presets"
    preset_subdir = SUBDIR
    preset_defines = ("rebound = bpy.context.scene.rebound",)
    preset_values = tuple(f"rebound.{name}" for name in kept_properties())

    def execute(self, context):
        removes = self.remove_name or self.remove_active
        name = bpy.types.REBOUND_PT_presets.bl_label if self.remove_active else self.name
        # Blender keeps what lies in an extension; ours may also lie elsewhere, in a developer's folder.
        if removes and name in SHIPPED:
            self.report({"WARNING"}, f"Preset '{name}' is Rebound's own and stays; add one of your own instead")
            return {"CANCELLED"}
        return super().execute(context)


def register() -> None:
    bpy.utils.register_preset_path(ROOT)
    bpy.utils.register_class(REBOUND_OT_preset_add)


def unregister() -> None:
    if REBOUND_OT_preset_add.is_registered:
        bpy.utils.unregister_class(REBOUND_OT_preset_add)
        bpy.utils.unregister_preset_path(ROOT)
