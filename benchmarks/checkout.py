"""Imported first by the scripts: makes ``rebound`` this folder where there is no more than Python, numpy and moderngl.

Blender wants the repository's root to be the package, so no entry of sys.path can name it. In a virtual environment of
``make setup`` a link does, and nothing is left to do here.
"""

import importlib.util
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def _provide() -> None:
    if importlib.util.find_spec("rebound") is not None:
        return
    init = ROOT / "__init__.py"
    spec = importlib.util.spec_from_file_location("rebound", init, submodule_search_locations=[str(ROOT)])
    assert spec is not None and spec.loader is not None
    package = sys.modules["rebound"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(package)


_provide()
