"""Try mobman with the lowest versions that pyproject.toml allows of every library: ``make lowest``.

An environment of its own, build/lowest, gets exactly these versions, for every extra that users
install, and runs a few tests of each part. With ``--constraints`` the versions are printed, as pip
takes them, and nothing is run.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DEVELOPERS = {"test", "speed", "docs"}
"""Extras for work on mobman itself, whose tools may be new."""
TESTS = (
    *("tests/test_public_names.py", "tests/bridges", "tests/figures", "tests/cli/test_cli.py"),
    *("tests/simulation/test_record_files.py", "tests/simulation/test_records_in_xarray.py"),
    *("tests/simulation/test_records_as_frames.py", "tests/simulation/test_contact.py"),
    *("tests/controllers/test_whole_body_qp.py", "tests/controllers/test_mpc.py"),
    *("tests/benchmark/test_store.py", "tests/benchmark/test_report.py"),
    *("tests/benchmark/tuning/test_tuning.py", "tests/robots/test_meshes.py"),
)


def extras(project: dict[str, dict[str, list[str]]]) -> list[str]:
    """The extras that users install."""
    return [name for name in project["optional-dependencies"] if name not in DEVELOPERS]


def constraints(project: dict[str, dict[str, list[str]]]) -> dict[str, str]:
    """The lowest version of every library of mobman and of those extras.

    Raises:
        ValueError: If a library has no lower bound, or two.
    """
    lowest: dict[str, str] = {}
    named = list(project["dependencies"])
    for extra in extras(project):
        named += project["optional-dependencies"][extra]
    for requirement in named:
        found = re.fullmatch(r"([\w.-]+)(?:\[[\w,]+\])?>=([\w.]+)(?:,<[\w.]+)?", requirement)
        if found is None:
            raise ValueError(f"{requirement!r}: expected NAME>=VERSION")
        if lowest.setdefault(found[1], found[2]) != found[2]:
            raise ValueError(f"{requirement!r}: another extra asks for {lowest[found[1]]}")
    return lowest


def main(arguments: list[str]) -> int:
    """Make the environment and run the tests in it; the exit status."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    lines = [f"{name}=={version}" for name, version in constraints(project).items()]
    if "--constraints" in arguments:
        print("\n".join(lines))
        return 0
    folder = ROOT / "build" / "lowest"
    venv.create(folder, with_pip=True, clear=True)
    python, listing = folder / "bin" / "python", folder / "constraints.txt"
    listing.write_text("\n".join(lines) + "\n", encoding="utf-8")
    wanted = f"{ROOT}[{','.join(extras(project))}]"
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    for command in (
        [*pip, "--constraint", listing, wanted, "pytest>=8", "psutil>=5.9"],
        [python, "-m", "pip", "check"],
        [python, "-m", "pytest", "-q", *(test for test in TESTS if (ROOT / test).exists())],
    ):
        if status := subprocess.run(command, cwd=ROOT).returncode:
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
