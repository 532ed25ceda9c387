"""The documentation site: every page has its place, every link its page, and nothing needs a network."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

import mobman as mm

ROOT = Path(__file__).parents[2]
_SPEC = importlib.util.spec_from_file_location("site_pages", ROOT / "docs" / "site" / "pages.py")
pages = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(pages)
LISTED = [page for titles in pages.CONTENTS.values() for page in titles]


def test_every_page_has_one_place_in_the_contents():
    written = {path.stem for path in (ROOT / "docs").glob("*.md")}
    written |= {page.removesuffix(".md") for page in pages.ELSEWHERE.values()} - {"index"}
    assert written == {page for page in LISTED if not page.startswith("reference/")}
    assert len(LISTED) == len(set(LISTED))


def test_links_lead_to_pages_of_the_site(tmp_path):
    pages.write_pages(tmp_path / "pages")
    found = 0
    for page in (tmp_path / "pages").rglob("*.md"):
        text = pages.FENCE.sub("", page.read_text(encoding="utf-8"))
        for target in pages.LINK.findall("" if "orphan" in text[:20] else text):
            path = target[1].partition("#")[0]
            if path and not re.match(r"[a-z]+:", path):
                assert (page.parent / path).is_file(), (page.name, path)
                found += 1
    assert found > 200
    assert (tmp_path / "pages" / "source" / "mobman" / "controllers" / "tsm.py.md").is_file()


@pytest.mark.parametrize(
    ("text", "turned"),
    [
        ("[law](controllers.md#time-delay)", "[law](controllers.md#time-delay)"),
        ("[safe](../SECURITY.md)", "[safe](security.md)"),
        ("[it](https://x.org/a.md), [here](#there)", "[it](https://x.org/a.md), [here](#there)"),
        ("[x](examples/deploy.py)", "[x](source/docs/examples/deploy.py.md)"),
        ("`mobman/linalg.py`", "[`mobman/linalg.py`](source/mobman/linalg.py.md)"),
        ("`mobman/no_such.py`", "`mobman/no_such.py`"),
        ("```sh\n[a](b.md)\n```", "```sh\n[a](b.md)\n```"),
    ],
)
def test_links_of_the_repository_become_those_of_the_site(text, turned):
    assert pages.linked(text, "docs/page.md")[0] == turned


def test_a_link_that_leads_nowhere_is_an_error():
    with pytest.raises(FileNotFoundError, match=r"docs/page\.md: none\.md#x"):
        pages.linked("[a](none.md#x)", "docs/page.md")


def test_commands_that_the_pages_name_are_there():
    """Suites, scripts and targets of the Makefile."""
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md"))
    suites = set(re.findall(r"`mobman bench (?:run|tune) ([a-z]+)`", text))
    assert len(suites) >= 7
    assert suites <= set(mm.list_suites())
    scripts = set(re.findall(r"python ((?:benchmarks|docs)/[\w/]+\.py)", text))
    assert len(scripts) >= 5
    assert [script for script in scripts if not (ROOT / script).is_file()] == []
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = re.findall(r"^([a-z-]+):", makefile, re.MULTILINE)
    assert set(re.findall(r"`make ([a-z-]+)", text)) <= set(targets) | {"test", "test-slow"}


class _Loaded(HTMLParser):
    """Addresses of what a page loads by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if tag == "link" and given.get("rel") in ("search", "index", "next", "prev"):
            return
        name = {"link": "href", "script": "src", "img": "src", "iframe": "src"}.get(tag, "")
        if given.get(name):
            self.addresses.append(given[name])


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_loads_only_its_own_files(tmp_path):
    """`make docs` builds it in CI."""
    pytest.importorskip("furo")
    site = tmp_path / "site"
    script = ROOT / "docs" / "site" / "build.py"
    done = subprocess.run(
        [sys.executable, script, site], capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    for page in [*(f"{listed}.html" for listed in LISTED), "index.html", "search.html"]:
        parser = _Loaded()
        parser.feed((site / page).read_text(encoding="utf-8"))
        assert len(parser.addresses) > 5
        for address in parser.addresses:
            path = address.partition("?")[0]
            assert ((site / page).parent / path).is_file(), (page, address)
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))
    assert not re.search(r"(url\(|@import)\s*[\"']?(https?:)?//", styles)
    theory = (site / "theory.html").read_text(encoding="utf-8")
    assert theory.count("<math") > 300
    assert "tsm.py.html" in theory
    assert "mobman.simulate" in (site / "reference" / "api_runs.html").read_text(encoding="utf-8")
    assert "sliding/s" in (site / "reference" / "record_file.html").read_text(encoding="utf-8")
