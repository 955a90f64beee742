"""Operators: thin, each reads its properties and calls one function below. Errors become one report line here."""

from __future__ import annotations

import bpy

from .save_rsm_buffers import REBOUND_OT_save_rsm_buffers
from .toggle_indirect import REBOUND_OT_toggle_indirect

CLASSES = (REBOUND_OT_save_rsm_buffers, REBOUND_OT_toggle_indirect)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        if cls.is_registered:
            bpy.utils.unregister_class(cls)
