"""A render engine that runs one function in render(), where Blender's own camera, border and depsgraph are at hand."""

from __future__ import annotations

from contextlib import contextmanager

import bpy


@contextmanager
def probe_engine(function):
    """Within the context the scene renders with an engine that calls ``function(engine, depsgraph)``.

    Yields a function that renders and returns what ``function`` returned; an exception in it is raised again.
    """
    results = []

    class ProbeEngine(bpy.types.RenderEngine):
        bl_idname = "REBOUND_TEST_PROBE"
        bl_label = "Probe"

        def render(self, depsgraph):
            try:
                results.append((function(self, depsgraph), None))
            except Exception as error:  # noqa: BLE001  raised again below: Blender would only print it
                results.append((None, error))

    def render():
        results.clear()
        bpy.context.scene.render.engine = ProbeEngine.bl_idname
        bpy.ops.render.render()
        result, error = results[-1]
        if error is not None:
            raise error
        return result

    bpy.utils.register_class(ProbeEngine)
    try:
        yield render
    finally:
        bpy.utils.unregister_class(ProbeEngine)
