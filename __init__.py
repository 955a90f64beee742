"""Rebound: a render engine that shows global illumination in real time.

This file imports nothing of Blender's, so that ``rebound.device``, ``rebound.renderer`` and their like can be used and
tested without Blender.
"""

from importlib import import_module

ENGINE_ID = "REBOUND"  # what a scene's render.engine says

# In order of registration; unregistered in reverse. Each has register() and unregister().
MODULES = (
    "log",
    "exit_status",
    "main_thread",
    "ui.properties",
    "ui.versions",
    "engine",
    "operators",
    "ui.quality",
    "ui.panels",
    "ui.compat",
    "ui.keymap",
    "ui.split",
    "ui.overlay",
)


def register() -> None:
    """Called by Blender when the extension is enabled. Registering twice is the same as once."""
    unregister()
    for module in _modules():
        module.register()


def unregister() -> None:
    """Called by Blender when the extension is disabled, and at its end. Harmless where nothing is registered."""
    for module in reversed(_modules()):
        module.unregister()


def _modules() -> list:
    return [import_module(f".{name}", __package__) for name in MODULES]
