"""Charts as specifications of Vega-Lite: shared parts, and curves against time.

Texts of others are values of the data, titles and descriptions only: never a field's name, a format
or an expression.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mobman.arrays import Array
from mobman.display import printable
from mobman.figures.looks import Look, looks_of, motor_looks

Spec: TypeAlias = dict[str, Any]
Rows: TypeAlias = Sequence[Mapping[str, Any]]
FLOOR = 1e-12
"""Smallest error that is drawn (m): what is below it is rounding."""
GREY = "#8a8f96"
SPAN = {"x": {"field": "from", "type": "quantitative"}, "x2": {"field": "to"}}
"""Encodings of what lies between two values."""
_SCHEMA = "https://vega.github.io/schema/vega-lite/v6.json"
_PARTS = 3  # axes of motors of like size
_PICK = {"type": "point", "fields": ["label"], "toggle": "true"}
_ZOOM = {"type": "interval", "encodings": ["x"], "zoom": "wheel![event.shiftKey]"}
"""By the wheel with Shift: the plain one is for scrolling the page."""
_NEAR = {"type": "point", "nearest": True, "on": "pointerover", "clear": "pointerout"}
_NONE: Spec = {"values": []}


class Curve(NamedTuple):
    """A thinned curve against time, with where it ended early (NaN if it did not)."""

    label: str
    t: Array
    values: Array
    end: float = math.nan


# Parts of every chart --------------------------------------------------------------------------------


def panel(
    title: str,
    layers: Sequence[Spec],
    rows: Rows,
    *,
    height: float,
    zoom: bool = True,
    legend: bool = True,
    heading: str = "",
) -> Spec:
    """Make the chart of layers on top of one another.

    Args:
        title: Its description for those who cannot see it.
        layers: First the one with the looks; those with rows of their own, but none, are left out.
        rows: Of all other layers.
        height: Of the panel (px).
        zoom: True if the horizontal axis can be moved and zoomed.
        legend: True if there is one, whose names can be clicked.
        heading: Words above the panel.
    """
    first, *others = layers
    near = [own["encoding"]["x"]["field"] for own in others if own.get("name") == "hover"]
    params: list[Spec] = [
        {"name": "near", "select": {**_NEAR, "fields": ["label", x]}, "views": ["hover"]}
        for x in near
    ]
    if legend:
        params.append({"name": "pick", "select": _PICK, "bind": "legend", "views": ["main"]})
    if zoom:
        params.append({"name": "zoom", "select": _ZOOM, "bind": "scales", "views": ["main"]})
    return {
        "$schema": _SCHEMA,
        "description": printable(title),
        **({"title": printable(heading)} if heading else {}),
        "data": _data(rows),
        "layer": [{**first, "name": "main"}, *(own for own in others if own.get("data") != _NONE)],
        "params": params,
        "width": "container",
        "height": height,
    }


def layer(
    mark: str,
    encoding: Mapping[str, Any],
    *,
    rows: Rows | None = None,
    flatten: Sequence[str] = (),
    only: str = "",
    name: str = "",
    **look: Any,
) -> Spec:
    """Make a layer: a mark with its look, and encodings by channel.

    By default it has the rows of the chart: with lists in fields, which are flattened, or those only for
    which an expression is true.
    """
    flattened = [{"flatten": list(flatten)}] if flatten else []
    parts = {
        "name": name,
        "data": None if rows is None else _data(rows),
        "transform": [*flattened, *([{"filter": only}] if only else [])],
        "mark": {"type": mark, **look},
        "encoding": dict(encoding),
    }
    return {key: part for key, part in parts.items() if part}


def _data(rows: Rows) -> Spec:
    return {"values": [{key: _value(value) for key, value in row.items()} for row in rows]}


def _value(value: Any) -> Any:
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_value(item) for item in value]
    # four digits are more than can be seen
    return float(f"{value:.4g}") if math.isfinite(value) else None


def quantity(field: str, **how: Any) -> Spec:
    """Make the encoding of a field of numbers."""
    return {"field": field, "type": "quantitative", **how}


def nominal(field: str, **how: Any) -> Spec:
    """Make the encoding of a field of words."""
    return {"field": field, "type": "nominal", **how}


def looked(
    looks: Mapping[str, Look], *, line: bool = False, marker: bool = False, legend: bool = True
) -> dict[str, Spec]:
    """Make the encodings that give each label its look, with dashes and widths of lines or with
    markers; with a legend, those that are not picked there fade."""
    domain = [printable(label) for label in looks]
    ranges: dict[str, list[Any]] = {"color": [look.colour for look in looks.values()]}
    if marker:
        ranges["shape"] = [look.marker for look in looks.values()]
    if line:
        ranges["strokeDash"] = [list(look.dashes) for look in looks.values()]
        ranges["strokeWidth"] = [look.width for look in looks.values()]
    how: dict[str, Any] = {"title": None} | ({} if legend else {"legend": None})
    found = {
        channel: nominal("label", scale={"type": "ordinal", "domain": domain, "range": own}, **how)
        for channel, own in ranges.items()
    }
    if legend:
        found["opacity"] = {"condition": {"param": "pick", "value": 1.0}, "value": 0.06}
    return found


def hovered(x: str, y: str, flatten: Sequence[str]) -> Spec:
    """Make the layer that shows the point of a curve nearest to the pointer, and its data."""
    shown = {"condition": {"param": "near", "value": 1.0, "empty": False}, "value": 0.0}
    how = {"x": quantity(x), "y": quantity(y), "opacity": shown}
    # Vega-Lite looks for texts of encoded tooltips in the wrong place if the nearest point is shown
    look: dict[str, Any] = {"filled": True, "size": 55, "color": GREY, "clip": True}
    return layer("point", how, name="hover", flatten=flatten, tooltip={"content": "data"}, **look)


def line_at(channel: str, values: Iterable[float], **look: Any) -> Spec:
    """Make a layer of dotted lines through the panel at some values."""
    look = {"strokeDash": [2, 3], "color": GREY, **look}
    rows = [{"at": value} for value in values]
    return layer("rule", {channel: quantity("at")}, rows=rows, **look)


def log_axis(low: float, high: float, title: str, end: float | None = None) -> dict[str, Any]:
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
    domain = [low, high if end is None else 2.5 * end]
    return {
        "title": title,
        "scale": {"type": "log", "domain": domain, "nice": False},
        "axis": {"values": ticks, "format": form, "labelExpr": label},
    }


def decades(values: Iterable[float], floor: float = FLOOR) -> tuple[float, float]:
    """Find the powers of ten around some values, not below the floor; one decade at least."""
    found = np.asarray(list(values), dtype=float)
    found = found[np.isfinite(found) & (found > 0.0)]
    if not len(found):
        return floor, 1.0
    low = max(math.floor(math.log10(found.min()) + 1e-9), round(math.log10(floor)))
    high = min(max(math.ceil(math.log10(found.max()) - 1e-9), low + 1), 300)
    return 10.0**low, 10.0**high


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
    linear = {"title": axis, "scale": {"domain": [low, high], "nice": False}}
    x = quantity("t", title="t  (s)", scale={"domain": [0, duration], "nice": False})
    y_axis = quantity("y", **(log_axis(low, high, axis) if log else linear))
    look, lists = looked(shown, line=True), ["t", "y"]
    part = [] if steady is None else [{"from": steady, "to": duration}]
    at_ends = {"x": quantity("t"), "y": quantity("y"), "color": look["color"]}
    cross: dict[str, Any] = {
        "shape": "cross",
        "angle": 45,
        "filled": True,
        "size": 70,
        "clip": True,
    }
    layers = [
        layer("line", {"x": x, "y": y_axis, **look}, flatten=lists, clip=True),
        layer("rect", SPAN, rows=part, color=GREY, opacity=0.09),
        line_at("y", [mark] if mark is not None and low < mark < high else []),
        line_at("x", [min(stop, duration)] if math.isfinite(stop) else [], strokeDash=[1, 0]),
        layer("point", {**at_ends, "tooltip": [nominal("ended")]}, rows=ends, **cross),
        hovered("t", "y", lists),
    ]
    return panel(title, layers, rows, height=height, heading=heading)


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
