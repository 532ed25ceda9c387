"""How a TOML names its URDF."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from mobman.errors import SpecError
from mobman.robots.spec import UrdfSource
from mobman.robots.urdf.read import urdf_file

_PACKAGE = "example-robot-data"


def urdf_source(urdf: Path, folder: Path | None, packages: Sequence[Path] = ()) -> UrdfSource:
    """The ``[urdf]`` table of a file, without ``lock``.

    Args:
        urdf: The file.
        folder: Folder of the TOML, for a relative path where one is above the other; None: absolute.
        packages: More folders with the packages of meshes.
    """
    urdf = urdf.resolve()
    named = [named_from(path.resolve(), folder) for path in packages]
    for robots in urdf.parents:
        if robots.parts[-2:] == (_PACKAGE, "robots"):
            source = UrdfSource(
                path=urdf.relative_to(robots).as_posix(), package=_PACKAGE, packages=named
            )
            if _is_there(source, urdf):
                return source
    return UrdfSource(path=named_from(urdf, folder), packages=named)


def named_from(path: Path, folder: Path | None) -> str:
    """A path relative to a folder where one is above the other, else absolute."""
    if folder is None:
        return str(path)
    folder = folder.resolve()
    if path.is_relative_to(folder) or folder.is_relative_to(path.parent):
        return Path(os.path.relpath(path, folder)).as_posix()
    return str(path)


def _is_there(source: UrdfSource, urdf: Path) -> bool:
    """Whether the package that is installed has this very file."""
    try:
        found = urdf_file(source.model_copy(update={"packages": []}), Path(), "")
    except SpecError:
        return False
    return found.path.resolve() == urdf
