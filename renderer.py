"""One frame: what the camera sees, direct light, one technique's indirect light, summed over anti-aliasing samples.

The renderer knows no Blender. It works in pieces of bounded GPU time: ``sample`` is a generator, so that the caller
can show progress, keep an interface alive, and cancel between two pieces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from .baked_light import BakedLight
from .device.interface import Device, DrawState, Target, Texture
from .frame import LIGHTS, Frame, new_frame
from .gpu_scene import Draw, GpuScene
from .gpu_shaders import TECHNIQUES
from .gpu_shaders.frame.clock import Clock
from .gpu_shaders.frame.direct import DirectLight
from .gpu_shaders.frame.draws import ADD, draw_scene, visible_draws
from .gpu_shaders.frame.inputs import FrameInputs, GBuffer
from .gpu_shaders.frame.pixel_filter import pixel_offset
from .gpu_shaders.frame.reflective_maps import ReflectiveShadowMaps
from .gpu_shaders.frame.shaders import GBUFFER, GEOMETRY, RESOLVE, TINT, accumulate
from .gpu_shaders.frame.views import (
    LAMPS,
    MOMENTS,
    SHOWN,
    TRANSFER,
    UNBOUNCED,
    VIEWS,
    draw_technique_view,
    draw_view,
    needed,
)
from .gpu_shaders.technique import DebugView, Technique
from .passes import PASSES
from .scene.data import View, Visibility
from .settings import Settings, shown_view

# How far a sample is after each step, for the progress bar: about their shares of the time.
GBUFFER_DONE, DIRECT_DONE, INDIRECT_DONE = 0.1, 0.4, 0.95

ALL_PASSES = tuple(p.key for p in PASSES)


class RenderError(RuntimeError):
    """A picture that cannot be rendered as asked; the message is one line for the user."""


@dataclass(frozen=True, eq=False)
class RsmBuffers:
    """One face of one light's reflective shadow map, read back.

    ``layers``, float32 with row 0 at the bottom: depth (h, w, 1), metres along the face's axis, 0 where the light sees
    nothing; position, world; normal, unit; flux, watts, all (h, w, 3).
    """

    light: str
    face: str
    layers: Mapping[str, np.ndarray]


class Renderer:
    """Owns the passes and their GPU resources; one per session."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._direct = DirectLight(device)
        self._baked = BakedLight(device)
        self._techniques: dict[str, Technique] = {}
        self._triangles = self._lights = 0
        self.clock = Clock(device)

    def begin(self, view: View, passes: Sequence[str] = ALL_PASSES) -> Frame:
        """An empty frame of the view's size, of which these passes can be read.

        Raises RenderError where the GPU has no texture of that size.
        """
        size = (view.width, view.height)
        largest = self.device.max_texture_size
        if max(size) > largest or min(size) < 1:
            raise RenderError(
                f"A picture of {size[0]} x {size[1]} pixels is not possible: this GPU takes 1 to {largest} a side"
            )
        return new_frame(self.device, *size, passes)

    def restart(self, frame: Frame) -> None:
        """Empty a frame for another picture of its size: much quicker than to begin one."""
        frame.samples = 0  # the next sample covers the sums
        frame.follows, frame.provisional, frame.is_resolved = True, False, False

    def sample(self, frame: Frame, gpu_scene: GpuScene, view: View, settings: Settings) -> Iterator[float]:
        """Add one anti-aliased sample to ``frame``; yields progress 0..1 after every bounded piece of GPU work.

        Stop iterating to cancel: the frame then still is the mean of its whole samples.
        """
        for done in self._sample(frame, gpu_scene, view, settings):
            self.clock.pause()
            yield done
            self.clock.resume()

    def _sample(self, frame: Frame, gpu_scene: GpuScene, view: View, settings: Settings) -> Iterator[float]:
        if frame.provisional:
            self.restart(frame)
        self.clock.begin()
        inputs = _inputs(frame, gpu_scene, view, int(settings["seed"]), self.clock.mark)
        gpu_scene.look_from(view)
        self._triangles, self._lights = gpu_scene.triangle_count, len(gpu_scene.scene.lights)
        technique = self._technique(settings)
        shown = shown_view(settings)
        frame.extras.keep(needed(shown, split=bool(settings["split"])))
        passed = gpu_scene.seen_through
        if passed:
            self.device.clear(frame.passed_target, color=(1.0, 1.0, 1.0, 1.0))
        if passed and not gpu_scene.environment.has_background:
            self.device.clear(frame.emission_target, color=(*_background(gpu_scene), 0.0))
        self._draw_gbuffer(frame, inputs)
        if _has_panorama(gpu_scene):
            gpu_scene.environment.draw_background(inputs, frame.emission_target)
        if passed:
            self._tint(frame, inputs, passed)
        self.clock.mark("surfaces")
        yield GBUFFER_DONE
        for done in self._draw_direct(frame, inputs, settings):
            yield GBUFFER_DONE + (DIRECT_DONE - GBUFFER_DONE) * done
        self.clock.mark("direct light")
        if LAMPS in frame.extras:
            self._add_up(frame, inputs, {("combined",): frame.extras[LAMPS]}, DrawState(), indirect=False)
        if settings["indirect"] and self._baked.update(gpu_scene, settings):
            self._baked.draw(inputs, frame.light, glossy=frame.is_glossy)
            self.clock.mark("baked light")
        # A view of what a technique does is asked of one that does it.
        bounced = technique is not None and (bool(settings["indirect"]) or shown in technique.views)
        if technique is not None and bounced:
            for done in technique.indirect(inputs, settings.of(technique.id), frame.light):
                yield DIRECT_DONE + (INDIRECT_DONE - DIRECT_DONE) * done
        frame.provisional = technique is not None and bounced and technique.provisional
        self._accumulate(frame, inputs, indirect=bounced)
        if shown is not TRANSFER:
            self._baked.end_view()
        if shown is not None:
            self._show(frame, inputs, shown, settings, bounced)
        self.clock.mark("sum")
        self.clock.end()
        frame.is_resolved = False
        yield 1.0

    def texture(self, frame: Frame) -> Texture:
        """RGBA32F mean of the picture so far, or of the view in its place; for the screen, until the next call."""
        picture = frame.extras.texture(SHOWN) or frame.sums["combined"]
        if frame.samples == 1:
            return picture
        if not frame.is_resolved:  # a redraw where nothing changed has it already
            weight = 1.0 / frame.samples if frame.samples else 0.0
            self.device.fullscreen(RESOLVE, frame.resolved_target, sum_tx=picture, pc_weight=weight)
            frame.is_resolved = True
        return frame.resolved

    def unbounced(self, frame: Frame) -> Texture | None:
        """The sum over ``frame.samples`` of the picture without what the technique adds; None unless it is wanted."""
        is_picture = frame.samples > 0 and SHOWN not in frame.extras
        return frame.extras.texture(UNBOUNCED) if is_picture else None

    def read(self, frame: Frame, key: str) -> np.ndarray:
        """One pass: (h, w, channels) float32, row 0 at the bottom."""
        render_pass = next(p for p in PASSES if p.key == key)
        return render_pass.read(lambda name: self._mean(frame, name))

    def _mean(self, frame: Frame, name: str) -> np.ndarray:
        if name == "position_depth":
            return self.device.read(frame.geometry[0])
        if name == "normal":
            return self.device.read(frame.geometry[1])
        shown = frame.extras.texture(SHOWN) if name == "combined" else None
        return self.device.read(shown or frame.sums[name]) / np.float32(max(frame.samples, 1))

    def rsm_buffers(self, gpu_scene: GpuScene, settings: Settings) -> list[RsmBuffers]:
        """Every light's reflective shadow map, drawn for this scene."""
        maps = ReflectiveShadowMaps(self.device)
        try:
            for _ in maps.update(gpu_scene, int(settings["rsm_resolution"])):
                pass
            names = [light.name for light in gpu_scene.scene.lights]
            return [RsmBuffers(names[light], face, layers) for light, face, layers in maps.read()]
        finally:
            maps.free()

    def statistics(self) -> Mapping[str, float]:
        """Counts for the statistics panel and the tests."""
        result: dict[str, float] = {
            "lights": self._lights,
            "triangles": self._triangles,
            "gpu_bytes": self.device.allocated_bytes,
            "baked_updates": self._baked.updates,
            "shadow_maps": len(self._direct.maps.tiles),
            "shadow_maps_drawn": self._direct.maps.drawn,
            "shadow_resolution": self._direct.maps.atlas.tile if self._direct.maps.atlas else 0,
        }
        for technique in self._techniques.values():
            result.update(technique.statistics())
        return result

    def free_frame(self, frame: Frame) -> None:
        for resource in frame.resources:
            self.device.free(resource)
        frame.extras.free()

    def free(self) -> None:
        self._direct.free()
        self._baked.free()
        for technique in self._techniques.values():
            technique.free()
        self._techniques.clear()

    def _technique(self, settings: Settings) -> Technique | None:
        """The chosen technique; the one before it gives its memory back."""
        wanted = str(settings["method"]).lower()
        for name in [name for name in self._techniques if name != wanted]:
            self._techniques.pop(name).free()
        for kind in TECHNIQUES:
            if kind.id == wanted and wanted not in self._techniques:
                self._techniques[wanted] = kind(self.device)
        return self._techniques.get(wanted)

    def _draw_direct(self, frame: Frame, inputs: FrameInputs, settings: Settings) -> Iterator[float]:
        """Direct light into its targets; a scene without a specular lobe leaves the glossy ones zero."""
        glossy = inputs.gpu_scene.is_glossy
        if frame.is_glossy and not glossy:
            self.device.clear(frame.direct_target)
            self.device.clear(frame.indirect_target)
        frame.is_glossy = glossy
        yield from self._direct.draw(
            inputs,
            frame.direct_target if glossy else frame.light.diffuse_direct,
            glossy=glossy,
            filtered=settings["soft_shadows"] == "FILTERED",
            resolution=int(settings["shadow_resolution"]),
        )

    def _draw_gbuffer(self, frame: Frame, inputs: FrameInputs) -> None:
        self.device.clear(frame.background_target)
        draw_scene(
            self.device,
            inputs.gpu_scene,
            GBUFFER,
            frame.gbuffer_target,
            visible_draws(inputs.gpu_scene, Visibility.CAMERA | Visibility.HOLDOUT),
            pc_clip_from_world=inputs.clip_from_world,
            pc_eye=inputs.eye,
            pc_dither=inputs.noise_seed(4) + inputs.sample,
        )

    def _tint(self, frame: Frame, inputs: FrameInputs, passed: Sequence[Draw]) -> None:
        """Colour what is seen by what lies in front of it, which all let it through in this sample."""
        draw_scene(
            self.device,
            inputs.gpu_scene,
            TINT,
            frame.tint_target,
            passed,
            state=DrawState(depth_test="LESS", blend="MULTIPLY"),
            lets_pass=_decides_nothing,
            pc_clip_from_world=inputs.clip_from_world,
            pc_eye=inputs.eye,
        )

    def _accumulate(self, frame: Frame, inputs: FrameInputs, *, indirect: bool) -> None:
        """Add the sample to all sums."""
        state = ADD if frame.samples else DrawState()
        targets = dict(frame.sum_targets)
        if MOMENTS in frame.extras:
            targets[MOMENTS,] = frame.extras[MOMENTS]
        self._add_up(frame, inputs, targets, state, indirect=indirect)
        if UNBOUNCED in frame.extras:
            lamps = frame.extras[LAMPS].colors[0]
            self.device.fullscreen(RESOLVE, frame.extras[UNBOUNCED], state=state, sum_tx=lamps, pc_weight=1.0)
        if frame.samples == 0 and frame.geometry_target is not None:
            self.device.fullscreen(
                GEOMETRY,
                frame.geometry_target,
                position_tx=frame.gbuffer.position,
                normal_tx=frame.gbuffer.normal,
                pc_view_from_world=inputs.view.view_from_world,
            )
        frame.samples += 1

    def _add_up(
        self,
        frame: Frame,
        inputs: FrameInputs,
        targets: Mapping[tuple[str, ...], Target],
        state: DrawState,
        *,
        indirect: bool,
    ) -> None:
        """Draw the sample into ``targets``, by the sums in their slots."""
        scene, passed = inputs.gpu_scene.scene, bool(inputs.gpu_scene.seen_through)
        given: dict[str, Any] = {f"{name}_tx": getattr(frame.light, name).colors[0] for name in LIGHTS}
        given |= {f"{field.name}_tx": getattr(frame.gbuffer, field.name) for field in fields(GBuffer)}
        color = _background(inputs.gpu_scene)
        given["pc_background"] = (0.0, 0.0, 0.0, 0.0) if scene.film_transparent else (*color, 1.0)
        panorama = _has_panorama(inputs.gpu_scene) or (passed and not scene.film_transparent)
        given["pc_eye"] = inputs.eye
        for sums, target in targets.items():
            shader = accumulate(sums, glossy=frame.is_glossy, indirect=indirect, panorama=panorama, passed=passed)
            wanted = (*shader.samplers, *shader.constants)
            resources = {name: given[name] for name in wanted}
            self.device.fullscreen(shader, target, state=state, **resources)

    def _show(self, frame: Frame, inputs: FrameInputs, view: DebugView, settings: Settings, bounced: bool) -> None:
        """Draw what is shown in the place of the picture."""
        combined, scratch = frame.sums["combined"], frame.light.diffuse_indirect
        if view is TRANSFER:
            draw_technique_view(
                self.device,
                view,
                frame.extras,
                scratch,
                combined,
                frame.samples,
                lambda target: self._baked.view(inputs, settings, target),
            )
            return
        if view in VIEWS:
            if not bounced:
                self.device.clear(scratch)  # of an earlier sample
            draw_view(self.device, view, frame.extras, frame.gbuffer, frame.light, combined, frame.samples)
            return
        technique = self._technique(settings)
        assert technique is not None
        values, light = settings.of(technique.id), max(int(settings["show_light"]) - 1, 0)

        def draw(target: Target) -> None:
            technique.view(view.key, inputs, values, target, light)

        draw_technique_view(self.device, view, frame.extras, scratch, combined, frame.samples, draw)


def _decides_nothing(material: int) -> bool:
    return False


def _background(gpu_scene: GpuScene) -> tuple[float, float, float]:
    """Radiance of a background of one colour."""
    world = gpu_scene.scene.world
    return world.color if world.seen else (0.0, 0.0, 0.0)


def _has_panorama(gpu_scene: GpuScene) -> bool:
    """Whether the picture's background is more than one colour."""
    return gpu_scene.environment.has_background and not gpu_scene.scene.film_transparent


def _inputs(frame: Frame, gpu_scene: GpuScene, view: View, seed: int, mark: Callable[[str], None]) -> FrameInputs:
    """Everything that the passes of the frame's next sample share."""
    offset = pixel_offset(frame.samples, gpu_scene.scene.filter_width)
    jitter = np.eye(4)
    jitter[:2, 3] = 2 * offset / (view.width, view.height)
    clip_from_world = jitter @ view.clip_from_view @ view.view_from_world
    world_from_view = np.linalg.inv(view.view_from_world)
    eye = (*world_from_view[:3, 3], 1.0) if view.is_perspective else (*world_from_view[:3, 2], 0.0)
    return FrameInputs(gpu_scene, frame.gbuffer, view, frame.samples, seed, eye, clip_from_world, frame.follows, mark)
