"""Settings of Sphinx for the site, which `make docs` builds; its pages need no network."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from math_core import LatexError, LatexToMathML
from sphinx.util import logging

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import pages  # noqa: E402

from mobman import __version__  # noqa: E402

project, author, version, release = "mobman", "The mobman developers", __version__, __version__
copyright = "The mobman developers"
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_click",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
root_doc = "index"

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
myst_heading_slug_func = pages.anchor
suppress_warnings = ["config.cache"]  # a function among the settings

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_type_aliases = {"Array": "Array"}
python_use_unqualified_type_names = True
autodoc_typehints_format = "short"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"mobman {__version__}"
html_static_path = [str(HERE / "static")]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_math_renderer = "mathml"
html_theme_options = {"navigation_with_keys": True, "top_of_page_buttons": []}
pygments_style, pygments_dark_style = "friendly", "github-dark"

_TO_MATHML = LatexToMathML(fancy_error=False)


def _mathml(translator: Any, node: nodes.Element) -> None:
    """Write a formula as MathML, which browsers draw by themselves."""
    block = isinstance(node, nodes.math_block)
    try:
        written = _TO_MATHML.convert_with_local_state(node.astext(), displaystyle=block)
    except LatexError as error:  # a warning, so that the build fails
        logging.getLogger(__name__).warning("%s: %s", node.astext(), error, location=node)
        written = ""
    translator.body.append(f'<div class="formula">{written}</div>' if block else written)
    raise nodes.SkipNode


_as_written: dict[str, list[str]] = {}


def _norms(_app: Any, what: str, name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Docstrings write norms as |x|, which is markup in reStructuredText."""
    lines[:] = [
        "".join(
            part if part.startswith(("`", ":")) else part.replace("|", r"\|")
            for part in re.split(r"(``.*?``|(?::\w+:)?`.*?`)", line)
        )
        for line in lines
    ]
    if what in ("attribute", "property") and not any(line.endswith(":") for line in lines):
        _as_written[name] = list(lines)


def _no_types(
    _app: Any, _what: str, name: str, _object: Any, _options: Any, lines: list[str]
) -> None:
    """Undo what napoleon does: to it, what stands before a colon is an attribute's type."""
    lines[:] = _as_written.pop(name, lines)


def _long_signatures(
    _app: Any, what: str, _name: str, _object: Any, _options: Any, given: str, returned: str
) -> tuple[str, str] | None:
    """A record is not made by hand: the arguments of such a class are its attributes."""
    if what == "class" and given and given.count(",") > 12:
        return "", returned
    named = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")  # as an alias in a union is shown
    return tuple(named.sub(r"\1", one) if one else one for one in (given, returned))


def setup(app: Any) -> None:
    """Add the renderer of formulas and its font, and what docstrings need."""
    app.connect("autodoc-process-docstring", _norms, priority=400)  # before napoleon
    app.connect("autodoc-process-docstring", _no_types, priority=600)  # and after it
    app.connect("autodoc-process-signature", _long_signatures)
    app.add_html_math_renderer("mathml", (_mathml, None), (_mathml, None))
    package = importlib.util.find_spec("ziamath")
    fonts = Path(package.submodule_search_locations[0]) / "fonts"
    app.config.html_static_path.append(str(fonts / "STIXTwoMath-Regular.ttf"))
