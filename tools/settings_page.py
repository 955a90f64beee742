"""Write docs/manual/settings.md, the table of every setting: `.venv/bin/python tools/settings_page.py`.

The settings describe themselves, so that the page and the tooltips cannot differ.
"""

from __future__ import annotations

from collections.abc import Iterable

from environments import ROOT

from rebound.bake_settings import BAKE_SETTINGS
from rebound.gpu_shaders import TECHNIQUES
from rebound.gpu_shaders.technique import Item, Setting, Value
from rebound.settings import (
    DISPLAY_SETTINGS,
    LIGHT_SETTINGS,
    OBJECT_SETTINGS,
    SETTINGS,
    VIEWPORT_SETTINGS,
)

PAGE = ROOT / "docs" / "manual" / "settings.md"
HEAD = """# Every setting

*Default* is that of renders; the viewport's own, where it has one, follows a slash. The name is that of the property in
Python.
"""


def page() -> str:
    """The whole page."""
    parts = [HEAD, _section("Render: `scene.rebound`", "", SETTINGS)]
    for technique in TECHNIQUES:
        title = f"Method {technique.label}: `scene.rebound`"
        parts.append(_section(title, f"{technique.id}_", technique.settings))
    parts.append("The viewport's own value of a setting is named `viewport_` and its name.\n")
    parts.append(_section("Viewports alone: `scene.rebound`", "viewport_", (*VIEWPORT_SETTINGS, *DISPLAY_SETTINGS)))
    parts.append(_section("Bakes of light transfer: `scene.rebound`", "", BAKE_SETTINGS))
    parts.append(_section("Lights: `light.rebound`", "", LIGHT_SETTINGS))
    parts.append(_section("Objects: `object.rebound`", "", OBJECT_SETTINGS))
    return "\n".join(parts)


def _section(title: str, prefix: str, settings: Iterable[Setting]) -> str:
    rows = [f"## {title}\n", "| setting | name | default | what it does |", "|---|---|---|---|"]
    rows += [_row(setting, prefix + setting.name) for setting in settings]
    return "\n".join(rows) + "\n"


def _row(setting: Setting, name: str) -> str:
    default = _value(setting, setting.default)
    if setting.viewport_default is not None:
        default += f" / {_value(setting, setting.viewport_default)}"
    unit = f" Unit: {setting.unit}." if setting.unit else ""
    choices = "".join(
        f"<br>**{item.label}** (`{item.key}`{_owner(item)}): {item.description}." for item in setting.items
    )
    return f"| {setting.label} | `{name}` | {default} | {setting.description}.{unit}{choices} |"


def _owner(item: Item) -> str:
    """Which method has a view, where not all have it."""
    return next((f", {t.label}" for t in TECHNIQUES if any(view.key == item.key for view in t.views)), "")


def _value(setting: Setting, value: Value) -> str:
    if setting.kind == "ENUM":
        return next(item.label for item in setting.items if item.key == value)
    if setting.kind == "BOOL":
        return "on" if value else "off"
    return f"{value:g}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
