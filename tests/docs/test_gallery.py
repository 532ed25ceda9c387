"""docs/examples/*.py: each runs, shortened, and draws its picture; the gallery's page is of them."""

from __future__ import annotations

import importlib.util
import runpy
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


_SPEC = importlib.util.spec_from_file_location("gallery", DOCS / "gallery.py")
gallery = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(gallery)


@pytest.mark.parametrize("name", gallery.NAMES)
def test_an_example_runs_and_draws(name, tmp_path):
    if name == "ground":
        pytest.importorskip("mujoco")
    script = runpy.run_path(str(DOCS / "examples" / f"{name}.py"))
    script["main"](tmp_path / "picture.svg", duration=0.1)
    assert (tmp_path / "picture.svg").read_text(encoding="utf-8").startswith("<svg")


@pytest.mark.parametrize("name", gallery.NAMES)
def test_an_example_is_short_and_says_what_it_shows(name):
    lines = (DOCS / "examples" / f"{name}.py").read_text(encoding="utf-8").splitlines()
    assert 10 <= len(lines) <= 40
    assert gallery.words(name)[0].endswith(".")


def test_every_script_is_in_the_gallery_and_the_page_is_its():
    scripts = {path.stem for path in (DOCS / "examples").glob("*.py")} - {"deploy"}
    assert scripts == set(gallery.NAMES)
    assert (DOCS / "gallery.md").read_text(encoding="utf-8") == gallery.page(), (
        f"{sys.executable} docs/gallery.py writes it anew"
    )
    for name in gallery.NAMES:
        assert (gallery.PICTURES / f"{name}.png").stat().st_size < 300_000
