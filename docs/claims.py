"""Renew the numbers of README and docs that runs produced, and tell which drifted: ``make claims``.

``claims.toml`` has single ones. The rows of tables between ``<!-- by: SCRIPT ARGUMENTS -->`` and
``<!-- end -->`` are what that script prints. Where a number drifted, its page gets the new one, and the
exit status is 1, so that the words around it are read again.
"""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import mobman as mm
from mobman.toml_model import read_toml

DOCS = Path(__file__).parent
TABLE = DOCS / "claims.toml"


@dataclass(frozen=True)
class Claim:
    """A number on a page, and what gives it; the fields are explained in ``claims.toml``."""

    claim: str
    page: str
    text: str
    command: str
    value: str
    tolerance: float
    sample: bool = False

    def __post_init__(self) -> None:
        if self.text.count("{}") != 1 or not self.tolerance > 1.0 or not float(self.value) > 0.0:
            raise ValueError(f"{self.claim}: one {{}}, a tolerance above 1 and a value above 0")

    @property
    def path(self) -> Path:
        """The page."""
        return DOCS.parent / self.page

    def written(self, value: str) -> re.Pattern[str]:
        """The words with a value, across line breaks."""
        words = re.escape(self.text.replace("{}", "\0")).replace(re.escape("\0"), "\0")
        words = re.sub(r"(\\ )+", lambda _: r"\s+", words)
        before, after = words.split("\0")
        return re.compile(f"({before}){re.escape(value)}({after})")

    def stands(self) -> bool:
        """True if the page says so, once."""
        return len(self.written(self.value).findall(self.path.read_text(encoding="utf-8"))) == 1

    def holds(self, found: float) -> bool:
        """True for a number within the tolerance."""
        value = float(self.value)
        return value / self.tolerance <= found <= value * self.tolerance

    def renewed(self, found: float) -> str:
        """A number, written as the value is."""
        mantissa = self.value.lower().partition("e")[0]
        digits = len(mantissa.replace(".", "").lstrip("0"))
        if "e" in self.value:
            number, exponent = f"{found:.{digits - 1}e}".split("e")
            return f"{number}e{int(exponent)}"
        return f"{float(f'{found:.{digits}g}'):g}"


def claims(path: Path = TABLE) -> list[Claim]:
    """All claims, in the order of the table."""
    return [Claim(**entry) for entry in read_toml(path, "table of claims")["claims"]]


# What commands use -----------------------------------------------------------------------------------


def run(
    law: str = "tsm",
    robot: str = "youbot",
    task: str = "paper",
    *,
    scenario: Any = None,
    duration: float = 10.0,
    dt: float = 1e-3,
    **gains: Any,
) -> mm.Record:
    """A run, by default of the paper's task."""
    law = mm.make_controller(law, **gains)
    return mm.simulate(robot, law, task, scenario=scenario, duration=duration, dt=dt)


def at(record: mm.Record, t: float) -> float:
    """|e^e| at an instant (m)."""
    return float(np.linalg.norm(record.task_error[np.searchsorted(record.t, t - 1e-9)]))


def after(record: mm.Record, t: float) -> float:
    """The largest |e^e| from an instant on (m)."""
    return float(np.linalg.norm(record.task_error[record.t >= t], axis=1).max())


def apart(one: mm.Record, other: mm.Record, name: str = "q") -> float:
    """The largest difference of two runs' samples."""
    return float(np.abs(getattr(one, name) - getattr(other, name)).max())


def ends(record: mm.Record) -> float:
    """When a run ends early (s); infinite for one that goes to its end."""
    return np.inf if record.status == "ok" else float(record.t[-1])


def found_by(claim: Claim) -> float:
    """The number that a claim's command gives."""
    return float(eval(claim.command, globals()))  # the project's own table


# Tables ----------------------------------------------------------------------------------------------

ROWS = r"(?: *\|.*\n)"
BLOCK = re.compile(
    rf"(?P<indent> *)<!-- by: (?P<command>[^>]+?) -->\n{ROWS}{{2}}(?P<rows>{ROWS}+) *<!-- end -->"
)
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?")
DRIFT, ROUNDING = 3.0, 1e-10  # a factor, and a number below which there is no telling


def blocks() -> list[tuple[Path, str]]:
    """The tables that scripts print: page and command."""
    pages = [DOCS.parent / "README.md", *sorted(DOCS.glob("*.md"))]
    found = ((page, BLOCK.finditer(page.read_text(encoding="utf-8"))) for page in pages)
    return [(page, block["command"]) for page, those in found for block in those]


def alike(one: str, other: str) -> bool:
    """True for rows with the same words and counts, whose other numbers have not drifted."""
    if NUMBER.sub("#", one) != NUMBER.sub("#", other):
        return False
    for a, b in zip(NUMBER.findall(one), NUMBER.findall(other), strict=True):
        large, small = sorted((max(float(a), ROUNDING), max(float(b), ROUNDING)), reverse=True)
        if large > (1.0 if a.isdigit() and b.isdigit() else DRIFT) * small:
            return False
    return True


def renew_block(page: Path, command: str) -> list[str]:
    """Run the script of a table; the rows that drifted, which are then in the page."""
    text = page.read_text(encoding="utf-8")
    found = next(found for found in BLOCK.finditer(text) if found["command"] == command)
    done = subprocess.run(
        [sys.executable, *shlex.split(command)],
        cwd=DOCS.parent,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    # a row begins with a name or a number; the page has its own headings, and 1e-8 for 1e-08
    printed = [re.sub(r"e([-+])0(?=\d)", r"e\1", line) for line in done.stdout.splitlines()]
    printed = [line for line in printed if re.match(r"\| [`\d]", line)]
    rows = [line.strip() for line in found["rows"].splitlines()]
    if len(rows) == len(printed) and all(map(alike, rows, printed)):
        return []
    begin, end = found.span("rows")
    body = "".join(f"{found['indent']}{line}\n" for line in printed)
    page.write_text(text[:begin] + body + text[end:], encoding="utf-8")
    return [row for row in printed if not any(alike(row, old) for old in rows)] or printed


# Renewing --------------------------------------------------------------------------------------------


def main(words: list[str]) -> int:
    """Renew claims and tables, or those whose page, claim or command has a word; the exit status."""
    drifted = looked_at = 0
    for claim in claims():
        name = f"{claim.page} {claim.claim} {claim.command}"
        if words and not any(word in name for word in words):
            continue
        looked_at += 1
        if not claim.stands():
            print(f"{claim.page}: {claim.text.replace('{}', claim.value)!r} is not there, or twice")
            drifted += 1
            continue
        found = found_by(claim)
        if claim.holds(found):
            print(f"{claim.page}: {claim.claim}: {claim.value}, found {found:.4g}")
            continue
        drifted += 1
        print(f"{claim.page}: {claim.claim}: {claim.value} DRIFTED, found {found:.4g}")
        if np.isfinite(found) and found > 0.0:
            renew(claim, claim.renewed(found))
    for page, command in blocks():
        name = f"{page.relative_to(DOCS.parent)}: {command}"
        if words and not any(word in name for word in words):
            continue
        looked_at += 1
        rows = renew_block(page, command)
        drifted += len(rows)
        print("\n".join([f"{name}: {len(rows)} rows DRIFTED" if rows else f"{name}: holds", *rows]))
    if not looked_at:
        print(
            f"no claim and no table has {' or '.join(map(repr, words))} in its page, name or command"
        )
        return 2
    print(f"{drifted} drifted" if drifted else "all hold")
    return 1 if drifted else 0


def renew(claim: Claim, value: str, table: Path = TABLE) -> None:
    """Write a claim's new value into its page and the table."""
    page = claim.path.read_text(encoding="utf-8")
    page = claim.written(claim.value).sub(lambda found: f"{found[1]}{value}{found[2]}", page)
    text = table.read_text(encoding="utf-8")
    begin = text.index(f'claim = "{claim.claim}"')
    old, new = f'value = "{claim.value}"', f'value = "{value}"'
    table.write_text(text[:begin] + text[begin:].replace(old, new, 1), encoding="utf-8")
    claim.path.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument(
        "words", nargs="*", help="only claims and tables whose page, name or command has one"
    )
    sys.exit(main(parser.parse_args().words))
