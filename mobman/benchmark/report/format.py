"""How numbers and texts are written in a report."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from markupsafe import Markup, escape

from mobman.benchmark.report.content import ReportedRun
from mobman.printable import printable

UNDEFINED = "–"
INFINITE = "∞"
NEVER = "never"

_MARKDOWN = re.compile(r"([\\`*_{}\[\]<>#|~$&])")


def number(value: float, digits: int = 3) -> str:
    """A number with some significant digits; "∞" and "–" for inf and NaN."""
    if math.isnan(value):
        return UNDEFINED
    if math.isinf(value):
        return INFINITE if value > 0 else "-" + INFINITE
    if value == 0.0:
        return "0"
    size = abs(float(f"{value:.{digits - 1}e}"))  # rounded first: 9.999e-4 is 1.00e-3
    if 1e-3 <= size < 1e5:
        decimals = max(0, digits - 1 - math.floor(math.log10(size)))
        return f"{value:.{decimals}f}"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def metric_value(name: str, value: float) -> str:
    """A metric's value, without its unit; see :func:`metric_unit`."""
    if name == "success":
        return UNDEFINED if math.isnan(value) else "yes" if value == 1.0 else "no"
    if name.startswith("settling_time") and value == math.inf:
        return NEVER
    return number(1e6 * value if name.startswith("compute_time") else value)


def metric_unit(name: str, unit: str) -> str:
    """The unit in which :func:`metric_value` writes a metric; empty for plain numbers."""
    if name.startswith("compute_time") and unit == "s":
        return "µs"
    return "" if unit == "1" else unit


def instant(t: float) -> str:
    """An instant of a run, with its unit."""
    return UNDEFINED if math.isnan(t) else f"{t:.4g} s"


def ended(status: str, t: float) -> str:
    """How a run that did not go to its end ended, in a few words."""
    return status if math.isnan(t) else f"{status} at {instant(t)}"


def ending(run: ReportedRun) -> str:
    """How a run ended, in a few words."""
    return "completed" if run.ok else ended(run.status, run.end)


def duration(seconds: float) -> str:
    """A wall time."""
    if seconds < 60.0:
        return f"{number(seconds)} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s"


def moment(iso: str) -> str:
    """A date and time of ISO 8601, to the minute and in UTC; as it is if it is something else."""
    try:
        return datetime.fromisoformat(iso).astimezone(UTC).strftime("%Y-%m-%d %H:%M UTC")
    except ValueError:
        return iso


def setting(value: Any) -> str:
    """The value of a gain or setting."""
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "the robot's own"}[value]
    if isinstance(value, float):
        return number(value) if len(repr(value)) > 8 else f"{value:g}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(setting(item) for item in value) + "]"
    return str(value)


def span(values: Sequence[float], scale: float, unit: str) -> str:
    """Values in few words: "1 ms", "1, 2 and 5 ms", "1 to 100 ms (7 values)"."""
    found = sorted(set(values))
    texts = [f"{scale * value:g}" for value in found]
    if len(texts) > 4:
        return f"{texts[0]} to {texts[-1]} {unit} ({len(texts)} values)"
    return f"{listing(texts)} {unit}"


def cut(words: str, most: int) -> str:
    """A text, of so many characters at the most."""
    return words if len(words) <= most else words[: most - 1] + "…"


def listing(items: Sequence[str]) -> str:
    """ "a, b and c"."""
    if len(items) < 2:
        return "".join(items)
    return ", ".join(items[:-1]) + " and " + items[-1]


def count(n: int, noun: str) -> str:
    """ "1 run", "2 runs"."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def html_text(text: str) -> Markup:
    """Text for HTML: escaped, with the paper's symbols set as such."""
    safe = str(escape(text))
    if "^" in safe:
        safe = re.sub(r"\be\^([ea])\b", r"<i>e</i><sup>\1</sup>", safe)
        safe = re.sub(r"(?<=\w|\|)\^(-?[0-9]+|T)\b", r"<sup>\1</sup>", safe)
    if "e-" in safe and " " in safe:
        # a line must not break after the hyphen of an exponent
        safe = re.sub(r"\b([0-9.]+e-[0-9]+)\b", r"<span>\1</span>", safe)
    return Markup(safe)


def markdown_text(text: str) -> str:
    """Text for Markdown, on one line, so that it is neither mark-up nor ends a table's cell."""
    return _MARKDOWN.sub(r"\\\1", one_line(text))


def one_line(text: str) -> str:
    """Text without line breaks and control characters."""
    return printable(" ".join(text.split()))


def slug(text: str) -> str:
    """Text for anchors and file names."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "x"
