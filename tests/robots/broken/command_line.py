"""The command line as a test calls it: in this process, or in one of its own."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cases import Corpus, descriptions, urdfs
from good_robot import GoodRobot

import mobman


@dataclass(frozen=True)
class Command:
    """A sub-command that must refuse the broken inputs.

    Attributes:
        arguments: What it is called with, for a robot.
        corpora: Which cases it must refuse.
        every: Of those, it is tried on every so many: all, or a sample where another sub-command
            goes the same way.
    """

    arguments: Callable[[GoodRobot], list[str]]
    corpora: tuple[Corpus, ...]
    every: int = 1

    def cases(self) -> list[str]:
        """The names of the cases that it is tried on."""
        return [name for corpus in self.corpora for name in corpus][:: self.every]


COMMANDS = {
    "show": Command(lambda robot: ["robots", "show", str(robot.toml)], (urdfs, descriptions)),
    "run": Command(
        lambda robot: [
            "run", str(robot.toml), "--duration", "0.02", "-o", str(robot.folder / "run.h5"),
        ],
        (urdfs, descriptions),
        every=6,
    ),
    "add": Command(
        lambda robot: ["robots", "add", str(robot.urdf), "-o", str(robot.folder / "new.toml")],
        (urdfs,),
    ),
    "check": Command(
        lambda robot: ["robots", "check", str(robot.toml)], (urdfs, descriptions), every=4
    ),
}  # fmt: skip
"""By name."""


@dataclass(frozen=True)
class Outcome:
    """What a call of the command line did."""

    status: int
    output: str
    errors: str


def call(arguments: list[str], capfd, monkeypatch) -> Outcome:
    """Call it in this process; what C++ prints on stderr is seen as well."""
    from mobman.cli import main as entry

    # what the entry point changes in its process stays that process's
    monkeypatch.setattr(entry.signal, "signal", lambda *_: None)
    monkeypatch.setattr(entry.warnings, "showwarning", entry.warnings.showwarning)
    monkeypatch.setattr(sys, "argv", ["mobman", *arguments])
    capfd.readouterr()
    status = 0
    try:
        entry.main()
    except SystemExit as end:
        status = int(end.code or 0)
    said = capfd.readouterr()
    return Outcome(status, said.out, said.err)


def call_alone(arguments: list[str], folder: Path) -> Outcome:
    """Call it in a process of its own, in that folder."""
    same_code = {"PYTHONPATH": str(Path(mobman.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, "-m", "mobman", *arguments],
        cwd=folder,
        env={**os.environ, **same_code},
        capture_output=True,
        text=True,
        timeout=60,
    )
    return Outcome(done.returncode, done.stdout, done.stderr)


def contents(folder: Path) -> dict[str, str]:
    """What is in a folder: the names, and for files a hash of what is in them."""
    return {
        str(path.relative_to(folder)): _summary(path)
        for path in sorted(folder.rglob("*"))
        if not path.is_symlink()
    }


def _summary(path: Path) -> str:
    if not path.is_file():
        return "no file"
    size = path.stat().st_size
    if size > 20_000_000:
        return f"{size} bytes"
    return hashlib.sha256(path.read_bytes()).hexdigest()
