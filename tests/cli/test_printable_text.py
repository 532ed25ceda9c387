"""Text of files reaches the terminal with its control characters escaped."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import pytest
from rich.table import Table
from support.command_line import Done, mobman

import mobman as mm
from mobman.cli import output
from mobman.cli.main import _show_warning
from mobman.cli.run import tell

STEERING = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""What no line of the command line may hold; newlines are its own."""
HOSTILE = "\x1b]0;owned\x07\x1b[31mred\x9b2J\x7f\r\u202eevil\u2066"
ESCAPED = r"\x1b[31mred"
TOML = HOSTILE.encode("unicode_escape").decode().replace("\\x", "\\u00")
"""The same in a string of a TOML file."""


def printed(done: Done) -> str:
    text = done.stdout + done.stderr
    assert not STEERING.findall(text)
    return text


def test_every_control_character_is_escaped_but_newline_and_tab():
    every = "".join(map(chr, [*range(0x20), *range(0x7F, 0xA0), *range(0x202A, 0x202F), 0xD800]))
    shown = output.printable(every)
    assert {char for char in shown if not 0x20 <= ord(char) < 0x7F} == {"\n", "\t"}
    assert output.printable("\x1b[2J\r\x85\u202e\udcff") == r"\x1b[2J\r\x85\u202e\udcff"
    assert output.printable("Größe · 5 µm, β̇") == "Größe · 5 µm, β̇"


def test_console_escapes_strings_and_cells(monkeypatch):
    console = output.console()
    console.file = io.StringIO()
    console.width = 200
    table = Table()
    table.add_column(HOSTILE)
    table.add_row(HOSTILE, f"{HOSTILE} :smile: [b]")
    console.print(HOSTILE)
    console.print(table)
    shown = console.file.getvalue()
    assert not STEERING.findall(shown)
    assert shown.count(ESCAPED) == 4
    assert ":smile: [b]" in shown


def test_json_stays_json(capsys, monkeypatch):
    monkeypatch.setattr(output, "wants_json", lambda: True)
    output.report({"text": HOSTILE})
    shown = capsys.readouterr().out
    assert not STEERING.findall(shown)
    assert json.loads(shown) == {"text": HOSTILE}


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A youBot whose texts steer the terminal."""
    own = mm.load_robot("youbot").spec.file
    text = own.read_text(encoding="utf-8").replace('"youbot.urdf"', f"'{own.parent}/youbot.urdf'")
    text = re.sub(
        r"^(description|source|license) = .*$",
        lambda found: f'{found[1]} = "{TOML}"',
        text,
        flags=re.M,
    )
    file = tmp_path_factory.mktemp("robot") / "youbot.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_robots_texts(robot):
    assert printed(mobman("robots", "show", str(robot))).count(ESCAPED) == 3


def test_errors_that_quote_a_file(robot, tmp_path):
    broken = tmp_path / "broken.toml"
    text = robot.read_text(encoding="utf-8")
    broken.write_text(text.replace('tip = "tip"', f'tip = "{TOML}"'), encoding="utf-8")
    done = mobman("robots", "show", str(broken))
    assert done.returncode == 2
    assert ESCAPED in printed(done)


def test_records_texts(capsys):
    record = mm.simulate("youbot", "tsm", "circle", duration=0.01)
    record.robot = record.task = record.status = HOSTILE
    tell(record, mm.load_robot("youbot"), None)
    shown = capsys.readouterr().out
    assert not STEERING.findall(shown)
    assert shown.count(ESCAPED) == 3


def test_warnings(capsys):
    _show_warning(UserWarning(HOSTILE))
    shown = capsys.readouterr().err
    assert not STEERING.findall(shown)
    assert ESCAPED in shown


def test_commands_print_by_echo_alone():
    """``click.echo`` and ``print`` would let control characters pass."""
    folder = Path(output.__file__).parent
    found = {
        path.name
        for path in folder.glob("*.py")
        if re.search(r"click\.s?echo\(|(?<![.\w])print\(", path.read_text(encoding="utf-8"))
    }
    assert found == {"output.py"}
