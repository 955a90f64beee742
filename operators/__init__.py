"""Operators: thin, each reads its properties and calls one function below. Errors become one report line here."""

from __future__ import annotations

import bpy

from .bake_command import run
from .bake_transfer import REBOUND_OT_bake_transfer, REBOUND_OT_remove_transfer
from .save_rsm_buffers import REBOUND_OT_save_rsm_buffers
from .toggle_indirect import REBOUND_OT_toggle_indirect

CLASSES = (
    REBOUND_OT_bake_transfer,
    REBOUND_OT_remove_transfer,
    REBOUND_OT_save_rsm_buffers,
    REBOUND_OT_toggle_indirect,
)
# Handles of what was registered and has no name to be asked for: the command `rebound`.
_COMMANDS: list = []


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    _COMMANDS.append(bpy.utils.register_cli_command("rebound", run))


def unregister() -> None:
    while _COMMANDS:
        bpy.utils.unregister_cli_command(_COMMANDS.pop())
    for cls in reversed(CLASSES):
        if cls.is_registered:
            bpy.utils.unregister_class(cls)
