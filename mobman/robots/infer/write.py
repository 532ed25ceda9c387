"""A robot's TOML with the reasons of its values as comments; the name, source and licence in it."""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Iterable, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from glob import escape
from importlib.resources import files
from itertools import islice
from pathlib import Path
from typing import Any

import tomlkit

from mobman.errors import SpecError, UsageError
from mobman.files import read_input
from mobman.robots.infer.findings import LICENCES, Inferred
from mobman.robots.infer.infer import Inference
from mobman.robots.spec import NAME, CriterionSource, Mount, UrdfSource, own_robots
from mobman.robots.urdf.read import parse_xml, urdf_file

_WIDTH = 100
_GENERIC = r"((robot|model|urdf|main|description)([_.-]|$))+"
"""File names that say nothing of the robot."""
_PACKAGE = "example-robot-data"
_ABOVE = 6  # folders above the URDF that are looked in
_IDENTIFIER = r"SPDX-License-Identifier: *([A-Za-z0-9][A-Za-z0-9.+-]*)"
_GNU = r"(?:GNU )?(?P<kind>Lesser|Library|Affero)? ?General Public License"
_GNU_SHORT = r"\b(?P<kind>L|A)?GPL"
_GNU_KINDS = {"lesser": "L", "library": "L", "affero": "A", "l": "L", "a": "A"}
_NUMBER = r"(?:[^0-9]{0,25}?\bv(?:ersion|er\.)?|[ -]?v?) ?(\d)(?:\.(\d))?\b"
_COMMONS = r"Creative Commons|\bCC[ -]BY\b|\bCC0\b"
_AUTHOR = r"author|copyright|\(c\)|©|export"
_SEVERAL = r"[,;/]|\band\b|\bor\b(?!.{0,30}later)"
_COMMONS_PARTS = (
    (r"Non-?Commercial|\bNC\b", "NC"),
    (r"No-?Deriv|\bND\b", "ND"),
    (r"Share-?Alike|\bSA\b", "SA"),
)
_HEADER = 3000  # characters at the start of a file where a header is
_LINE = 160  # characters of it that are quoted


def choose_name(wanted: str | None, output: Path | None, inside: str, urdf: Path) -> str:
    """A name for a robot: the wanted one, or by the output file (None: in the catalogue), the URDF's
    file, unless that says nothing, or the name inside the URDF.

    Raises:
        UsageError: If the user's cannot be one, or nothing gives one.
    """
    if wanted is not None:
        if not re.fullmatch(NAME, wanted):
            allowed = "letters, digits, '_', '.' and '-', first a letter or digit"
            raise UsageError(f"--name {wanted!r}: allowed: {allowed}")
        return wanted
    generic = re.fullmatch(_GENERIC, urdf.stem.lower()) is not None
    of_files = (inside, urdf.stem) if generic else (urdf.stem, inside)
    for candidate in (output.stem if output is not None else "", *of_files):
        clean = re.sub(r"[^A-Za-z0-9_.-]+", "_", candidate).strip("_.-").lower()
        if re.fullmatch(NAME, clean):
            # many URDFs are those of robots that come with mobman
            return f"my_{clean}" if output is None and clean in own_robots() else clean
    raise UsageError(f"{urdf}: no name for the robot; give --name")


def robot_toml(
    found: Inference,
    name: str,
    sources: Sequence[tuple[UrdfSource, set[str]]],
    warnings: Sequence[str],
    path: Path,
    heading: Inferred | None = None,
) -> str:
    """The text of a robot's TOML.

    Args:
        found: What was inferred.
        name: The robot's name.
        sources: Its URDFs, the platform's first, and the names of the joints in each.
        warnings: What is to be known of the URDFs.
        path: The file that they are from, for its licence.
        heading: Weight of the heading in the criterion, once it is computed.
    """
    import jinja2

    source = sources[0][0]
    place = source.path if source.package is None else f"{source.package}, {source.path}"
    said = [f"{place}, robot {found.robot_name!r} of the URDF"]
    # the first of the comments that says who wrote it
    authors = (text for text in _comments(path) if re.search(_AUTHOR, text, re.IGNORECASE))
    short = (text if len(text) <= _LINE else f"{text[: _LINE - 3]}..." for text in authors)
    said += islice(short, 1)
    text = (files("mobman.robots.infer") / "robot.toml.j2").read_text(encoding="utf-8")
    options: dict[str, Any] = {"undefined": jinja2.StrictUndefined, "keep_trailing_newline": True}
    template: Any = jinja2.Template(text, trim_blocks=True, **options)
    made: str = template.render(
        found=found,
        drive=found.platform,
        arm=found.arm,
        name=name,
        path=path,
        source="; ".join(said),
        licence=licence(path),
        parts=[_part(part, own, found) for part, own in sources],
        warnings=warnings,
        heading=heading,
        usual=CriterionSource(),
        beside=_beside,
        comment=_comment,
        field=_field,
        toml=_toml,
    )
    return made


def _part(
    source: UrdfSource, own: set[str], found: Inference
) -> tuple[str, dict[str, Inferred], list[tuple[str, str]]]:
    """The table of a URDF with these joints: its header, its fields, and patterns of what is locked."""
    fields = {
        "package": Inferred(source.package),
        "path": Inferred(source.path),
        "sha256": Inferred(source.sha256, "of the file, which is said if it changes"),
        "packages": Inferred(source.packages, "where package://NAME/... is"),
    }
    if source.up != "z":
        fields["up"] = Inferred(source.up, "the root link's axis that points up")
    header, prefix = "[urdf]", ""
    if isinstance(source, Mount):
        header, prefix = "[[mount]]", source.prefix
        fields |= {"parent": Inferred(source.parent, "as asked for"), "prefix": Inferred(prefix)}

    def of_part(joints: Sequence[str]) -> list[str]:
        names = (name.removeprefix(prefix) for name in joints)
        return [name for name in names if name in own]

    locks = [
        (pattern, "" if i else lock.why)
        for lock in found.locks
        for i, pattern in enumerate(patterns(of_part(lock.joints), of_part(found.joints)))
    ]
    return header, {key: fact for key, fact in fields.items() if fact.value}, locks


def _field(key: str, fact: Inferred) -> str:
    """A line with a value and, as a comment, its reason."""
    return f"{tomlkit.key(key).as_string()} = {_toml(fact.value)}{_beside(fact.why)}"


def _toml(value: Any) -> str:
    """A value in TOML; a dictionary in one line."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key} = {_toml(one)}' for key, one in value.items())}}}"
    text: str = tomlkit.item(value).as_string()
    return text


def _beside(why: str) -> str:
    return f" # {_clean(why)}" if why else ""


def _comment(*texts: str) -> str:
    """A text as lines of comments."""
    wrapper = textwrap.TextWrapper(_WIDTH - 2, break_long_words=False, break_on_hyphens=False)
    return "\n".join(f"# {line}" for line in wrapper.wrap(_clean(" ".join(texts))))


def _clean(text: str) -> str:
    """A text that may stand in a comment: TOML allows no control characters there."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def patterns(wanted: Sequence[str], every: Iterable[str]) -> list[str]:
    """Patterns that match of every name exactly the wanted ones, in their order."""
    others = [name for name in every if name not in set(wanted)]
    left = list(dict.fromkeys(wanted))
    found: list[str] = []
    while left:
        best = max(
            (p for p in _candidates(left[0]) if not any(fnmatchcase(n, p) for n in others)),
            # of those that say the same the simplest kind, "hand_*", and the longest of that kind
            key=lambda p: (sum(fnmatchcase(n, p) for n in left), p.endswith("*"), len(p)),
            default="",
        )
        if sum(fnmatchcase(name, best) for name in left) < 2:
            best = escape(left[0])
        found.append(best)
        left = [name for name in left if not fnmatchcase(name, best)]
    return found


def _candidates(name: str) -> list[str]:
    """Patterns from the words of a name: how it begins, begins and ends, and ends."""
    ends = [match.end() for match in re.finditer(r"[_\-./ ]", name)]
    heads, tails = [name[:i] for i in ends], [name[i - 1 :] for i in ends]
    both = [(head, tail) for head in heads for tail in ("", *tails) if len(tail) < len(name)]
    both += [("", tail) for tail in tails]
    return [f"{escape(head)}*{escape(tail)}" for head, tail in both]


def urdf_source(
    urdf: Path, folder: Path | None, packages: Sequence[Path] = (), up: str = "z"
) -> UrdfSource:
    """The ``[urdf]`` table of a file, without ``lock``, with folders that hold packages of meshes.

    Paths are relative to the TOML's folder where one is above the other, absolute if that is None.
    """
    urdf = urdf.resolve()
    named = [_path_from(path.resolve(), folder) for path in packages]
    for robots in (above for above in urdf.parents if above.parts[-2:] == (_PACKAGE, "robots")):
        place = urdf.relative_to(robots).as_posix()
        with suppress(SpecError):
            found = urdf_file(UrdfSource(path=place, package=_PACKAGE), Path(), "")
            if found.path == urdf:  # the package has this very file
                return UrdfSource(path=place, package=_PACKAGE, packages=named, up=up)
    return UrdfSource(path=_path_from(urdf, folder), packages=named, up=up)


def _path_from(path: Path, folder: Path | None) -> str:
    """A path relative to a folder where one is above the other, else absolute."""
    if folder is not None:
        folder = folder.resolve()
        if path.is_relative_to(folder) or folder.is_relative_to(path.parent):
            return Path(os.path.relpath(path, folder)).as_posix()
    return str(path)


def licence(path: Path) -> str:
    """The licence by the URDF's header, or the nearest package.xml or licence file above it.

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


def _comments(path: Path) -> list[str]:
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
        parts = [short for long, short in _COMMONS_PARTS if re.search(long, said, re.IGNORECASE)]
        version = re.search(r"\b(\d\.\d)\b", said)
        return "-".join(["CC-BY", *parts, *([version[1]] if version else [])])
    if start := re.search(_GNU, text, re.IGNORECASE) or re.search(_GNU_SHORT, text):
        name = f"{_GNU_KINDS.get((start['kind'] or '').lower(), '')}GPL"
        said = text[start.end() : start.end() + _LINE]
        if (version := re.search(_NUMBER, said, re.IGNORECASE)) is None:
            return name
        later = re.search(r"\bor\b.{0,35}?\blater", said, re.IGNORECASE)
        return f"{name}-{version[1]}.{version[2] or 0}{'-or-later' if later else ''}"
    found = (name for name, pattern in LICENCES if re.search(pattern, text, re.IGNORECASE))
    return next(found, "")
