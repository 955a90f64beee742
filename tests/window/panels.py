"""Every tab of the Properties editor with Rebound in a real window, a material's preview, and an error of F12's."""

from __future__ import annotations

import bpy
from steps import (
    check,
    module,
    rendering,
    run,
    screenshot,
    select,
    wait_for,
    window_context,
)

TABS = ("RENDER", "OUTPUT", "VIEW_LAYER", "SCENE", "WORLD", "OBJECT", "DATA", "MATERIAL")
PREVIEWS: list[tuple[int, int]] = []


def note_previews() -> None:
    """Note the size of every preview picture that is rendered."""
    final_render = module("final_render")
    view = final_render._view

    def noted(engine, depsgraph):
        if engine.is_preview:
            PREVIEWS.append((engine.resolution_x, engine.resolution_y))
        return view(engine, depsgraph)

    final_render._view = noted


def open_all_panels() -> None:
    """As if the user had opened every panel: what is closed is not drawn, and would hide a fault."""
    for panel in module("ui.panels").CLASSES:
        if "DEFAULT_CLOSED" in getattr(panel, "bl_options", ()):
            bpy.utils.unregister_class(panel)
            panel.bl_options = panel.bl_options - {"DEFAULT_CLOSED"}
            bpy.utils.register_class(panel)


def scenario():
    scene = bpy.context.scene
    scene.render.engine = "REBOUND"
    note_previews()
    open_all_panels()
    window = window_context()["window"]
    # The 3D viewport becomes a second, large Properties editor.
    area = window_context()["area"]
    area.type = "PROPERTIES"
    space = area.spaces.active
    for name in ("Cube", "Light", "Camera"):
        select(name)
        for tab in TABS if name == "Cube" else ("DATA", "OBJECT"):
            yield 0.5
            try:
                space.context = tab
            except TypeError:  # this object has no such tab
                continue
            yield 1.0
            screenshot(f"tab_{name.lower()}_{tab.lower()}")
    select("Cube")
    yield 0.5
    space.context = "MATERIAL"
    yield from wait_for(lambda: bool(PREVIEWS), 30)
    check("the material's preview is rendered with Rebound", bool(PREVIEWS), PREVIEWS[:3])
    yield 3.0
    screenshot("material_tab")
    yield from f12_errors(window, area)


def f12_errors(window, area):
    """What F12 cannot render ends at once."""
    camera = bpy.context.scene.camera
    camera.scale = (0, 0, 0)
    with bpy.context.temp_override(window=window, area=area):
        try:
            bpy.ops.render.render("INVOKE_DEFAULT")
        except RuntimeError as error:  # where it failed before the operator returned
            check("a failed render says why", "zero scale" in str(error), error)
    yield 1.0
    yield from wait_for(lambda: not rendering(), 20)
    check("a failed render ends", not rendering())
    yield 1.0
    screenshot("f12_error")
    bpy.data.objects.remove(camera)
    try:
        with bpy.context.temp_override(window=window, area=area):
            bpy.ops.render.render("INVOKE_DEFAULT")
        check("a render without camera is refused", False)
    except RuntimeError as refusal:
        check("a render without camera is refused", "No camera" in str(refusal))


run(scenario)
