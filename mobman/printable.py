"""Text of other people, without what would steer a terminal or hide text."""

from __future__ import annotations

import re

_UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that steer a terminal (all control characters but newline and tab), that reverse the order
of text, or that have no encoding."""


def printable(text: str) -> str:
    r"""Escape control characters, as in ``\x1b``: names and messages come from files of other people."""
    return _UNPRINTABLE.sub(lambda found: found[0].encode("unicode_escape").decode(), text)
