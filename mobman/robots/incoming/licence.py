"""The licence of a robot: by its URDF's header, its package, or the licence files above it."""

from __future__ import annotations

import re
import tomllib
from importlib.resources import files
from itertools import islice
from pathlib import Path

from mobman.errors import SpecError
from mobman.files import read_input
from mobman.robots.urdf.read import parse_xml

_ABOVE = 6  # folders above the URDF that are looked in
_IDENTIFIER = r"SPDX-License-Identifier: *([A-Za-z0-9][A-Za-z0-9.+-]*)"
_GNU = r"(?:GNU )?(?P<kind>Lesser|Library|Affero)? ?General Public License"
_GNU_SHORT = r"\b(?P<kind>L|A)?GPL"
_GNU_KINDS = {"lesser": "L", "library": "L", "affero": "A", "l": "L", "a": "A"}
_NUMBER = r"(?:[^0-9]{0,25}?\bv(?:ersion|er\.)?|[ -]?v?) ?(\d)(?:\.(\d))?\b"
_COMMONS = r"Creative Commons|\bCC[ -]BY\b|\bCC0\b"
_SEVERAL = r"[,;/]|\band\b|\bor\b(?!.{0,30}later)"
_HEADER = 3000  # characters at the start of a file where a header is
_LINE = 160  # characters behind a licence's name that belong to it
_PATTERNS: dict[str, list[tuple[str, str]]] = tomllib.loads(
    (files("mobman.robots.incoming") / "licences.toml").read_text(encoding="utf-8")
)
"""Short names and regular expressions of licences, and of the parts of Creative Commons' ones."""


def licence(path: Path) -> str:
    """The licence by the URDF's header, or the nearest package.xml or licence file above it."""
    if said := _named_in(" ".join(comments_of(path))):
        return f"{said} (says the URDF's header)"
    for folder in islice(path.parents, _ABOVE):
        package = folder / "package.xml"
        if package.is_file() and (said := _of_package(package)):
            return f"{said} (says {package.name} in {folder.name})"
        for file in sorted(folder.glob("LICEN[CS]E*")):
            if file.is_file() and (said := _of_text(file)):
                return f"{said} (says {file.name} in {folder.name})"
        if (folder / ".git").exists():
            break
    return "not stated"


def comments_of(path: Path) -> list[str]:
    """The comments at the start of a file, each in one line."""
    comments = re.findall(r"<!--(.*?)-->", _start(path, _HEADER), re.DOTALL)
    return [" ".join(re.sub(r"[=|*#-]{2,}|\|", " ", text).split()) for text in comments]


def _start(path: Path, count: int) -> str:
    with path.open(encoding="utf-8", errors="replace") as file:
        return file.read(count)


def _of_package(path: Path) -> str:
    try:
        content = read_input(path, "package's description", 1.0, "it has a few kB")
        said = " ".join((parse_xml(content, str(path))[0].findtext("license") or "").split())
    except SpecError:
        return ""
    if said.lower() in ("", "todo", "unknown"):
        return ""
    return said if re.search(_SEVERAL, said) else _named_in(said) or said


def _of_text(path: Path) -> str:
    try:
        return _named_in(" ".join(_start(path, 2 * _HEADER).split()))
    except OSError:
        return ""


def _named_in(text: str) -> str:
    """The short name of the licence that a text speaks of; empty if it speaks of none."""
    if identifier := re.search(_IDENTIFIER, text):
        return identifier[1]
    if start := re.search(_COMMONS, text, re.IGNORECASE):
        said = text[start.start() : start.start() + _LINE]
        if re.search(r"CC0|Zero", said, re.IGNORECASE):
            return "CC0-1.0"
        own = _PATTERNS["commons"]
        parts = [name for name, part in own if re.search(part, said, re.IGNORECASE)]
        version = re.search(r"\b(\d\.\d)\b", said)
        return "-".join(["CC-BY", *parts, *([version[1]] if version else [])])
    if start := re.search(_GNU, text, re.IGNORECASE) or re.search(_GNU_SHORT, text):
        name = f"{_GNU_KINDS.get((start['kind'] or '').lower(), '')}GPL"
        said = text[start.end() : start.end() + _LINE]
        if (version := re.search(_NUMBER, said, re.IGNORECASE)) is None:
            return name
        later = re.search(r"\bor\b.{0,35}?\blater", said, re.IGNORECASE)
        return f"{name}-{version[1]}.{version[2] or 0}{'-or-later' if later else ''}"
    own = _PATTERNS["licences"]
    return next((name for name, part in own if re.search(part, text, re.IGNORECASE)), "")
