"""Folders of the project's own robots and suites: in the wheel, or next to the package in a checkout."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from mobman.errors import MobmanError


def resource_folder(name: str) -> Path:
    """The folder ``robots`` or ``benchmarks`` that travels with mobman.

    Raises:
        MobmanError: If the installation lacks it.
    """
    package = Path(str(files("mobman")))
    for folder in (package / "data" / name, package.parent / name):
        if folder.is_dir():
            return folder
    raise MobmanError(f"mobman's folder {name!r} is missing: looked in {package} and beside it")
