"""The engine's settings as plain values: the renderer reads them, ui.properties makes Blender properties of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from .gpu_shaders import TECHNIQUES
from .gpu_shaders.technique import Item, Setting, Value

SETTINGS = (
    Setting(
        "method",
        "ENUM",
        "Method",
        "How indirect light is computed",
        "VPL",
        items=(
            Item("NONE", "Direct Only", "No indirect light"),
            *(Item(technique.id.upper(), technique.label, technique.description) for technique in TECHNIQUES),
        ),
    ),
    Setting(
        "show",
        "ENUM",
        "Show",
        "What the picture shows: itself, or what the method does",
        "PICTURE",
        viewport_default="PICTURE",
        items=(
            Item("PICTURE", "Picture", "The rendered picture"),
            *(view for technique in TECHNIQUES for view in technique.views),
        ),
    ),
    Setting(
        "samples",
        "INT",
        "Samples",
        "Pictures that are averaged, each with other places inside the pixels. More makes edges, soft shadows and "
        "bounce smoother, at the cost of time",
        64,
        viewport_default=32,
        minimum=1,
        maximum=65536,
        unit="samples",
    ),
    Setting(
        "shadow_resolution",
        "INT",
        "Shadow Resolution",
        "Texels along a side of each light's shadow map. Higher makes shadow edges sharper, at the cost of memory and "
        "of time when lights or objects move",
        2048,
        viewport_default=1024,
        minimum=64,
        maximum=8192,
        unit="texels",
    ),
    Setting(
        "soft_shadows",
        "ENUM",
        "Soft Shadows",
        "How lights with a size cast their shadows",
        "SAMPLED",
        viewport_default="FILTERED",
        items=(
            Item(
                "SAMPLED",
                "Sampled",
                "A shadow map from another point of the light in every sample: exact after enough "
                "samples, at the cost of drawing the scene from the light every time",
            ),
            Item(
                "FILTERED",
                "Filtered",
                "One shadow map, blurred by the light's size (PCSS): soft from the first samples, "
                "approximate for large or near lights and where shadows of several objects meet",
            ),
        ),
    ),
    Setting(
        "seed",
        "INT",
        "Seed",
        "Start of the noise pattern: another value gives other noise, the same value the same picture",
        0,
        minimum=0,
        maximum=65535,
    ),
)


def named_settings() -> Iterator[tuple[str, Setting]]:
    """Every setting with its full name on scene.rebound; a viewport value of its own has "viewport_" before it."""
    for setting in SETTINGS:
        yield setting.name, setting
    for technique in TECHNIQUES:
        for setting in technique.settings:
            yield f"{technique.id}_{setting.name}", setting


@dataclass(frozen=True)
class Settings:
    """Values by full name, the same names for viewport and final render."""

    values: Mapping[str, Value]

    @classmethod
    def defaults(cls, viewport: bool = False, **changed: Value) -> Settings:
        """The defaults with some values changed. Raises KeyError for a name that is no setting."""
        values = {
            name: s.viewport_default if viewport and s.viewport_default is not None else s.default
            for name, s in named_settings()
        }
        unknown = changed.keys() - values.keys()
        if unknown:
            raise KeyError(f"no such setting: {', '.join(sorted(unknown))}")
        return cls({**values, **changed})

    def __getitem__(self, name: str) -> Value:
        return self.values[name]

    def of(self, technique: str) -> dict[str, Value]:
        """One technique's values by their short names."""
        prefix = f"{technique}_"
        return {name.removeprefix(prefix): value for name, value in self.values.items() if name.startswith(prefix)}
