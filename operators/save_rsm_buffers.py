"""Save RSM Buffers: what every light sees, as one multi-layer EXR to look at or to compute with."""

from __future__ import annotations

from pathlib import Path

import bpy
import gpu

from ..device.interface import DeviceError
from ..exr import ExrError, Layer, layer_name, write_layers
from ..gpu_probe import missing_gpu
from ..renderer import RenderError, RsmBuffers
from ..scene.errors import SceneError
from ..session import Session, read_settings

CHANNELS = {"depth": "Z", "position": "XYZ", "normal": "XYZ", "flux": "RGB"}
USER_FAULTS = (SceneError, RenderError, DeviceError, ExrError)


class REBOUND_OT_save_rsm_buffers(bpy.types.Operator):
    """Write the reflective shadow map of every light to one multi-layer EXR file: depth and world position in metres, \
normal, reflected flux in watts"""

    bl_idname = "rebound.save_rsm_buffers"
    bl_label = "Save RSM Buffers"

    filepath: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="File Path", description="The EXR file to write", subtype="FILE_PATH", default="//rsm_buffers.exr"
    )
    filter_glob: bpy.props.StringProperty(default="*.exr", options={"HIDDEN"})  # type: ignore[valid-type]
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})  # type: ignore[valid-type]

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        path = Path(bpy.path.ensure_ext(bpy.path.abspath(self.filepath), ".exr"))
        try:
            count = save_rsm_buffers(context.evaluated_depsgraph_get(), path)
        except USER_FAULTS as error:
            self.report({"ERROR"}, f"Rebound: {error}")
            return {"CANCELLED"}
        self.report({"INFO"}, f"{count} reflective shadow maps written to {path}")
        return {"FINISHED"}


def save_rsm_buffers(depsgraph, path: Path) -> int:
    """Write every light's map to ``path``; returns how many there were. Raises the USER_FAULTS."""
    _ensure_gpu()
    session = Session()
    try:
        session.sync(depsgraph, for_viewport=True)
        buffers = session.rsm_buffers(read_settings(depsgraph.scene, viewport=False))
    finally:
        session.free()
    if not buffers:
        raise SceneError("No light in the scene has a reflective shadow map: there is nothing to save")
    write_layers(path, _layers(buffers))
    return len(buffers)


def _layers(buffers: list[RsmBuffers]) -> dict[str, Layer]:
    """Layers by name: "Spot.position"; a point light's faces come in between: "Point.+X.position"."""
    result = {}
    for buffer in buffers:
        prefix = ".".join(layer_name(part) for part in (buffer.light, buffer.face) if part)
        result |= {f"{prefix}.{name}": Layer(CHANNELS[name], array) for name, array in buffer.layers.items()}
    return result


def _ensure_gpu() -> None:
    """Blender gives operators a GPU context in a window; in background only when asked, and only since 5.2."""
    if not bpy.app.background:
        return
    missing = missing_gpu()
    if missing:
        raise DeviceError(missing)
    if hasattr(gpu, "init"):
        gpu.init()
        return
    try:
        gpu.platform.backend_type_get()
    except SystemError as error:
        raise DeviceError(
            "Blender before 5.2 has a GPU in background only after a render: call bpy.ops.render.render() first"
        ) from error
