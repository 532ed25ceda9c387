"""Suites: which robots do which tasks under which controllers, scenarios and seeds."""

from __future__ import annotations

import os
from functools import cached_property
from importlib.metadata import EntryPoint
from pathlib import Path

from mobman.benchmark.expand import number_of_runs, runs_of
from mobman.benchmark.suite_tables import SuiteTables
from mobman.display import Displayed, Shown
from mobman.errors import FOREIGN_ERRORS, SpecError
from mobman.files import resource_folder
from mobman.registry import entry_points
from mobman.simulation.run_spec import RunSpec
from mobman.toml_model import TomlLines, named_file, read_toml, validate


class Suite(Displayed, SuiteTables):
    """A suite: what a file ``benchmarks/NAME.toml`` says.

    >>> import mobman as mm
    >>> suite = mm.Suite.model_validate(
    ...     {
    ...         "schema": 1,
    ...         "name": "mine",
    ...         "duration": 0.05,  # s
    ...         "controllers": {"baseline": {"law": "pseudo-inverse"}},
    ...         "groups": [{"robots": ["youbot"], "tasks": ["paper"]}],
    ...     }
    ... )
    >>> [str(run) for run in suite.runs()]
    ['youbot · paper · nominal · baseline · 0.001 s · seed 0']
    """

    @cached_property
    def lines(self) -> TomlLines | None:
        """Lines of its file, for messages; None if it is not of a file."""
        return None

    def _shown(self) -> Shown:
        parts = {
            "controllers": ", ".join(self.controllers),
            "robots": ", ".join(dict.fromkeys(r for group in self.groups for r in group.robots)),
            "tasks": ", ".join(dict.fromkeys(t for group in self.groups for t in group.tasks)),
            "duration (s)": self.duration,
        }
        line = f"Suite({self.name!r}, {len(self.controllers)} controllers, {self.duration:g} s)"
        return Shown(line, {"description": self.description, **parts})

    def runs(self) -> list[RunSpec]:
        """Every run, in the order of the file.

        Raises:
            SpecError: With everything that is wrong: unknown names, labels and gains.
        """
        return runs_of(self, self.lines)

    def size(self) -> int:
        """Number of runs, by the names alone.

        Raises:
            SpecError: With all names that are unknown.
        """
        return number_of_runs(self, self.lines)


def list_suites() -> list[str]:
    """The names that :func:`load_suite` takes, sorted: mobman's and other packages'.

    >>> import mobman as mm
    >>> "paper" in mm.list_suites()
    True
    """
    return sorted({*_files(), *_plugins()})


def load_suite(name_or_path: str | os.PathLike[str]) -> Suite:
    """A suite by name, or from a TOML file.

    >>> import mobman as mm
    >>> mm.load_suite("quick").size()
    96

    Args:
        name_or_path: One of :func:`list_suites`, or a path, which ends in ``.toml`` or has a separator.

    Raises:
        UnknownNameError: If there is no such name.
        SpecError: If the file is not valid.
    """
    files, text = _files(), str(name_or_path)
    if text not in files and (point := _plugins().get(text)) is not None:
        try:
            files[text] = Path(point.load())
        except FOREIGN_ERRORS as error:
            raise SpecError(
                f"suite {text!r} of {point.value} cannot be loaded: {error!r}; expected the path of "
                "a TOML file"
            ) from error
    path = named_file("suite", name_or_path, files)
    content = read_toml(path, "suite file")
    lines = TomlLines(path.read_text(encoding="utf-8-sig"))
    suite = validate(Suite, content, str(path), lines)
    vars(suite)["lines"] = lines
    return suite


def _plugins() -> dict[str, EntryPoint]:
    """Other packages' suites; each entry point is the path of a TOML file."""
    return {point.name: point for point in entry_points(group="mobman.suites")}


def _files() -> dict[str, Path]:
    return {path.stem: path for path in sorted(resource_folder("benchmarks").glob("*.toml"))}
