"""The measurement as a picture, ``speed.svg``: bars for each robot, and growth with the arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import altair as alt
import vl_convert

_BARS = {
    "bare_tick": ("(a) bare Pinocchio", "#9aa0a6"),
    "step": ("(b) our step", "#f2a65a"),
    "tick": ("(c) our tick", "#d1495b"),
    "pink_solve": ("(d) Pink solve_ik", "#66a182"),
    "mujoco_step": ("(e) MuJoCo step", "#2e4057"),
    "plain_tick": ("(f) plain loop", "#7a5195"),
}
_GROWTH = {
    "step": ("controller step", "#f2a65a"),
    "bare_controller": ("bare Pinocchio", "#9aa0a6"),
    "own": ("own work", "#d1495b"),
}


def draw(result: dict[str, Any], path: Path) -> None:
    """Write the picture."""
    charts = [_bars(result.get("robots", {}))]
    joints = result.get("growth", {}).get("joints")
    if joints is not None:
        charts.append(_growth(joints))
    whole = alt.hconcat(*charts, spacing=30).resolve_scale(color="independent", y="independent")
    whole = whole.configure(background="white", font="sans-serif").configure_view(stroke="#e1e3e6")
    path.write_text(vl_convert.vegalite_to_svg(whole.to_dict()), encoding="utf-8")


def _bars(robots: dict[str, Any]) -> alt.LayerChart:
    rows = [
        {"robot": f"{name} (r = {robot['nz']})", "what": label, **_interval(robot["seconds"][key])}
        for name, robot in robots.items()
        for key, (label, _) in _BARS.items()
        if robot["seconds"].get(key)
    ]
    x = {
        "x": alt.X("robot:N", title=None, sort=None, axis=alt.Axis(labelAngle=-25)),
        "xOffset": alt.XOffset("what:N"),
    }
    base = alt.Chart(alt.Data(values=rows)).encode(**x)
    y = alt.Y("median:Q", scale=alt.Scale(type="log"), title="time (µs)")
    bars = base.mark_bar().encode(y=y, color=_colour(_BARS))
    whiskers = base.mark_rule(strokeWidth=0.8).encode(y="low:Q", y2="high:Q")
    title = "a tick, medians and quartiles"
    return alt.layer(bars, whiskers).properties(width=460, height=280, title=title)


def _growth(joints: dict[str, Any]) -> alt.LayerChart:
    rows = [
        {"r": r, "what": label, **_interval(one)}
        for kind, (label, _) in _GROWTH.items()
        for r, one in zip(joints["nz"], joints[kind], strict=True)
    ]
    last_r, last = joints["nz"][-1], 1e6 * joints["own"][-1]["median"]
    cubic = [{"r": r, "median": last * (r / last_r) ** 3} for r in joints["nz"]]
    lowest = min(row["median"] for row in rows if row["median"] > 0.0)
    base = alt.Chart(alt.Data(values=rows))
    x = alt.X("r:Q", scale=alt.Scale(type="log"), title="r = length of z")
    x = x.axis(values=joints["nz"], format="d")
    scale = alt.Scale(type="log", domainMin=0.5 * lowest)
    y = alt.Y("median:Q", scale=scale, title="time (µs)")
    lines = base.mark_line(point=True).encode(x=x, y=y, color=_colour(_GROWTH))
    bands = base.mark_area(opacity=0.25, clip=True).encode(x=x, y="low:Q", y2="high:Q")
    bands = bands.encode(color=_colour(_GROWTH))
    cube = alt.Chart(alt.Data(values=cubic)).mark_line(strokeDash=[2, 2], color="black", clip=True)
    title = "a controller step on chains of 3 to 40 joints; dotted: r³"
    return alt.layer(bands, lines, cube.encode(x=x, y=y)).properties(
        width=320, height=280, title=title
    )


def _interval(one: dict[str, float]) -> dict[str, float]:
    return {key: 1e6 * one[key] for key in ("median", "low", "high")}


def _colour(names: dict[str, tuple[str, str]]) -> alt.Color:
    labels, colours = zip(*names.values(), strict=True)
    legend = alt.Legend(orient="bottom", columns=3)
    scale = alt.Scale(domain=list(labels), range=list(colours))
    return alt.Color("what:N", title=None, scale=scale, legend=legend)
