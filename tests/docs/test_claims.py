"""Numbers of the docs that runs produced: each stands on its page, and some are run again."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
_SPEC = importlib.util.spec_from_file_location("claims", ROOT / "docs" / "claims.py")
table = importlib.util.module_from_spec(_SPEC)
sys.modules["claims"] = table
_SPEC.loader.exec_module(table)
CLAIMS = table.claims()


def test_each_number_stands_on_its_page_once():
    missing = [claim.text.replace("{}", claim.value) for claim in CLAIMS if not claim.stands()]
    assert not missing
    assert len({claim.claim for claim in CLAIMS}) == len(CLAIMS)


@pytest.mark.parametrize(
    "claim",
    [
        pytest.param(claim, marks=() if claim.sample else pytest.mark.slow, id=claim.claim)
        for claim in CLAIMS
    ],
)
def test_number_is_what_its_command_gives(claim):
    found = table.found_by(claim)
    assert claim.holds(found), f"{claim.value} on {claim.page}, found {found:.6g}: make claims"


@pytest.mark.parametrize(
    ("value", "found", "renewed"),
    [("713", 692.6, "693"), ("2.3e-9", 1.04e-8, "1.0e-8"), ("0.05", 0.0723, "0.07")],
)
def test_a_number_that_drifted_is_renewed_where_it_stands(tmp_path, value, found, renewed):
    page, rows = tmp_path / "page.md", tmp_path / "claims.toml"
    page.write_text(f"It is\n  {value} m there, and {value} s elsewhere.", encoding="utf-8")
    rows.write_text(
        "".join(
            f'[[claims]]\nclaim = "{name}"\npage = "{page}"\ntext = "It is {{}} m"\n'
            f'command = "{found}"\nvalue = "{value}"\ntolerance = 1.01\n'
            for name in ("one", "two")
        ),
        encoding="utf-8",
    )
    claim = table.claims(rows)[1]
    assert claim.stands()
    assert not claim.holds(table.found_by(claim))
    assert claim.holds(float(value) * 1.009)
    assert claim.renewed(found) == renewed
    table.renew(claim, renewed, rows)
    assert page.read_text() == f"It is\n  {renewed} m there, and {value} s elsewhere."
    assert [c.value for c in table.claims(rows)] == [value, renewed]
    assert not claim.stands()


def test_each_table_names_a_script_that_is_there():
    commands = [command for _, command in table.blocks()]
    assert len(set(commands)) == len(commands) >= 6
    for command in commands:
        assert (ROOT / command.split()[0]).is_file(), command
    marked = sum(
        page.read_text("utf-8").count("<!-- by: ") for page in {p for p, _ in table.blocks()}
    )
    assert marked == len(commands)  # none is written so that it is not found


def test_a_table_that_drifted_is_renewed(tmp_path):
    script, page = tmp_path / "print.py", tmp_path / "page.md"
    script.write_text(
        "print('| law |')\nprint('| `a` | 2.0e-7 | ends |')\nprint('| `b` | 3.0 | – |')"
    )
    command = f"{script} all"
    head = f"Before.\n<!-- by: {command} -->\n| law | error | |\n|---|---|---|\n"
    page.write_text(f"{head}| `a` | 1.1e-7 | ends |\n| `b` | 3.1 | – |\n<!-- end -->\nAfter.")
    held = page.read_text()
    assert table.renew_block(page, command) == []
    assert page.read_text() == held
    page.write_text(held.replace("3.1", "12.0"))
    assert table.renew_block(page, command) == ["| `b` | 3.0 | – |"]
    assert (
        page.read_text()
        == f"{head}| `a` | 2.0e-7 | ends |\n| `b` | 3.0 | – |\n<!-- end -->\nAfter."
    )
    page.write_text(held.replace("ends", "holds"))
    assert table.renew_block(page, command) == ["| `a` | 2.0e-7 | ends |"]


def test_a_claim_that_cannot_be_checked_is_refused():
    for wrong in ({"text": "none"}, {"tolerance": 1.0}, {"value": "0"}):
        with pytest.raises(ValueError, match="a tolerance above 1"):
            replace(CLAIMS[0], **wrong)


@pytest.mark.parametrize(
    ("other", "same"),
    [
        ("| `tsm` | 1.9e-9 | 46 of 48 |", True),
        ("| `tsm` | 8e-9 | 46 of 48 |", False),
        ("| `tsm` | 2e-9 | 45 of 48 |", False),
        ("| `mpc` | 2e-9 | 46 of 48 |", False),
    ],
)
def test_counts_of_a_table_are_the_same_and_other_numbers_near(other, same):
    assert table.alike("| `tsm` | 2e-9 | 46 of 48 |", other) == same


def test_a_word_that_fits_nothing_is_an_error(capsys):
    assert table.main(["nosuchword"]) == 2
    assert "'nosuchword'" in capsys.readouterr().out
