"""Baking light transfer with the installed package: by the command in a Blender without a window, and the operator."""

from __future__ import annotations

import subprocess
from pathlib import Path

import bpy
from steps import OUT, check, module, run, screenshot, wait_for, window_context

SECONDS = 120  # for a bake of a hundred vertices


def scenario():
    yield from command()
    yield from operator()


def blender(*words: str):
    """Run `blender --background --offline-mode --command rebound` beside this one; its status and what it said."""
    log = Path(OUT) / "command.txt"
    with log.open("w") as out:
        line = [bpy.app.binary_path, "--background", "--offline-mode", "--command", "rebound", *words]
        process = subprocess.Popen(line, stdout=out, stderr=subprocess.STDOUT)
        yield from wait_for(lambda: process.poll() is not None, SECONDS)
    if process.poll() is None:
        process.kill()
    return process.wait(), log.read_text()


def command():
    source, target = Path(__file__).with_name("scene.blend"), Path(OUT) / "baked.blend"
    untouched = source.read_bytes()
    words = ["--objects", "Floor", "Tall block", "--bands", "3", "--directions", "64", "--save-as", str(target)]
    status, said = yield from blender("bake", str(source), *words)
    check("the command ends with status 0", status == 0, status)
    check("it says what traces its rays", "CPU, rays by Embree" in said)
    files = sorted(path.name for path in (Path(OUT) / "baked.bakes").glob("*.exr"))
    check("there is a file for each object", len(files) == 2, files)
    status, said = yield from blender("bake", str(source), "--objects", "Nobody", "--save-as", str(target))
    check("an unknown object ends it with status 1", status == 1 and "no object 'Nobody'" in said, status)
    status, said = yield from blender("bake", "nowhere.blend")
    check("a missing file ends it with status 1", status == 1, status)
    status, _ = yield from blender("bake")
    check("missing words end it with status 2", status == 2, status)
    bpy.ops.wm.open_mainfile(filepath=str(target))
    yield 1.0
    for name in ("Floor", "Tall block"):
        path = Path(bpy.path.abspath(bpy.data.objects[name].rebound.transfer_file))
        about = module("bake.file").read_about(path)
        check(f"'{name}' names its file in the saved .blend", path.name in files and about["settings"]["bands"] == 3)
    check("the file that was read is as it was", source.read_bytes() == untouched)


def operator():
    """As pressed: modal, beside the window, by the same Embree."""
    scene = bpy.context.scene
    scene.render.engine, scene.rebound.bake_directions = "REBOUND", 64
    bpy.data.objects["Floor"].rebound.transfer_file = ""
    with bpy.context.temp_override(**window_context()):
        begun = bpy.ops.rebound.bake_transfer("INVOKE_DEFAULT", objects="ALL")
    check("the operator begins", begun == {"RUNNING_MODAL"}, begun)
    progress = bpy.context.window_manager.rebound
    yield 0.3
    screenshot("baking")
    yield from wait_for(lambda: not progress.bake_line, SECONDS)
    about = module("bake.file").read_about(Path(bpy.path.abspath(bpy.data.objects["Floor"].rebound.transfer_file)))
    check("all objects are baked, by Embree", about["device"].startswith("CPU, rays by Embree"), about["device"])


run(scenario)
