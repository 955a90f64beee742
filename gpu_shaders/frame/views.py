"""Views of a frame that need no technique: parts of its light, its surfaces, and how sure its picture is."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from ...device.interface import Device, DrawState, Target, Texture
from ...device.shader import Shader
from ..technique import DebugView
from .draws import ADD
from .inputs import GBuffer, LightTargets
from .shaders import RESOLVE

DIRECT = DebugView(
    "DIRECT",
    "Direct Only",
    "The picture without what the method adds: light of lamps that arrives unreflected, and what glows by itself",
)
INDIRECT = DebugView(
    "INDIRECT",
    "Indirect Only",
    "What the method adds to the picture: bounced light, and light of glowing surfaces and of the sky that arrives on "
    "others. As bright as in the picture",
)
IRRADIANCE = DebugView(
    "IRRADIANCE",
    "Irradiance",
    "Light that arrives at surfaces, as if all were white and dull: direct and bounced light without the surfaces' "
    "own colours and reflections",
)
ALBEDO = DebugView(
    "ALBEDO",
    "Albedo",
    "The part of light that surfaces reflect to all sides, colour by colour: white reflects all, black none. Metals "
    "are black",
)
NORMALS = DebugView(
    "NORMALS",
    "Normals",
    "Which way surfaces face in the world: red grows along X, green along Y, blue along Z; a floor is light blue",
)
VARIANCE = DebugView(
    "VARIANCE",
    "Variance",
    "How unsure the mean of the samples is: its standard error, the root of s² / n over n samples with s² = (sum of "
    "squares - n mean²) / (n - 1) of luminance, as a part of the mean. Black 0.1 % or less, blue 1 %, green 10 %, red "
    "100 % or more; grey: not known after one sample. Samples that share light (Reuse) are taken for independent: then "
    "it is a lower bound",
)
TRANSFER = DebugView(
    "TRANSFER",
    "Transfer Coefficient",
    "One coefficient of each object's baked light transfer, chosen by Term and Reflected Term: red where it is "
    "positive, blue where negative, full where it is largest on the object. Grey has no bake that fits",
    averaged=True,
)
VIEWS = (DIRECT, INDIRECT, IRRADIANCE, ALBEDO, NORMALS, VARIANCE, TRANSFER)

# Pictures that a view, or the split, wants beside the sums. SHOWN: the view's own, its sum over the samples.
SHOWN, LAMPS, UNBOUNCED, MOMENTS = "shown", "lamps", "unbounced", "moments"
# LAMPS: this sample without the technique; UNBOUNCED: the sum of those; MOMENTS: sums of luminance and its square.
_NEEDS = {"DIRECT": (LAMPS, UNBOUNCED), "INDIRECT": (LAMPS, UNBOUNCED), "VARIANCE": (MOMENTS,)}


def _surface_view(name: str, *samplers: str) -> Shader:
    return Shader(
        name=f"frame_view_{name.lower()}",
        fragment="frame/frame_view_frag.glsl",
        outputs={"out_color": "VEC4"},
        samplers={f"{sampler}_tx": "FLOAT_2D" for sampler in ("albedo", *samplers)},
        defines=((f"VIEW_{name}", "1"),),
    )


SURFACE_VIEWS = {
    "ALBEDO": _surface_view("ALBEDO"),
    "NORMALS": _surface_view("NORMALS", "normal"),
    "IRRADIANCE": _surface_view("IRRADIANCE", "diffuse_direct", "diffuse_indirect"),
}
DIFFERENCE = Shader(
    name="frame_difference",
    fragment="frame/frame_difference_frag.glsl",
    outputs={"out_color": "VEC4"},
    samplers={"whole_tx": "FLOAT_2D", "part_tx": "FLOAT_2D"},
)
VARIANCE_VIEW = Shader(
    name="frame_variance",
    fragment="frame/frame_variance_frag.glsl",
    outputs={"out_color": "VEC4"},
    samplers={"moments_tx": "FLOAT_2D"},
    constants={"pc_samples": "FLOAT"},
)
VIEW_SHADERS = (*SURFACE_VIEWS.values(), DIFFERENCE, VARIANCE_VIEW)


class Extras:
    """RGBA32F pictures of one frame's size beside its sums: each is there only while something wants it."""

    def __init__(self, device: Device, size: tuple[int, int]) -> None:
        self.device, self.size = device, size
        self._targets: dict[str, Target] = {}

    def keep(self, names: Iterable[str]) -> None:
        """Have these and no others; new ones are zero."""
        wanted = set(names)
        for name in self._targets.keys() - wanted:
            self._drop(name)
        for name in wanted - self._targets.keys():
            self._targets[name] = self.device.target([self.device.texture(self.size, "RGBA32F")])

    def __contains__(self, name: str) -> bool:
        return name in self._targets

    def __getitem__(self, name: str) -> Target:
        return self._targets[name]

    def texture(self, name: str) -> Texture | None:
        """The picture of that name, if it is there."""
        target = self._targets.get(name)
        return target.colors[0] if target else None

    def free(self) -> None:
        self.keep(())

    def _drop(self, name: str) -> None:
        target = self._targets.pop(name)
        self.device.free(target)
        self.device.free(target.colors[0])


def needed(view: DebugView | None, *, split: bool) -> set[str]:
    """The extras that a view and the split want."""
    names = {LAMPS, UNBOUNCED} if split else set()
    return names | ({SHOWN, *_NEEDS.get(view.key, ())} if view else set())


def draw_view(
    device: Device,
    view: DebugView,
    extras: Extras,
    gbuffer: GBuffer,
    light: LightTargets,
    combined: Texture,
    samples: int,
) -> None:
    """Bring SHOWN up to date after a sample: ``samples`` with it. ``combined`` is the sum of the picture."""
    target = extras[SHOWN]
    if view.key in SURFACE_VIEWS:
        shader = SURFACE_VIEWS[view.key]
        given: dict[str, Any] = {
            "albedo_tx": gbuffer.albedo,
            "normal_tx": gbuffer.normal,
            "diffuse_direct_tx": light.diffuse_direct.colors[0],
            "diffuse_indirect_tx": light.diffuse_indirect.colors[0],
        }
        state = ADD if samples > 1 else DrawState()
        device.fullscreen(shader, target, state=state, **{name: given[name] for name in shader.samplers})
    elif view.key == "VARIANCE":
        moments = extras[MOMENTS].colors[0]
        device.fullscreen(VARIANCE_VIEW, target, moments_tx=moments, pc_samples=float(samples))
    elif view.key == "INDIRECT":
        device.fullscreen(DIFFERENCE, target, whole_tx=combined, part_tx=extras[UNBOUNCED].colors[0])
    else:
        device.fullscreen(RESOLVE, target, sum_tx=extras[UNBOUNCED].colors[0], pc_weight=1.0)


def draw_technique_view(
    device: Device,
    view: DebugView,
    extras: Extras,
    scratch: Target,
    combined: Texture,
    samples: int,
    draw: Callable[[Target], None],
) -> None:
    """The same for a technique's view: ``draw`` puts it into ``scratch``, which has the picture's size."""
    if view.over_picture:
        device.fullscreen(RESOLVE, scratch, sum_tx=combined, pc_weight=1.0 / samples)
    else:
        device.clear(scratch, (0.0, 0.0, 0.0, 1.0))
    draw(scratch)
    adds = view.averaged and samples > 1
    device.fullscreen(
        RESOLVE,
        extras[SHOWN],
        state=ADD if adds else DrawState(),
        sum_tx=scratch.colors[0],
        pc_weight=1.0 if view.averaged else float(samples),
    )
