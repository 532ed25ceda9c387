"""XML of unknown origin as an element tree: no entities, no DTD, and the line of every element.

The parser takes names as they are, with their prefixes: URDFs have elements such as
``<sensor:camera>`` whose namespace nobody declared, and the tools that read URDFs do not mind.
"""

from __future__ import annotations

import codecs
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from xml.sax import SAXParseException
from xml.sax.handler import ContentHandler
from xml.sax.xmlreader import AttributesImpl

from defusedxml import sax
from defusedxml.common import DefusedXmlException, DTDForbidden
from defusedxml.expatreader import DefusedExpatParser

from mobman.errors import SpecError

_DEEPEST = 100
_DECLARED = re.compile(rb"""<\?xml[^>]{0,200}?encoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f]")
_CUT_OFF = ("no element found", "unclosed token", "unclosed CDATA section")


@dataclass(frozen=True)
class Document:
    """An XML file.

    Attributes:
        text: Its text.
        root: Its root element.
        lines: The line on which each element starts, from 1.
    """

    text: str
    root: ET.Element
    lines: dict[ET.Element, int]


def parse_xml(content: bytes, where: str) -> Document:
    """The elements of an XML file.

    Args:
        content: The file's content.
        where: What to call the file in messages.

    Raises:
        SpecError: If it is not XML, declares entities or a document type, or is nested without end.
    """
    text = _text(content, where)
    start = text.lstrip("\ufeff \t\r\n")
    if not start.startswith("<"):
        raise SpecError(
            f"{where} is not valid XML: it starts with {_shown(start)}, not with <robot>"
        )
    parser = sax.make_parser()
    parser.forbid_dtd = True
    handler = _Elements(parser, lines_before=text[: len(text) - len(start)].count("\n"))
    parser.setContentHandler(handler)
    try:
        parser.feed(start)
        parser.close()
    except SAXParseException as error:
        raise SpecError(f"{where} is not valid XML: {handler.explain(error)}") from error
    except DTDForbidden as error:
        if str(error.name).lower() == "html":
            raise SpecError(f"{where} is a web page (HTML): download the file itself") from error
        raise SpecError(
            f"{where} has a document type or entity declaration (<!DOCTYPE>), line {handler.line()}: "
            "these are not read; remove it, with what it declares written out"
        ) from error
    except DefusedXmlException as error:
        raise SpecError(f"{where} declares entities, which are not read: {error}") from error
    return Document(start, handler.builder.close(), handler.lines)


class _Elements(ContentHandler):
    """Builds the tree while the parser reads."""

    def __init__(self, parser: DefusedExpatParser, lines_before: int) -> None:
        super().__init__()
        self.builder = ET.TreeBuilder()
        self.lines: dict[ET.Element, int] = {}
        self._parser = parser
        self._lines_before = lines_before
        self._open: list[ET.Element] = []

    def line(self) -> int:
        return self._lines_before + int(self._parser.getLineNumber() or 0)

    def startElement(self, name: str, attrs: AttributesImpl) -> None:
        element = self.builder.start(name, dict(attrs.items()))
        self.lines[element] = self.line()
        self._open.append(element)
        if len(self._open) > _DEEPEST:
            raise SAXParseException(f"more than {_DEEPEST} nested elements", None, self._parser)

    def endElement(self, name: str) -> None:
        self.builder.end(name)
        self._open.pop()

    def characters(self, content: str) -> None:
        self.builder.data(content)

    def explain(self, error: SAXParseException) -> str:
        reason = error.getMessage()
        line = self._lines_before + int(error.getLineNumber() or 0)
        said = f"{reason} (line {line}, column {int(error.getColumnNumber() or 0) + 1})"
        if reason in _CUT_OFF:
            said += "; the file ends too early, as if it were cut off"
        if reason == "not well-formed (invalid token)":
            said += "; in values, write &amp; for & and &lt; for <"
        if self._open and reason in (*_CUT_OFF, "mismatched tag"):
            last = self._open[-1]
            said += f"; <{last.tag}> of line {self.lines[last]} is not closed"
        return said


def _text(content: bytes, where: str) -> str:
    """The file's text, by the encoding that it names; UTF-8 by default."""
    if content.startswith(_UTF_16):
        encoding = "utf-16"
    else:
        if _NO_TEXT.search(content, 0, 4096):
            raise SpecError(f"{where} is a binary file; a URDF is a text file (XML)")
        declared = _DECLARED.search(content, 0, 400)
        encoding = declared[1].decode("ascii") if declared else "utf-8"
    try:
        return content.decode(encoding)
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


def _shown(text: str) -> str:
    return repr(text[:20] + ("..." if len(text) > 20 else ""))
