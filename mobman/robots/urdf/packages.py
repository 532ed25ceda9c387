"""Where the packages of ROS are that the meshes of a URDF lie in."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

from mobman.robots.urdf.file import UrdfFile

_NAME = re.compile(rb"<name>\s*([^<\s]+)\s*</name>")
_MANIFEST_BYTES = 65536


class Packages:
    """The packages that the meshes of a URDF may be in.

    A package NAME is a folder of that name, or one whose ``package.xml`` says so. It is looked for in
    the folders that the description gives, the folders above the URDF, those of ``ROS_PACKAGE_PATH``
    (and the folders in these), and ``share`` of those of ``AMENT_PREFIX_PATH``, in this order; each of
    these folders may be the package itself.

    Args:
        urdf: The URDF.

    Attributes:
        folders: Where packages are looked for.
        within: The folders that meshes must lie in; None for any.
    """

    def __init__(self, urdf: UrdfFile) -> None:
        ros = _of_ros()
        self.folders = _unique([*urdf.package_folders, *urdf.path.parents, *ros])
        self.within = None if urdf.within is None else (*urdf.within, *ros)
        self._found: dict[str, list[Path]] = {}

    def of(self, name: str) -> list[Path]:
        """The folders of a package, the first one preferred; none if it is not found."""
        if name not in self._found:
            self._found[name] = self._look_for(name)
        return self._found[name]

    def _look_for(self, name: str) -> list[Path]:
        if not name or name in (".", ".."):
            return []
        found: list[Path] = []
        for folder in self.folders:
            if is_there(folder / name, folder=True):
                found.append(folder / name)
            if folder.name == name:
                found.append(folder)
        return _unique(found) or [f for f in self.folders if _declared_name(f) == name]


def is_there(path: Path, *, folder: bool = False) -> bool:
    """Whether there is such a file (or folder); a name that no file can have is not there."""
    try:
        return path.is_dir() if folder else path.is_file()
    except (OSError, ValueError):
        return False


def _of_ros() -> list[Path]:
    """The folders that the environment of ROS 1 and ROS 2 names."""
    folders = []
    for folder in _path_list("ROS_PACKAGE_PATH"):
        try:
            inner = sorted(path for path in folder.iterdir() if path.is_dir())
        except OSError:
            continue
        folders += [folder, *inner]
    return folders + [folder / "share" for folder in _path_list("AMENT_PREFIX_PATH")]


def _path_list(variable: str) -> list[Path]:
    given = os.environ.get(variable, "")
    return [Path(folder).absolute() for folder in given.split(os.pathsep) if folder]


def _declared_name(folder: Path) -> str | None:
    manifest = folder / "package.xml"
    if not is_there(manifest):
        return None
    try:
        with manifest.open("rb") as file:
            found = _NAME.search(file.read(_MANIFEST_BYTES))
    except OSError:
        return None
    return None if found is None else found[1].decode("utf-8", errors="replace")


def _unique(paths: Iterable[Path]) -> list[Path]:
    return list(dict.fromkeys(paths))
