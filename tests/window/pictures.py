"""Pictures of the interface for the manual: no test, but `tools/test_window.py pictures --copy-to docs/manual/images`.

The scene is examples/cornell_box.blend, or the file that REBOUND_SCENE names. Pictures carry nothing but pixels.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import bpy
from steps import OUT, SCREEN, areas, check, finished, run, select, window_context

TABS = {"render": "RENDER", "light": "DATA", "object": "OBJECT", "view_layer": "VIEW_LAYER"}


def shot(name: str, box: tuple[int, int, int, int] = (0, 0, *SCREEN)) -> None:
    """A part of the screen, (left, top, width, height), as a small PNG without any text in it."""
    left, top, width, height = box
    subprocess.run(["import", "-window", "root", "-crop", f"{width}x{height}+{left}+{top}", "+repage", "-strip",
                    "-define", "png:compression-level=9", "-define", "png:compression-filter=5",
                    "-define", "png:exclude-chunks=date,time,gAMA,cHRM", f"{OUT}/{name}.png"], check=True)  # fmt: skip


def box_of(thing) -> tuple[int, int, int, int]:
    """Where an area or a region stands on the screen."""
    return thing.x, SCREEN[1] - thing.y - thing.height, thing.width, thing.height


def scenario():
    bpy.ops.wm.open_mainfile(filepath=str(Path(__file__).with_name("scene.blend")))
    yield 1.0
    scene, context = bpy.context.scene, window_context()
    scene.render.engine = "REBOUND"
    space = context["space_data"]
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_extras = space.overlay.show_cursor = False
    for obj in bpy.context.view_layer.objects:
        obj.select_set(False)
    if space.region_3d.view_perspective != "CAMERA":
        with bpy.context.temp_override(**context):
            bpy.ops.view3d.view_camera()
    yield 1.0
    space.region_3d.view_camera_zoom = 8
    scene.camera.data.show_passepartout = False  # it would hide what views draw beside the frame
    scene.rebound.viewport_samples = 12
    space.shading.type = "RENDERED"
    areas("PROPERTIES")[0][1].spaces.active.context = "RENDER"
    yield from finished(180)
    shot("window")
    area = window_context()["area"]
    header = next(r for r in area.regions if r.type == "HEADER")
    left, top, width, height = box_of(header)
    shot("header", (left + width - 520, top, 520, height))
    yield from viewport_tools(scene, area)
    yield from panels()
    check("pictures were taken", len(list(Path(OUT).glob("*.png"))) > 8)


def viewport_tools(scene, area):
    """Split view, statistics and every view of the method."""
    group = scene.rebound
    group.viewport_split = True
    yield from finished(120)
    shot("split", box_of(area))
    group.viewport_split = False
    group.viewport_indirect = False
    yield from finished(120)
    shot("direct_only", box_of(area))
    group.viewport_indirect = group.viewport_stats = True
    yield from finished(120)
    group.viewport_samples += 1  # a sample with its times
    yield from finished(120)
    shot("statistics", box_of(area))
    group.viewport_stats = False
    for item in group.bl_rna.properties["viewport_show"].enum_items:
        if item.identifier == "PICTURE" or item.identifier.startswith("RSM_"):
            continue
        group.viewport_show = item.identifier
        yield from finished(120)
        shot(f"view_{item.identifier.lower().removeprefix('vpl_')}", box_of(area))
    group.viewport_show = "PICTURE"
    yield from finished(120)


def panels():
    """The tabs of the Properties editor, as high as the window, with all of Rebound's panels open."""
    bpy.context.scene.rebound.viewport_samples = 1
    area = window_context()["area"]
    area.type = "PROPERTIES"
    space = area.spaces.active
    light = next(obj for obj in bpy.data.objects if obj.type == "LIGHT")
    mesh = next(obj for obj in bpy.data.objects if obj.type == "MESH")
    for name, tab in TABS.items():
        select(light.name if name == "light" else mesh.name)
        yield 0.5
        space.context = tab
        yield 1.5
        left, top, _width, height = box_of(area)
        shot(f"panel_{name}", (left, top, area.width, height))


run(scenario)
