"""What happens to a viewport while it renders: other engines, other files, F12, a compositor, disabling Rebound."""

from __future__ import annotations

import addon_utils
import bpy
import numpy as np
from steps import (
    OUT,
    PACKAGE,
    SAME,
    check,
    count_draws,
    cube_on_floor,
    difference,
    finished,
    module,
    note_log,
    picture,
    press_f12,
    rendering,
    run,
    samples,
    say,
    session,
    sessions,
    viewports,
    wait_for,
    window_context,
)


def scenario():
    cube_on_floor(samples=8)
    yield from finished(90)
    first = picture("first")
    yield from other_engine(first)
    yield from load_file(first)
    yield from other_versions(first)
    yield from f12_meanwhile()
    yield from compositor()
    yield from view_layers()
    yield from disabled()


def other_engine(first):
    scene = bpy.context.scene
    for _ in range(3):
        scene.render.engine = "BLENDER_WORKBENCH"
        yield from wait_for(lambda: not viewports(), 5)
        check("another engine takes over", not viewports())
        scene.render.engine = "REBOUND"
        yield from finished()
    check("and back it is the same picture", difference(picture("engine_back"), first) < SAME)


def load_file(first):
    """Save, load while the viewport works, load a file with another scene, and undo is no part of it."""
    path = f"{OUT}/saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.context.scene.rebound.viewport_samples = 4096  # which never ends
    yield 1.0
    bpy.ops.wm.open_mainfile(filepath=path)
    yield 0.5
    space = window_context()["space_data"]
    check("Blender opens files in Solid mode", space.shading.type == "SOLID")
    space.shading.type = "RENDERED"
    yield from finished(90)
    check("a loaded file is rendered", bpy.context.scene.rebound.viewport_samples == 8)
    check("and is the same picture", difference(picture("loaded"), first) < SAME)
    yield from wait_for(lambda: len(viewports()) == 1, 5)
    check("the session of the old file is gone", len(viewports()) == 1, len(viewports()), len(sessions()))


def other_versions(first):
    """Files of an older and of a newer Rebound are opened: the one is brought up to date, the other says so once."""
    versions = module("ui.versions")
    path, newer = f"{OUT}/version.blend", versions.VERSION + 1
    for name, held in (
        ("older", {"version": 0, "vpl_bounces": 0}),
        ("newer", {"version": newer, "method": 99, "from_the_future": 3.5}),
    ):
        bpy.ops.wm.open_mainfile(filepath=f"{OUT}/saved.blend")
        yield 0.5
        versions.unregister()  # so that saving numbers nothing
        for key, value in held.items():
            versions.stored(bpy.context.scene.rebound)[key] = value
        bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
        versions.register()
        told = note_log()
        bpy.ops.wm.open_mainfile(filepath=path)
        yield 0.5
        window_context()["space_data"].shading.type = "RENDERED"
        yield from finished(90)
        group, shot = bpy.context.scene.rebound, picture(f"file_{name}")
        if name == "older":
            bounces = group.vpl_bounces, group.viewport_vpl_bounces
            check("an older file's setting became two", bounces == ("ONE", "ONE") and not told, *bounces, *told)
            check("it has a number now", group.version == versions.VERSION, group.version)
            shown = session()._picture.settings["vpl_bounces"]
            check("and a picture with one bounce", shown == "ONE" and difference(shot, first) < 0.1, shown)
        else:
            check("a newer file says so in the log", any("newer Rebound" in line for line in told), *told)
            check("each line once", len(told) == len(set(told)))
            check("its settings are left", group.version == newer and versions.stored(group)["from_the_future"] == 3.5)
            check("its unknown method is the default's picture", difference(shot, first) < SAME)
        check("no error in the viewport", not any(s.status.error for s in sessions()))
    bpy.ops.wm.open_mainfile(filepath=f"{OUT}/saved.blend")
    yield 0.5
    window_context()["space_data"].shading.type = "RENDERED"
    yield from finished(90)


def f12_meanwhile():
    """A render by F12 and a viewport that has much to do, at the same time."""
    scene = bpy.context.scene
    draws = count_draws()
    scene.render.resolution_x, scene.render.resolution_y = 160, 90
    scene.rebound.viewport_samples = 4096
    yield 1.0
    yield from press_f12(32)
    began = rendering()
    count, before = len(draws), samples()
    yield from wait_for(lambda: not rendering(), 90)
    check("F12 ends while the viewport works", began and not rendering())
    say(f"{len(draws) - count} redraws of the viewport meanwhile, from {before} to {samples()} samples")
    bpy.data.images["Render Result"].save_render(f"{OUT}/f12_meanwhile.png")
    image = bpy.data.images.load(f"{OUT}/f12_meanwhile.png")
    pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    bpy.data.images.remove(image)
    check("its picture is there", pixels.max() > 0.3 and pixels.std() > 0.02)
    windows = bpy.context.window_manager.windows
    if len(windows) > 1:
        with bpy.context.temp_override(window=windows[-1]):
            bpy.ops.wm.window_close()
    yield 1.0
    scene.rebound.viewport_samples = 8
    yield from finished()
    check("the viewport is whole afterwards", picture("after_f12").std() > 0.05)


def compositor():
    """The viewport compositor gets Rebound's picture."""
    before = picture("compositor_off")
    window_context()["space_data"].shading.use_compositor = "ALWAYS"
    tree = bpy.data.node_groups.new("Invert", "CompositorNodeTree")
    bpy.context.scene.compositing_node_group = tree
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    layers, invert, out = (
        tree.nodes.new(f"{kind}") for kind in ("CompositorNodeRLayers", "CompositorNodeInvert", "NodeGroupOutput")
    )
    tree.links.new(layers.outputs["Image"], invert.inputs["Color"])
    tree.links.new(invert.outputs["Color"], out.inputs[0])
    yield 1.0
    yield from finished()
    after = picture("compositor_on")
    h, w = before.shape[0] // 2, before.shape[1] // 2
    part = np.s_[h - 80 : h + 120, w - 150 : w + 150]
    both = np.corrcoef(before[part].ravel(), after[part].ravel())[0, 1]
    check("the compositor inverts the picture", both < -0.5, round(float(both), 3))
    window_context()["space_data"].shading.use_compositor = "DISABLED"
    yield from finished()
    check("and lets go of it", difference(picture("compositor_off_again"), before) < SAME)


def view_layers():
    """Another view layer shows what is in it."""
    scene = bpy.context.scene
    before = picture("view_layer")
    layer = scene.view_layers.new("Without")
    layer.layer_collection.children[0].exclude = True
    bpy.context.window.view_layer = layer
    yield from finished()
    empty = picture("view_layer_without")
    check("another view layer hides its collections", difference(empty, before) > 0.02)
    bpy.context.window.view_layer = scene.view_layers[0]
    yield from finished()
    check("and the first one is as it was", difference(picture("view_layer_again"), before) < SAME)


def disabled():
    """Rebound is disabled and enabled in the preferences while a viewport of its works."""
    bpy.context.scene.rebound.viewport_samples = 4096
    yield 1.0
    old = module("session").SESSIONS
    addon_utils.disable(PACKAGE)
    yield 1.5
    check("disabled, nothing is left on the GPU", all(s._gpu is None for s in old.alive))
    addon_utils.enable(PACKAGE)
    bpy.context.scene.render.engine = "REBOUND"
    bpy.context.scene.rebound.viewport_samples = 8
    window_context()["space_data"].shading.type = "RENDERED"
    yield from finished(90)
    counts = [s.status.samples for s in viewports()]
    shown = float(picture("enabled_again").std())
    check("enabled again, it renders", counts == [8] and shown > 0.05, counts, len(sessions()), round(shown, 3))


run(scenario)
