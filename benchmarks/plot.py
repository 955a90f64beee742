"""Line charts on logarithmic axes as SVG text: the same in a page, where it takes the page's colours, and as a file.

Written here because a chart of this kind is a page of code, follows a dark page, and is the same to the byte every
time; no plotting library does all three.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

# Okabe and Ito's colours, which people with any colour vision tell apart; each line has a marker of its own besides.
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d31", "#777777")
MARKERS = ("circle", "square", "diamond", "triangle")
WIDTH, HEIGHT = 640, 330
LEFT, RIGHT, TOP, BOTTOM = 64, 16, 34, 46
LEGEND_ROW = 18
LEAST, MOST = 1e-30, 1e30  # beyond is no measurement


@dataclass(frozen=True)
class Line:
    """Points in data units; those that a logarithm cannot show are left out."""

    label: str
    points: Sequence[tuple[float, float]]

    @property
    def shown(self) -> list[tuple[float, float]]:
        return [(x, y) for x, y in self.points if LEAST < x < MOST and LEAST < y < MOST]


@dataclass(frozen=True)
class _Axis:
    """A logarithmic axis from ``low`` to ``high``, drawn from pixel ``begin`` to ``end``."""

    low: float
    high: float
    begin: float
    end: float

    @classmethod
    def over(cls, values: Sequence[float], begin: float, end: float) -> _Axis:
        low, high = (min(values), max(values)) if values else (1.0, 10.0)
        margin = max((high / low) ** 0.06, 2.0 / math.sqrt(high / low), 1.1)  # never less than a factor of 4 in all
        return cls(low / margin, high * margin, begin, end)

    def place(self, value: float) -> float:
        part = math.log(value / self.low) / math.log(self.high / self.low)
        return self.begin + part * (self.end - self.begin)

    def ticks(self) -> list[float]:
        """Powers of ten; where those are few, also what lies between them."""
        decades = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        for factors in ((1,), (1, 3), (1, 2, 5), (1, 1.5, 2, 3, 4, 5, 6, 8)):
            found = [f * 10.0**d for d in decades for f in factors if self.low <= f * 10.0**d <= self.high]
            if len(found) >= 3:
                break
        step = math.ceil(len(found) / 9)
        return found[::step]


def chart(
    title: str, x_label: str, y_label: str, lines: Sequence[Line], *, levels: Sequence[float] = (), paper: bool = False
) -> str:
    """The chart; ``levels`` are y values marked across it. ``paper``: dark on white, for a file that stands alone."""
    lines = [line for line in lines if line.shown]
    height = HEIGHT + LEGEND_ROW * len(lines) + 8
    points = [p for line in lines for p in line.shown]
    x = _Axis.over([p[0] for p in points], LEFT, WIDTH - RIGHT)
    y = _Axis.over([p[1] for p in points] + (list(levels) if points else []), HEIGHT - BOTTOM, TOP)
    label = escape(f"{title}: {y_label} over {x_label}")
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {WIDTH} {height}" role="img"'
        f' aria-label="{label}" font-family="sans-serif" font-size="12"' + (' color="#1f2328">' if paper else ">"),
        f'<rect width="{WIDTH}" height="{height}" fill="white"/>' if paper else "",
        _text(LEFT, 20, title, "start", 'font-weight="bold" font-size="14"'),
        *_grid(x, y, levels),
        _text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 8, x_label),
        f'<g transform="translate(14 {(TOP + HEIGHT - BOTTOM) / 2:.0f}) rotate(-90)">{_text(0, 0, y_label)}</g>',
        *(_line(line, number, x, y) for number, line in enumerate(lines)),
        *(_legend(line, number) for number, line in enumerate(lines)),
        "" if lines else _text(WIDTH / 2, HEIGHT / 2, "nothing measured"),
        "</svg>",
    ]
    return "\n".join(part for part in parts if part) + "\n"


def _grid(x: _Axis, y: _Axis, levels: Sequence[float]) -> list[str]:
    left, right, top, bottom = LEFT, WIDTH - RIGHT, TOP, HEIGHT - BOTTOM
    faint = 'stroke="currentColor" stroke-opacity="0.15"'
    parts = []
    for tick in x.ticks():
        at = x.place(tick)
        parts.append(f'<line x1="{at:.1f}" x2="{at:.1f}" y1="{top}" y2="{bottom}" {faint}/>')
        parts.append(_text(at, bottom + 16, number(tick)))
    for tick in y.ticks():
        at = y.place(tick)
        parts.append(f'<line x1="{left}" x2="{right}" y1="{at:.1f}" y2="{at:.1f}" {faint}/>')
        parts.append(_text(left - 6, at + 4, number(tick), "end"))
    for level in levels:
        at = y.place(level)
        dashed = 'stroke="currentColor" stroke-opacity="0.6" stroke-dasharray="4 4"'
        parts.append(f'<line x1="{left}" x2="{right}" y1="{at:.1f}" y2="{at:.1f}" {dashed}/>')
    frame = 'fill="none" stroke="currentColor" stroke-opacity="0.5"'
    parts.append(f'<rect x="{left}" y="{top}" width="{right - left}" height="{bottom - top}" {frame}/>')
    return parts


def _line(line: Line, index: int, x: _Axis, y: _Axis) -> str:
    color = COLORS[index % len(COLORS)]
    places = [(x.place(a), y.place(b)) for a, b in line.shown]
    path = " ".join(f"{a:.1f},{b:.1f}" for a, b in places)
    marks = "".join(_marker(index, a, b, color) for a, b in places)
    return f'<polyline points="{path}" fill="none" stroke="{color}" stroke-width="2"/>{marks}'


def _legend(line: Line, index: int) -> str:
    at = HEIGHT + LEGEND_ROW * index + 10
    color = COLORS[index % len(COLORS)]
    stroke = f'<line x1="{LEFT}" x2="{LEFT + 28}" y1="{at}" y2="{at}" stroke="{color}" stroke-width="2"/>'
    return stroke + _marker(index, LEFT + 14, at, color) + _text(LEFT + 36, at + 4, line.label, "start")


def _marker(index: int, x: float, y: float, color: str) -> str:
    kind = MARKERS[index % len(MARKERS)]
    if kind == "circle":
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{color}"/>'
    if kind == "square":
        return f'<rect x="{x - 3:.1f}" y="{y - 3:.1f}" width="6" height="6" fill="{color}"/>'
    corners = {"diamond": ((0, -4.5), (4.5, 0), (0, 4.5), (-4.5, 0)), "triangle": ((0, -4.5), (4.5, 3.5), (-4.5, 3.5))}
    path = " ".join(f"{x + dx:.1f},{y + dy:.1f}" for dx, dy in corners[kind])
    return f'<polygon points="{path}" fill="{color}"/>'


def _text(x: float, y: float, content: str, anchor: str = "middle", more: str = "") -> str:
    attributes = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="currentColor"'
    return f"<text {attributes}{' ' + more if more else ''}>{escape(content)}</text>"


def number(value: float) -> str:
    """Short enough for an axis: 0.05, 300, 50k, 5M."""
    for limit, letter in ((1e6, "M"), (1e4, "k")):
        if value >= limit:
            return f"{value / (1e6 if letter == 'M' else 1e3):.4g}{letter}"
    return f"{value:.3g}" if value >= 1e-3 else f"{value:.0e}".replace("e-0", "e-")
