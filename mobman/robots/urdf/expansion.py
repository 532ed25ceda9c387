"""Whether a URDF is still a file for xacro, the macro language that most URDFs are written in."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from mobman.errors import SpecError
from mobman.robots.urdf.document import Document

_LANGUAGE = (
    "macro", "property", "include", "arg", "if", "unless", "call", "element", "attribute",
    "insert_block",
)  # fmt: skip
_ELSEWHERE = ("gazebo", "transmission", "ros2_control", "sensor")  # what other programs read


def check_expanded(document: Document, path: Path) -> None:
    """
    Raises:
        SpecError: If the file has elements or expressions of xacro's language. A mere call of a macro
            that nobody defines is none: older versions of xacro leave such calls in what they make.
    """
    prefixes = _prefixes(document.root)
    if not any(sign in document.text for sign in ("${", "$(", *(f"<{p}" for p in prefixes))):
        return
    language = tuple(prefix + name for prefix in prefixes for name in _LANGUAGE)
    for part in document.root:
        if part.tag in _ELSEWHERE:
            continue
        for element in part.iter():
            if element.tag in language:
                raise not_expanded(element, f"<{element.tag}>", document, path)
            if element.tag == "mesh":
                continue  # its $(find PACKAGE) is as good as package://PACKAGE
            for value in element.attrib.values():
                if "${" in value or "$(" in value:
                    raise not_expanded(element, repr(value), document, path)


def macro_call(document: Document) -> ET.Element | None:
    """The first call of a macro that is left in the file."""
    prefixes = tuple(_prefixes(document.root))
    return next((part for part in document.root if str(part.tag).startswith(prefixes)), None)


def not_expanded(element: ET.Element, found: str, document: Document, path: Path) -> SpecError:
    """The error for a file that xacro has not made a URDF of yet."""
    return SpecError(
        f"the URDF {path}, line {document.lines[element]}: {found} is for xacro, which makes a URDF of "
        f"it; run xacro first: xacro {path.name} > robot.urdf"
    )


def _prefixes(root: ET.Element) -> list[str]:
    declared = [
        attribute.removeprefix("xmlns:") + ":"
        for attribute, value in root.items()
        if attribute.startswith("xmlns:") and "xacro" in value
    ]
    return ["xacro:", *declared]
