"""The engine's settings as plain values: the renderer reads them, ui.properties makes Blender properties of them.

Those of lights and objects are read by the converters in ``scene``, as part of what lights and objects are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from .bake_settings import BAKE_SETTINGS
from .gpu_shaders import TECHNIQUES
from .gpu_shaders.frame.views import VIEWS
from .gpu_shaders.technique import DebugView, Item, Setting, Value

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
        "What the picture shows: itself, parts of its light, or what the method does",
        "PICTURE",
        viewport_default="PICTURE",
        items=(
            Item("PICTURE", "Picture", "The rendered picture"),
            *VIEWS,
            *(view for technique in TECHNIQUES for view in technique.views),
        ),
    ),
    Setting(
        "show_light",
        "INT",
        "Light",
        "Whose map the views of light maps show, counted from 1 in the order of the scene; 0 for the active light in a "
        "viewport, the first one in a render. Higher and lower only choose another one",
        0,
        minimum=0,
        maximum=65535,
        unit="number of a light",
    ),
    Setting(
        "show_term",
        "INT",
        "Term",
        "Which coefficient of the light the view of baked transfer shows: l (l + 1) + m of harmonics, or the number of "
        "a wavelet. Higher ones tell finer detail of the surroundings apart, lower ones coarser",
        0,
        minimum=0,
        maximum=24575,
        unit="number of a coefficient",
    ),
    Setting(
        "show_result",
        "INT",
        "Reflected Term",
        "Glossy bakes: which coefficient of what arrives the view of baked transfer shows, l (l + 1) + m. Higher ones "
        "are finer detail of reflections, lower ones coarser",
        0,
        minimum=0,
        maximum=120,
        unit="number of a coefficient",
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
        "transfer_use",
        "BOOL",
        "Use Bakes",
        "Light objects that have a bake of light transfer by it: the world's light, its shadows and bounces, without "
        "noise. Off lights them as all others",
        True,
    ),
    Setting(
        "transfer_bands",
        "INT",
        "Used Bands",
        "How many bands of a bake are used at most. Higher shows all that was baked; lower is softer",
        6,
        minimum=1,
        maximum=11,
        unit="bands",
    ),
    Setting(
        "transfer_terms",
        "INT",
        "Wavelet Terms",
        "How many terms of the world's light a wavelet bake is lit by, those that matter most. Higher makes shadows "
        "sharper and truer, at the cost of time whenever the world changes; lower is quicker",
        256,
        minimum=1,
        maximum=24576,
        unit="terms",
        soft_maximum=2048,
    ),
    Setting(
        "transfer_lobe",
        "ENUM",
        "Lobe",
        "How glossy bakes are seen: by which lobe surfaces mirror what arrives",
        "GGX",
        items=(
            Item(
                "GGX", "GGX", "The lobe of the materials: longer and leaning to the normal where it is seen obliquely"
            ),
            Item("PHONG", "Phong", "The same round lobe from all sides, as wide as GGX: even highlights"),
        ),
    ),
    Setting(
        "transfer_widen",
        "BOOL",
        "Widen Lobes",
        "Soft, Glossy bakes show surfaces that are smoother than their bands hold as the smoothest that they do hold: "
        "without rings, but softer than they are. Off is sharper by a little, with black and coloured spots around "
        "bright light",
        True,
    ),
    Setting(
        "transfer_window",
        "FLOAT",
        "Window",
        "How much of the finest detail of the world's light is smoothed away, against rings of light and dark around "
        "bright spots. Higher has fewer rings, lower sharper shadows",
        0.0,
        minimum=0.0,
        maximum=1.0,
        unit="parts of the curvature",
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

# What only a viewport has: its properties are named viewport_<name>, and a final render has the defaults.
VIEWPORT_SETTINGS = (
    Setting(
        "indirect",
        "BOOL",
        "Indirect Light",
        "Compute bounced light. Off shows the light of lamps alone and costs nothing; all that was found is kept, so "
        "that it is back at once",
        True,
    ),
    Setting(
        "split",
        "BOOL",
        "Split",
        "Show the picture without bounced light left of a line, and with it on the right. Drag the line; it costs one "
        "pass and one picture's memory",
        False,
    ),
)
# The same, of how a picture is shown: changing one does not begin another.
DISPLAY_SETTINGS = (
    Setting(
        "split_place",
        "FLOAT",
        "Split Position",
        "Where the line of the split view stands. Higher shows more without bounced light, lower less",
        0.5,
        minimum=0.0,
        maximum=1.0,
        unit="parts of the width",
    ),
    Setting(
        "stats",
        "BOOL",
        "Rebound Statistics",
        "Times of all passes, and counts, as text in the viewport. To time a pass the GPU is waited for after each "
        "one: that makes everything slower while this is on, and is not done while it is off",
        False,
    ),
)


# light.rebound
LIGHT_SETTINGS = (
    Setting(
        "use_bounce",
        "BOOL",
        "Bounce",
        "Whether surfaces that this light shines on pass its light on. Off saves the time and memory of its map, at "
        "the cost of all indirect light that it gives",
        True,
    ),
    Setting(
        "bounce_strength",
        "FLOAT",
        "Bounce Strength",
        "Artistic control: factor of this light's indirect light, reflections of what it lights included. 1 is what "
        "nature does; higher is brighter around what the light hits, lower darker, and neither keeps the balance of "
        "direct and indirect light",
        1.0,
        minimum=0.0,
        maximum=100.0,
        unit="times the physical bounce",
        soft_maximum=4.0,
    ),
    Setting(
        "map_size",
        "ENUM",
        "Map Size",
        "Width of this light's map of what it shines on, against Map Resolution of the render settings. Larger keeps "
        "small and touching surfaces apart, at the cost of memory, as all lights' maps take more then; smaller is "
        "quicker when things move",
        "FULL",
        items=(
            Item("EIGHTH", "1:8", "An eighth of the width: for lights that hardly matter"),
            Item("QUARTER", "1:4", "A quarter of the width"),
            Item("HALF", "1:2", "Half the width"),
            Item("FULL", "1:1", "As the render settings say"),
            Item("DOUBLE", "2:1", "Twice the width"),
            Item("QUADRUPLE", "4:1", "Four times the width: for a sun over fine detail"),
        ),
    ),
)

# object.rebound
OBJECT_SETTINGS = (
    Setting(
        "receive_bounce",
        "BOOL",
        "Receive Bounce",
        "Whether light of other surfaces and of the sky reaches this object: bounced light, glowing surfaces, the "
        "world, reflections. Off leaves lamps and its own emission, which is quicker to compute and darker than life",
        True,
    ),
)

# What a .blend holds of a choice is its number. Elsewhere that is its place in the list, to which choices are added at
# the end; these lists are put together from several, so it is their place here. Only ever add to the end.
CHOICE_NUMBERS = {
    "method": ("NONE", "RSM", "VPL"),
    "show": (
        *("PICTURE", "VPL_BOUND", "VPL_VOXELS", "VPL_HISTORY"),
        *("DIRECT", "INDIRECT", "IRRADIANCE", "ALBEDO", "NORMALS", "VARIANCE"),
        *("VPL_OCCLUSION", "VPL_RESOLUTION", "VPL_POOL"),
        *("VPL_MAPS", "VPL_MAP_DEPTH", "VPL_MAP_POSITION", "VPL_MAP_NORMAL", "VPL_MAP_FLUX"),
        *("RSM_RESOLUTION", "RSM_MAPS", "RSM_MAP_DEPTH", "RSM_MAP_POSITION", "RSM_MAP_NORMAL", "RSM_MAP_FLUX"),
        "TRANSFER",
    ),
}


def choice_number(name: str, key: str) -> int:
    """The number that a file holds for a choice of the ENUM setting of this full name. Raises ValueError for a new
    choice that CHOICE_NUMBERS lacks.
    """
    keys = CHOICE_NUMBERS.get(name) or next(tuple(i.key for i in s.items) for n, s in every_setting() if n == name)
    return keys.index(key)


def views_of(method: str) -> tuple[str, ...]:
    """The choices of *Show* that mean something with this method: those of no technique, and its own."""
    foreign = {item.key for technique in TECHNIQUES if technique.id.upper() != method for item in technique.views}
    show = next(setting for setting in SETTINGS if setting.name == "show")
    return tuple(item.key for item in show.items if item.key not in foreign)


def every_setting() -> Iterator[tuple[str, Setting]]:
    """Settings of the scene by their full names, then those of viewports alone, of bakes, of lights and of objects."""
    yield from named_settings()
    for setting in (*VIEWPORT_SETTINGS, *DISPLAY_SETTINGS, *BAKE_SETTINGS, *LIGHT_SETTINGS, *OBJECT_SETTINGS):
        yield setting.name, setting


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
        values |= {setting.name: setting.default for setting in VIEWPORT_SETTINGS}
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


def shown_view(settings: Settings) -> DebugView | None:
    """What is shown in the place of the picture; None for the picture, and for a view of another method."""
    views = [*VIEWS, *(v for kind in TECHNIQUES if kind.id == str(settings["method"]).lower() for v in kind.views)]
    return next((view for view in views if view.key == settings["show"]), None)
