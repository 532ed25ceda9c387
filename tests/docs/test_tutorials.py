"""Tutorials that begin on the command line: their commands and scripts, in an empty folder."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from support.forked import SHORT_RUNS, forks_of

DOCS = Path(__file__).parents[2] / "docs"


def blocks(page, language):
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def commands(page):
    console = "".join(blocks(page, "console"))
    return [shlex.split(line) for line in re.findall(r"^\$ mobman (.*)$", console, re.MULTILINE)]


def run(folder, *words):
    done = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=3000,  # a hang, not a slow machine
        check=False,
    )
    assert done.returncode == 0, (words, done.stderr)
    return done.stdout


def test_the_start_page_leads_to_its_pictures(tmp_path):
    (block,) = blocks("start", "python")
    assert len(commands("start")) == 3
    libraries = ("h5py", "scipy.optimize", "scipy.stats", "mobman.cli.main", "mobman.viewer.view")
    with forks_of("mobman.simulation.simulate", *libraries, prepare=SHORT_RUNS) as forks:
        for words in (*(["-m", "mobman", *words] for words in commands("start")), ["-c", block]):
            done = forks.run(*words, cwd=tmp_path)
            assert done.returncode == 0, (words, done.stderr)
    said = " ".join([*(word for words in commands("start") for word in words), block])
    named = set(re.findall(r"\w+\.(?:h5|html|svg)", said))
    assert named == {path.name for path in tmp_path.iterdir()}
    assert (tmp_path / "runs.html").stat().st_size > 100_000


@pytest.fixture
def suite(tmp_path):
    (file,) = blocks("own_suite", "toml")
    (script,) = blocks("own_suite", "python")
    (tmp_path / "mine.toml").write_text(file)
    (tmp_path / "mine.py").write_text(script)
    return tmp_path


def test_the_suite_of_the_tutorial_takes_a_law_from_a_script(suite):
    """With runs of 20 ms."""
    short = (suite / "mine.toml").read_text().replace("duration = 8.0 ", "duration = 0.02 ")
    assert "0.02" in short
    (suite / "mine.toml").write_text(short)
    said = run(suite, "mine.py")
    assert re.search(r"^controller +baseline +damped +tsm$", said, re.MULTILINE)
    assert (suite / "worst.pdf").read_bytes().startswith(b"%PDF")
    page = (suite / "results" / "mine" / "report.html").read_text(encoding="utf-8")
    assert "damped" in page
    assert "not said" not in page  # what it uses


@pytest.mark.slow
def test_the_suite_of_the_tutorial_ends_in_its_report(suite):
    show, bench, report = commands("own_suite")
    assert "16" in run(suite, "-m", "mobman", *show)
    for words in (bench, report):
        run(suite, "-m", "mobman", *words)
    assert (suite / "results" / "mine" / "report.html").is_file()
    assert (suite / "tables" / "example.tex").is_file()
    run(suite, "mine.py")
    assert len(list((suite / "results" / "mine" / "runs").glob("*.h5"))) == 24
