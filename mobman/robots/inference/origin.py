"""Where a URDF comes from, and under which licence."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from itertools import islice
from pathlib import Path

_ABOVE = 6  # folders above the URDF that are looked in
_LICENCES = (
    (r"Apache(-| Software| License|,)*.{0,40}?(Version |-|v)? ?2(\.0)?\b", "Apache-2.0"),
    (r"Redistribution and use in source and binary forms.*Neither the name", "BSD-3-Clause"),
    (r"Redistribution and use in source and binary forms", "BSD-2-Clause"),
    (r"(BSD[ -]?3|(3|three)[ -]clause BSD)", "BSD-3-Clause"),
    (r"(BSD[ -]?2|(2|two)[ -]clause BSD)", "BSD-2-Clause"),
    (
        r"^MIT$|\bMIT[- ]Licen[cs]e|Licen[cs]e\W{0,3}MIT\b|Permission is hereby granted, free of charge",
        "MIT",
    ),
    (r"\bBSD\b", "BSD"),
)
"""What texts say, and the short name of SPDX; the ones that say most first."""
_IDENTIFIER = r"SPDX-License-Identifier: *([A-Za-z0-9][A-Za-z0-9.+-]*)"
_GNU = r"(?:GNU )?(?P<kind>Lesser|Library|Affero)? ?General Public License"
_GNU_SHORT = r"\b(?P<kind>L|A)?GPL"
_GNU_KINDS = {"lesser": "L", "library": "L", "affero": "A", "l": "L", "a": "A"}
_NUMBER = r"(?:[^0-9]{0,25}?\bv(?:ersion|er\.)?|[ -]?v?) ?(\d)(?:\.(\d))?\b"
_COMMONS = r"Creative Commons|\bCC[ -]BY\b|\bCC0\b"
_SEVERAL = r"[,;/]|\band\b|\bor\b(?!.{0,30}later)"
_COMMONS_PARTS = (
    (r"Non-?Commercial|\bNC\b", "NC"),
    (r"No-?Deriv|\bND\b", "ND"),
    (r"Share-?Alike|\bSA\b", "SA"),
)
_HEADER = 3000  # characters at the start of a file where a header is
_LINE = 160  # characters of it that are quoted


def licence(path: Path) -> str:
    """What the URDF's header says, or the nearest package.xml or licence file above it.

    ``not stated`` where nothing says it.
    """
    if said := _named_in(" ".join(_comments(path))):
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


def header(path: Path) -> str:
    """The first comment of a URDF that says who wrote it, in one line; empty if there is none."""
    for comment in _comments(path):
        if re.search(r"author|copyright|\(c\)|©|export", comment, re.IGNORECASE):
            return comment if len(comment) <= _LINE else f"{comment[: _LINE - 3]}..."
    return ""


def _comments(path: Path) -> list[str]:
    """The comments at the start of a file, each in one line."""
    with path.open(encoding="utf-8", errors="replace") as file:
        start = file.read(_HEADER)
    comments = re.findall(r"<!--(.*?)-->", start, re.DOTALL)
    return [" ".join(re.sub(r"[=|*#-]{2,}|\|", " ", text).split()) for text in comments]


def _of_package(path: Path) -> str:
    try:
        found = ET.parse(path).getroot().find("license")
    except (ET.ParseError, OSError):
        return ""
    said = "" if found is None else " ".join((found.text or "").split())
    if said.lower() in ("", "todo", "unknown"):
        return ""
    return said if re.search(_SEVERAL, said) else _named_in(said) or said


def _of_text(path: Path) -> str:
    try:
        text = " ".join(path.read_text(encoding="utf-8", errors="replace")[:6000].split())
    except OSError:
        return ""
    return _named_in(text)


def _named_in(text: str) -> str:
    """The short name of the licence that a text speaks of; empty if it speaks of none."""
    if (identifier := re.search(_IDENTIFIER, text)) is not None:
        return identifier[1]
    if said := _creative_commons(text) or _gnu(text):
        return said
    return next(
        (name for pattern, name in _LICENCES if re.search(pattern, text, re.IGNORECASE)), ""
    )


def _creative_commons(text: str) -> str:
    start = re.search(_COMMONS, text, re.IGNORECASE)
    if start is None:
        return ""
    said = text[start.start() : start.start() + _LINE]
    if re.search(r"CC0|Zero", said, re.IGNORECASE):
        return "CC0-1.0"
    parts = [part for pattern, part in _COMMONS_PARTS if re.search(pattern, said, re.IGNORECASE)]
    version = re.search(r"\b(\d\.\d)\b", said)
    return "-".join(["CC-BY", *parts, *([version[1]] if version else [])])


def _gnu(text: str) -> str:
    start = re.search(_GNU, text, re.IGNORECASE) or re.search(_GNU_SHORT, text)
    if start is None:
        return ""
    name = f"{_GNU_KINDS.get((start['kind'] or '').lower(), '')}GPL"
    said = text[start.end() : start.end() + _LINE]
    version = re.search(_NUMBER, said, re.IGNORECASE)
    if version is None:
        return name
    later = "-or-later" if re.search(r"\bor\b.{0,35}?\blater", said, re.IGNORECASE) else ""
    return f"{name}-{version[1]}.{version[2] or 0}{later}"
