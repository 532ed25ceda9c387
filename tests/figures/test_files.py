"""Charts in files, and of records."""

from __future__ import annotations

import json
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from support.reported import made_up_record

from mobman.errors import MobmanError, UsageError
from mobman.figures import charts, files
from mobman.figures.looks import looks_of

HOSTILE = "</script><script>alert(1)</script>\x1b[31m'\"`${1}\\"


def chart(label="tsm", **changes):
    t = np.linspace(0.0, 1.0, 200)
    curve = charts.Curve(label, t, np.exp(-9.0 * t))
    options = {"title": "Made up", "axis": "y", "duration": 1.0, "mark": 1e-3, "steady": 0.7}
    return charts.time_chart([curve], looks_of({label: label}), **{**options, **changes})


@pytest.mark.parametrize(
    ("kind", "start"), [("svg", b"<svg"), ("pdf", b"%PDF"), ("png", b"\x89PNG")]
)
def test_one_chart_in_every_form(tmp_path, kind, start):
    path = files.save(tmp_path / f"new/chart.{kind}", [chart(), chart("pseudo-inverse")], "Two")
    content = path.read_bytes()
    assert content.startswith(start)
    if kind == "svg":
        text = content.decode()
        ElementTree.fromstring(text)
        for word in ("tsm", "pseudo-inverse", "#0072b2", "#d55e00"):
            assert word in text
        assert "hover" not in text
    assert [item.name for item in path.parent.iterdir()] == [path.name]


def test_a_page_needs_nothing_from_outside(tmp_path):
    page = files.save(tmp_path / "chart.html", [chart()], "A & B").read_text(encoding="utf-8")
    assert "default-src 'none'" in page
    plain = re.sub(r"(<script[^>]*>).*?</script>", r"\1", page, flags=re.DOTALL)
    assert plain.count("<script") == 3
    assert not re.search(r"(src|href)=|url\(", plain)
    assert "A &amp; B" in page
    assert page.count("window.vegaEmbed=") == 1
    spec = json.loads(re.search(r'<script type="application/json">(.*?)</script>', page)[1])
    assert spec["data"]["values"][0]["label"] == "tsm"


def test_texts_of_others_stay_data(tmp_path):
    spec = chart(HOSTILE, title=HOSTILE, heading=HOSTILE)
    text = files.element(spec)
    assert text.count("<script") == text.count("</script") == 1
    inner = json.loads(re.search(r">(\{.*\})</script>", text)[1])
    assert "alert(1)" in inner["data"]["values"][0]["label"]
    assert "\x1b" not in json.dumps(inner, ensure_ascii=False)
    # no expression, field or format holds a text of others
    code = re.findall(
        r'"(?:expr|labelExpr|test|field|format|url|href)": ("[^"]*")', json.dumps(inner)
    )
    assert code
    assert not [item for item in code if "alert" in item]
    svg = files.drawn(spec, "svg").decode()
    assert ElementTree.fromstring(svg) is not None
    assert "<script" not in svg
    assert files.drawn(spec, "pdf").startswith(b"%PDF")


def test_another_suffix_is_refused_and_a_folder_that_is_a_file_is_said(tmp_path):
    with pytest.raises(UsageError, match=r"one of \.html, \.pdf, \.png, \.svg"):
        files.save(tmp_path / "chart.jpg", [chart()], "x")
    (tmp_path / "file").write_text("")
    with pytest.raises(MobmanError, match="cannot write"):
        files.save(tmp_path / "file" / "chart.html", [chart()], "x")


def test_vegas_script_is_kept_and_a_cache_that_cannot_be_written_is_none(tmp_path, monkeypatch):
    monkeypatch.setattr("vl_convert.javascript_bundle", lambda snippet: "a </script> b")
    place = tmp_path / "cache"
    monkeypatch.setattr("platformdirs.user_cache_path", lambda name: place)
    files._vega.cache_clear()
    try:
        assert files._vega() == r"a <\/script> b"
        (kept,) = place.iterdir()
        kept.write_text("kept")
        files._vega.cache_clear()
        assert files._vega() == "kept"
        kept.unlink()
        place.rmdir()
        place.write_text("a file")
        files._vega.cache_clear()
        assert files._vega() == r"a <\/script> b"
    finally:
        files._vega.cache_clear()


@pytest.mark.parametrize("suffix", ["html", "svg", "pdf", "png"])
def test_a_record_is_plotted(tmp_path, suffix):
    path = tmp_path / f"run.{suffix}"
    assert made_up_record(robot="<b>robot</b>").plot(path) == path
    assert path.stat().st_size > 1000
    if suffix in ("html", "svg"):
        text = path.read_text(encoding="utf-8")
        assert "alpha_1" in text
        assert "<b>robot" not in text


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("n", [1, 2, 50])
def test_any_record_can_be_plotted(n):
    odd = made_up_record(n, status="diverged", message="at t = 0.3 s: |z| is 1e9")
    odd.torque[:] = np.nan
    odd.task_error[-1] = 1e200
    odd.auxiliary_error[:] = 0.0
    shown = odd.plot().to_dict()
    assert len(shown["vconcat"]) >= 3
    assert "diverged" in shown["vconcat"][0]["title"]
