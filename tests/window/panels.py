"""Every tab of the Properties editor with Rebound in a real window, a material's preview, and an error of F12's."""

from __future__ import annotations

import time

import bpy
import numpy as np
from steps import (
    check,
    module,
    principled,
    rendering,
    run,
    say,
    screenshot,
    select,
    wait_for,
    window_context,
)

TABS = ("RENDER", "OUTPUT", "VIEW_LAYER", "SCENE", "WORLD", "OBJECT", "DATA", "MATERIAL")
PREVIEWS: list[tuple[int, int]] = []
SECONDS: list[float] = []  # of every preview picture, reading Blender's preview scene included


def note_previews() -> None:
    """Note size and time of every preview picture that is rendered."""
    final_render, engine_module = module("final_render"), module("engine")
    view, render = final_render._view, engine_module.render_final

    def timed(engine, depsgraph):
        start = time.perf_counter()
        render(engine, depsgraph)
        if engine.is_preview:
            SECONDS.append(time.perf_counter() - start)

    engine_module.render_final = timed

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
    yield from thumbnails()
    yield from f12_errors(window, area)


def thumbnails():
    """The small pictures of materials in lists and in the asset browser, each in the material's colour."""
    before = len(SECONDS)
    for name, color in (("Red", (0.8, 0.02, 0.02, 1)), ("Blue", (0.02, 0.02, 0.8, 1))):
        material, surface = principled(name)
        surface.inputs["Base Color"].default_value = color
        start = time.monotonic()
        with bpy.context.temp_override(id=material):
            bpy.ops.ed.lib_id_generate_preview()
        shot = np.zeros((1, 4))
        while not shot.any() and time.monotonic() < start + 60:
            yield 0.1
            shot = np.array(material.preview.image_pixels_float[:]).reshape(-1, 4)
        red, _green, blue = shot[shot[:, 3] > 0.5][:, :3].mean(axis=0) if shot.any() else (0, 0, 0)
        well = (red > 1.3 * blue) if name == "Red" else (blue > 1.3 * red)
        check(f"the thumbnail of {name}", well, len(shot), round(float(red), 3), round(float(blue), 3))
        say(f"shown after {time.monotonic() - start:.1f} s")
    check("thumbnails are Rebound's", len(SECONDS) > before)
    say("seconds of preview pictures:", *(round(seconds, 2) for seconds in SECONDS))


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
