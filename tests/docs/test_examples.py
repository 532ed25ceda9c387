"""Every Python block of README and of the site runs by itself, and so does every command.

Each block is a process of its own, in a folder that has the files that earlier ones of its page wrote.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys

import pytest
from support.examples import ELSEWHERE, ROOT, Block, blocks, prepared, run_block
from support.forked import forks_of
from support.variants import youbot_urdf

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def arm(name):
    """The URDF of a robot whose tip is tool0."""
    text = youbot_urdf().replace('<robot name="youbot">', f'<robot name="{name}">')
    return text.replace('"tip"', '"tool0"')


def page_file(page, text):
    """A file that a page shows."""
    (found,) = (b.text for b in blocks(ROOT / "docs" / f"{page}.md") if text in b.text)
    return found


SUITE = """
schema = 1
name = "{name}"
duration = 0.02
controllers = {{ {laws} }}
groups = [{{ robots = ["youbot"], tasks = ["circle"] }}]
tuning = {{ trials = 1, duration = 0.02 }}
"""
LAWS = ("tsm", "pseudo-inverse", "damped-least-squares", "extended-jacobian")
SLURM = """
import sys, time

class SLURMCluster:
    scheduler_address = "tcp://10.0.0.1:8786"

    def __init__(self, **options):
        time.sleep = lambda _: sys.exit()  # it waits for its jobs for ever

    def scale(self, *, jobs):
        pass
"""


def small(name, laws=LAWS):
    return SUITE.format(name=name, laws=", ".join(f'{law} = {{ law = "{law}" }}' for law in laws))


# What a page supposes that its reader has: files, and results of suites that it talks about.
GIVEN = {
    "command_line": {"my.urdf": arm("my"), "my.toml": small("my", LAWS[:1])},
    "own_suite": {
        # visibly shorter
        "mine.toml": page_file("own_suite", 'name = "mine"').replace("= 8.0 ", "= 0.02 ")
    },
    "robots": {"path/to/husky_arm.urdf": arm("husky_arm")},
    "running": {"dask_jobqueue.py": SLURM},
}
RESULTS = {"report": "mobman bench run robustness", "results": "mobman bench run paper"}
LEFT = {
    "start": {"tsm.h5", "baseline.h5", "runs.html", "errors.svg"},
    "own_suite": {"worst.pdf", "tables/example.tex", "results/mine/report.html"},
}
"""What a page leads to."""


@pytest.fixture(scope="module")
def forks():
    with forks_of(
        *("altair", "h5py", "optuna", "pandas", "scipy.optimize", "scipy.stats", "xarray"),
        *("mobman.simulation.simulate", "mobman.cli.main", "mobman.viewer.view"),
        "mobman.benchmark.report.report",
        prepare=prepared(),
    ) as forks:
        yield forks


def run_page(page, folder, forks):
    for name, text in GIVEN.get(page.stem, {}).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    if command := RESULTS.get(page.stem):
        run_block(Block(page, 0, "sh", command), folder, forks)
    for block in blocks(page):
        run_block(block, folder, forks)


@pytest.mark.parametrize(
    "page", [page for page in PAGES if blocks(page)], ids=lambda page: page.stem
)
def test_a_page_runs(page, forks, tmp_path):
    run_page(page, tmp_path, forks)
    assert [name for name in LEFT.get(page.stem, ()) if not (tmp_path / name).is_file()] == []
    if page.stem == "own_suite":
        report = (tmp_path / "results" / "mine" / "report.html").read_text(encoding="utf-8")
        assert "damped" in report
        assert "not said" not in report  # what it uses


@pytest.mark.slow
def test_the_suite_of_the_tutorial_at_its_full_length(tmp_path):
    """In processes as a reader starts them."""
    (tmp_path / "mine.toml").write_text(page_file("own_suite", 'name = "mine"'), encoding="utf-8")
    for block in blocks(ROOT / "docs" / "own_suite.md"):
        if block.language == "python":
            (tmp_path / "mine.py").write_text(block.text, encoding="utf-8")
            started = [["mine.py"]]
        else:
            started = [["-m", *words] for words in block.commands()]
        for words in started:
            subprocess.run([sys.executable, *words], cwd=tmp_path, check=True, timeout=3000)
    assert len(list((tmp_path / "results" / "mine" / "runs").glob("*.h5"))) == 24


def test_a_block_that_needs_a_name_of_an_earlier_one_is_named(forks, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```python\nx = 1\n```\n\nAnd:\n\n```python\n# more\nprint(x)\n```\n")
    with pytest.raises(AssertionError, match=r"page\.md, line 8 fails by itself") as failed:
        run_page(page, tmp_path, forks)
    assert re.search(r"line 9, in <module>[^+]*NameError", str(failed.value))


def test_a_command_that_no_test_runs_is_named(forks, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```sh\nmake test\nmobman metrics\nfrobnicate 'a b'\n```\n")
    with pytest.raises(AssertionError, match="no test runs frobnicate 'a b'"):
        run_page(page, tmp_path, forks)


def test_commands_that_other_tests_run_are_there():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert [path for path in ELSEWHERE.values() if path and not (ROOT / path).is_file()] == []
    for page in PAGES:
        for block in blocks(page):
            for words in block.commands():
                if words[0] == "make":
                    assert re.search(rf"^{words[1]}:", makefile, re.MULTILINE), shlex.join(words)
