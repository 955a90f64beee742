"""Times of each pass on one GPU, raster and compute apart: the same renderer on a headless device, without Blender."""

from __future__ import annotations

import statistics
from dataclasses import dataclass, field

from rebound.device.headless import HeadlessDevice
from rebound.scene.data import Scene, View

from .results import Pass
from .studio import Method, Studio, seconds
from .timed_device import COMPUTE, RASTER, UPLOAD, TimedDevice, median_passes


@dataclass(frozen=True)
class GpuRun:
    """One scene with one method: what a first frame, a steady one and their passes took."""

    device: str
    clock: str  # how the passes were timed
    scene: str
    method: str
    settings: str  # viewport or final
    size: tuple[int, int]
    first: float  # seconds: shaders compiled, scene uploaded, first frame
    frame: float  # seconds of a steady frame, the GPU waited for at its end only
    passes: list[Pass] = field(default_factory=list)

    def total(self, kind: str) -> float:
        """Milliseconds a frame of one kind of work."""
        return sum(p.milliseconds for p in self.passes if p.kind == kind)


def measure(
    name: str, scene: Scene, view: View, method: Method, *, viewport: bool, frames: int, warm_up: int = 3
) -> GpuRun:
    """Time a still picture getting better, on a device of its own."""
    device = HeadlessDevice()
    try:
        settings = method.settings(viewport=viewport)
        studio = Studio(device, settings)

        def frame() -> None:
            studio.sample()
            studio.display()

        first = seconds(device, lambda: (studio.show(scene), studio.begin(view), frame()))
        for _ in range(warm_up):
            frame()
        steady = statistics.median(seconds(device, frame) for _ in range(frames))
        studio.free()
        timed = TimedDevice(device)
        passes = _passes(timed, scene, view, settings, frames, warm_up)
        kind = "viewport" if viewport else "final"
        size = (view.width, view.height)
        return GpuRun(device.name, timed.clock.name, name, method.label, kind, size, first, steady, passes)
    finally:
        device.close()


def _passes(timed: TimedDevice, scene: Scene, view: View, settings, frames: int, warm_up: int) -> list[Pass]:
    studio = Studio(timed.as_device, settings)
    studio.show(scene)
    studio.begin(view)
    seen = []
    for _ in range(warm_up + frames):
        timed.passes()
        studio.sample()
        studio.display()
        seen.append(timed.passes())
    studio.free()
    return median_passes(seen[warm_up:])


def lines(run: GpuRun) -> list[str]:
    """The run as text for a terminal."""
    width, height = run.size
    text = [
        f"{run.scene}, {width} x {height}, {run.method}, {run.settings} settings",
        f"  first frame {1000 * run.first:.1f} ms, a steady one {1000 * run.frame:.3f} ms; passes by {run.clock}:",
    ]
    for p in run.passes:
        text.append(f"  {p.milliseconds:10.3f} ms  {p.kind:8} {p.calls:4g} x  {p.name}")
    totals = ", ".join(f"{kind} {run.total(kind):.3f} ms" for kind in (RASTER, COMPUTE, UPLOAD))
    return [*text, f"  together: {totals}"]
