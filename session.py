"""One viewport or one final render: its scene, its GPU copies, its renderer. The only state that outlives a callback.

Data flows one way: ``Session.sync`` reads Blender (CPU only, on any thread); ``Session.picture`` and what it returns
work on the GPU (on the thread that has the context).
"""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from .device.blender import BlenderDevice
from .frame import Frame
from .gpu_scene import GpuScene
from .gpu_shaders.frame import DISPLAY, SPLIT
from .gpu_shaders.technique import Setting, Value
from .renderer import Renderer, RsmBuffers
from .scene.changes import Changes
from .scene.data import BakeState, Scene, View
from .scene.follow import SceneFollower
from .settings import VIEWPORT_SETTINGS, Settings, named_settings

T = TypeVar("T")
# In each redraw of a viewport; until the programs of all materials are there, some are shown by their constants.
SECONDS_OF_COMPILING = 0.05


@dataclass
class Status:
    """What the status panel shows of a session."""

    device: str = ""
    error: str = ""
    warnings: tuple[str, ...] = ()
    statistics: Mapping[str, float] = field(default_factory=dict)
    samples: int = 0
    seconds: Mapping[str, float] = field(default_factory=dict)  # by pass, of the newest sample, while they are timed
    redrawn: Mapping[str, float] = field(default_factory=dict)  # what of the statistics grew since the picture began
    bakes: Mapping[Hashable, BakeState] = field(default_factory=dict)  # Scene.bakes of the last sync
    region: int = 0  # address of the viewport's region, 0: no viewport


@dataclass(eq=False)
class Picture:
    """A picture that is being accumulated on the GPU, and what it was begun for."""

    device: BlenderDevice
    gpu_scene: GpuScene
    renderer: Renderer
    frame: Frame
    view: View
    settings: Settings
    status: Status
    _pieces: Iterator[float] | None = None  # of the sample under way
    _part: float = 0.0  # how far that is, 0..1
    _before: Mapping[str, float] = field(default_factory=dict)  # statistics when it was begun

    def __post_init__(self) -> None:
        self._before = dict(self.renderer.statistics())

    @property
    def samples(self) -> int:
        """Whole samples so far."""
        return self.frame.samples

    @property
    def done(self) -> float:
        """Samples so far, with the part of the one under way."""
        return self.samples + self._part

    def lacks(self, wanted: int) -> bool:
        """True if it has fewer samples than that, or what it shows is still to be replaced."""
        return self.samples < wanted or self.frame.provisional or self.gpu_scene.waits

    def piece(self) -> bool:
        """Do one bounded piece of GPU work; True when that completed a sample."""
        if self._pieces is None:
            self._pieces = self.renderer.sample(self.frame, self.gpu_scene, self.view, self.settings)
        self._part = next(self._pieces, 1.0)
        if self._part < 1.0:
            return False
        for _ in self._pieces:  # nothing is left but the generator's own end
            pass
        self._pieces, self._part = None, 0.0
        self.status.samples = self.samples
        self.status.statistics = found = dict(self.renderer.statistics())
        self.status.redrawn = {name: value - self._before.get(name, 0) for name, value in found.items()}
        self.status.seconds = dict(self.renderer.clock.seconds)
        return True

    def advance(self, seconds: float) -> None:
        """Work for about so long, but at least until there is a first sample and at most until there is one more."""
        end = time.perf_counter() + seconds
        while self.samples == 0 or time.perf_counter() < end:
            if self.piece():
                return

    def time_passes(self, wanted: bool) -> None:
        """Whether every pass from the next sample on is waited for and timed."""
        self.renderer.clock.on = wanted

    def show(self, split_place: float = 0.5) -> None:
        """Draw the picture so far into the framebuffer that is bound now.

        Where the settings ask for a split, what lies left of ``split_place`` (0..1) is drawn without bounced light.
        """
        image, without = self.renderer.texture(self.frame), self.renderer.unbounced(self.frame)
        if without is None:
            self.device.draw_to_current(DISPLAY, image_tx=image)
            return
        weight = 1.0 / self.samples
        self.device.draw_to_current(SPLIT, image_tx=image, without_tx=without, pc_place=split_place, pc_weight=weight)

    def read(self, key: str) -> np.ndarray:
        """One pass of the picture so far: (h, w, channels) float32, row 0 at the bottom."""
        return self.renderer.read(self.frame, key)

    def is_for(self, view: View, settings: Settings) -> bool:
        """True if the picture was begun for this view with these settings."""
        return self.settings == settings and same_view(self.view, view)

    def free(self) -> None:
        """Give its GPU memory back."""
        self._pieces = None
        self.renderer.free_frame(self.frame)


class _Gpu:
    """The GPU side of a session. Raises DeviceError without a usable GPU."""

    def __init__(self) -> None:
        self.device = BlenderDevice()
        self.scene = GpuScene(self.device)
        self.renderer = Renderer(self.device)
        self.holds: Scene | None = None  # what the GPU scene was updated to

    def upload(self, scene: Scene) -> bool:
        """Make the GPU hold ``scene``; True if that changes the picture."""
        if self.holds is scene:
            return False
        changes = Changes.between(self.holds, scene)
        self.scene.update(scene, changes)
        self.holds = scene
        return changes.any

    def free(self) -> None:
        self.renderer.free()
        self.scene.free()
        self.device.close()


class Session:
    """One viewport or one final render. ``free`` it on the thread that has the GPU context."""

    def __init__(self) -> None:
        self.scene = Scene()
        self.status = Status()
        self._follower = SceneFollower()
        self._in_viewport = False
        self._gpu: _Gpu | None = None
        self._picture: Picture | None = None
        SESSIONS.alive.add(self)

    def sync(self, depsgraph, *, for_viewport: bool, **options: Any) -> None:
        """Read the depsgraph: CPU work, on any thread. ``options`` are further ones of ``SceneFollower.read``."""
        self._in_viewport = for_viewport
        self.scene = self._follower.read(depsgraph, for_viewport=for_viewport, **options)
        self.status.warnings = (*self.scene.warnings, *_missing(self.scene))
        self.status.error, self.status.bakes = "", self.scene.bakes

    def picture(self, view: View, settings: Settings, passes: Sequence[str]) -> Picture:
        """Bring the GPU up to date; the last picture if scene, view and settings are still the same, else an empty one.

        ``passes`` are the keys of those that can be read of it; a session always asks for the same.
        Raises DeviceError without a usable GPU and RenderError for a picture that the GPU cannot hold.
        """
        gpu = self._ready()
        changed = gpu.upload(self.scene)
        if self._in_viewport:
            changed |= gpu.scene.compile(SECONDS_OF_COMPILING)
        old = self._picture
        if old and not changed and old.is_for(view, settings):
            return old
        frame = self._empty_frame(gpu, view, passes)
        self._picture = Picture(gpu.device, gpu.scene, gpu.renderer, frame, view, settings, self.status)
        return self._picture

    def _empty_frame(self, gpu: _Gpu, view: View, passes: Sequence[str]) -> Frame:
        """The last picture's frame, emptied, if it has the right size; else a new one."""
        old, self._picture = self._picture, None
        if old and (old.frame.width, old.frame.height) == (view.width, view.height):
            gpu.renderer.restart(old.frame)
            return old.frame
        if old:
            old.free()
        return gpu.renderer.begin(view, passes)

    def rsm_buffers(self, settings: Settings) -> list[RsmBuffers]:
        """Every light's reflective shadow map, for the scene of the last sync."""
        gpu = self._ready()
        gpu.upload(self.scene)
        return gpu.renderer.rsm_buffers(gpu.scene, settings)

    def in_timer(self, call: Callable[[], T]) -> T:
        """Do GPU work from a timer of Blender's: in whatever context, and done when this returns.

        Work that was only queued would keep Blender's own drawing waiting, for longer than any timer knows.
        """
        if self._gpu:
            self._gpu.device.context_may_differ()
        result = call()
        if self._gpu:
            self._gpu.device.finish()
        return result

    def free(self) -> None:
        """Give back all GPU memory; the next picture starts from nothing. Harmless when repeated."""
        gpu, picture, self._gpu, self._picture = self._gpu, self._picture, None, None
        if picture:
            picture.free()
        if gpu:
            gpu.free()

    def _ready(self) -> _Gpu:
        if self._gpu is None:
            self._gpu = _Gpu()
            self.status.device = self._gpu.device.name
        return self._gpu


class Sessions:
    """What outlives every engine object: which sessions there are, and what the newest picture was made with."""

    def __init__(self) -> None:
        self.alive: weakref.WeakSet[Session] = weakref.WeakSet()
        self.newest = Status()  # of the session that rendered last, for the panel

    def status_of(self, region: int) -> Status | None:
        """That of the viewport in the region at this address, if there is one."""
        return next((session.status for session in self.alive if session.status.region == region), None)

    def free_all(self) -> None:
        """Free every session, whether its engine is alive or not. To be called on the main thread."""
        for session in list(self.alive):
            session.free()
        self.newest = Status()


# Module-level, because Blender gives panels and the disabling of an extension no way to the engine objects.
SESSIONS = Sessions()


def read_settings(scene, *, viewport: bool) -> Settings:
    """The values of ``scene.rebound``; the viewport's own where a setting has them.

    A choice that a newer Rebound made reads as nothing: its default is used, which the panel says (ui.versions).
    """
    group = scene.rebound

    def value(name: str, setting: Setting) -> Value:
        default = setting.viewport_default if viewport else None
        own = default is not None
        found = getattr(group, f"viewport_{name}" if own else name)
        if setting.kind == "ENUM" and not found:
            return default if own else setting.default
        return found

    values = {name: value(name, setting) for name, setting in named_settings()}
    for setting in VIEWPORT_SETTINGS:
        values[setting.name] = getattr(group, f"viewport_{setting.name}") if viewport else setting.default
    return Settings(values)


def same_view(a: View, b: View) -> bool:
    """True if both views show the same pixels."""
    return (
        (a.width, a.height) == (b.width, b.height)
        and np.array_equal(a.view_from_world, b.view_from_world)
        and np.array_equal(a.clip_from_view, b.clip_from_view)
    )


def _missing(scene: Scene) -> tuple[str, ...]:
    """A line for what makes a picture empty or dark though nothing is wrong with it."""
    if not scene.instances:
        return ("The scene has nothing to draw: the picture shows the background only",)
    used = {index for instance in scene.instances for index in instance.materials}
    shines = scene.world.shines or any(any(scene.materials[index].emission) for index in used)
    if not scene.lights and not shines:
        return ("The scene has no light: no lamp, no emission, and a black world",)
    return ()
