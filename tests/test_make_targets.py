"""Every target of the Makefile does its work, on the smallest setting, in a small checkout."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import mobman

ROOT = Path(__file__).parents[1]
MAKE = shutil.which("make")

pytestmark = pytest.mark.skipif(MAKE is None, reason="there is no make")

SUITE = """
schema = 1
name = "small"
duration = 0.02

[controllers.tsm]
law = "tsm"
gains = { a = 0.2, A = 0.2 }

[[groups]]
robots = ["youbot", "tiago_no_hand"]
tasks = ["circle"]
scenarios = ["nominal", "heavier"]
"""
TESTS = """
import pytest


def test_sum() -> None:
    assert 1 + 1 == 2


@pytest.mark.slow
def test_product() -> None:
    assert 2 * 2 == 4
"""


class Checkout:
    """A folder with the Makefile and what its targets call; the programs are this environment's.

    Nothing can be installed in it: its pip fails, and its stamps say that all is there.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("benchmarks", ".ci"):
            shutil.copytree(
                ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__")
            )
        for name in ("docs", "docs/images", "tests", "tests/support", ".venv", ".venv/bin"):
            (folder / name).mkdir()
        scripts = ("docs/pictures.py", "docs/suite_table.py", "docs/claims.py", "docs/claims.toml")
        for name in ("Makefile", "pyproject.toml", "README.md", *scripts):
            shutil.copy(ROOT / name, folder / name)
        (folder / "small.toml").write_text(SUITE)
        (folder / "tests" / "test_small.py").write_text(TESTS.lstrip())
        # what the tests of mobman need takes a while to compile
        (folder / "tests" / "support" / "kernels.py").write_text('print("compiled the kernels")\n')
        python = f'exec "{sys.executable}"'
        own = (
            """--config 'lint.isort.known-first-party = ["mobman"]'"""  # which is not in the folder
        )
        self._program("python", f'{python} "$@"')
        self._program("mobman", f'{python} -m mobman "$@"')
        self._program("ruff", f'{python} -m ruff "$@" {own}')
        # make lint has run these two on all of mobman before these tests, and they take a while
        self._program("lint-imports", 'echo "checked the imports: $*"')
        self._program("mypy", 'echo "checked the types: $*"')
        self._program("pip", "exit 9")
        os.utime(folder / "pyproject.toml", (1.0, 1.0))  # older than the stamps
        # the stamps depend on it, and may not be older
        (folder / ".venv" / "python").touch()
        for extra in ("", "-test", "-speed", "-film", "-docs"):
            (folder / ".venv" / f"installed{extra}").touch()

    def _program(self, name: str, command: str) -> None:
        file = self.folder / ".venv" / "bin" / name
        file.write_text(f"#!/bin/sh\n{command}\n")
        file.chmod(0o755)

    def make(self, *arguments: str, status: int = 0, **variables: str) -> str:
        """Call make; what it and its programs printed."""
        inherited = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("PYTEST_", "MAKE", "MFLAGS"))
        }
        done = subprocess.run(
            [str(MAKE), *arguments],
            cwd=self.folder,
            env={
                **inherited,
                "PYTHONPATH": str(Path(mobman.__file__).parents[1]),
                "PYTEST_XDIST_AUTO_NUM_WORKERS": "1",
                **variables,
            },
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            check=False,
        )
        assert done.returncode == status, done.stdout
        return done.stdout


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    folder = tmp_path_factory.mktemp("checkout") / "mobman"
    folder.mkdir()
    return Checkout(folder)


@pytest.fixture(scope="module")
def browser_script():
    spec = importlib.util.spec_from_file_location("browser_script", ROOT / ".ci" / "browser.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def without_browser(tmp_path):
    """Variables with which no browser is found, nor apt-get."""
    return {"PATH": str(tmp_path), "PLAYWRIGHT_BROWSERS_PATH": str(tmp_path), "MOBMAN_BROWSER": ""}


def targets():
    return re.search(
        r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE
    )[1].split()


def test_help_says_what_every_target_does(checkout):
    listed = dict(re.findall(r"^make (\S+) +(\S.*)$", checkout.make("help"), re.MULTILINE))
    assert sorted(listed) == sorted(targets())
    assert all(len(words.split()) >= 3 for words in listed.values())
    assert checkout.make() == checkout.make("help")


@pytest.fixture(scope="module")
def results(checkout):
    """Of ``make bench``."""
    checkout.make("bench", "SUITE=small.toml")
    return checkout.folder / "results" / "small"


def test_bench_writes_results_and_report(results):
    assert (results / "report.html").is_file()
    assert len(list((results / "runs").glob("*.h5"))) == 4


def test_table_is_written_into_its_page(checkout):
    page = checkout.folder / "docs" / "suites.md"
    command = "docs/suite_table.py small.toml --rows controller,uses --below 1e-4"
    head = f"Before.\n\n<!-- by: {command} -->\n| law | uses | `nominal` |\n|---|---|---|\n"
    page.write_text(f"{head}| `tsm` | old |\n<!-- end -->\n\nAfter.\n")
    said = checkout.make("table", "TABLE=small.toml", status=2)  # the numbers drifted
    assert "1 drifted" in said or "rows DRIFTED" in said
    text = page.read_text(encoding="utf-8")
    assert text.startswith(head)
    assert text.endswith("<!-- end -->\n\nAfter.\n")
    assert re.search(r"^\| `tsm` \| z', M, J' \| [^|]*\(\d\) \|", text, re.MULTILINE)
    assert "all hold" in checkout.make("table", "TABLE=small.toml")


@pytest.mark.slow
@pytest.mark.usefixtures("results")
def test_pictures_draws_what_it_can_and_says_what_it_cannot(checkout, browser_script):
    """The charts need no browser, the views of robots do."""
    words = ("-o", "bench", "pictures", "SUITE=small.toml", "OPTIONS=--quick")
    images = {p.name for p in (ROOT / "docs" / "images").glob("*.png")} - {"fair.png"}
    if browser_script.found() is None:
        said = checkout.make(*words, status=2)
        assert "pictures.py: pictures and film need Chromium or Chrome, and there is none" in said
        assert "Traceback" not in said
        images = {name for name in images if not name.startswith("view-")}
    else:
        checkout.make(*words)
    assert {path.name for path in (checkout.folder / "docs" / "images").iterdir()} == images


@pytest.mark.slow
def test_speed_makes_every_measurement(checkout):
    checkout.make("speed", "OPTIONS=--quick --robots youbot")
    folder = checkout.folder / "results" / "speed"
    found = json.loads((folder / "speed.json").read_text(encoding="utf-8"))
    assert found["robots"].keys() == found["long_runs"].keys() == {"youbot"}
    assert found["growth"].keys() == {"joints", "dt", "workers"}
    assert found["real_time"]["factor"]["median"] > 0.0
    assert found["imports"].keys() >= {"pinocchio", "mobman", "mobman_used"}
    assert "### Growth" not in (folder / "speed.md").read_text(encoding="utf-8")
    assert (folder / "speed.svg").is_file()


@pytest.mark.parametrize(
    ("target", "script"), [("docs", "site/build.py build/site"), ("gallery", "gallery.py ")]
)
def test_docs_and_gallery_call_their_scripts(checkout, target, script):
    """tests/docs/test_site.py and test_gallery.py run these."""
    said = checkout.make(target, "--dry-run")
    assert said.strip("\n").splitlines()[-1].endswith(f"python docs/{script}")
    assert (ROOT / "docs" / script.split()[0]).is_file()


def test_test_runs_lint_and_then_the_tests(checkout):
    said = checkout.make("test")
    parts = (
        "ruff check .",
        "checked the imports: --no-logo",
        "checked the types:",
        "pytest -n auto",
    )
    assert [*parts] == sorted(parts, key=said.index)
    assert said.index("compiled the kernels") < said.index("pytest -n auto")
    assert "1 passed" in said.strip().splitlines()[-1]


@pytest.mark.slow  # test_nightly_runs_every_test sees how they are asked for
def test_slow_runs_the_slow_ones_alone(checkout):
    last = checkout.make("test-slow").strip().splitlines()[-1]
    assert "1 passed" in last


def test_nightly_runs_every_test(checkout):
    said = checkout.make("nightly", "--dry-run")
    assert said.count("pytest -n auto") == 2
    slow, claims = said.strip().splitlines()[-2:]
    assert "-m slow" in slow
    assert claims.endswith("docs/claims.py")


def test_lowest_asks_for_the_lowest_version_of_every_library(checkout):
    """Every library that a user installs has a lower bound, one alone, which `make lowest` tries."""
    said = checkout.make("--silent", "lowest", "OPTIONS=--constraints")
    lowest = dict(line.split("==") for line in said.split())
    with (ROOT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    extras = project["optional-dependencies"]
    named = [*project["dependencies"], *extras["gym"], *extras["mujoco"], *extras["film"]]
    assert {re.split("[>=]", one)[0] for one in named} <= lowest.keys()
    assert all(f"{name}>={version}" in str(project) for name, version in lowest.items())
    assert "ruff" not in lowest


def test_lint_finds_what_format_mends(tmp_path):
    checkout = Checkout(tmp_path)
    bad = tmp_path / "bad.py"
    bad.write_text("import sys\nimport os\nprint( os.sep,sys.argv )\n")
    checkout.make("lint", status=2)
    checkout.make("format")
    assert bad.read_text(encoding="utf-8") == "import os\nimport sys\n\nprint(os.sep, sys.argv)\n"


def test_clean_leaves_sources_and_results(tmp_path):
    checkout = Checkout(tmp_path)
    for name in ("build", "dist", ".mypy_cache", ".pytest_cache", ".ruff_cache", "results"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").touch()
    before = {path.name for path in tmp_path.iterdir()}
    checkout.make("clean")
    gone = before - {path.name for path in tmp_path.iterdir()}
    assert gone == {".venv", "build", "dist", ".mypy_cache", ".pytest_cache", ".ruff_cache"}


# The browser -----------------------------------------------------------------------------------


def test_browser_says_what_it_would_install(checkout, without_browser):
    said = checkout.make("browser", "OPTIONS=--dry-run", **without_browser)
    assert said.strip().splitlines()[-1].endswith("-m playwright install chromium")


def test_a_browser_that_does_not_start_is_not_replaced(checkout, without_browser):
    named = {**without_browser, "MOBMAN_BROWSER": str(shutil.which("false"))}
    said = checkout.make("browser", status=2, **named)
    assert "false does not start" in said


def test_system_packages_come_first_for_root(browser_script):
    system, fallback = browser_script.ways(root=True, apt="/usr/bin/apt-get")
    assert system[-1] == ["/usr/bin/apt-get", "install", "-y", "-qq", "chromium"]
    assert fallback[0][1:] == ["-m", "playwright", "install", "--with-deps", "chromium"]
    for root, apt in ((False, "/usr/bin/apt-get"), (True, None), (False, None)):
        ((command,),) = browser_script.ways(root=root, apt=apt)
        assert command == [sys.executable, "-m", "playwright", "install", "chromium"]


def test_ci_requires_what_it_installs(checkout, tmp_path):
    log = tmp_path / "log"
    required = "${MOBMAN_REQUIRE_BROWSER:-0} ${MOBMAN_REQUIRE_LATEX:-0}"
    for name in ("make", "pdflatex"):
        fake = tmp_path / name
        fake.write_text(f'#!/bin/sh\necho "$1 {required}" >> "{log}"\n')
        fake.chmod(0o755)
    subprocess.run(
        ["bash", checkout.folder / ".ci" / "run"],
        env={"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"},
        stdin=subprocess.DEVNULL,
        check=True,
    )
    assert log.read_text(encoding="utf-8").split("\n")[:-1] == [
        "browser 0 0",
        "test 1 1",
        "docs 1 1",
    ]
