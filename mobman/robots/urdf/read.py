"""URDFs: where they are, and their content as a checked element tree.

XML of unknown origin is read by Python's own parser, with document types, and so entities, refused.
Names are taken as they are, with their prefixes: URDFs have elements such as ``<sensor:camera>`` whose
namespace nobody declared, and the tools that read URDFs do not mind.
"""

from __future__ import annotations

import codecs
import copy
import hashlib
import os
import re
import sysconfig
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from xml.parsers import expat

from mobman.errors import SpecError
from mobman.files import read_input
from mobman.robots.spec import RobotSpec, UrdfSource
from mobman.robots.urdf.compose import tidy, turn_up
from mobman.robots.urdf.shapes import scalar
from mobman.robots.urdf.validate import KNOWN, Validation

MEGABYTES = 5.0
"""Largest size of a URDF (MB)."""
_DEEPEST = 100
_DECLARED = re.compile(rb"""<\?xml[^>]{0,200}?encoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f]")
_CUT_OFF = ("no element found", "unclosed token", "unclosed CDATA section")


@dataclass(frozen=True)
class UrdfFile:
    """A URDF on disk, and where the packages of its meshes are looked for."""

    path: Path
    package_folders: tuple[Path, ...]  # may hold a package NAME of package://NAME/...
    kept: bytes | None = field(default=None, repr=False)
    """Its content, where that is not read from disk: a run's record keeps it."""
    within: tuple[Path, ...] | None = None
    """The folders that its meshes must lie in, apart from installed packages; None for any."""
    up: str = "z"  # the axis of its root link that points up, such as "y"
    made_of: str = ""  # what the user gave, if it was made of that: messages name it

    @property
    def named(self) -> str:
        """The file in messages."""
        return f"the URDF made of {self.made_of}" if self.made_of else f"the URDF {self.path}"

    @cached_property
    def content(self) -> bytes:
        """The file's content as it was when first asked for: what the robot was made of."""
        if self.kept is not None:
            return self.kept
        return read_input(self.path, "URDF", MEGABYTES, "geometry belongs in meshes")

    def sha256(self) -> str:
        """Hash of the content."""
        return hashlib.sha256(self.content).hexdigest()

    def parse(self) -> ET.Element:
        """The ``<robot>`` element, checked; a new one at each call.

        It is as in the file but for what :func:`mobman.robots.urdf.compose.tidy` does; elements that
        URDFs do not know (``<gazebo>``, ``<transmission>``, ...) are kept and not looked at.

        Raises:
            SpecError: If the file cannot be read or is not a URDF that makes sense. The message names
                the file and, of every problem, the line, the link or joint, the field, what was found,
                and what is allowed.
        """
        return copy.deepcopy(self._checked[0])

    @property
    def remarks(self) -> tuple[str, ...]:
        """Everything in it that is left out since it is wrong, in sentences."""
        return self._checked[1]

    @property
    def friction(self) -> list[str]:
        """The joints to which ``<dynamics>`` gives damping or friction."""
        joints, keys = self._checked[0].findall("joint"), ("damping", "friction")
        given = {joint.get("name", ""): joint.find("dynamics") for joint in joints}
        return [name for name, own in given.items() if any(scalar(own, k) > 0.0 for k in keys)]

    @cached_property
    def _checked(self) -> tuple[ET.Element, tuple[str, ...]]:
        where = self.named
        robot, lines = parse_xml(self.content, where)
        if robot.tag != "robot":
            other = KNOWN["others"].get(robot.tag)
            advice = f": it is {other}; convert it, or find the robot's URDF" if other else ""
            raise SpecError(f"{where} starts with <{robot.tag}>, not with <robot>{advice}")
        validation, macro = Validation(where, lines), next(macros(robot), None)
        without_links = robot.find("link") is None
        if not (macro or without_links):
            validation.check(robot)
        if without_links or validation.found:  # or else a call of a macro does no harm
            prefixes = tuple(_prefixes(robot))
            calls = ((one, f"<{one.tag}>") for one in robot if one.tag.startswith(prefixes))
            macro = macro or next(calls, None)
        if macro is not None:
            raise SpecError(
                f"{where}, line {lines[macro[0]]}: {macro[1]} is for xacro, which makes a URDF of it; "
                f"add it by 'mobman robots add {self.path.name}', which expands it, or run xacro "
                f"first: xacro {self.path.name} > robot.urdf"
            )
        if without_links:
            srdf = robot.find("group") is not None or robot.find("disable_collisions") is not None
            kind = ": it is an SRDF (MoveIt's groups and poses); give the robot's URDF"
            raise SpecError(f"{where} has no <link>{kind if srdf else ''}")
        validation.raise_any()
        for link, part, _ in validation.left_out:
            link.remove(part)
        tidy(robot, self.path.stem)
        turn_up(robot, self.up, where)
        return robot, tuple(said for *_, said in validation.left_out)


@dataclass(frozen=True)
class UrdfSources:
    """The files that a robot is made of: its URDF or the platform's, then what is mounted on it."""

    files: tuple[UrdfFile, ...]

    @property
    def path(self) -> Path | None:
        """The first file, the platform's; None if there is none."""
        return self.files[0].path if self.files else None

    def sha256(self) -> str:
        """Hash of one file's content, or of the hashes of several, hexadecimal."""
        if len(self.files) == 1:
            return self.files[0].sha256()
        return hashlib.sha256("".join(file.sha256() for file in self.files).encode()).hexdigest()

    def __str__(self) -> str:
        return ", ".join(str(file.path) for file in self.files) or "(described by its numbers)"


def urdf_sources(spec: RobotSpec) -> UrdfSources:
    """The files that a description points at; a SpecError if one does not exist."""
    named = [("urdf", spec.urdf)] if spec.urdf is not None else []
    parts = [*named, *((f"mount[{i}]", mount) for i, mount in enumerate(spec.mount))]
    where = f"{spec.where}: field '"
    return UrdfSources(tuple(urdf_file(part, spec.folder, where + name) for name, part in parts))


def urdf_file(source: UrdfSource, folder: Path, field: str) -> UrdfFile:
    """The file that a part of a description points at, by a path that starts from a folder; SpecError if
    there is none. Messages call the part by ``field``, such as ``"robot 'tiago': field 'urdf"``."""
    packages = [_resolved(folder / name, f"{field}.packages'") for name in source.packages]
    for package in packages:
        if not package.is_dir():
            raise SpecError(f"{field}.packages': there is no folder {package}")
    if source.package is None:
        path = _resolved(folder / source.path, f"{field}.path'")
        packages += path.parents
    else:
        shares = share_folders()
        share = next((one for one in shares if (one / source.package).is_dir()), None)
        if share is None:
            raise SpecError(
                f"{field}.package': {source.package} is not installed (looked in "
                f"{', '.join(map(str, shares))}); install it with: pip install {source.package}"
            )
        path = _resolved(share / source.package / "robots" / source.path, f"{field}.path'")
        if not path.is_relative_to((share / source.package).resolve()):
            raise SpecError(f"{field}.path': {source.path!r} leads outside {source.package}")
        packages += [share]
    if not os.path.exists(path):
        gone = ", which was there when the description was written: it was moved or removed"
        raise SpecError(f"{field}.path': there is no URDF at {path}{gone if source.sha256 else ''}")
    file = UrdfFile(path, tuple(packages), up=source.up)
    if source.sha256 not in (None, file.sha256()):
        warnings.warn(
            f"{field}.sha256': {path} has changed since the description was written for it, which may "
            "not fit any more: write it again by 'mobman robots add', or remove the field",
            stacklevel=4,
        )
    return file


def _resolved(path: Path, field: str) -> Path:
    """A path without links and ``..``; one with a NUL or with links in a circle is no file's."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise SpecError(f"{field}: {str(path)!r} is not the path of a file: {error}") from error


def share_folders() -> list[Path]:
    """The ``share`` folders of data packages that ship no Python module, as example-robot-data."""
    import pinocchio

    # .../cmeel.prefix/lib/pythonX.Y/site-packages/pinocchio/__init__.py
    prefixes = (
        Path(sysconfig.get_paths()["purelib"]) / "cmeel.prefix",
        Path(pinocchio.__file__).parents[4],
    )
    return list(dict.fromkeys(prefix / "share" for prefix in prefixes))


def macros(robot: ET.Element) -> Iterator[tuple[ET.Element, str]]:
    """Elements and expressions of the language of xacro, which most URDFs are written in. A mere call of
    a macro that nobody defines is none: older versions of xacro leave such calls in what they make."""
    other = KNOWN["xacro"]["elsewhere"]
    language = {prefix + name for prefix in _prefixes(robot) for name in KNOWN["xacro"]["elements"]}
    for element in (e for part in robot if part.tag not in other for e in part.iter()):
        if element.tag in language:
            yield element, f"<{element.tag}>"
        elif element.tag != "mesh":  # its $(find PACKAGE) is as good as package://PACKAGE
            yield from (
                (element, repr(v)) for v in element.attrib.values() if "${" in v or "$(" in v
            )


def _prefixes(robot: ET.Element) -> list[str]:
    """The prefixes of xacro's elements, with their colons."""
    names = (name for name, value in robot.items() if "xacro" in value)
    return ["xacro:", *(f"{n.removeprefix('xmlns:')}:" for n in names if n.startswith("xmlns:"))]


def parse_xml(content: bytes, where: str) -> tuple[ET.Element, dict[ET.Element, int]]:
    """The root element of an XML file, which messages call ``where``, and the line on which each element
    starts, from 1; SpecError if it is not XML, declares a document type, or is nested without end."""
    text = text_of(content, where)
    start = text.lstrip("\ufeff \t\r\n")
    if not start.startswith("<"):
        shown = repr(start[:20] + ("..." if len(start) > 20 else ""))
        raise SpecError(f"{where} is not valid XML: it starts with {shown}, not with <robot>")
    lines_before = text[: len(text) - len(start)].count("\n")
    parser, builder = expat.ParserCreate(), ET.TreeBuilder()
    parser.buffer_text = True
    lines: dict[ET.Element, int] = {}
    unclosed: list[ET.Element] = []

    def invalid(reason: str, line: int, column: int) -> SpecError:
        said = f"{reason} (line {lines_before + line}, column {column + 1})"
        if reason in _CUT_OFF:
            said += "; the file ends too early, as if it were cut off"
        if reason == "not well-formed (invalid token)":
            said += "; in values, write &amp; for & and &lt; for <"
        if unclosed and reason in (*_CUT_OFF, "mismatched tag"):
            said += f"; <{unclosed[-1].tag}> of line {lines[unclosed[-1]]} is not closed"
        return SpecError(f"{where} is not valid XML: {said}")

    def doctype(name: str, *_: object) -> None:
        if name.lower() == "html":
            raise SpecError(f"{where} is a web page (HTML): download the file itself")
        raise SpecError(
            f"{where} has a document type or entity declaration (<!DOCTYPE>), line "
            f"{lines_before + parser.CurrentLineNumber}: these are not read; remove it, with what it "
            "declares written out"
        )

    def open_element(tag: str, attributes: dict[str, str]) -> None:
        unclosed.append(builder.start(tag, attributes))
        lines[unclosed[-1]] = lines_before + parser.CurrentLineNumber
        if len(unclosed) > _DEEPEST:
            reason = f"more than {_DEEPEST} nested elements"
            raise invalid(reason, parser.CurrentLineNumber, parser.CurrentColumnNumber)

    def close_element(tag: str) -> None:
        builder.end(tag)
        unclosed.pop()

    parser.StartDoctypeDeclHandler, parser.CharacterDataHandler = doctype, builder.data
    parser.StartElementHandler, parser.EndElementHandler = open_element, close_element
    try:
        parser.Parse(start, True)
    except expat.ExpatError as error:
        raise invalid(expat.ErrorString(error.code), error.lineno, error.offset) from error
    return builder.close(), lines


def text_of(content: bytes, where: str) -> str:
    """The file's text, by the encoding that it names; UTF-8 by default."""
    if content.startswith(_UTF_16):
        encoding = "utf-16"
    else:
        if _NO_TEXT.search(content, 0, 4096):
            raise SpecError(f"{where} is a binary file; a URDF is a text file (XML)")
        declared = _DECLARED.search(content, 0, 400)
        encoding = declared[1].decode("ascii") if declared else "utf-8"
    try:
        text = content.decode(encoding)
        text.encode()  # some encodings hold what is no character
        return text
    except LookupError as error:
        raise SpecError(
            f"{where} names the encoding {encoding!r}, which is not known; save it as UTF-8"
        ) from error
    except UnicodeError as error:
        place = ""
        if isinstance(error, UnicodeDecodeError):
            line = content.count(b"\n", 0, error.start) + 1
            place = f" (byte 0x{content[error.start]:02x} in line {line})"
        raise SpecError(
            f"{where} is not in the encoding {encoding.upper()}{place}; save it as UTF-8, or name its "
            'encoding in the first line, such as <?xml version="1.0" encoding="ISO-8859-1"?>'
        ) from error
