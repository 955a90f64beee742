"""Write the table of docs/nodes.md: each node, whether it is supported, and how far it is from Cycles.

`.venv/bin/python tools/node_table.py [GROUP …]` prints it; with --write it goes into the page (all groups only).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import bpy
import gpu

from rebound.device.blender import BlenderDevice
from rebound.gpu_shaders.materials import supported_kinds
from rebound.scene.materials import APPROXIMATED_NODES
from rebound.scene.node_reader import CONSTANTS
from rebound.tests.support.node_cases import GROUPS, NodeCase
from rebound.tests.support.node_sheet import deviations

PAGE = Path(__file__).resolve().parents[1] / "docs" / "nodes.md"
BEGIN, END = "<!-- table -->\n", "<!-- end of table -->\n"
# What is no shading of a surface, or belongs to another part of Blender.
ELSEWHERE = ("Output", "Volume", "LineStyle", "UVAlongStroke", "Group", "Background")


def measure(groups: list[str]) -> dict[str, list[tuple[NodeCase, float]]]:
    """The deviations of every case, by kind."""
    found: dict[str, list[tuple[NodeCase, float]]] = {}
    device = BlenderDevice()
    for group in groups:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        cases = list(GROUPS[group]())
        with tempfile.TemporaryDirectory(prefix="rebound-nodes-") as folder:
            for case, largest in zip(cases, deviations(device, Path(folder), cases), strict=True):
                found.setdefault(case.kind, []).append((case, largest))
    return found


def kinds() -> dict[str, str]:
    """Every shader node of this Blender that belongs to surfaces: its type and its label."""
    tree = bpy.data.node_groups.new("Kinds", "ShaderNodeTree")
    found = {}
    for name in sorted(dir(bpy.types)):
        shading = name.startswith("ShaderNode") and not any(word in name for word in ELSEWHERE)
        if shading and name not in ("ShaderNode", "ShaderNodeTree"):
            found[name] = tree.nodes.new(name).bl_label
    return found


def table(found: dict[str, list[tuple[NodeCase, float]]]) -> str:
    """Markdown."""
    lines = ["| Node | Supported | Cases | Largest deviation |", "|---|---|---|---|"]
    for kind, label in sorted(kinds().items(), key=lambda item: item[1]):
        cases = found.get(kind, [])
        supported = _supported(kind)
        largest = f"{max(value for _, value in cases):.0e}" if cases else ""
        reasons = "; ".join(dict.fromkeys(case.reason for case, _ in cases if case.reason))
        lines.append(f"| {label} | {supported} | {len(cases) or ''} | {largest}{reasons and f' ({reasons})'} |")
    return "\n".join(lines) + "\n"


def _supported(kind: str) -> str:
    if kind == "ShaderNodeDisplacement":
        return "yes, but displacement is shown as a bump"
    if kind not in supported_kinds() and kind not in CONSTANTS:
        return "**no**"
    return f"yes, but {APPROXIMATED_NODES[kind]}" if kind in APPROXIMATED_NODES else "yes"


def main() -> None:
    groups = [name for name in sys.argv[1:] if name in GROUPS] or list(GROUPS)
    gpu.init()
    text = table(measure(groups))
    if "--write" in sys.argv:
        page = PAGE.read_text(encoding="utf-8")
        before, after = page.split(BEGIN)[0], page.split(END)[1]
        PAGE.write_text(f"{before}{BEGIN}{text}{END}{after}", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
