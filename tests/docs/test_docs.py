"""The documentation against the code: tables are the code's, links lead somewhere.

Tables of what the code declares stand between ``<!-- table: NAME -->`` and ``<!-- end -->``;
``python tests/docs/test_docs.py`` writes them anew.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

import mobman as mm
from mobman.benchmark.suite import load_suite
from mobman.controllers.protocol import INFORMATION, controllers
from mobman.files import resource_folder
from mobman.model.platforms.body import Body
from mobman.model.platforms.platform import platforms
from mobman.simulation.disturbances import disturbances
from mobman.simulation.metrics import list_metrics
from mobman.simulation.scenario import Scenario
from mobman.tasks.task import list_tasks, parameters_of

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
README = ROOT / "README.md"
PAGES = sorted(DOCS.glob("*.md"))
OWN_ROBOTS = sorted(path.stem for path in resource_folder("robots").glob("*.toml"))
OWN_CONTROLLERS = [
    "adaptive",
    "computed-torque-integral",
    "damped-least-squares",
    "disturbance-observer",
    "extended-jacobian",
    "first-order-sliding",
    "linear-cascade",
    "mpc",
    "pseudo-inverse",
    "super-twisting",
    "task-priority",
    "time-delay",
    "tsm",
    "tsm-inverse-actuation",
    "tsm-null-space",
    "tsm-simplified",
    "whole-body-qp",
]
OWN_TASKS = [
    "paper",
    "circle",
    "figure-eight",
    "ellipse",
    "square",
    "lissajous",
    "line",
    "pose",
    "pose-circle",
    "pointing-circle",
    "waypoints",
    "path",
    "kinematic-singularity",
    "algorithmic-singularity",
]
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
TABLE = re.compile(r"(<!-- table: ([^>]*?) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.*)$", re.MULTILINE)


def gains_table(laws: str, known: frozenset[str] = frozenset()) -> str:
    """The gains of laws that have the same ones, but for those that are known."""
    first, *others = (controllers.get(name).Gains for name in laws.split())
    assert all(gains is first for gains in others), f"{laws} have different gains"
    rows = []
    for field in dataclasses.fields(first):
        if field.name in known:
            continue
        unit = field.metadata["unit"].replace(
            "see docs/theory.md", "[see theory](theory.md#gains-units-and-conditions)"
        )
        cells = (f"`{field.name}`", f"`{field.default!r}`", unit, _plain(field.metadata["meaning"]))
        rows.append(cells)
    return _table(("gain", "default", "unit", "meaning"), rows)


def added_gains_table(law: str) -> str:
    """The gains that a law has beyond those of the law that it derives from."""
    inherited = dataclasses.fields(controllers.get(law).Gains.__mro__[1])
    return gains_table(law, frozenset(field.name for field in inherited))


def laws_table(_: str = "") -> str:
    """The laws that come with mobman: what they use, and where they are."""
    rows = []
    for name in OWN_CONTROLLERS:
        law = controllers.get(name)
        marks = ("yes" if item in law.uses else "" for item in INFORMATION)
        file = law.__module__.removeprefix("mobman.controllers.")
        rows.append((f"`{name}`", *marks, f"`{file}.py`"))
    return _table(("law", *map(_plain, INFORMATION), "file in `mobman/controllers`"), rows)


def robots_table(columns: str = "") -> str:
    """The robots that come with mobman, in short or with their sources."""
    rows = []
    for name in OWN_ROBOTS:
        robot = mm.load_robot(name)
        spec = robot.spec
        mass = sum(link.mass for link in robot.model.inertias)
        numbers = (str(robot.n), str(robot.nz), f"{mass:.1f}")
        what = (spec.description,) if columns == "names" else (f"`{robot.tip}`", spec.source)
        licence = re.split(r"[;(]", spec.license)[0].strip() if columns == "names" else spec.license
        rows.append((f"`{name}`", spec.platform.type, *numbers, *what, licence))
    what = ("what it is",) if columns == "names" else ("tip", "source")
    return _table(("robot", "platform", "$n$", "`nz`", "kg", *what, "licence"), rows)


def suites_table(_: str = "") -> str:
    """The suites that come with mobman."""
    suites = [load_suite(path) for path in sorted(resource_folder("benchmarks").glob("*.toml"))]
    rows = [(f"`{suite.name}`", str(suite.size()), suite.description) for suite in suites]
    return _table(("suite", "runs", "what it is for"), rows)


def scenarios_table(_: str = "") -> str:
    """The scenarios that come with mobman."""
    rows = [(f"`{name}`", mm.load_scenario(name).description) for name in mm.list_scenarios()]
    return _table(("scenario", "what it does"), rows)


def tasks_table(_: str = "") -> str:
    """The tasks that come with mobman, with their parameters."""
    rows = []
    for name in OWN_TASKS:
        parameters = parameters_of(name)
        for item in parameters:
            default = "by the robot" if item.default is None else f"`{json.dumps(item.default)}`"
            task = f"`{name}`" if item is parameters[0] else ""
            rows.append((task, f"`{item.name}`", default, item.unit, _plain(item.meaning)))
        if not parameters:
            rows.append((f"`{name}`", "none", "", "", ""))
    return _table(("task", "parameter", "default", "unit", "meaning"), rows)


GENERATED = {
    "gains": gains_table,
    "added gains": added_gains_table,
    "laws": laws_table,
    "robots": robots_table,
    "scenarios": scenarios_table,
    "suites": suites_table,
    "tasks": tasks_table,
}


def generated(title: str) -> str:
    """The table of a marker such as ``gains of tsm``."""
    kind, _, of = title.partition(" of ")
    return GENERATED[kind](of)


def _table(headings: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [headings, ("---",) * len(headings), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def _plain(text: str) -> str:
    """Text in which Markdown sees no markup: the code's meanings have |x|, x_1 and x^2."""
    return re.sub(r"([|_*<])", r"\\\1", text)


def _prose(page: Path) -> str:
    return FENCE.sub("", page.read_text(encoding="utf-8"))


def _anchors(page: Path) -> set[str]:
    """GitHub's anchors of a page's headings."""
    headings = (re.sub(r"[`*$]", "", heading) for heading in HEADING.findall(_prose(page)))
    return {re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-") for text in headings}


def _first_cells(page: Path, heading: str) -> list[str]:
    """The names in backquotes in the first column of the tables under a heading."""
    section = page.read_text(encoding="utf-8").split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return re.findall(r"^\| `([^`]+)` \|", section, re.MULTILINE)


@pytest.mark.parametrize("page", [*PAGES, README], ids=lambda page: page.stem)
def test_generated_tables_are_the_codes(page):
    for _, title, content, _ in TABLE.findall(page.read_text(encoding="utf-8")):
        assert content == generated(title), (
            f"{page.name}: the table {title!r} is not what the code says; "
            "python tests/docs/test_docs.py writes it anew"
        )


def test_every_law_has_its_table_of_gains():
    text = (DOCS / "controllers.md").read_text(encoding="utf-8")
    titles = [title for _, title, _, _ in TABLE.findall(text)]
    documented = [name for title in titles for name in title.partition("gains of ")[2].split()]
    assert sorted(documented) == OWN_CONTROLLERS
    assert set(OWN_CONTROLLERS) <= set(mm.list_controllers())


def test_every_metric_is_explained():
    text = (DOCS / "metrics.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([^`]+)` \| ([^|]+?) \| ([^|]+?) \|", text, re.MULTILINE)
    metrics = list_metrics()
    assert sorted(name for name, _, _ in rows) == [metric.name for metric in metrics]
    stated = {name: (unit, better) for name, unit, better in rows}
    assert stated == {metric.name: (metric.unit, metric.better or "–") for metric in metrics}


def test_every_field_of_every_platform_type_is_explained():
    page = (DOCS / "platforms.md").read_text(encoding="utf-8")
    general = {"heading", "body"}
    numbers = page.split("\n## By numbers\n")[1]
    for name in platforms.names():
        section = page.split(f"\n## {name}\n")[1].split("\n## ")[0]
        own = platforms.get(name).fields.model_fields
        for field in own.keys() - general:
            assert f"`{field}`" in section, (name, field)
        body = get_args(own["body"].annotation)[0] if "body" in own else Body
        for field in body.model_fields:
            assert f"`{field}`" in numbers, (name, field)


def test_every_robot_scenario_task_and_disturbance_is_named():
    assert set(OWN_ROBOTS) <= set(mm.list_robots())
    scenarios = DOCS / "scenarios.md"
    assert sorted(_first_cells(scenarios, "Fields")) == sorted(Scenario.model_fields)
    assert sorted(_first_cells(scenarios, "Disturbances")) == disturbances.names()
    assert _first_cells(DOCS / "tasks.md", "Paths") == OWN_TASKS
    assert set(OWN_TASKS) <= set(list_tasks())


@pytest.mark.parametrize("page", [*PAGES, README], ids=lambda page: page.stem)
def test_links_lead_somewhere(page):
    for target in LINK.findall(_prose(page)):
        if re.match(r"[a-z]+:", target):
            continue  # other sites are not ours to test
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.exists(), f"{page.name}: {target}"
        if anchor:
            assert anchor in _anchors(there), f"{page.name}: {target}"


def test_this_file_is_a_script_that_needs_no_path():
    """As CONTRIBUTING has it."""
    here = {"cwd": Path(__file__).parent, "capture_output": True, "text": True}
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, "-c", "import test_docs"], env=environment, check=False, **here
    )
    assert done.returncode == 0, done.stderr


def write_tables() -> None:
    """Write the generated tables of all pages anew."""
    for page in (*PAGES, README):
        text = page.read_text(encoding="utf-8")
        written = TABLE.sub(lambda found: found[1] + generated(found[2]) + found[4], text)
        page.write_text(written, encoding="utf-8")


if __name__ == "__main__":
    write_tables()
