"""One HTML page that holds everything: pictures under a divider, error maps, tables, charts. Nothing is loaded from
anywhere: it can be mailed, and opened from a folder.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np
from PIL import Image

from .pictures import COMBINED, load_picture
from .results import CYCLES, EEVEE, F12, FigureSet, Scaling, SceneResult
from .score import cell_errors
from .tables import figure_table, scaling_chart, scaling_table, scene_chart, scene_tables

HERE = Path(__file__).resolve().parent
# The browser itself refuses whatever is not in the page.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
# Colours of an error map, equally spaced between the two errors: page.css shows the same ones.
MAP_COLORS = np.array([(0, 0, 0), (75, 29, 145), (197, 49, 77), (246, 160, 27), (255, 255, 208)], np.float64)
LEAST_ERROR, MOST_ERROR = 1e-4, 1.0
QUALITY = 85


@dataclass(frozen=True)
class Shown:
    """A picture of the page: its name, its pixels (h, w, 3) scene-linear with row 0 at the top."""

    label: str
    pixels: np.ndarray


def make_page(
    scenes: Sequence[SceneResult], figures: Sequence[FigureSet], scalings: Sequence[Scaling], folder: Path, machine: str
) -> str:
    """The page; ``folder`` is where the results' pictures lie."""
    parts = [_section(result, number, folder) for number, result in enumerate(scenes)]
    titles = [(f"scene-{n}", result.name) for n, result in enumerate(scenes)]
    if figures:
        parts.append(
            f'<section id="figures"><h2>Figures</h2>{"".join(figure_table(f).html() for f in figures)}</section>'
        )
        titles.append(("figures", "Figures"))
    if scalings:
        parts.append(f'<section id="scaling"><h2>Scaling</h2>{_scalings(scalings)}</section>')
        titles.append(("scaling", "Scaling"))
    links = "".join(f'<a href="#{anchor}">{escape(title)}</a>' for anchor, title in titles)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{POLICY}">
<title>Rebound beside EEVEE and Cycles</title>
<style>
{(HERE / "page.css").read_text(encoding="utf-8")}</style>
</head>
<body>
<h1>Rebound beside EEVEE and Cycles</h1>
<p class="machine">{escape(machine)}. Times compare with one another on this machine; errors hold on any.</p>
<nav>{links}</nav>
{"".join(parts)}
<script>
{(HERE / "page.js").read_text(encoding="utf-8")}</script>
</body>
</html>
"""


def _section(result: SceneResult, number: int, folder: Path) -> str:
    reference, shown = _pictures(result, folder)
    anchor = f"scene-{number}"
    tables = scene_tables(result)
    return f"""<section id="{anchor}">
<h2>{escape(result.name)}</h2>
{_compare(result, anchor, [*shown, *reference])}
{_error_maps(reference[0], shown) if reference else ""}
{tables[0].html()}
{scene_chart(result, paper=False)}
{"".join(table.html() for table in tables[1:])}
</section>
"""


def _pictures(result: SceneResult, folder: Path) -> tuple[list[Shown], list[Shown]]:
    """The reference of the first goal, and every engine's best picture; a method's F12 shows the same as the method."""
    wanted = result.goals[0].partition("/")[2]
    shown = []
    for curve in result.curves:
        last = curve.points[-1]
        if last.picture and not curve.label.endswith(F12):
            label = f"{curve.label}, {last.samples} sample{'s' if last.samples > 1 else ''}"
            shown.append(Shown(label, load_picture(folder / last.picture)[COMBINED]))
    reference = result.references.get(wanted)
    return [Shown("Reference", load_picture(folder / reference)[COMBINED])] if reference else [], shown


def _compare(result: SceneResult, anchor: str, pictures: list[Shown]) -> str:
    """Two pictures with a divider, and two lists to choose them from: Rebound and EEVEE at first."""
    labels = [picture.label for picture in pictures]
    second = next(
        (i for e in (EEVEE, CYCLES) for i, label in enumerate(labels) if label.startswith(e)), len(labels) - 1
    )
    store = "".join(
        f'<img id="{anchor}-{i}" alt="" src="{_webp(p.pixels, result.exposure)}">' for i, p in enumerate(pictures)
    )
    width, height = result.size
    name = escape(result.name)
    widest = f"max-width: {max(2 * width, 640)}px"
    chosen = _choice("Left", anchor, labels, 0) + _choice("Right", anchor, labels, second)
    return f"""<div class="choose" style="{widest}">{chosen}</div>
<div class="compare" style="{widest}; aspect-ratio: {width} / {height}">
<img class="right" alt=""><img class="left" alt="">
<div class="divider" role="slider" tabindex="0" aria-label="Divider between two pictures of {name}"
 aria-valuemin="0" aria-valuemax="100" aria-valuenow="50"></div>
</div>
<p class="note">Exposure {result.exposure:+.1f} EV as in the file, sRGB without a film look.</p>
<div hidden>{store}</div>"""


def _choice(side: str, anchor: str, labels: list[str], chosen: int) -> str:
    options = "".join(
        f'<option value="{anchor}-{i}"{" selected" if i == chosen else ""}>{escape(label)}</option>'
        for i, label in enumerate(labels)
    )
    return f"<label>{side} <select>{options}</select></label>"


def _error_maps(reference: Shown, shown: list[Shown]) -> str:
    figures = "".join(
        f'<figure><img alt="Error map of {escape(p.label)}" src="{_error_map(reference.pixels, p.pixels)}">'
        f"<figcaption>{escape(p.label)}</figcaption></figure>"
        for p in shown
    )
    return f"""<p class="note">Relative squared error of Combined in cells of 4 × 4 pixels:</p>
<div class="scale"></div><div class="ends"><span>{LEAST_ERROR:g}</span><span>{MOST_ERROR:g}</span></div>
<div class="errors">{figures}</div>"""


def _scalings(scalings: Sequence[Scaling]) -> str:
    parts = []
    for title in dict.fromkeys(s.title for s in scalings):
        of_title = [s for s in scalings if s.title == title]
        parts.append(scaling_chart(of_title, paper=False))
        parts += [scaling_table(s).html() for s in of_title]
    return "".join(parts)


# --- pixels ----------------------------------------------------------------------------------------------------------


def display(linear: np.ndarray, exposure: float) -> np.ndarray:
    """Scene-linear to sRGB bytes after an exposure in stops."""
    x = np.clip(linear * 2.0**exposure, 0.0, 1.0)
    return np.round(255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)).astype(np.uint8)


def error_colors(errors: np.ndarray) -> np.ndarray:
    """RGB bytes of relative squared errors, on a logarithmic scale."""
    span = np.log(MOST_ERROR / LEAST_ERROR)
    part = np.clip(np.log(np.maximum(errors, LEAST_ERROR) / LEAST_ERROR) / span, 0.0, 1.0) * (len(MAP_COLORS) - 1)
    places = np.arange(len(MAP_COLORS))
    return np.stack([np.interp(part, places, MAP_COLORS[:, c]) for c in range(3)], -1).round().astype(np.uint8)


def _webp(linear: np.ndarray, exposure: float) -> str:
    return _data_uri(display(linear, exposure), "WEBP", quality=QUALITY, method=4)


def _error_map(reference: np.ndarray, test: np.ndarray) -> str:
    return _data_uri(error_colors(cell_errors(reference, test)), "PNG", optimize=True)


def _data_uri(pixels: np.ndarray, kind: str, **options: object) -> str:
    content = io.BytesIO()
    Image.fromarray(pixels).save(content, kind, **options)
    return f"data:image/{kind.lower()};base64,{base64.b64encode(content.getvalue()).decode()}"
