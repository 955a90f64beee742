"""A 3D viewport: syncs a session, draws its picture better with every redraw, and shows an error as text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager

import blf
import gpu
from mathutils import Matrix

from .main_thread import MAIN_THREAD
from .scene.cameras import Border, region_border, region_view
from .scene.data import Scene
from .session import SESSIONS, Session, read_settings
from .settings import Settings

# Seconds of work between two redraws once there is a picture; navigation waits no longer than this.
SECONDS_PER_DRAW = 0.1
SHOWN = ("combined",)  # the passes of a viewport
TEXT_SIZE = 14  # pixels
TEXT_COLOR = (1.0, 0.3, 0.1, 1.0)


class Viewport:
    """What one RenderEngine object of a viewport holds."""

    def __init__(self) -> None:
        self.session = Session()
        self.error = ""
        self.progress = ""  # one line for Blender to show in the corner
        self.unfinished = False  # True if another redraw would make the picture better
        self._synced = False
        self._failed_for: tuple[Settings, int, int] | None = None  # what is not tried again before an edit

    def update(self, context, depsgraph) -> None:
        """Blender's data changed. CPU work only."""
        space = context.space_data
        self.error, self._failed_for, self._synced = "", None, False
        SESSIONS.newest = self.session.status
        self.session.sync(
            depsgraph, for_viewport=True, visible=lambda obj: obj.visible_in_viewport_get(space), shows=_shows(space)
        )
        self._synced = True

    def draw(self, context, depsgraph) -> None:
        """Work on the picture for a bounded time and draw it."""
        border = region_border(context.region, context.region_data, context.space_data, depsgraph.scene)
        view = region_view(context.region, context.region_data, border)
        settings = _of_active_light(read_settings(depsgraph.scene, viewport=True), self.session.scene, depsgraph)
        attempt = (settings, view.width, view.height)
        if not self._synced or attempt == self._failed_for:
            return
        self._failed_for = attempt  # until it went well
        self.session.status.region = context.region.as_pointer()
        picture, wanted = self.session.picture(view, settings, SHOWN), int(settings["samples"])
        picture.time_passes(depsgraph.scene.rebound.viewport_stats)
        # A final render shares the main thread: beside a viewport that goes on it would hardly get anywhere.
        working = picture.lacks(wanted) and not (picture.samples and MAIN_THREAD.is_busy())
        if working:
            picture.advance(SECONDS_PER_DRAW)
        with _within(border):
            picture.show(_split_place(depsgraph.scene.rebound.viewport_split_place, context.region, border))
        self._failed_for, self.error = None, ""
        self.unfinished = working and picture.lacks(wanted)
        waits = picture.gpu_scene.waits
        self.progress = "Compiling materials" if waits else f"Sample {picture.samples}/{wanted}"

    def fail(self, message: str) -> None:
        """Show ``message`` until the next edit, which tries again from nothing."""
        self.error = self.session.status.error = message
        self.progress, self.unfinished = "", False
        self.session.free()

    def draw_error(self, context) -> None:
        """The error as text in the middle of the region, if there is one."""
        if not self.error:
            return
        region = context.region
        lines = textwrap.wrap(f"Rebound: {self.error}", max(region.width // TEXT_SIZE - 4, 20))
        with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():  # type: ignore[attr-defined]
            gpu.matrix.load_identity()
            gpu.matrix.load_projection_matrix(_pixel_space(region.width, region.height))
            blf.size(0, TEXT_SIZE)
            blf.color(0, *TEXT_COLOR)
            for number, line in enumerate(lines):
                left = (region.width - blf.dimensions(0, line)[0]) / 2
                blf.position(0, left, region.height / 2 - number * 1.5 * TEXT_SIZE, 0)
                blf.draw(0, line)


def _of_active_light(settings: Settings, scene: Scene, depsgraph) -> Settings:
    """The settings with the active light's number in the place of 0, where a view asks whose maps it is to show."""
    if settings["show_light"] or "_MAP" not in str(settings["show"]):
        return settings
    active = depsgraph.view_layer.objects.active
    names = [light.name for light in scene.lights]
    number = names.index(active.name) + 1 if active is not None and active.name in names else 0
    return Settings({**settings.values, "show_light": number})


def _shows(space) -> tuple[bool, ...] | None:
    """The kinds of objects that a 3D viewport shows; None where it shows some objects only, as in local view."""
    if space.local_view is not None or space.use_local_collections:
        return None
    kinds = ("mesh", "curve", "surf", "meta", "font", "curves", "pointcloud", "light", "empty")
    return tuple(getattr(space, f"show_object_viewport_{kind}") for kind in kinds)


@contextmanager
def _within(border: Border | None) -> Iterator[None]:
    """Full-screen draws fill only the border's pixels of the region."""
    whole = gpu.state.viewport_get()
    if border is not None:
        left, bottom, right, top = border
        gpu.state.viewport_set(whole[0] + left, whole[1] + bottom, right - left, top - bottom)
    try:
        yield
    finally:
        gpu.state.viewport_set(*whole)


def _split_place(place: float, region, border: Border | None) -> float:
    """Where the divider of a split view stands in what is drawn, 0 to 1, from where it stands in the region."""
    if border is None:
        return place
    left, _bottom, right, _top = border
    return min(max((place * region.width - left) / (right - left), 0.0), 1.0)


def _pixel_space(width: int, height: int) -> Matrix:
    """Projection from pixels of a region, origin at its lower left, to clip space."""
    return Matrix(((2 / width, 0, 0, -1), (0, 2 / height, 0, -1), (0, 0, -1, 0), (0, 0, 0, 1)))
