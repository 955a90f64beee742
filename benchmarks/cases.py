"""What is rendered: the example, and the shared test scenes where there are any, each with its references."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from .pictures import COMBINED, INDIRECT

ROOT = Path(__file__).resolve().parent.parent
EXAMPLE = "cornell_box"
# Bounces after the first hit, by the middle part of a reference's file name.
BOUNCES = {"one_bounce": 1, "multi_bounce": 8}
# Sizes and samples of what is rendered where no reference lies ready: (side in pixels, samples).
OWN_REFERENCE, OWN_REFERENCE_QUICK = (320, 2048), (128, 256)


@dataclass(frozen=True)
class Goal:
    """One figure that a picture is judged by: a quantity against one of the references."""

    quantity: str
    reference: str

    @property
    def key(self) -> str:
        return f"{self.quantity}/{self.reference}"

    @property
    def label(self) -> str:
        return f"{self.quantity}, {self.reference.replace('_', ' ')}"


@dataclass(frozen=True)
class Case:
    """A scene with what it is compared with; ``references`` is empty where one is rendered on the fly."""

    name: str
    blend: Path
    references: dict[str, Path] = field(default_factory=dict)

    @property
    def goals(self) -> tuple[Goal, ...]:
        """The first is what tables and plots show: what a user sees, against all bounces where they are known."""
        kinds = [kind for kind in ("multi_bounce", "one_bounce") if kind in (self.references or {"multi_bounce"})]
        combined = [Goal(COMBINED, kind) for kind in kinds]
        return (*combined, *(Goal(INDIRECT, kind) for kind in reversed(kinds)))


def shared_folder(given: str | None = None) -> Path:
    """Where the shared test scenes are, if anywhere: as the tests look for them."""
    return Path(given or os.environ.get("REBOUND_SHARED", ROOT.parent / "shared"))


def find_cases(folder: Path) -> list[Case]:
    """The example, then every shared scene that has a reference, by name."""
    found = [Case(EXAMPLE, ROOT / "examples" / f"{EXAMPLE}.blend")]
    blends = {path.stem: path for path in sorted((folder / "scenes").rglob("*.blend"))}
    references: dict[str, dict[str, Path]] = {}
    for path in sorted((folder / "references").glob("*.exr")):
        name, _, kind = path.stem.partition(".")
        if kind in BOUNCES and name in blends:
            references.setdefault(name, {})[kind] = path
    return found + [Case(name, blends[name], kinds) for name, kinds in references.items()]


def chosen_cases(folder: Path, names: Sequence[str]) -> list[Case]:
    """The named cases in the given order; all of them for no names. Raises SystemExit for a name that is none."""
    cases = {case.name: case for case in find_cases(folder)}
    unknown = [name for name in names if name not in cases]
    if unknown:
        raise SystemExit(f"bench: no scene {', '.join(unknown)}; there are {', '.join(cases)} (looked in {folder})")
    return [cases[name] for name in names] if names else list(cases.values())
