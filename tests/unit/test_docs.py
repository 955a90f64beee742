"""The texts a reader meets first: links lead somewhere, pictures carry nothing but pixels."""

import importlib
import re
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_relative_links_lead_to_files(page):
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8"))
    missing = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert not missing


@pytest.mark.parametrize("path", sorted((ROOT / "docs").rglob("*.png")), ids=lambda path: path.name)
def test_pictures_carry_no_text(path):
    """Blender writes the place of the .blend file on the machine that rendered it into every PNG."""
    with Image.open(path) as picture:
        picture.load()
        assert not picture.text


def test_page_of_settings_is_what_they_say_of_themselves(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    made = importlib.import_module("settings_page").page()
    assert made == (ROOT / "docs" / "manual" / "settings.md").read_text(encoding="utf-8"), "run `make manual`"
