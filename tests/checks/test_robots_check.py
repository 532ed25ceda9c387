"""``mobman robots check``: exit status, table and JSON."""

from __future__ import annotations

import json

import pytest
from support.command_line import mobman
from support.variants import description, toml, youbot_urdf


def check(*arguments):
    return mobman("robots", "check", *arguments)


@pytest.fixture
def described(tmp_path):
    """A TOML of the youBot with changes of its URDF and of itself."""

    def write(replaced=(), **changes):
        text = youbot_urdf()
        for old, new in replaced:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "mine.urdf").write_text(text, encoding="utf-8")
        file = tmp_path / "mine.toml"
        file.write_text(toml(description(urdf__path="mine.urdf", **changes)), encoding="utf-8")
        return file

    return write


def test_warnings_alone_are_status_0():
    done = check("youbot")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    for word in ("check", "result", "found", "fix", "closed-loop", "warning", "0 wrong"):
        assert word in done.stdout


@pytest.mark.parametrize("option", [[], ["--json"]])
def test_something_wrong_is_status_1(described, option):
    done = check(described(platform__wheel_radius=0.06), "--no-simulation", *option)
    assert done.returncode == 1
    assert done.stderr == ""
    assert "wheel-radius" in done.stdout
    assert "closed-loop" not in done.stdout
    if option:
        assert json.loads(done.stdout)["summary"]["status"] == "wrong"


@pytest.mark.parametrize("option", [[], ["--json"]])
def test_description_that_cannot_be_loaded_is_status_2(described, option):
    done = check(described(arm__tip="hand"), *option)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "field 'arm.tip' is 'hand'" in done.stderr


def test_unknown_robot_is_status_2():
    done = check("yuobot")
    assert done.returncode == 2
    assert "did you mean 'youbot'" in done.stderr


def test_json(described):
    file = described([('<mass value="1.4"/>', '<mass value="100"/>')])
    done = check(file, "--json", "--no-simulation")
    content = json.loads(done.stdout)
    assert set(content) == {"robot", "findings", "summary"}
    assert content["robot"] == "youbot"
    for finding in content["findings"]:
        assert set(finding) == {"check", "status", "found", "fix"}
        assert all(isinstance(value, str) for value in finding.values())
    counts = dict.fromkeys(("ok", "warning", "wrong"), 0)
    for finding in content["findings"]:
        counts[finding["status"]] += 1
    assert content["summary"] == {"status": "warning", **counts}
    assert done.returncode == 0
    assert any("100 kg" in finding["found"] for finding in content["findings"])


def test_narrow_terminal_leaves_room_for_what_is_found(described, monkeypatch):
    """The fix is below what is found, not beside it; wheels that are alike have one row."""
    monkeypatch.setenv("COLUMNS", "80")
    done = check(described(platform__wheel_radius=0.06), "--no-simulation")
    lines = done.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    (row,) = [i for i, line in enumerate(lines) if line.startswith("wheel-radius")]
    assert "wheels 'phi_1', 'phi_2': radius 0.06 m" in lines[row]
    below = [line.split() for line in lines[row + 1 : row + 4]]
    assert any(words[:2] == ["fix", "set"] for words in below)
    assert max(len(line[23:].rstrip()) for line in lines) > 45


def test_help_names_the_statuses():
    done = check("--help")
    assert "--no-simulation" in done.stdout
    assert "Exit status 1" in done.stdout
