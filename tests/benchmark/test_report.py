"""The report: what is in it, that it stands alone, and that it never lies by omission."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import tempfile
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from mobman.benchmark.report.charts import looks_for
from mobman.benchmark.report.data import Results
from mobman.benchmark.report.findings import limitations_of, summary_lines
from mobman.benchmark.report.format import (
    duration,
    html_text,
    listing,
    markdown_text,
    metric_value,
    moment,
    number,
    rank_range,
    setting,
    span,
)
from mobman.benchmark.report.gains import settings_of
from mobman.benchmark.report.report import write_report
from mobman.benchmark.report.standings import board_of
from mobman.benchmark.report.tables import metrics_table, summary_table, versions_table
from mobman.errors import MobmanError
from mobman.figures.charts import motors_by_size, thin
from mobman.simulation.metrics import list_metrics
from mobman.simulation.record import Record

NASTY = "at t = 0.25 s: <script>alert('x')</script> & | worse"
SUITE = {
    "name": "small",
    "description": "Two robots & <three> laws",
    "seconds": 83.0,
    "workers": 2,
}


def record(**changes) -> Record:
    """A small record of a run that converges, or what ``changes`` make of it."""
    n = changes.pop("n", 101)
    error = changes.pop("error", 1e-9)
    t = 0.01 * np.arange(n)
    size = np.maximum(4.0 * np.exp(-25.0 * t), error)
    metrics = {metric.name: 0.5 for metric in list_metrics()}
    metrics |= {"success": 1.0, "task_error_max": error, "repeatability": math.nan}
    metrics |= {"settling_time_1e-6": math.inf, "compute_time_median": 2.5e-4}
    fields = {
        "t": t,
        "q": np.zeros((n, 4)),
        "z": np.zeros((n, 3)),
        "torque": np.stack([100.0 * np.cos(t), np.sin(t), -t], axis=1),
        "tip_position": np.zeros((n, 2)),
        "tip_desired": np.zeros((n, 2)),
        "task_error": np.stack([size, np.zeros(n)], axis=1),
        "auxiliary_error": size[:, None],
        "compute_time": np.full(n, 2.5e-4),
        "signals": {},
        "metrics": metrics,
        "status": "ok",
        "message": "",
        "robot": "youbot",
        "controller": "tsm",
        "task": "paper",
        "scenario": "nominal",
        "seed": 0,
        "spec": {"scenario": {"acceleration": "exact"}},
        "settings": {"a": 0.0123, "c": 2.0, "discretization": "implicit"},
        "versions": {"mobman": "0.1.0", "python": "3.12.0"},
        "urdf_sha256": "0" * 64,
        "created": "2024-05-01T12:00:00+00:00",
        "joint_names": ["base_x", "phi_1", "y_1", "y_2"],
        "velocity_names": ["alpha_1", "alpha_2", "y_1"],
    }
    return Record(**{**fields, **changes})


def diverged(**changes) -> Record:
    """A record that ends early, with the numbers that such a run leaves."""
    ended = record(
        status="diverged",
        message=NASTY,
        n=26,
        settings={"a": 0.2, "c": 2.0, "discretization": "explicit"},
        **changes,
    )
    ended.metrics |= {"success": 0.0, "task_error_max": math.inf, "torque_peak": 1e99}
    ended.torque[-1] = 1e200
    ended.task_error[-2:] = [[1e160, 1e200], [np.nan, np.inf]]
    return ended


def run(label: str, content: Record, gains=None, **changes) -> dict:
    """The row of a run: what its record says, and how the samples are read."""
    names = ("robot", "task", "scenario", "seed", "status", "message", "metrics", "settings")
    fields = {
        **{name: getattr(content, name) for name in (*names, "versions", "created")},
        "label": label,
        "dt": 0.01,
        "duration": 1.0,
        "file": f"runs/{content.robot}-{content.scenario}-{label}.h5",
        "law": content.controller,
        "load": lambda: content,
        "acceleration": content.spec["scenario"]["acceleration"],
        "gains": gains or {},
    }
    return {**fields, **changes}


def results(*rows: list[dict]) -> Results:
    return Results([row for some in rows for row in some], **SUITE)


def runs() -> list[dict]:
    pinv = {"controller": "pseudo-inverse", "settings": {"K_p": 25.0, "K_v": 7.0}}
    found = []
    for robot, scenario in (("youbot", "heavier"), ("youbot", "nominal"), ("tiago", "nominal")):
        where = {"robot": robot, "scenario": scenario}
        missed = record(**where, **pinv, error=0.5)
        missed.metrics["success"] = 0.0
        found += [
            run("tsm", record(**where)),
            run("pinv", missed, {"Kv": 7.0}),
            run("tsm explicit", diverged(**where), {"discretization": "explicit", "a": 0.2}),
        ]
    return found


FAILURES = [
    {
        "label": "pinv",
        "robot": "tiago",
        "task": "paper",
        "scenario": "heavier",
        "dt": 0.01,
        "state": "failed",
        "message": "ModelError: <b>no tip</b>\nat all",
    }
]


class Page(HTMLParser):
    """What a test asks of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self._hidden = False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self._hidden = tag in ("style", "script")

    def handle_endtag(self, tag):
        self._hidden = False

    def handle_data(self, data):
        if not self._hidden:
            self.text.append(data)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    files = write_report(folder, results(runs(), FAILURES))
    assert files.html == folder / "report.html"
    assert files.markdown == folder / "report.md"
    return folder


@pytest.fixture(scope="module")
def html(folder) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(html) -> Page:
    return Page(html)


@pytest.fixture(scope="module")
def markdown(folder) -> str:
    return (folder / "report.md").read_text(encoding="utf-8")


def test_html_needs_nothing_from_outside(html, page):
    for tag, attributes in page.tags:
        assert tag not in ("link", "img", "iframe", "object", "embed")
        assert tag != "script" or "src" not in attributes
        for name in ("src", "href", "xlink:href", "data"):
            address = attributes.get(name) or "#"
            assert "//" not in address, (tag, address)
            assert not address.startswith(("data:", "javascript:", "/"))
    policy = next(a["content"] for tag, a in page.tags if a.get("http-equiv"))
    assert policy.startswith("default-src 'none'; ")
    assert "http" not in policy
    style = html[html.index("<style>") : html.index("</style>")]
    assert not re.search(r"url\(|@import|@font-face", style)
    assert html.count("vega-embed") > 1  # its script is in the page


def test_every_figure_is_in_the_html(page, folder):
    figures = [attributes for tag, attributes in page.tags if attributes.get("role") == "img"]
    named = [figure["aria-label"] for figure in figures]
    # leaderboard, two heat maps, two profiles, two efforts, an overview a group
    assert len([name for name in named if "against time" not in name]) == 1 + 2 + 2 + 2 + 2
    for cell in ("youbot, paper, heavier", "youbot, paper, nominal", "tiago, paper, nominal"):
        own = [name for name in named if "against time" in name and cell in name]
        # both errors, torques of a law by size of the motors, torques of two other controllers
        assert len([name for name in own if name.startswith("Norm")]) == 2
        assert len([name for name in own if name.startswith("Torques")]) == 2 + 2


def test_the_charts_of_the_html_are_specifications_without_code(page, html):
    found = re.findall(r'<script type="application/json">(.*?)</script>', html, re.DOTALL)
    assert len(found) == sum(attributes.get("role") == "img" for _, attributes in page.tags)
    for text in found:
        spec = json.loads(text)
        assert {"layer", "description", "width"} <= spec.keys()
        assert "url" not in text


def test_names_in_the_html_are_unique_and_found(page):
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    for tag, attributes in page.tags:
        for name in ("href", "xlink:href", "aria-labelledby"):
            address = attributes.get(name) or ""
            if address.startswith("#") or name == "aria-labelledby":
                assert not address or address.lstrip("#") in ids, (tag, address)
        for value in re.findall(r"url\(#([^)]+)\)", attributes.get("clip-path") or ""):
            assert value in ids


def test_html_holds_every_robot_scenario_controller_and_reason(page):
    text = " ".join(page.text)
    for word in ("youbot", "tiago", "nominal", "heavier", "tsm", "pinv", "tsm explicit"):
        assert word in text
    assert "<script>alert('x')</script> & | worse" in text
    assert "ModelError: <b>no tip</b>" in text
    assert "Two robots & <three> laws" in text
    for metric in list_metrics():
        assert metric.name in text


def test_html_escapes_what_it_is_given(html):
    assert "<script>alert" not in html
    assert "<b>no tip" not in html
    assert "&lt;script&gt;" in html


def test_html_links_the_records(page):
    links = {attributes.get("href") for tag, attributes in page.tags if tag == "a"}
    assert {item["file"].replace(" ", "%20") for item in runs()} <= links


def test_report_says_what_the_explicit_form_is(html, markdown):
    for text in (html, markdown):
        assert "chatters or diverges; shown for comparison" in text


def test_markdowns_figures_exist_and_are_whole(markdown, folder):
    links = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", markdown)
    assert links == ["figures/leaderboard.svg", "figures/youbot-paper-nominal-task-error.svg"]
    for link in links:
        svg = (folder / link).read_text(encoding="utf-8")
        assert svg.startswith("<svg")
        assert svg.rstrip().endswith("</svg>")


def test_markdowns_tables_are_tables(markdown):
    lines = markdown.splitlines()
    rules = [i for i, line in enumerate(lines) if re.fullmatch(r"\|(-+:?\|)+", line)]
    assert len(rules) >= 5
    for i in rules:
        columns = lines[i].count("|")
        for line in (lines[i - 1], *lines[i + 1 :]):
            if not line.startswith("|"):
                break
            assert len(re.findall(r"(?<!\\)\|", line)) == columns, line


def test_markdown_escapes_what_it_is_given(markdown):
    assert not re.search(r"(?<!\\)<script", markdown)
    assert r"\<script\>" in markdown
    assert r"\| worse" in markdown


def test_nominal_comes_first(page):
    text = " ".join(page.text)
    results = text[text.index("Results of all cells") :]
    assert results.index("nominal") < results.index("heavier")
    # the paper's figures are those of its task where nothing is changed
    figures = text[text.index("The paper’s Figs. 2 to 4") :]
    assert figures.index("youbot, paper, nominal") < figures.index("heavier")


def test_the_paper_is_named_where_its_task_is(tmp_path):
    other = write_report(tmp_path, results([{**item, "task": "circle"} for item in runs()]))
    for path in (other.html, other.markdown):
        text = " ".join(Page(path.read_text(encoding="utf-8")).text)
        assert "paper" not in text.replace("on paper", "")


def test_a_report_that_fails_leaves_the_old_one(tmp_path, monkeypatch):
    write_report(tmp_path, results(runs()[:1]))
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    def broken(*args, **kwargs):
        raise RuntimeError("broken template")

    monkeypatch.setattr("jinja2.Template.render", broken)
    with pytest.raises(RuntimeError, match="broken template"):
        write_report(tmp_path, results(runs()))
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_a_full_disk_leaves_the_old_report_and_no_litter(tmp_path, monkeypatch):
    write_report(tmp_path, results(runs()[:1]))
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    write = Path.write_bytes

    def full(self, *args, **kwargs):
        if "report.html" in self.name:
            raise OSError(28, "No space left on device", str(self))
        return write(self, *args, **kwargs)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(MobmanError, match="No space left on device"):
        write_report(tmp_path, results(runs()[:2]))
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


@pytest.mark.skipif(os.name == "nt", reason="folders take files there")
def test_a_folder_that_cannot_be_made_is_an_error_of_ours(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(MobmanError, match=r"cannot write .*another folder can be given"):
        write_report(tmp_path / "file" / "deeper", results(runs()[:1]))


def test_nothing_to_report_is_said(tmp_path):
    files = write_report(tmp_path, results([]))
    assert "There is no run to report." in files.html.read_text(encoding="utf-8")


def test_failures_alone_make_a_report(tmp_path):
    files = write_report(tmp_path, results(FAILURES))
    assert "ModelError" in files.html.read_text(encoding="utf-8")
    assert "ModelError" in files.markdown.read_text(encoding="utf-8")


@pytest.mark.filterwarnings("error")
def test_any_record_can_be_drawn(tmp_path):
    found = []
    for n in (1, 2, 101):
        odd = record(n=n)
        odd.task_error[:] = 0.0
        odd.auxiliary_error[:] = np.nan
        odd.torque[:] = np.nan
        odd.metrics.clear()
        cell = {"scenario": f"{n} samples"}
        found += [run("odd", odd, **cell), run("ended", diverged(), **cell)]
    files = write_report(tmp_path, results(found))
    assert files.html.read_text(encoding="utf-8").count('class="chart"') >= 9


def test_margins_of_monitored_runs_are_drawn(tmp_path):
    margins = {f"monitors/margin_{stage}": np.full(101, 3.0) for stage in ("kinematic", "dynamic")}
    found = [run("watched", record(signals=margins)), run("not watched", record())]
    page = write_report(tmp_path, results(found)).html.read_text(encoding="utf-8")
    for stage in ("kinematic", "dynamic"):
        assert page.count(f"Gain of the {stage} stage over what the theorems ask for") == 1
    plain = write_report(tmp_path, results([run("not watched", record())])).html
    assert "what the theorems ask for" not in plain.read_text(encoding="utf-8")


def test_a_report_needs_no_matplotlib():
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); from pathlib import Path; import test_report; "
        "before = [m for m in ('matplotlib',) if m in sys.modules]; "
        "test_report.write_report(Path(sys.argv[2]), test_report.results(test_report.runs()[:2])); "
        "print(before, 'matplotlib' in sys.modules)"
    )
    here = Path(__file__).parent
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", code, str(here), folder],
            capture_output=True,
            text=True,
            check=True,
        )
    assert done.stdout.strip() == "[] False"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (math.nan, "–"),
        (math.inf, "∞"),
        (-math.inf, "-∞"),
        (0.0, "0"),
        (1.0, "1.00"),
        (5.2671, "5.27"),
        (0.09996, "0.100"),
        (9.9999e-4, "0.00100"),
        (9.99e-4, "9.99e-4"),
        (123.4, "123"),
        (12345.6, "12346"),
        (99999.9, "1.00e5"),
        (1.234e29, "1.23e29"),
        (-1.5e-10, "-1.50e-10"),
    ],
)
def test_number(value, text):
    assert number(value) == text


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("settling_time_1e-4", math.inf, "never"),
        ("settling_time_1e-4", 5.267, "5.27"),
        ("task_error_max", math.inf, "∞"),
        ("repeatability", math.nan, "–"),
        ("success", 1.0, "yes"),
        ("success", 0.0, "no"),
        ("compute_time_p99", 8.41e-5, "84.1"),
    ],
)
def test_metric_value(name, value, text):
    assert metric_value(name, value) == text


def test_texts():
    assert listing([]) == ""
    assert listing(["a", "b", "c"]) == "a, b and c"
    assert duration(59.0) == "59.0 s"
    assert duration(271.0) == "4 min 31 s"
    assert duration(7300.0) == "2 h 1 min"
    assert moment("2024-05-01T14:00:00+02:00") == "2024-05-01 12:00 UTC"
    assert moment("yesterday") == "yesterday"
    assert setting([1.0, 0.05]) == "[1, 0.05]"
    assert span([1e-3, 2e-3, 1e-3], 1e3, "ms") == "1 and 2 ms"
    assert span([i * 1e-3 for i in range(1, 8)], 1e3, "ms") == "1 to 7 ms (7 values)"
    assert rank_range(None) == "–"
    assert setting(None) == "the robot's own"
    assert html_text("|e^e| < 1 m^2") == "|<i>e</i><sup>e</sup>| &lt; 1 m<sup>2</sup>"
    assert markdown_text("a | b\n<c>") == r"a \| b \<c\>"


def test_thinning_keeps_extremes_ends_and_gaps():
    t = np.linspace(0.0, 1.0, 10_001)
    values = np.sin(40.0 * t)
    values[[3333, 7777]] = 50.0, -50.0
    values[5000:5100] = np.nan
    thin_t, thinned = thin(t, values, 100)
    assert len(thin_t) < 400
    assert {50.0, -50.0} <= set(thinned)
    assert (thin_t[0], thin_t[-1]) == (0.0, 1.0)
    assert np.all(np.diff(thin_t) > 0)
    assert np.isnan(thinned[(thin_t >= t[5000]) & (thin_t < t[5100])]).all()
    assert np.isnan(thinned).any()


def test_looks_are_distinguished_and_explicit_ones_are_dashed():
    looks = looks_for(results(runs()))
    assert looks["tsm"].colour == looks["tsm explicit"].colour != looks["pinv"].colour
    assert looks["tsm explicit"].dashes[1] > 0.0
    assert looks["tsm"].dashes[1] == 0.0
    many = [run(f"law {i}", record(controller=f"law {i}")) for i in range(12)]
    assert len({(k.colour, k.dashes) for k in looks_for(results(many)).values()}) == 12


def test_motors_share_an_axis_with_their_like():
    torque = np.array([[1.0, -300.0, 2.0, 40.0, 0.0, 50.0]])
    assert motors_by_size(torque) == [[1, 3, 5], [0, 2, 4]]
    assert motors_by_size(np.zeros((5, 2))) == [[0, 1]]
    assert motors_by_size(np.zeros((0, 2))) == [[0, 1]]


def test_summary_counts_what_failed():
    found = results(runs(), FAILURES)
    text = "\n".join(summary_lines(found, board_of(found)))
    assert "10 runs: 3 controllers in 4 cells" in text
    assert "tsm in all of 3; pinv in none of 4; tsm explicit in none of 3" in text
    assert "3 runs diverged: tsm explicit (3)." in text
    assert "1 run gave no result by a fault of the software" in text
    assert "youbot, paper, nominal: smallest steady |e^e| with tsm" in text
    assert "tsm explicit does not finish" in text


def test_summary_table_is_the_worst_of_the_seeds():
    found = [run("tsm", record(seed=0)), run("tsm", record(seed=1, error=1e-5))]
    (row,) = summary_table(results(found), "youbot, paper").rows
    assert [entry.text for entry in row] == ["tsm", "1.00e-5", "2 of 2"]
    found.append(run("tsm", diverged(seed=2)))
    (row,) = summary_table(results(found), "youbot, paper").rows
    assert [entry.text for entry in row[1:]] == ["diverged at 0.25 s (1 of 3 seeds)", "2 of 3"]
    assert row[1].mark == "bad"


def test_best_is_among_those_that_succeed():
    cheap = diverged()
    cheap.metrics["torque_energy"] = 1e-3
    found = [run("cheap", cheap), run("a", record()), run("b", record())]
    found[1]["metrics"]["torque_energy"] = 0.4
    table = metrics_table(results(found), 0)
    row = next(row for row in table.rows if row[0].text == "torque_energy")
    assert [entry.mark for entry in row[2:]] == ["", "best", ""]


def test_metrics_of_another_version_are_shown():
    table = metrics_table(results([run("x", record(metrics={"novel": 3.0}))]), 0)
    row = next(row for row in table.rows if row[0].text == "novel")
    assert row[2].text == "3.00"


def test_where_gains_come_from():
    remarks = {item.label: item.remark for item in settings_of(results(runs()))}
    assert remarks["pinv"] == "Given: K_v = 7. All others are the law's defaults."
    assert "Given: a = 0.2, discretization = explicit." in remarks["tsm explicit"]
    tsm = "Found automatically: a = 0.0123. All others are the law's defaults."
    assert remarks["tsm"] == tsm


def test_controllers_from_elsewhere_have_settings_too():
    foreign = record(controller="not registered", settings={"k": 3.0})
    silent = record(controller="not registered", settings={})
    found = settings_of(results([run("x", foreign), run("y", silent)]))
    assert found[0].table is not None
    assert found[1].table is None


def test_mixed_versions_are_said():
    one, other = record(), record(versions={"mobman": "0.2.0", "python": "3.12.0"})
    assert versions_table(results([run("a", one)]))[1] == ""
    table, warning = versions_table(results([run("a", one), run("b", other)]))
    assert "mobman" in warning
    assert "python" not in warning
    assert table.rows[0][1].text == "0.1.0 (1 run), 0.2.0 (1 run)"


def test_limitations_are_those_of_the_runs():
    text = "\n".join(limitations_of(results(runs())))
    for words in (
        "equivalent control",
        "explicit",
        "One seed (0)",
        "without slip",
        "youBot",
        "chosen, not sampled",
        "limits of joints",
        "simulation",
    ):
        assert words in text
    pinv = [item for item in runs() if (item["label"], item["robot"]) == ("pinv", "tiago")]
    assert "equivalent control" not in "\n".join(limitations_of(results(pinv)))
    several = [run("a", record(seed=seed)) for seed in (0, 1)]
    assert "One seed" not in "\n".join(limitations_of(results(several)))


def test_every_curve_of_a_robot_with_many_motors_has_its_look(tmp_path):
    many = 60
    t = 0.01 * np.arange(101)
    torque = np.cos(t)[:, None] * np.arange(1.0, many + 1.0)
    names = [f"y_{i}" for i in range(many)]
    content = record(torque=torque, z=np.zeros((101, many)), velocity_names=names)
    write_report(tmp_path, results([run("tsm", content)]))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    looks: dict[str, tuple] = {}
    for found in re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL):
        spec = json.loads(found)
        if spec["description"].startswith("Torques"):
            line = next(item for item in spec["layer"] if item["mark"]["type"] == "line")[
                "encoding"
            ]
            colours, dashes = (line[name]["scale"] for name in ("color", "strokeDash"))
            for name, *look in zip(
                colours["domain"], colours["range"], dashes["range"], strict=True
            ):
                looks[name] = repr(look)
    assert sorted(looks) == sorted(names)
    assert len(set(looks.values())) == many
