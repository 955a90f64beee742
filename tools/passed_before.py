"""Remember which suites passed for exactly this source tree, so that no run does them twice."""

from __future__ import annotations

import hashlib
import json
import subprocess
from typing import Any

from environments import ROOT

_FILE = ROOT / ".cache" / "passed.json"


def tree_hash() -> str | None:
    """A hash of every file that git tracks or would track; None outside a git checkout."""
    listing = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True
    )
    if listing.returncode != 0:
        return None
    digest = hashlib.sha256()
    for name in sorted(filter(None, listing.stdout.split(b"\0"))):
        path = ROOT / name.decode()
        digest.update(name + b"\0" + (path.read_bytes() if path.is_file() else b"") + b"\0")
    return digest.hexdigest()


def remember(key: str, outcome: dict[str, Any], tree: str | None) -> None:
    """Note that suite `key` passed with `outcome` on `tree`, unless a file was changed while it ran."""
    if tree is None or tree != tree_hash():
        return
    known = _load(tree) | {key: outcome}
    _FILE.parent.mkdir(exist_ok=True)
    _FILE.write_text(json.dumps({"tree": tree, "suites": known}, indent=1))


def recall(key: str) -> dict[str, Any] | None:
    """What suite `key` counted when it passed on this very tree, else None."""
    tree = tree_hash()
    return None if tree is None else _load(tree).get(key)


def _load(tree: str) -> dict[str, Any]:
    if not _FILE.exists():
        return {}
    content = json.loads(_FILE.read_text())
    return content["suites"] if content["tree"] == tree else {}
