"""Format of numbers and texts in a report, and the templates that they go into."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from typing import Any
from urllib.parse import quote

import jinja2
from markupsafe import Markup, escape

from mobman.benchmark.statistics import Interval
from mobman.display import printable
from mobman.figures import files

UNDEFINED = "–"
NEVER = "never"
_MARKDOWN = re.compile(r"([\\`*_{}\[\]<>#|~$&])")
_LONGEST = 400  # characters of a reason


def number(value: float, digits: int = 3) -> str:
    """Write a number with some significant digits; "∞" and "–" for inf and NaN."""
    if math.isnan(value):
        return UNDEFINED
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    if value == 0.0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    size = abs(float(f"{mantissa}e{exponent}"))  # rounded first: 9.999e-4 is 1.00e-3
    if 1e-3 <= size < 1e5:
        return f"{value:.{max(0, digits - 1 - math.floor(math.log10(size)))}f}"
    return f"{mantissa}e{int(exponent)}"


def metric_value(name: str, value: float) -> str:
    """Write a metric's value, without its unit; see :func:`metric_unit`."""
    if name == "success":
        return UNDEFINED if math.isnan(value) else "yes" if value == 1.0 else "no"
    if name.startswith("settling_time") and value == math.inf:
        return NEVER
    return number(1e6 * value if name.startswith("compute_time") else value)


def metric_unit(name: str, unit: str) -> str:
    """Give the unit in which :func:`metric_value` writes a metric; empty for plain numbers."""
    if name.startswith("compute_time") and unit == "s":
        return "µs"
    return "" if unit == "1" else unit


def instant(t: float) -> str:
    """Write an instant of a run, with its unit."""
    return UNDEFINED if math.isnan(t) else f"{t:.4g} s"


def rank_range(ranks: tuple[int, int] | None) -> str:
    """Write "1", "1–3", or a dash where there is no rank."""
    if ranks is None:
        return UNDEFINED
    return str(ranks[0]) if ranks[0] == ranks[1] else f"{ranks[0]}–{ranks[1]}"


def interval_range(interval: Interval, digits: int = 2) -> str:
    """Write an interval's ends."""
    return f"{number(interval.low, digits)} to {number(interval.high, digits)}"


def percent(interval: Interval) -> str:
    """Write an interval of shares."""
    return f"{100 * interval.low:.0f} to {100 * interval.high:.0f} %"


def p_value(value: float) -> str:
    """Write a p-value: no more zeros than anyone reads."""
    return "< 0.001" if value < 1e-3 else f"{value:.3f}"


def signed(value: float) -> str:
    """Write a difference."""
    if math.isinf(value):
        return "+∞" if value > 0 else "−∞"
    return f"{value:+.2f}".replace("-", "−")


def duration(seconds: float) -> str:
    """Write a wall time."""
    if seconds < 60.0:
        return f"{number(seconds)} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s"


def moment(iso: str) -> str:
    """Write a time of ISO 8601 to the minute and in UTC; anything else as it is."""
    try:
        return datetime.fromisoformat(iso).astimezone(UTC).strftime("%Y-%m-%d %H:%M UTC")
    except ValueError:
        return iso


def setting(value: Any) -> str:
    """Write the value of a gain or setting."""
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "the robot's own"}[value]
    if isinstance(value, float):
        return number(value) if len(repr(value)) > 8 else f"{value:g}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(setting(item) for item in value) + "]"
    return str(value)


def span(values: Sequence[float], scale: float, unit: str) -> str:
    """Write values in few words: "1 ms", "1, 2 and 5 ms", "1 to 100 ms (7 values)"."""
    texts = [f"{scale * value:g}" for value in sorted(set(values))]
    if len(texts) > 4:
        return f"{texts[0]} to {texts[-1]} {unit} ({len(texts)} values)"
    return f"{listing(texts)} {unit}"


def cut(words: str, most: int = _LONGEST) -> str:
    """Shorten a text to so many characters."""
    return words if len(words) <= most else words[: most - 1] + "…"


def listing(items: Sequence[str]) -> str:
    """Write "a, b and c"."""
    return " and ".join([", ".join(items[:-1]), items[-1]]) if len(items) > 1 else "".join(items)


def count(n: int, noun: str) -> str:
    """Write "1 run", "2 runs"."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def html_text(text: str) -> Markup:
    """Write text for HTML: escaped, with the paper's symbols set as such."""
    safe = str(escape(printable(text)))
    if "^" in safe:
        safe = re.sub(r"\be\^([ea])\b", r"<i>e</i><sup>\1</sup>", safe)
        safe = re.sub(r"(?<=\w|\|)\^(-?[0-9]+|T)\b", r"<sup>\1</sup>", safe)
    if "e-" in safe and " " in safe:
        # a line must not break after the hyphen of an exponent
        safe = re.sub(r"\b([0-9.]+e-[0-9]+)\b", r"<span>\1</span>", safe)
    return Markup(safe)


def markdown_text(text: str) -> str:
    """Write text for Markdown, on one line, so that it neither is mark-up nor ends a table's cell."""
    return _MARKDOWN.sub(r"\\\1", printable(" ".join(text.split())))


def slug(text: str) -> str:
    """Write text for anchors and file names."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "x"


@cache
def environment() -> jinja2.Environment:
    """Make the environment of the templates; those of HTML escape what they are given."""
    found = jinja2.Environment(
        loader=jinja2.PackageLoader("mobman.benchmark.report", "templates"),
        autoescape=jinja2.select_autoescape(enabled_extensions=("html.j2",)),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    found.filters |= {
        "symbols": html_text,
        "md": markdown_text,
        "slug": slug,
        "element": files.element,
        "address": quote,
        "plain": lambda text: escape(printable(str(text))),
    }
    found.globals |= {"scripts": files.scripts, "policy": files.POLICY, "chart_help": files.HELP}
    return found
