"""What an indirect-light technique is: settings that describe themselves, and a few calls that the renderer makes.

A technique is one folder beside this file and one line in ``gpu_shaders.TECHNIQUES``. Techniques never import
one another; what two of them share lives in ``lib/`` or ``frame/``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

if TYPE_CHECKING:
    from ..device.interface import Device, Target
    from ..device.shader import Shader
    from .frame.inputs import FrameInputs, LightTargets

Value = float | int | bool | str


@dataclass(frozen=True)
class Item:
    """One choice of an ENUM setting."""

    key: str
    label: str
    description: str


@dataclass(frozen=True)
class DebugView(Item):
    """A picture of what goes on, in place of the rendered one. ``description`` says what its colours mean.

    ``averaged``: the mean over the samples is shown, else what the newest one gave. ``over_picture``: it is drawn over
    the rendered picture, and covers parts of it.
    """

    averaged: bool = False
    over_picture: bool = False


@dataclass(frozen=True)
class Setting:
    """One user-visible value. ``ui.properties`` makes a Blender property from it, the tests check its limits.

    ``viewport_default`` given: the viewport has a value of its own, named ``viewport_<name>``.
    ``unit`` is what the number counts ("px", "samples", "" for a pure number); ``description`` says the trade-off
    both ways. ``panel`` is the title of the closed sub-panel that it stands in, "" for the technique's own.
    ``soft_maximum`` is how far a slider goes; more can be typed in.
    """

    name: str
    kind: Literal["FLOAT", "INT", "BOOL", "ENUM"]
    label: str
    description: str
    default: Value
    viewport_default: Value | None = None
    minimum: float = 0
    maximum: float = 1
    unit: str = ""
    items: tuple[Item, ...] = ()
    panel: str = ""
    soft_maximum: float | None = None


class Technique(Protocol):
    """One way to compute indirect light.

    Instances hold the GPU resources of one renderer, and what the sample or picture before has found: for a frame that
    does not follow another (``FrameInputs.follows``) the first sample is as if they were new.
    """

    id: str  # "rsm"; its settings are named rsm_<setting> on scene.rebound
    label: str
    description: str
    settings: tuple[Setting, ...]
    shaders: tuple[Shader, ...]
    views: tuple[DebugView, ...]  # pictures of what the technique does; keys "<ID>_<NAME>"

    def __init__(self, device: Device) -> None: ...

    @property
    def provisional(self) -> bool:
        """Whether the newest sample was made in haste and is not to be summed with those that follow."""
        ...

    def indirect(self, inputs: FrameInputs, settings: Mapping[str, Value], targets: LightTargets) -> Iterator[float]:
        """Add this sample's indirect light to ``targets``.

        The direct ones hold the sample's direct light. The indirect ones may hold what an earlier sample left: the
        technique draws over all of the diffuse one, and of the glossy one where the scene is glossy, or clears them.

        ``settings`` holds this technique's values by their short names. Yields its progress (0..1) after every
        bounded piece of GPU work, so that a caller can show it and cancel between two pieces.
        """
        ...

    def view(
        self, key: str, inputs: FrameInputs, settings: Mapping[str, Value], target: Target, light: int = 0
    ) -> None:
        """Draw one of ``views`` into ``target``, after ``indirect``, and leave no trace of that in later samples.

        ``target`` is RGBA32F, of the picture's size: black, or for a view over the picture what was rendered so far.
        ``light``: index of the one that is asked about, where a view is of one light.
        """
        ...

    def statistics(self) -> Mapping[str, float]:
        """Counts of the newest sample, for the statistics panel and the tests."""
        ...

    def free(self) -> None:
        """Release the GPU resources."""
        ...
