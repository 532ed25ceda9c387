"""Texts of a record or a suite stay texts: in HTML, Markdown, CSV, LaTeX and the viewer's page."""

from __future__ import annotations

import csv
import io
import math
import re
from functools import cache
from html.parser import HTMLParser
from xml.etree import ElementTree

import pytest
from support.reported import made_up_metrics, made_up_record, made_up_run, results_of

import mobman as mm
from mobman.benchmark.report.data import csv_of
from mobman.benchmark.report.latex import escape, latex_table, write_latex
from mobman.benchmark.report.report import write_report
from mobman.benchmark.report.tables import Entry, Table
from mobman.figures import files
from mobman.viewer.view import View, make_scene

TEXTS = {
    "script": "</script><script>alert(1)</script>",
    "attribute": '"><img src=x onerror=alert(1)>',
    "apostrophe": "' onmouseover='alert(1)",
    "markdown": "a | b `c` [d](javascript:alert(1)) **e** ![f](g) ~~~ $x$ &lt;b&gt;\n\n# heading\n"
    "<img src=x>",
    "fence": "~~~",
    "formula": '=HYPERLINK("http://example.org/?"&A1)',
    "latex": "\\input{/etc/passwd}\\write18{x}%&_#{}~^^M[1pt]\x1b\x00\u202e$\\undefined$",
}
TEXTS["together"] = " ".join(TEXTS[name] for name in ("script", "attribute", "apostrophe", "latex"))
# Each by itself in make test-slow: a report of each takes seconds.
EACH = [
    name
    if name in ("together", "markdown", "fence")
    else pytest.param(name, marks=pytest.mark.slow)
    for name in TEXTS
]


def runs_with(hostile):
    """Runs whose every text is the one given, apart from what tells them apart."""
    names = [f"{hostile} {i}" for i in range(3)]
    record = made_up_record(
        status="diverged",
        **dict.fromkeys(("message", "robot", "controller", "task", "scenario", "created"), hostile),
        settings={hostile: hostile, "a": 0.1},
        versions={hostile: hostile, "mobman": "0.1.0"},
        joint_names=names,
        velocity_names=names[:2],
        metrics=made_up_metrics(1e-9, **{hostile: 1.0}),
        signals={},
    )
    return [
        made_up_run(
            label,
            error,
            robot=hostile,
            task=hostile,
            scenario=scenario,
            file=f"runs/{hostile}.h5",
            law=hostile,
            status=hostile if math.isinf(error) else "ok",
            message=hostile,
            metrics=made_up_metrics(error, **{hostile: 1.0}),
            settings={hostile: hostile, "a": 0.1},
            versions={hostile: hostile, "mobman": "0.1.0"},
            created=hostile,
            machine={"processor": hostile, hostile: hostile},
            acceleration=hostile,
            family=hostile,
            gains={hostile: hostile},
            command=hostile,
            replay=hostile,
            load=lambda: record,
        )
        for scenario in names[:2]
        for label, error in zip(names, (1e-9, 1e-3, math.inf), strict=True)
    ]


def results_with(hostile):
    """Results whose every text is the one given."""
    row = {
        "label": f"{hostile} 0",
        "robot": hostile,
        "task": hostile,
        "scenario": f"{hostile} 0",
        "state": "failed",
        "message": hostile,
        "family": hostile,
        "seed": 1,
    }
    about = {"name": hostile, "description": hostile, "seconds": 1.0, "workers": 2}
    return results_of(runs_with(hostile), [row], **about, folder=hostile, unused={hostile: hostile})


class Elements(HTMLParser):
    """What elements and attributes a page has."""

    def __init__(self, page):
        super().__init__()
        self.found, self.attributes = [], []
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.found.append(tag)
        self.attributes += [(name, value or "") for name, value in attributes]


def harmless(page, like):
    """The page has the scripts of one with plain texts, and nothing that could run another."""
    found, plain = Elements(page), Elements(like)
    assert found.found.count("script") == plain.found.count("script")
    assert found.found.count("img") == plain.found.count("img")
    handlers = {name for name, _ in found.attributes if name.startswith("on")}
    assert handlers == {name for name, _ in plain.attributes if name.startswith("on")}
    assert not [value for _, value in found.attributes if value.lower().startswith("javascript:")]
    for raw in ("<script>alert", "<img src=x", "</script><script>"):
        assert raw not in page


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """A function that gives the report of a text, and of plain ones."""

    @cache
    def report(name):
        hostile = {**TEXTS, "plain": "plain"}[name]
        return write_report(tmp_path_factory.mktemp(name), results_with(hostile))

    return report


def read(path):
    return path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", EACH)
def test_html(reports, name):
    harmless(read(reports(name).html), read(reports("plain").html))
    for figure in (reports(name).html.parent / "figures").glob("*.svg"):
        harmless(read(figure), "")
        ElementTree.fromstring(read(figure))


@pytest.mark.parametrize("name", EACH)
def test_markdown(reports, name):
    lines = read(reports(name).markdown).splitlines()
    plain = read(reports("plain").markdown).splitlines()

    def marks(lines, pattern):
        return sum(bool(re.match(pattern, line)) for line in lines)

    for pattern in (r"#+ ", r"\|---", r"<(details|summary|/details)", r"!\[", r"- ", "```", "~~~"):
        assert marks(lines, pattern) == marks(plain, pattern)
    outside = "\n".join(line for line in lines if not line.startswith("<summary>"))
    assert not re.search(r"(?<!\\)<(script|img)", outside, re.IGNORECASE)
    assert not re.search(r"(?<!\\)\]\(javascript", outside)
    inside = "\n".join(line for line in lines if line.startswith("<summary>"))
    assert not re.search(r"<(script|img)", inside)
    tables = re.findall(r"(?:^\|.*\n)+", "\n".join(lines) + "\n", re.MULTILINE)
    assert len(tables) == len(re.findall(r"(?:^\|.*\n)+", "\n".join(plain) + "\n", re.MULTILINE))
    for table in tables:
        rows = table.splitlines()
        assert len({len(re.findall(r"(?<!\\)\|", row)) for row in rows}) == 1
    assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e]", "\n".join(lines))


@pytest.mark.parametrize(
    "first", ["=1+1", "+1", "-1+cmd|' /C calc'!A0", "@SUM(A1)", "\t=1", "\r=1"]
)
def test_csv(first):
    rows = list(csv.reader(io.StringIO(csv_of(results_with(first)), newline="")))
    assert len(rows) == 1 + len(runs_with(first)) + 1
    number = re.compile(r"-?[0-9.e+-]+|-?inf|nan")
    texts = [cell for row in rows for cell in row if cell and not number.fullmatch(cell)]
    assert any(cell.startswith("'" + first.replace("\r", "\\r")) for cell in texts)
    assert not [cell for cell in texts if cell[0] in "=+-@\t\r"]


def test_csv_keeps_numbers():
    run = made_up_run("tsm", 1e-9, metrics=made_up_metrics(-1.5, settling=-math.inf))
    rows = list(csv.DictReader(io.StringIO(csv_of(results_of([run])))))
    assert (rows[0]["task_error_max"], rows[0]["settling"]) == ("-1.5", "-inf")


@pytest.mark.parametrize(
    "name", ["latex", *(pytest.param(n, marks=pytest.mark.slow) for n in ("formula", "markdown"))]
)
def test_latex(name, tmp_path, monkeypatch):
    if name != "latex":  # figures hold the same texts
        monkeypatch.setattr(files, "printed", lambda *charts, **options: b"")
    write_latex(tmp_path, results_with(TEXTS[name]))
    included = {path.stem for path in tmp_path.glob("*.tex")}
    for path in tmp_path.glob("*.tex"):
        content = read(path)
        assert set(re.findall(r"\\input\{([^}]*)\}", content)) <= included
        assert set(re.findall(r"\\[a-zA-Z]+", content)) <= COMMANDS
        assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e]", content)
        assert not re.search(r"(?<!\\)%|\^\^", content.replace("% For LaTeX", ""))


COMMANDS = set(
    re.findall(
        r"\\[a-z]+",
        r"\documentclass\usepackage\IfFileExists\begin\end\section\input\includegraphics\centering\caption\label"
        r"\resizebox\ifdim\width\linewidth\else\fi\toprule\midrule\bottomrule\addlinespace"
        r"\multicolumn\boldmath\textbf\textbackslash\textasciitilde\textasciicircum\textless"
        r"\textgreater\textbar\textquotedbl\textasciigrave\infty\times\cdot\textsuperscript\textmu"
        r"\to\ldots\lVert\rVert\num\numrange\sisetup",
        re.IGNORECASE,
    )
)


def test_latex_escapes_what_would_be_an_argument_of_the_row_before():
    table = Table("c", [Entry("a"), Entry("b")], [[Entry("[1pt]"), Entry("*")]])
    assert r"{[}1pt{]} & {*} \\" in latex_table(table)
    assert escape("\\input x\x1b\x7f\u202e") == (
        r"\textbackslash{}input x\textbackslash{}x1b\textbackslash{}x7f\textbackslash{}u202e"
    )


@pytest.mark.parametrize("name", ["script", "attribute", "apostrophe"])
def test_page_of_a_run(name):
    hostile = TEXTS[name]
    record = mm.simulate("youbot", "pseudo-inverse", "circle", duration=0.01)
    pages = []
    for words in (hostile, "plain"):
        record.robot = record.controller = record.task = record.scenario = words
        record.status = record.message = record.created = words
        record.settings = record.versions = {words: words}
        with View(make_scene([record, record])) as shown:
            pages.append(shown.html())
    harmless(*pages)


@pytest.mark.parametrize("name", ["script", "attribute", "apostrophe"])
def test_page_of_a_robot(name):
    hostile = TEXTS[name]
    spec = mm.load_robot("youbot").spec
    pages = []
    for words in (hostile, "plain"):
        changed = dict.fromkeys(("description", "source", "license"), words)
        robot = mm.load_robot(spec.model_copy(update={**changed, "tags": [words]}))
        robot.name = words
        with View(make_scene(robot)) as shown:
            pages.append(shown.html())
    harmless(*pages)
