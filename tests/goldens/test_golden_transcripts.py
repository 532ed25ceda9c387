"""Transcripts of the command line, in ``cli/``: one file for each command, its first line.

They are for information where words change on purpose: ``make.py transcripts`` makes them again. Some
of the words are those of libraries, so that the test is skipped with other versions of these.
"""

from __future__ import annotations

import re
import shlex
import tempfile
from importlib.metadata import version
from pathlib import Path

import pytest
from support.goldens import (
    FOLDER,
    mobman,
    normalised,
    read_json,
    terminal,
    text_differences,
    write_json,
)
from support.variants import youbot_urdf

TRANSCRIPTS, VERSIONS = FOLDER / "cli", "cli_versions.json"
LIBRARIES = ("click", "rich", "pydantic", "tomlkit")

COMMANDS = """
mobman --version
mobman robots
mobman robots show youbot
mobman robots show tiago --json
mobman robots check youbot
mobman robots check --no-simulation fixed_panda
mobman robots add mine.urdf --name mine --tip tip -o mine.toml
mobman robots check --no-simulation mine.urdf
mobman bench list
mobman bench list --json
mobman bench show quick
mobman bench show quick --json
mobman bench show paper
mobman run youbot --controller pseudo-inverse --duration 0.05
mobman run youbot --controller tsm --task paper --duration 0.05 --gain a=0.2 --gain A=0.1
mobman run youbot --duration 2 --dt 0.01 --gain discretization=explicit --gain a=1e-3
mobman run youbot --controller pseudo-inverse --duration 0.05 --all
mobman controllers pseudo-inverse
mobman tasks circle
mobman scenarios heavier
mobman metrics success --json

mobman
mobman bnech
mobman run
mobman run yuobot
mobman run youbot --controller tms
mobman run youbot --task circel
mobman run youbot --scenario havier
mobman run youbot --contoller tsm
mobman run youbot --gain lambda_9=1
mobman run youbot --gain a
mobman run youbot --gain a=0
mobman run youbot --gain c=0.5
mobman run youbot --gain alpha_1=2
mobman run youbot --gain lambda_1=1,2
mobman run youbot --gain discretization=implicitly
mobman run youbot --task-option radius=-1
mobman run youbot --task-option radios=1
mobman run youbot --duration -1
mobman run youbot --duration ten
mobman run youbot --dt 0
mobman run youbot --seed -1
mobman run youbot -o run.txt
mobman scenarios havier
mobman run missing.toml
mobman run syntax.toml
mobman run fields.toml
mobman run urdf.toml
mobman run youbot --duration 0.01 --scenario scenario.toml
mobman robots show tiagoo
mobman robots check missing.toml
mobman robots add missing.urdf
mobman robots add broken.urdf
mobman robots add loop.urdf
mobman robots add massless.urdf
mobman bench run papper
mobman bench run suite.toml
mobman bench run suite-names.toml
mobman bench run quick --part 3/2
mobman bench run quick --workers 0
mobman bench show missing.toml
mobman bench report .
mobman bench report missing
mobman bench merge missing -o merged
mobman bench tune quick --no-such-option
mobman rerun missing.h5
mobman rerun text.h5
mobman view missing.h5
mobman view text.h5
mobman view yuobot
"""

FILES = {
    "syntax.toml": 'schema = 1\nname = "broken\n',
    "fields.toml": (
        'schema = 1\nname = "wrong fields"\nmass = 3\n[urdf]\npath = "mine.urdf"\n'
        '[platform]\ntype = "diferential"\nwheel_radius = "big"\n[arm]\ntip = "tip"\n'
    ),
    "urdf.toml": (
        'schema = 1\nname = "no-urdf"\n[urdf]\npath = "nowhere.urdf"\n'
        '[platform]\ntype = "fixed"\n[arm]\ntip = "tip"\n'
    ),
    "scenario.toml": (
        'name = "wrong"\nmass_factor = -1.0\npayloads = 2.0\n[[friction]]\ntype = "viscuous"\n'
    ),
    "suite.toml": 'schema = 1\nname = "wrong"\nduration = -1\nsede = 3\n',
    "suite-names.toml": (
        'schema = 1\nname = "names"\nduration = 1.0\n[controllers.a]\nlaw = "tms"\n'
        '[controllers.b]\nlaw = "tsm"\ngains = { c = 0.1 }\n'
        '[[groups]]\nrobots = ["yuobot"]\ntasks = ["circel"]\nscenarios = ["havier"]\n'
    ),
    "broken.urdf": '<robot name="broken">\n  <link name="a">\n</robot>\n',
    "loop.urdf": (
        '<robot name="loop">\n  <link name="a"/>\n  <link name="b"/>\n'
        '  <joint name="one" type="fixed"><parent link="a"/><child link="b"/></joint>\n'
        '  <joint name="two" type="fixed"><parent link="b"/><child link="a"/></joint>\n</robot>\n'
    ),
    "massless.urdf": (
        '<robot name="massless">\n  <link name="a"/>\n  <link name="b"/>\n'
        '  <joint name="turns" type="revolute"><parent link="a"/><child link="b"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>\n'
        "</robot>\n"
    ),
    "text.h5": "no HDF5\n",
}


def in_folder(folder: Path) -> None:
    """Write the files that the commands name."""
    for name, text in {**FILES, "mine.urdf": youbot_urdf()}.items():
        (folder / name).write_text(text, encoding="utf-8")


def transcript(command: str, folder: Path) -> str:
    """The command, its exit status and what it printed; of a file that it wrote, the content."""
    before = {path.name for path in folder.iterdir()}
    with pytest.MonkeyPatch.context() as patch, terminal():
        patch.chdir(folder)
        status, out, err = mobman(*shlex.split(command)[1:])
    text = f"$ {command}\nexit status {status}\n"
    written = {p.name: p for p in sorted(folder.iterdir()) if p.name not in before and p.is_file()}
    parts = {"stdout": out, "stderr": err}
    parts |= {name: path.read_text(encoding="utf-8") for name, path in written.items()}
    for name, content in parts.items():
        if kept := _without_times(normalised(content, folder)):
            text += f"--- {name}\n{kept}"
    return text


def _without_times(text: str) -> str:
    """Without times, and without the line that says, on some machines, that kernels are compiled."""
    lines = text.splitlines(keepends=True)
    left_out = ("compute_time", "  timing  ", "mobman: compiling its kernels")
    return "".join(line for line in lines if not any(word in line for word in left_out))


def versions() -> dict[str, str]:
    """Of the libraries that some of the words come from, without the last part."""
    return {name: version(name).rpartition(".")[0] for name in LIBRARIES}


@pytest.mark.skipif(
    read_json(VERSIONS) != versions(), reason=f"transcripts are of {read_json(VERSIONS)}"
)
@pytest.mark.parametrize("path", sorted(TRANSCRIPTS.glob("*.txt")), ids=lambda path: path.stem)
def test_commands_print_what_is_stored(path, tmp_path):
    stored = path.read_text(encoding="utf-8")
    command = stored.partition("\n")[0].removeprefix("$ ")
    in_folder(tmp_path)
    problems = list(text_differences(transcript(command, tmp_path), stored))
    assert not problems, "\n".join(problems)


def test_every_command_is_stored():
    stored = {p.read_text(encoding="utf-8").partition("\n")[0] for p in TRANSCRIPTS.glob("*.txt")}
    assert {f"$ {command}" for command in (*helps(), *commands())} <= stored


def commands() -> list[str]:
    """The commands above."""
    return [line for line in COMMANDS.splitlines() if line]


def helps(command: str = "mobman") -> list[str]:
    """``--help`` of a command and of all below it, as its own help lists them."""
    with terminal():
        _, out, _ = mobman(*command.split()[1:], "--help")
    listed = re.findall(r"^  ([a-z]+)  ", out.partition("Commands:")[2], re.MULTILINE)
    below = [line for name in listed for line in helps(f"{command} {name}")]
    return [f"{command} --help", *below]


# Making the files ---------------------------------------------------------------------------------


def make(report=print) -> None:
    """Store what every command prints."""
    TRANSCRIPTS.mkdir(exist_ok=True)
    write_json(VERSIONS, versions())
    for path in TRANSCRIPTS.glob("*.txt"):
        path.unlink()
    for command in (*helps(), *commands()):
        path = TRANSCRIPTS / f"{'-'.join(re.findall(r'[a-z0-9_]+', command.lower()))}.txt"
        assert not path.exists(), path.name
        with tempfile.TemporaryDirectory() as folder:
            in_folder(Path(folder))
            text = transcript(command, Path(folder).resolve())
        path.write_text(text, encoding="utf-8")
