"""A scene on a device, rendered as a viewport or a final render does it, without Blender."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rebound.device import Device
from rebound.frame import Frame
from rebound.gpu_scene import GpuScene
from rebound.gpu_shaders import TECHNIQUES
from rebound.passes import PASSES
from rebound.renderer import ALL_PASSES, Renderer
from rebound.scene.changes import Changes
from rebound.scene.data import Scene, View
from rebound.settings import SETTINGS, Settings, Value

from .pictures import KEPT_PASSES, Passes

VIEWPORT = ("combined",)  # all that a viewport shows


@dataclass(frozen=True)
class Method:
    """A way to compute indirect light, by the settings that choose it."""

    label: str
    changed: Mapping[str, Value]

    def settings(self, *, viewport: bool, **more: Value) -> Settings:
        """The defaults but for what makes the method, and ``more``."""
        return Settings.defaults(viewport=viewport, **{**self.changed, **more})


def methods(*, estimators: bool = False, many_bounces: bool = False) -> list[Method]:
    """Every technique with one bounce and else its default settings, the engine's default first.

    With ``estimators`` also those that are no default; with ``many_bounces`` what can bounce more than once does so,
    too, for references that have all bounces.
    """
    found = []
    default = next(setting.default for setting in SETTINGS if setting.name == "method")
    for technique in sorted(TECHNIQUES, key=lambda t: t.id.upper() != default):
        chosen: dict[str, Value] = {"method": technique.id.upper()}
        bounces = f"{technique.id}_bounces"
        if any(setting.name == "bounces" for setting in technique.settings):
            chosen[bounces] = "ONE"
        found.append(Method(technique.label, dict(chosen)))
        for setting in technique.settings:
            if many_bounces and setting.name == "bounces":
                found.append(Method(f"{technique.label}, many bounces", {**chosen, bounces: "MANY"}))
            others = [item for item in setting.items if item.key != setting.default]
            if estimators and setting.name == "estimator":
                names = ({**chosen, f"{technique.id}_{setting.name}": item.key} for item in others)
                found += [Method(f"{technique.label}, {i.label}", n) for i, n in zip(others, names, strict=True)]
    return found


class Studio:
    """Holds one scene and one picture of it, as a session does. Calls wait for the GPU only where they say so."""

    def __init__(self, device: Device, settings: Settings, passes: Sequence[str] = ALL_PASSES) -> None:
        self.device, self.settings, self._wanted = device, settings, passes
        self.gpu_scene = GpuScene(device)
        self.renderer = Renderer(device)
        self._holds: Scene | None = None
        self._frame: Frame | None = None
        self._view: View | None = None

    @property
    def frame(self) -> Frame:
        assert self._frame is not None, "begin() comes first"
        return self._frame

    def show(self, scene: Scene) -> None:
        """Upload what differs from the last scene."""
        self.gpu_scene.update(scene, Changes.between(self._holds, scene))
        self._holds = scene

    def begin(self, view: View) -> None:
        """An empty picture of ``view``: the last one emptied where the size is the same, as in a viewport."""
        if self._frame and (self._frame.width, self._frame.height) == (view.width, view.height):
            self.renderer.restart(self._frame)
        else:
            if self._frame:
                self.renderer.free_frame(self._frame)
            self._frame = self.renderer.begin(view, self._wanted)
        self._view = view

    def sample(self) -> None:
        """Add one sample to the picture."""
        assert self._view is not None, "begin() comes first"
        for _ in self.renderer.sample(self.frame, self.gpu_scene, self._view, self.settings):
            pass

    def display(self) -> None:
        """Draw the picture so far, for the screen, and wait until it is there."""
        self.renderer.texture(self.frame)
        self.device.finish()

    def shown(self) -> np.ndarray:
        """What the screen shows: (h, w, 3) float32, row 0 at the top."""
        return self.device.read(self.renderer.texture(self.frame))[::-1, :, :3]

    def passes(self) -> Passes:
        """The passes that are compared, row 0 at the top."""
        wanted = [p for p in PASSES if p.label in KEPT_PASSES]
        return {p.label: self.renderer.read(self.frame, p.key)[::-1, :, :3] for p in wanted}

    def read(self, key: str) -> np.ndarray:
        """One pass by its key, row 0 at the top."""
        return self.renderer.read(self.frame, key)[::-1]

    def free(self) -> None:
        """Give all GPU memory back; the device stays."""
        if self._frame:
            self.renderer.free_frame(self._frame)
        self._frame = None
        self.renderer.free()
        self.gpu_scene.free()


def rendered(device: Device, scene: Scene, view: View, settings: Settings, samples: int) -> Iterator[Studio]:
    """A studio after each of ``samples`` samples; freed when the last one was taken or the caller stops."""
    studio = Studio(device, settings)
    try:
        studio.show(scene)
        studio.begin(view)
        for _ in range(samples):
            studio.sample()
            yield studio
    finally:
        studio.free()


def picture(device: Device, scene: Scene, view: View, settings: Settings, samples: int) -> np.ndarray:
    """What the screen shows after so many samples, rendered from nothing."""
    shown = np.zeros((view.height, view.width, 3), np.float32)
    for studio in rendered(device, scene, view, settings, samples):
        if studio.frame.samples == samples:
            shown = studio.shown()
    return shown


def seconds(device: Device, call: Callable[[], object]) -> float:
    """How long a call takes, with the GPU waited for before and after."""
    device.finish()
    start = time.perf_counter()
    call()
    device.finish()
    return time.perf_counter() - start


def resized(view: View, width: int, height: int) -> View:
    """The view as a picture of another size: its longer side keeps its field, as with Blender's automatic fit."""
    clip = np.array(view.clip_from_view)
    longer = clip[0, 0] if view.width >= view.height else clip[1, 1]
    size = max(width, height)
    clip[0, 0], clip[1, 1] = longer * size / width, longer * size / height
    return replace(view, clip_from_view=clip, width=width, height=height)
