"""Sections of the documentation's pages."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
_SPEC = importlib.util.spec_from_file_location("site_pages", DOCS / "site" / "pages.py")
_site_pages = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_site_pages)
anchor = _site_pages.anchor


def section(page: str, name: str) -> str:
    """The text below a heading, named by its anchor, up to the next of its level; without, all."""
    text = (DOCS / page).read_text(encoding="utf-8")
    if not name:
        return text
    headings = list(re.finditer(r"^(#+) (.+)$", text, re.MULTILINE))
    for i, found in enumerate(headings):
        if anchor(found[2]) == name:
            after = (one.start() for one in headings[i + 1 :] if len(one[1]) <= len(found[1]))
            return text[found.end() : next(after, len(text))]
    raise AssertionError(f"{page} has no section #{name}")
