"""A viewport without a window, for the tests of what viewports draw."""

from types import SimpleNamespace

import bpy
import gpu
import numpy as np

from rebound import engine
from rebound.tests.support.engine_build import HEIGHT, WIDTH
from rebound.viewport import Viewport


class View:
    """A viewport with the region that Blender would give it."""

    def __init__(self, scene, width=WIDTH, height=HEIGHT):
        self.scene = scene
        self.viewport = Viewport()
        camera = scene.camera
        bpy.context.view_layer.update()
        projection = camera.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=width, y=height)
        region_data = SimpleNamespace(
            view_matrix=camera.matrix_world.inverted(), window_matrix=projection, view_perspective="PERSP"
        )
        space = SimpleNamespace(use_render_border=False)
        region = SimpleNamespace(width=width, height=height, as_pointer=lambda: id(self))
        self.context = SimpleNamespace(region=region, region_data=region_data, space_data=space)

    def update(self):
        # Local view is asked of a real 3D viewport, which there is none of in background.
        self.viewport.session.sync(bpy.context.evaluated_depsgraph_get(), for_viewport=True)
        self.viewport.error, self.viewport._failed_for, self.viewport._synced = "", None, True

    def draw(self):
        """One redraw; the pixels of the region, row 0 at the bottom."""
        region = self.context.region
        target = gpu.types.GPUOffScreen(region.width, region.height, format="RGBA32F")
        with target.bind():
            framebuffer = gpu.state.active_framebuffer_get()
            framebuffer.clear(color=(0, 0, 0, 0))
            with engine.boundary(self.viewport.fail):
                self.viewport.draw(self.context, bpy.context.evaluated_depsgraph_get())
            buffer = framebuffer.read_color(0, 0, region.width, region.height, 4, 0, "FLOAT")
        buffer.dimensions = region.width * region.height * 4
        pixels = np.array(buffer, np.float32).reshape(region.height, region.width, 4)
        target.free()
        return pixels

    def set_border(self, low, high):
        """The viewport's render region, from (x, y) to (x, y) in parts of the region."""
        space = self.context.space_data
        space.use_render_border = True
        space.render_border_min_x, space.render_border_min_y = low
        space.render_border_max_x, space.render_border_max_y = high

    def finish(self):
        """Redraw until the picture is finished; the last pixels."""
        for _ in range(200):
            pixels = self.draw()
            if not self.viewport.unfinished:
                return pixels
        raise AssertionError("the viewport never finishes")

    @property
    def picture(self):
        return self.viewport.session._picture
