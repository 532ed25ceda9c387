"""CITATION.cff, CONTRIBUTING.md, and what the source distribution has."""

from __future__ import annotations

import re
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest

import mobman

ROOT = Path(__file__).parents[2]
CITATION = ROOT / "CITATION.cff"
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ADDITIONS = [
    "A robot",
    "A platform",
    "A controller",
    "A task",
    "A criterion",
    "A piece of a scenario, or a scenario",
    "A metric",
    "A suite",
    "A check of robots",
]


def citation():
    yaml = pytest.importorskip("yaml")
    return yaml.safe_load(CITATION.read_text(encoding="utf-8"))


def test_citation_has_the_fields_of_its_format():
    found = citation()
    assert found["cff-version"] == "1.2.0"
    assert found.keys() >= {"message", "title", "authors"}
    assert found["authors"] == [{"name": "The mobman developers"}]
    assert found["license"] == "BSD-2-Clause"


def test_citation_is_of_this_version():
    version = re.search(r"^version: (\S+)$", CITATION.read_text(encoding="utf-8"), re.MULTILINE)
    assert version is not None
    assert version[1] == mobman.__version__


def test_citation_and_readme_name_the_same_paper_and_version():
    paper = citation()["preferred-citation"]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (author,) = paper["authors"]
    said = f'{author["given-names"]} {author["family-names"]}, "{paper["title"]}", *{paper["journal"]}*'
    assert f"{said}, {paper['year']}." in readme
    assert f"version = {{{mobman.__version__}}}" in readme


@pytest.mark.parametrize("heading", ADDITIONS)
def test_contributing_says_how_to_add_each_thing_in_ten_lines(heading):
    section = CONTRIBUTING.split(f"\n## {heading}\n")[1].split("\n## ")[0].strip()
    assert 2 <= len(section.splitlines()) <= 10


def test_every_path_in_contributing_exists():
    named = re.findall(r"`([\w.-]*[/.][\w./-]+)`", CONTRIBUTING)
    paths = [name for name in named if name != "self.criterion" and "/my" not in name]
    assert len(paths) > 40
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_every_name_in_contributing_is_in_the_file_that_is_named_with_it():
    found = 0
    for line in CONTRIBUTING.splitlines():
        files = [ROOT / path for path in re.findall(r"`([\w./-]+\.py)`", line)]
        text = "".join(path.read_text(encoding="utf-8") for path in files)
        for name in re.findall(r"`([A-Z][A-Za-z_]+)` (?:of|in|\()", line):
            assert re.search(rf"^(class )?{name}\b", text, re.MULTILINE), line
            found += 1
    assert found >= 8


def test_registries_in_contributing_are_those_of_the_code():
    source = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "mobman").rglob("*.py"))
    for registry in re.findall(r"`(\w+)\.register\(", CONTRIBUTING):
        assert re.search(rf"^{registry}(: Registry| = types_of\()", source, re.MULTILINE), registry


def test_changelog_begins_with_what_is_not_released_and_has_this_version():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (\d+\.\d+\.\d+) \((.+)\)$", text, re.MULTILINE)
    versions = [tuple(map(int, version.split("."))) for version, _ in headings]
    assert versions == sorted(versions, reverse=True)
    assert mobman.__version__ in dict(headings)
    assert all(re.fullmatch(r"unreleased|\d{4}-\d\d-\d\d", when) for _, when in headings)


def test_the_list_for_releases_names_commands_and_files_that_exist():
    text = (ROOT / "docs" / "release.md").read_text(encoding="utf-8")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"`make (\w+)`", text):
        assert re.search(rf"^{target}: ", makefile, re.MULTILINE), target
    files = re.findall(r"`([\w/]+\.(?:py|md|cff|toml))`", text)
    assert len(files) >= 5
    assert [name for name in files if not (ROOT / name).exists()] == []
    extras = re.search(r"whl\[([\w,]+)\]", text)
    with (ROOT / "pyproject.toml").open("rb") as file:
        known = tomllib.load(file)["project"]["optional-dependencies"]
    assert extras is not None
    assert {*extras[1].split(",")} <= known.keys()


@pytest.fixture(scope="module")
def sdist(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sdist")
    subprocess.run(
        [sys.executable, "-m", "build", "--sdist", "--no-isolation", "--outdir", folder, ROOT],
        check=True,
        capture_output=True,
    )
    (file,) = folder.glob("*.tar.gz")
    with tarfile.open(file) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
        information = archive.extractfile(f"mobman-{mobman.__version__}/PKG-INFO")
        assert information is not None
        return names, information.read().decode()


def test_source_distribution_has_what_the_two_commands_need(sdist):
    names, _ = sdist
    assert names >= {
        *(
            "CITATION.cff",
            "CODE_OF_CONDUCT.md",
            "CONTRIBUTING.md",
            "README.md",
            "LICENSE",
            "Makefile",
            ".ci/run",
        ),
        *("pyproject.toml", "mobman/__init__.py", "robots/youbot.toml", "benchmarks/paper.toml"),
        *("tests/conftest.py", "docs/pictures.py"),
    }
    assert not [name for name in names if "__pycache__" in name]


def test_classifiers_name_the_versions_of_python(sdist):
    _, information = sdist
    versions = re.findall(r"^Classifier: .*Python :: (3\.\d+)$", information, re.MULTILINE)
    assert versions == ["3.11", "3.12", "3.13"]
    assert "Requires-Python: >=3.11" in information
