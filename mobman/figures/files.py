"""Charts in files: SVG, PDF and PNG without a browser, and pages that need no network."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib import metadata
from importlib.resources import files
from pathlib import Path
from typing import Any

import platformdirs

from mobman.display import printable
from mobman.errors import MobmanError, UsageError
from mobman.figures.charts import GREY, Spec
from mobman.files import write_all

SUFFIXES = (".html", ".pdf", ".png", ".svg")
_WIDTH = 720.0  # px, of a figure in a file
_FONT = "system-ui, 'Liberation Sans', Arial, sans-serif"
_ENTRY = 165.0  # px, of a legend
_LEGENDS = {"color", "shape", "strokeDash", "strokeWidth"}
_EXPORT = "window.vegaEmbed = vegaEmbed"
# Said in the page itself: it loads nothing and sends nothing, whatever texts it holds.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:"
)


def config(
    ink: str, soft: str, line: str, font: str = _FONT, size: float = 11.0, longest: float = 320.0
) -> dict[str, Any]:
    """Make Vega-Lite's configuration for a page's colours of titles, of labels and of grids; labels have
    a size (px), and what is longer than some length (px) is cut."""
    colours = {"labelColor": soft, "titleColor": ink}
    sizes = {"titleFontSize": size * 12 / 11, "labelFontSize": size}
    words = {**colours, **sizes, "titleFontWeight": "normal"}
    symbols = {"symbolSize": 70, "symbolOpacity": 1}
    lines = {"domainColor": soft, "tickColor": soft, "gridColor": line}
    return {
        "background": None,
        "font": font,
        "axis": {**words, **lines, "labelLimit": longest},
        "legend": {**words, **symbols, "orient": "top", "labelLimit": 0.75 * longest},
        "title": {"color": ink, "fontSize": size * 12 / 11, "fontWeight": 600, "anchor": "start"},
        "view": {"stroke": line},
        "text": {"color": ink},
    }


_LIGHT = "#1c1e21", "#5a6068", "#e1e3e6"
CONFIGS = {"light": config(*_LIGHT), "dark": config("#e6e8ea", "#a4abb3", "#30343a")}
_PRINTED = {**CONFIGS["light"], "background": "white"}


def beside(
    specs: Sequence[Spec],
    *,
    across: bool = False,
    width: float | None = None,
    entry: float = _ENTRY,
) -> Spec:
    """Put charts into one figure for a file, one below the other, or across: one beside the other; each
    has a width, in which a legend's entry takes some room (px)."""
    if width is None:
        width = 0.5 * _WIDTH - 30.0 if across else _WIDTH
    charts = [_still(spec, width, "bottom" if across else "top", entry) for spec in specs]
    seen: list[Any] = []
    for chart in charts:  # a legend that is there already is not repeated
        legends = [layer["encoding"].get("color", {}) for layer in chart["layer"]]
        names = [legend.get("scale") for legend in legends if "legend" in legend]
        if names in seen:
            for encoding in (layer["encoding"] for layer in chart["layer"]):
                for channel in _LEGENDS & encoding.keys():
                    encoding[channel]["legend"] = None
        seen.append(names)
    alone = dict.fromkeys(_LEGENDS, "independent")
    return {
        "hconcat" if across else "vconcat": charts,
        "spacing": 20,
        "resolve": {"scale": alone, "legend": alone},
    }


def _still(spec: Spec, width: float, orient: str = "top", entry: float = _ENTRY) -> Spec:
    """Take away what only a page can show: names to click, values under the pointer, zoom."""
    if "layer" not in spec:
        return spec
    spec = {k: v for k, v in copy.deepcopy(spec).items() if k not in ("params", "$schema")}
    spec["width"] = width
    spec["layer"] = [layer for layer in spec["layer"] if layer.get("name") != "hover"]
    for layer in spec["layer"]:  # of two views of one name, both would show the last one's data
        layer.pop("name", None)
    for encoding in (layer["encoding"] for layer in spec["layer"]):
        encoding.pop("tooltip", None)
        if "param" in encoding.get("opacity", {}).get("condition", {}):
            del encoding["opacity"]
        for channel in _LEGENDS & encoding.keys():
            if encoding[channel].get("legend", 1) is not None and "field" in encoding[channel]:
                legend = {"columns": max(1, int(width / entry)), "orient": orient}
                encoding[channel]["legend"] = legend
    return spec


def drawn(spec: Spec, kind: str, look: Mapping[str, Any] = CONFIGS["light"]) -> bytes:
    """Draw a chart on white as ``"svg"``, ``"pdf"`` or ``"png"``."""
    import vl_convert

    spec = {"padding": 8, **_still(spec, _WIDTH)}
    options: dict[str, Any] = {"config": {k: v for k, v in look.items() if k != "background"}}
    if kind == "png":
        options["scale"] = 2.0
    try:
        found = getattr(vl_convert, f"vegalite_to_{kind}")(spec, allowed_base_urls=[], **options)
    except ValueError as error:
        raise MobmanError(f"cannot draw the figure: {str(error).splitlines()[0]}") from error
    return found.encode() if isinstance(found, str) else bytes(found)


_COLUMNS = {"single": 252.0, "double": 515.5}  # pt


@dataclass(frozen=True)
class Print:
    """Column, font and size of a paper's figures."""

    column: str = "single"
    """``"single"`` or ``"double"``: 3.5 or 7.16 inches wide, those of most journals' columns."""
    font: str = "Liberation Sans"  # its name, or "serif", "sans-serif"
    size: float = 8.0  # of labels (pt)

    def __post_init__(self) -> None:
        if self.column not in _COLUMNS:
            raise UsageError(f"column: found {self.column!r}; allowed are {', '.join(_COLUMNS)}")
        if not 4.0 <= self.size <= 24.0:
            raise UsageError(f"font size: found {self.size!r}; allowed are 4 to 24 pt")


def printed(specs: Sequence[Spec], how: Print, *, across: bool = False) -> bytes:
    """Draw charts as a PDF of exactly a column's width, to be included as it is.

    Raises:
        UsageError: If the font is not installed.
    """
    across, whole = across and how.column == "double", _COLUMNS[how.column]
    look = config(*_LIGHT, how.font, how.size * 11 / 12, 0.4 * whole)
    columns = len(specs) if across else 1
    inner = whole / columns - 60.0
    for _ in range(4):  # what labels take beside the plots is known once they are drawn
        charts = beside(_set(specs, how), across=across, width=inner, entry=10.0 * how.size)
        content = drawn({**charts, "padding": 2}, "pdf", look)
        box = re.search(rb"/MediaBox\s*\[\s*\S+\s+\S+\s+(\S+)", content)
        excess = float(box[1]) - whole if box else 0.0
        if abs(excess) < 1.0:
            break
        inner = max(inner - excess / columns, 30.0)
    if b"/BaseFont" not in content:  # of a font that is not there nothing is drawn
        raise UsageError(
            f"font: {how.font!r} is not installed here; allowed are installed ones, 'serif' and "
            "'sans-serif'"
        )
    return content


def _set(specs: Sequence[Spec], how: Print) -> list[Spec]:
    """Charts with the sizes that they state themselves in the print's."""

    def sized(part: Any) -> Any:
        if isinstance(part, list):
            return [sized(item) for item in part]
        if not isinstance(part, dict):
            return part
        own = {key: value if key == "datasets" else sized(value) for key, value in part.items()}
        return own | ({"fontSize": how.size * 11 / 12} if "fontSize" in part else {})

    share = how.size / 11.0 if how.column == "single" else 1.0
    return [{**sized(spec), "height": share * spec["height"]} for spec in specs]


def displayed(specs: Sequence[Spec]) -> Any:
    """Make one chart of Altair of several, which notebooks show."""
    import altair as alt

    return alt.Chart.from_dict({**beside(specs), "config": _PRINTED})


def save(path: Path, specs: Sequence[Spec], title: str) -> Path:
    """Write charts to one file, whole or not at all, in the form that its suffix names.

    Raises:
        UsageError: If the suffix is none of :data:`SUFFIXES`.
        MobmanError: If the file cannot be written.
    """
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        allowed = ", ".join(SUFFIXES)
        raise UsageError(
            f"cannot write a figure to {path.name}: the suffix must be one of {allowed}"
        )
    if kind == ".html":
        content = page(specs, title).encode("utf-8", "backslashreplace")
    else:
        content = drawn(beside(specs), kind[1:])
    write_all({path: content})
    return path


# Pages ---------------------------------------------------------------------------------------------


def element(spec: Spec) -> str:
    """Make the element of a page in which :func:`scripts` draws a chart."""
    label = escape(str(spec.get("description", "")), quote=True)
    # its room is kept, so that what is below does not move when it is drawn
    room = f'style="min-height: {spec["height"] + 55:.0f}px"'
    return (
        f'<div class="chart" role="img" {room} aria-label="{label}">'
        f'<script type="application/json">{json_text(spec)}</script></div>'
    )


def json_text(content: Any) -> str:
    """Write JSON so that it cannot end the script that it stands in."""
    text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return re.sub("[<>&\u2028\u2029]", lambda found: f"\\u{ord(found[0]):04x}", text)


def scripts() -> str:
    """Vega, once for the whole page, and what draws the charts that come into sight."""
    own = (files("mobman.figures") / "charts.js").read_text(encoding="utf-8")
    own = own.replace("CONFIGS", json_text(CONFIGS))
    return f"<script>{_vega()}</script>\n<script>{own}</script>"


@cache
def _vega() -> str:
    """Bundle Vega's script; it takes seconds, so that it is kept in the user's cache."""
    import vl_convert

    version = metadata.version("vl-convert-python")
    path = platformdirs.user_cache_path("mobman") / f"vega-{version}.js"
    with suppress(OSError, UnicodeDecodeError):
        return path.read_text(encoding="utf-8")
    found = re.sub("</(?=script)", r"<\\/", vl_convert.javascript_bundle(_EXPORT), flags=re.I)
    with suppress(MobmanError):  # a cache that cannot be written is none
        write_all({path: found.encode()})
    return found


def page(specs: Sequence[Spec], title: str) -> str:
    """Make a page of charts that needs no network."""
    words = escape(printable(title))
    style = (
        ":root{color-scheme:light dark}body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;"
        f"max-width:60rem;padding:0 1rem}}.chart{{width:100%}}.note{{color:{GREY}}}"
    )
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{words}</title>\n<style>{style}</style>\n</head>\n<body>\n<h1>{words}</h1>\n"
        + "\n".join(map(element, specs))
        + f'\n<p class="note">{HELP}</p>\n{scripts()}\n</body>\n</html>\n'
    )


HELP = (
    "Point at a curve for its values; click a name to hide the others, or more names to compare; drag "
    "to move, turn the wheel with Shift to zoom, double-click for the whole."
)
