"""Tables and charts of what was measured, as data; Markdown and HTML are written from the same ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape

from .plot import Line, chart
from .results import CYCLES, EEVEE, F12, Curve, FigureSet, Scaling, SceneResult

TARGETS = (0.05, 0.01)
MISSING = "—"
MOST_PASSES = 10


@dataclass(frozen=True)
class Table:
    """Rows of finished text; the first column names what a row is about."""

    title: str
    header: list[str]
    rows: list[list[str]]
    note: str = ""

    def markdown(self) -> str:
        lines = [f"**{self.title}**", ""] if self.title else []
        lines += ["| " + " | ".join(self.header) + " |", "|" + "---|" * len(self.header)]
        lines += ["| " + " | ".join(row) + " |" for row in self.rows]
        text = "\n".join(lines + (["", self.note] if self.note else [])) + "\n"
        return text.replace("DiffInd*", "DiffInd\\*")  # two stars would make what is between them italic

    def html(self) -> str:
        head = "".join(f'<th scope="col">{escape(h)}</th>' for h in self.header)
        body = "".join(
            f'<tr><th scope="row">{escape(row[0])}</th>' + "".join(f"<td>{escape(c)}</td>" for c in row[1:]) + "</tr>"
            for row in self.rows
        )
        caption = f"<caption>{escape(self.title)}</caption>" if self.title else ""
        note = f'<p class="note">{escape(self.note)}</p>' if self.note else ""
        wide = f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        return f'<div class="wide">{wide}</div>{note}'


# --- one scene -------------------------------------------------------------------------------------------------------


def scene_tables(result: SceneResult) -> list[Table]:
    """Times and errors of every engine, its errors by every reference, and the passes of a frame."""
    return [_times(result), _errors(result), *_passes(result)]


def _times(result: SceneResult) -> Table:
    goal = result.goals[0]
    eevee = _of(result, EEVEE)
    cycles = _cycles(result, goal)
    header = ["", "first picture (÷ EEVEE)", "one more sample (÷ EEVEE)"]
    header += [f"to {target} (÷ Cycles)" for target in TARGETS]
    header += ["samples", "their time (÷ EEVEE)", "relmse (÷ EEVEE)", "Cycles to the same error (÷)"]
    rows = []
    for curve in _compared(result, goal):
        last = curve.points[-1]
        error = last.scores[goal]["relmse"]
        row = [curve.label, _over(curve.first, eevee and eevee.first), _over(curve.sample, eevee and eevee.sample)]
        row += [_over(curve.time_to(goal, t), cycles and cycles.time_to(goal, t)) for t in TARGETS]
        row += [str(last.samples), _over(last.seconds, eevee and eevee.points[-1].seconds)]
        row.append(_over(error, eevee and eevee.points[-1].scores[goal]["relmse"], ""))
        equal = cycles.time_to(goal, error) if cycles and curve is not cycles else None
        row.append(_over(equal, last.seconds))
        rows.append(row)
    runs = max((point.runs for curve in result.curves for point in curve.points), default=1)
    what = f"{_count(result.triangles, 'triangle')}, {_count(result.lights, 'light')}"
    size = f"{result.size[0]} × {result.size[1]}, {what}"
    note = f"{size}. Times are medians of up to {_count(runs, 'run')}. {MISSING}: not reached, or not measured."
    return Table(f"{result.name}: {result.labels[0]}", header, rows, note)


def _errors(result: SceneResult) -> Table:
    """Energy and relmse of every engine's last picture, for all goals."""
    eevee = _of(result, EEVEE)
    rows = []
    for curve in result.curves:
        row = [f"{curve.label}, {_count(curve.points[-1].samples, 'sample')}"]
        for goal in result.goals:
            scores = curve.points[-1].scores.get(goal)
            other = eevee.points[-1].scores.get(goal) if eevee else None
            ratio = _ratio(scores["relmse"], other["relmse"]) if scores and other else ""
            row.append(f"{scores['energy']:.3f} / {significant(scores['relmse'])}{ratio}" if scores else MISSING)
        rows.append(row)
    header = ["", *(f"{label}: energy / relmse (÷ EEVEE)" for label in result.labels)]
    return Table(f"{result.name}: against every reference", header, rows)


def _passes(result: SceneResult) -> list[Table]:
    """The steady frame of a still viewport, pass by pass."""
    tables = []
    for curve in result.curves:
        if not curve.passes or curve.frame is None:
            continue
        total = sum(p.milliseconds for p in curve.passes)
        rows = [
            [
                p.name,
                p.kind,
                f"{p.calls:g}",
                f"{significant(p.milliseconds)} ms",
                f"{100 * p.milliseconds / total:.0f} %",
            ]
            for p in curve.passes[:MOST_PASSES]
        ]
        first = f", first frame {_seconds(curve.first_frame)}" if curve.first_frame is not None else ""
        title = f"{result.name}, {curve.label}: a steady viewport frame of {_seconds(curve.frame)}{first}"
        tables.append(Table(title, ["pass", "kind", "calls", "a frame", "share"], rows))
    return tables


def scene_chart(result: SceneResult, *, paper: bool) -> str:
    """Error over time of every engine that reaches the first goal."""
    goal = result.goals[0]
    lines = [
        Line(curve.label, [(p.seconds, p.scores[goal]["relmse"]) for p in curve.points if goal in p.scores])
        for curve in _compared(result, goal)
        if not curve.label.endswith(F12)
    ]
    title = f"{result.name}: {result.labels[0]}"
    return chart(title, "seconds of rendering", "relmse", lines, levels=TARGETS, paper=paper)


def _compared(result: SceneResult, goal: str) -> list[Curve]:
    """The curves that the goal is fair to: Cycles is there once for each number of bounces."""
    cycles = _cycles(result, goal)
    return [c for c in result.curves if goal in c.points[-1].scores and (c.engine != CYCLES or c is cycles)]


def _cycles(result: SceneResult, goal: str) -> Curve | None:
    """The Cycles that converges to the goal's reference."""
    wanted = "one bounce" if goal.endswith("/one_bounce") else CYCLES
    return next((c for c in result.curves if c.engine == CYCLES and c.label.endswith(wanted)), None)


def _of(result: SceneResult, engine: str) -> Curve | None:
    return next((curve for curve in result.curves if curve.engine == engine), None)


# --- figures and scaling ---------------------------------------------------------------------------------------------


def figure_table(figures: FigureSet) -> Table:
    """One row for each figure, what it is compared with, and the ratio."""
    rows = []
    for figure in figures.figures:
        against = f"{_with_unit(figure.against, figure.unit)}, {figure.against_name}" if figure.against_name else ""
        ratio = f"{significant(figure.ratio)} ×" if figure.ratio is not None else ""
        note = f" ({figure.note})" if figure.note else ""
        rows.append([figure.name + note, _with_unit(figure.value, figure.unit), against, ratio])
    return Table(figures.title, ["", "measured", "beside", "ratio"], rows)


def scaling_table(scaling: Scaling) -> Table:
    """Times by number, and against the first one."""
    base = scaling.points[0]
    rows = []
    for point in scaling.points:
        longest = f"{point.passes[0].name} {significant(point.passes[0].milliseconds)} ms" if point.passes else ""
        row = [f"{point.x:,}", _over(point.seconds, base.seconds), _over(point.first, base.first), longest]
        rows.append(row)
    header = [scaling.unit, "a frame (÷ the first row)", "the first frame (÷ the first row)", "its longest pass"]
    return Table(f"{scaling.title}, {scaling.method}", header, rows)


def scaling_chart(scalings: list[Scaling], *, paper: bool) -> str:
    """All methods' curves of one axis."""
    lines = [Line(s.method, [(p.x, 1000 * p.seconds) for p in s.points]) for s in scalings]
    return chart(f"A frame by {scalings[0].unit}", scalings[0].unit, "ms a frame", lines, paper=paper)


# --- numbers ---------------------------------------------------------------------------------------------------------


def significant(value: float) -> str:
    """Three significant digits, without an exponent where that is readable."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    digits = max(2 - math.floor(math.log10(abs(value))), 0)
    return f"{value:.{digits}f}" if digits <= 6 else f"{value:.2e}"


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}" + ("" if number == 1 else "s")


def _seconds(value: float) -> str:
    return f"{significant(1000 * value)} ms" if value < 0.1 else f"{significant(value)} s"


def _with_unit(value: float | None, unit: str) -> str:
    if value is None:
        return MISSING
    return _seconds(value) if unit == "s" else f"{significant(value)} {unit}"


def _over(value: float | None, other: float | None, unit: str = "s") -> str:
    """A figure with its ratio to another in parentheses."""
    if value is None:
        return MISSING
    return (_seconds(value) if unit == "s" else significant(value)) + _ratio(value, other)


def _ratio(value: float, other: float | None) -> str:
    return f" ({significant(value / other)} ×)" if other else ""
