"""Charts as Vega-Lite specifications, made by Altair: shared parts, and curves against time.

Texts of others are values of the data, titles and descriptions only: never a field's name, a format
or an expression.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import altair as alt
import numpy as np
from numpy.typing import NDArray

from mobman.arrays import Array
from mobman.display import printable
from mobman.figures.looks import Look, looks_of, motor_looks

Spec: TypeAlias = dict[str, Any]
FLOOR = 1e-12
"""Smallest error that is drawn (m): what is below it is rounding."""
GREY = "#8a8f96"
_PARTS = 3  # axes of motors of like size
_PICK = alt.selection_point(name="pick", fields=["label"], bind="legend", toggle="true")


class Curve(NamedTuple):
    """A thinned curve against time, with where it ended early (NaN if it did not)."""

    label: str
    t: Array
    values: Array
    end: float = math.nan


# Parts of every chart --------------------------------------------------------------------------------


def figure(chart: Any, title: str, **data: Sequence[Mapping[str, Any]]) -> Spec:
    """Make a specification of a chart: its title for those who cannot see it, and its named data."""
    return _filled(_bare(chart), title, **data)


def _bare(chart: Any) -> Spec:
    return {key: value for key, value in chart.to_dict().items() if key != "config"}


def _filled(spec: Spec, title: str, **data: Sequence[Mapping[str, Any]]) -> Spec:
    spec = copy.deepcopy(spec)
    spec["description"] = printable(title)
    if "layer" in spec:  # one of its own data is left out where there is none
        named = ((layer, layer.get("data", {}).get("name")) for layer in spec["layer"])
        spec["layer"] = [layer for layer, name in named if name is None or data.get(name)]
    for part in (spec, *spec.get("layer", ())):
        name = part.get("data", {}).get("name")
        if name is not None:
            rows = (
                {key: _value(value) for key, value in row.items()} for row in data.get(name, ())
            )
            part["data"] = {"values": list(rows)}
    return spec


def _value(value: Any) -> Any:
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_value(item) for item in value]
    # four digits are more than can be seen
    return float(f"{value:.4g}") if math.isfinite(value) else None


def layered(
    *layers: alt.Chart, data: str, height: float, zoom: str = "", legend: bool = True
) -> Any:
    """Layer charts of named data in a panel of some height (px), first the one with the looks, whose
    names in the legend, if there is one, can be clicked; axes to zoom are ``"x"``, ``"xy"`` or none."""
    chart = alt.layer(*layers, data=alt.NamedData(data)).properties(
        width="container", height=height
    )
    params: list[Any] = [_PICK] if legend else []
    if zoom:  # by the wheel with Shift: the plain one is for scrolling the page
        how: dict[str, Any] = {"encodings": list(zoom), "zoom": "wheel![event.shiftKey]"}
        params.append(alt.selection_interval(name="zoom", bind="scales", **how))
    return chart.add_params(*params)


def layer(data: str = "") -> alt.Chart:
    """Make a layer with data of its own, by their name; by default with those of the whole."""
    return alt.Chart(alt.NamedData(data)) if data else alt.Chart()


def looked(
    looks: Mapping[str, Look], *, line: bool = False, marker: bool = False, legend: bool = True
) -> dict[str, Any]:
    """Make the encodings that give each label its look, with dashes and widths of lines or with
    markers; with a legend, those that are not picked there fade."""
    scales = _scales(looks)
    wanted = {"color": alt.Color, **({"shape": alt.Shape} if marker else {})}
    wanted |= {"strokeDash": alt.StrokeDash, "strokeWidth": alt.StrokeWidth} if line else {}
    how: dict[str, Any] = {"field": "label", "type": "nominal", "title": None}
    how |= {} if legend else {"legend": None}
    found: dict[str, Any] = {
        name: channel(scale=alt.Scale(**scales[name]), **how) for name, channel in wanted.items()
    }
    if legend:
        found["opacity"] = alt.condition(_PICK, alt.value(1.0), alt.value(0.06))
    return found


def _scales(looks: Mapping[str, Look]) -> dict[str, dict[str, Any]]:
    """Make the scales by which labels have their looks, by encoding channel."""
    domain = [printable(label) for label in looks]
    ranges: dict[str, list[Any]] = {
        "color": [look.colour for look in looks.values()],
        "strokeDash": [list(look.dashes) for look in looks.values()],
        "strokeWidth": [look.width for look in looks.values()],
        "shape": [look.marker for look in looks.values()],
    }
    return {k: {"type": "ordinal", "domain": domain, "range": v} for k, v in ranges.items()}


def hovered(base: alt.Chart, x: str, y: str) -> Any:
    """Make the layer that shows the point of a curve nearest to the pointer, and its data."""
    fields = ["label", x]
    pointer: dict[str, Any] = {"on": "pointerover", "clear": "pointerout", "empty": False}
    near = alt.selection_point(name="near", nearest=True, fields=fields, **pointer)
    shown: Any = alt.condition(near, alt.value(1.0), alt.value(0.0))
    # Vega-Lite looks for texts of encoded tooltips in the wrong place if the nearest point is shown
    points = base.mark_point(
        filled=True, size=55, color=GREY, clip=True, tooltip={"content": "data"}
    )
    points = points.encode(x=f"{x}:Q", y=f"{y}:Q", opacity=shown)
    return points.properties(name="hover").add_params(near)


def log_axis(
    low: float, high: float, title: str | None, end: float | None = None
) -> dict[str, Any]:
    """Make title, scale and axis of a logarithmic encoding, with few round ticks.

    Failures are drawn at ``end``, beyond ``high``, if it is given.
    """
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    step = max(1, math.ceil((last - first + 1) / 7))
    ticks = [10.0**k for k in range(first, last + 1) if k % step == 0]
    if last - first < 2:
        near = [f * 10.0**k for k in range(first - 1, last + 1) for f in (1.0, 2.0, 5.0)]
        ticks = [tick for tick in near if low <= tick <= high * (1.0 + 1e-9)]
    label = "replace(datum.label, '+', '')"  # 1e0, not 1e+0
    if end is not None:
        ticks, label = [*ticks, end], f"datum.value > {high * 1.01:.6g} ? '∞' : {label}"
    form = "~g" if low > 1e-3 and high < 1e5 else "~e"
    axis: dict[str, Any] = {"values": ticks, "format": form, "labelExpr": label}
    scale = alt.Scale(type="log", domain=[low, high if end is None else 2.5 * end], nice=False)
    return {"title": title, "scale": scale, "axis": alt.Axis(**axis)}


def decades(values: Iterable[float], floor: float = FLOOR) -> tuple[float, float]:
    """Find the powers of ten around some values, not below the floor; one decade at least."""
    found = np.asarray(list(values), dtype=float)
    found = found[np.isfinite(found) & (found > 0.0)]
    if not len(found):
        return floor, 1.0
    low = max(math.floor(math.log10(found.min()) + 1e-9), round(math.log10(floor)))
    high = min(max(math.ceil(math.log10(found.max()) - 1e-9), low + 1), 300)
    return 10.0**low, 10.0**high


def line_at(name: str, channel: str, **mark: Any) -> alt.Chart:
    """Make a layer of dotted lines through the panel, at the field ``at`` of its own data."""
    mark = {"strokeDash": [2, 3], "color": GREY, **mark}
    place: Any = {channel: alt.X("at:Q") if channel == "x" else alt.Y("at:Q")}
    chart: alt.Chart = layer(name).mark_rule(**mark).encode(**place)
    return chart


# Curves against time -------------------------------------------------------------------------------


def thin(t: Array, values: Array, columns: int = 500) -> tuple[Array, Array]:
    """Keep the least and the largest value in each of some columns, in their order in time.

    Unlike every n-th sample this keeps what chatters as wide as it is. Samples that are not finite
    stay as gaps.

    Args:
        t: Increasing, shape (n,).
        values: Shape (n,).
        columns: How many columns the whole of t is divided into, at most.
    """
    n = len(t)
    if n <= 2 * columns:
        return t, values
    wide = -(-n // columns)
    rows = -(-n // wide)
    padded = np.full(rows * wide, np.nan)
    padded[:n] = values
    block = padded.reshape(rows, wide)
    finite = np.isfinite(block)
    first = wide * np.arange(rows)
    some = finite.any(axis=1)
    least = first + np.where(finite, block, np.inf).argmin(axis=1)
    largest = first + np.where(finite, block, -np.inf).argmax(axis=1)
    # what fills the last row up is a gap too, but not one of the curve's
    gaps = (first + finite.argmin(axis=1))[~finite.all(axis=1)]
    kept = np.unique(np.concatenate([[0, n - 1], least[some], largest[some], gaps[gaps < n]]))
    return t[kept], values[kept]


def norm_curve(
    label: str, t: Array, values: Array, end: float = math.nan, columns: int = 500
) -> Curve:
    """Thin the norm of a vector against time, shape (n, m), for a log axis: not below the floor."""
    with np.errstate(over="ignore", invalid="ignore"):
        x, y = thin(t, np.asarray(np.linalg.norm(values, axis=1)), columns)
    return Curve(label, x, np.where(np.isfinite(y), np.maximum(y, FLOOR), math.nan), end)


def _bends(t: Array, values: Array, height: float) -> NDArray[np.intp]:
    """Indices of the samples without which the curve would look different, to 0.1 % of its height."""
    kept = np.arange(len(t))
    for _ in range(4):
        if len(kept) < 3:
            break
        x, y = t[kept], values[kept]
        line = y[:-2] + (y[2:] - y[:-2]) * (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
        bent = ~(np.abs(y[1:-1] - line) <= 1e-3 * height)  # gaps, which are not finite, are kept
        bent[1::2] = True  # of two neighbours one stays
        kept = kept[np.concatenate([[True], bent, [True]])]
    return kept


@cache
def _against_time(log: bool) -> Spec:
    """Make the chart of curves against time, without data, looks and limits of the axes.

    Altair takes a tenth of a second for a chart, and a report has hundreds of this one.
    """
    x = alt.X("t:Q", title="t  (s)", scale=alt.Scale(domain=[0, 1], nice=False))
    y: Any = alt.Y("y:Q", scale=alt.Scale(domain=[-1, 1], nice=False))
    if log:
        y = alt.Y("y:Q", **log_axis(1e-12, 1.0, ""))
    look, curves = looked({}, line=True), layer().transform_flatten(["t", "y"])
    steady = layer("steady").mark_rect(color=GREY, opacity=0.09)
    ends = layer("ends").mark_point(shape="cross", angle=45, filled=True, size=70, clip=True)
    chart = layered(
        curves.mark_line(clip=True).encode(x=x, y=y, **look),
        steady.encode(x=alt.X("from:Q"), x2="to:Q"),
        line_at("marks", "y"),
        line_at("stop", "x", strokeDash=[1, 0]),
        ends.encode(x="t:Q", y="y:Q", color=look["color"], tooltip=["ended:N"]),
        hovered(curves, "t", "y"),
        data="curves",
        height=1,
        zoom="x",
    )
    return _bare(chart)


def time_chart(
    curves: Sequence[Curve],
    looks: Mapping[str, Look],
    *,
    title: str,
    axis: str,
    duration: float,
    log: bool = True,
    limits: tuple[float, float] | None = None,
    steady: float | None = None,
    mark: float | None = None,
    stop: float = math.nan,
    heading: str = "",
    height: float = 240.0,
) -> Spec:
    """Draw curves against time, the thinner above the wider.

    Args:
        curves: The curves.
        looks: By label.
        title: Of the figure.
        axis: Title of the vertical axis, which is logarithmic by default.
        duration: Where the axis of time ends (s).
        log: True for a logarithmic axis.
        limits: Of the vertical axis; by default around all values.
        steady: Where the steady part begins (s), which is shaded.
        mark: Value of a dotted line.
        stop: Where a vertical line shows that all ended (s).
        heading: Words above the panel.
        height: Of the panel (px).
    """
    shown = {label: looks[label] for label in looks if any(c.label == label for c in curves)}
    values = [c.values[np.isfinite(c.values)] for c in curves]
    every = np.concatenate([*values, np.zeros(0)])
    low, high = limits or (decades(every) if log else _around(every))
    rows, ends = [], []
    for curve in sorted(curves, key=lambda c: looks[c.label].depth):
        drawn = np.maximum(curve.values, low) if log else curve.values
        scaled, room = (np.log10(drawn), math.log10(high / low)) if log else (drawn, high - low)
        seen = _bends(curve.t, scaled, room)
        rows.append({"label": curve.label, "t": curve.t[seen], "y": drawn[seen]})
        finite = drawn[np.isfinite(drawn)]
        if math.isfinite(curve.end) and (not log or len(finite)):
            y = float(np.clip(finite[-1] if len(finite) else 0.0, low, high))
            words = f"{curve.label} ended at {curve.end:.4g} s"
            ends.append({"label": curve.label, "t": curve.end, "y": y, "ended": words})
    found = _filled(
        _against_time(log),
        title,
        curves=rows,
        ends=ends,
        steady=[] if steady is None else [{"from": steady, "to": duration}],
        marks=[{"at": mark}] if mark is not None and low < mark < high else [],
        stop=[{"at": min(stop, duration)}] if math.isfinite(stop) else [],
    )
    if heading:
        found["title"] = printable(heading)
    found["height"] = height
    for part in found["layer"]:
        encoding, scales = part["encoding"], _scales(shown)
        for channel in scales.keys() & encoding.keys():
            encoding[channel]["scale"] = scales[channel]
    encoding = found["layer"][0]["encoding"]  # of the lines
    encoding["x"]["scale"]["domain"] = [0, duration]
    encoding["y"]["title"] = axis
    encoding["y"]["scale"]["domain"] = [low, high]
    if log:
        encoding["y"]["axis"] = log_axis(low, high, "")["axis"].to_dict()
    return found


def _around(values: Array) -> tuple[float, float]:
    low, high = min(values.min(initial=0.0), 0.0), max(values.max(initial=0.0), 0.0)
    margin = 0.05 * (high - low) or 1.0
    return float(low - margin), float(high + margin)


def motors_by_size(torque: Array) -> list[list[int]]:
    """Group columns of torque that can share an axis, the largest first, in three parts at most.

    The largest of a part is no more than eight times its smallest, but for the last part; idle
    motors join the last, and the order within a part is that of the columns.
    """
    if len(torque) == 0:
        return [list(range(torque.shape[1]))]
    sizes = np.abs(np.where(np.isfinite(torque), torque, 0.0)).max(axis=0)
    parts: list[list[int]] = []
    largest = math.inf
    for motor in np.argsort(-sizes, kind="stable"):
        new = sizes[motor] < largest / 8.0 and sizes[motor] > 0.0 and len(parts) < _PARTS
        if not parts or new:
            parts.append([])
            largest = sizes[motor]
        parts[-1].append(int(motor))
    return [sorted(part) for part in parts]


def torque_charts(
    t: Array,
    torque: Array,
    names: Sequence[str],
    *,
    title: str,
    duration: float,
    end: float = math.nan,
    columns: int = 250,
    together: bool = False,
    heading: str = "",
) -> list[Spec]:
    """Draw the torques of a run against time, shape (n, motors), motors of like size on one axis, or all
    together; for the other arguments see :func:`time_chart` and :func:`thin`.

    The run ended early at ``end`` (s), if it did; the heading is above the first panel.
    """
    charts: list[Spec] = []
    how: dict[str, Any] = {"title": title, "axis": "v  (N m or N)", "duration": duration}
    torque = np.where(np.isfinite(torque), torque, np.nan)
    for motors in [[*range(len(names))]] if together else motors_by_size(torque):
        sizes = np.abs(torque[:, motors])
        sizes, limits = sizes[~np.isnan(sizes)], None
        if math.isfinite(end) and sizes.size >= 20:
            # the blow-up of a diverging run must not hide what led to it
            bound = 1.2 * float(np.quantile(sizes, 0.97))
            limits = (-bound, bound) if 0.0 < 3.0 * bound < sizes.max() else None
        curves = [Curve(names[i], *thin(t, torque[:, i], columns)) for i in motors]
        how |= {"limits": limits, "stop": end, "heading": "" if charts else heading}
        charts.append(time_chart(curves, motor_looks(names), log=False, height=150.0, **how))
    return charts


def run_charts(
    t: Array,
    errors: Mapping[str, Array],
    torque: Array,
    names: Sequence[str],
    *,
    law: str,
    title: str,
    ended: bool,
    ratios: Mapping[str, Mapping[str, Array]],
) -> list[Spec]:
    """Draw a run against time: norms of errors, ratios such as shares of limits, and torques.

    Args:
        t: Time (s), shape (n,).
        errors: Errors in columns, by the title of their axis.
        torque: Shape (n, motors).
        names: Of the motors.
        law: Of its controller, whose colour it has.
        title: Of the figure.
        ended: True if it ended early.
        ratios: Values by name, by the title of their axis, for a panel each in which 1 is marked.
    """
    duration = float(t[-1]) if len(t) and t[-1] > 0.0 else 1.0
    end = duration if ended else math.nan
    charts: list[Spec] = []

    def draw(axis: str, curves: list[Curve], looks: Mapping[str, Look], **options: Any) -> None:
        words = f"{axis} against time: {title}"
        how = {"duration": duration, "height": 150.0, **options}
        charts.append(time_chart(curves, looks, title=words, axis=axis, **how))

    for axis, values in errors.items():
        first = {} if charts else {"heading": title, "height": 240.0}
        draw(axis, [norm_curve(law, t, values, end)], looks_of({law: law}), **first)
    for axis, parts in ratios.items():
        if parts:
            curves = [Curve(name, *thin(t, own), end) for name, own in parts.items()]
            seen = np.concatenate([curve.values for curve in curves])
            limits = 1e-2, decades([10.0, *seen[np.isfinite(seen)]])[1]
            draw(axis, curves, motor_looks(list(parts)), limits=limits, mark=1.0)
    words = f"Torques against time: {title}"
    return charts + torque_charts(t, torque, names, title=words, duration=duration, end=end)
