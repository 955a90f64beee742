"""What a picture is accumulated in: G-buffer and light of a sample, the sums over samples, and their targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

from .device.interface import Device, Target, Texture
from .gpu_shaders.frame.inputs import GBuffer, LightTargets
from .gpu_shaders.frame.shaders import SUMS
from .gpu_shaders.frame.views import Extras
from .passes import PASSES

WAYS = ("direct", "indirect")
LIGHTS = tuple(field.name for field in fields(LightTargets))
# Sums in one accumulation: as many as a GPU draws into at once.
SUMS_A_PASS = 6


@dataclass(eq=False)
class Frame:
    """The running sum of one picture: ``samples`` of it so far."""

    width: int
    height: int
    gbuffer: GBuffer
    gbuffer_target: Target
    emission_target: Target  # the G-buffer's emission alone
    passed_target: Target  # what is passed on the way to what is seen
    tint_target: Target  # that, and all of the G-buffer that it colours
    background_target: Target  # what of the G-buffer means something where there is no surface
    light: LightTargets
    direct_target: Target  # both direct ones of ``light``
    indirect_target: Target  # both indirect ones
    sums: Mapping[str, Texture]  # those of SUMS that its passes need
    sum_targets: Mapping[tuple[str, ...], Target]  # by the sums in their slots
    geometry: tuple[Texture, ...]  # position and depth, normal: of the first sample; none where no pass needs them
    geometry_target: Target | None
    resolved: Texture
    resolved_target: Target
    extras: Extras  # what a view or the split wants beside all that
    samples: int = 0
    follows: bool = False  # whether it was restarted, not begun
    provisional: bool = False  # whether the next sample begins anew, as the newest was made in haste
    is_resolved: bool = False  # whether the texture for the screen holds the newest mean
    is_glossy: bool = False  # whether there may be something in the glossy targets

    @property
    def resources(self) -> tuple[Texture | Target, ...]:
        """Everything to free: framebuffers before their textures."""
        targets = (
            self.gbuffer_target,
            self.emission_target,
            self.passed_target,
            self.tint_target,
            self.background_target,
            *self._lights,
            self.direct_target,
            self.indirect_target,
            *self.sum_targets.values(),
            *((self.geometry_target,) if self.geometry_target else ()),
            self.resolved_target,
        )
        textures = (
            *self.gbuffer.colors,
            self.gbuffer.depth,
            self.gbuffer.passed,
            *(target.colors[0] for target in self._lights),
            *self.sums.values(),
            *self.geometry,
            self.resolved,
        )
        return (*targets, *textures)

    @property
    def _lights(self) -> tuple[Target, ...]:
        return tuple(getattr(self.light, name) for name in LIGHTS)


def new_frame(device: Device, width: int, height: int, passes: Sequence[str]) -> Frame:
    """An empty one, of which these passes can be read."""

    def texture(name: str) -> Texture:
        return device.texture((width, height), name)

    gbuffer = GBuffer(
        albedo=texture("RGBA16F"),
        emission=texture("RGBA32F"),
        position=texture("RGBA32F"),
        normal=texture("RGBA32F"),
        specular=texture("RGBA16F"),
        depth=texture("DEPTH32F"),
        passed=texture("RGBA16F"),
    )
    light = LightTargets(**{name: device.target([texture("RGBA32F")]) for name in LIGHTS})
    direct, indirect = ([getattr(light, f"{kind}_{way}").colors[0] for kind in ("diffuse", "glossy")] for way in WAYS)
    needs = {"combined"}.union(*(p.needs for p in PASSES if p.key in passes))
    names = [name for name in SUMS if name in needs]
    sums = {name: texture("RGBA32F") for name in names}
    parts = [tuple(names[first : first + SUMS_A_PASS]) for first in range(0, len(names), SUMS_A_PASS)]
    geometry = (texture("RGBA32F"), texture("RGBA32F")) if needs & {"position_depth", "normal"} else ()
    resolved = texture("RGBA32F")
    return Frame(
        width,
        height,
        gbuffer,
        device.target(gbuffer.colors, gbuffer.depth),
        device.target([gbuffer.emission]),
        device.target([gbuffer.passed]),
        device.target([gbuffer.albedo, gbuffer.emission, gbuffer.specular, gbuffer.passed], gbuffer.depth),
        device.target([gbuffer.albedo, gbuffer.position], gbuffer.depth),
        light,
        device.target(direct),
        device.target(indirect),
        sums,
        {part: device.target([sums[name] for name in part]) for part in parts},
        geometry,
        device.target(geometry) if geometry else None,
        resolved,
        device.target([resolved]),
        Extras(device, (width, height)),
    )
