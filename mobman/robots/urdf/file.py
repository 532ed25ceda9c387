"""A URDF on disk, and where a description says that it is."""

from __future__ import annotations

import hashlib
import os
import sysconfig
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from mobman.errors import SpecError
from mobman.robots.spec import RobotSpec, UrdfSource
from mobman.robots.urdf.reading import parse_urdf, read_content


@dataclass(frozen=True)
class UrdfFile:
    """A URDF on disk, and where the packages of its meshes are looked for.

    Attributes:
        path: The file.
        package_folders: Folders that may hold a package NAME of ``package://NAME/...``.
        kept: Its content, where that is not read from disk: a run's record keeps it.
        within: The folders that its meshes must lie in, apart from those of ROS; None for any.
    """

    path: Path
    package_folders: tuple[Path, ...]
    kept: bytes | None = field(default=None, repr=False)
    within: tuple[Path, ...] | None = None

    @cached_property
    def content(self) -> bytes:
        """The file's content as it was when first asked for: what the robot was made of.

        Raises:
            SpecError: If the file cannot be read.
        """
        return read_content(self.path) if self.kept is None else self.kept

    def sha256(self) -> str:
        """Hash of the file's content, hexadecimal."""
        return hashlib.sha256(self.content).hexdigest()

    def parse(self) -> ET.Element:
        """The ``<robot>`` element, checked; a new one at each call.

        Raises:
            SpecError: If the file cannot be read or is not a URDF that makes sense.
        """
        return parse_urdf(self.content, self.path)


@dataclass(frozen=True)
class UrdfSources:
    """The files that a robot is made of: its URDF or the platform's, then what is mounted on it."""

    files: tuple[UrdfFile, ...]

    @property
    def path(self) -> Path | None:
        """The first file, the platform's; None if there is none."""
        return self.files[0].path if self.files else None

    def sha256(self) -> str:
        """Hash of one file's content, or of the hashes of several, hexadecimal."""
        if len(self.files) == 1:
            return self.files[0].sha256()
        return hashlib.sha256("".join(file.sha256() for file in self.files).encode()).hexdigest()

    def __str__(self) -> str:
        return ", ".join(str(file.path) for file in self.files) or "(described by its numbers)"


def urdf_sources(spec: RobotSpec) -> UrdfSources:
    """The files that a description points at.

    Raises:
        SpecError: If one does not exist.
    """
    where = f"{spec.where}: field"
    named = [] if spec.urdf is None else [(f"{where} 'urdf", spec.urdf)]
    named += [(f"{where} 'mount[{i}]", mount) for i, mount in enumerate(spec.mount)]
    return UrdfSources(tuple(urdf_file(part, spec.folder, field) for field, part in named))


def urdf_file(source: UrdfSource, folder: Path, field: str) -> UrdfFile:
    """The file that a part of a description points at.

    Args:
        source: The part.
        folder: What relative paths start from.
        field: What to call the part in messages, such as ``"robot 'tiago': field 'urdf"``, without
            the closing quote.

    Raises:
        SpecError: If it does not exist.
    """
    packages = [_resolved(folder / name, f"{field}.packages'") for name in source.packages]
    for package in packages:
        if not package.is_dir():
            raise SpecError(f"{field}.packages': there is no folder {package}")
    if source.package is None:
        path = _resolved(folder / source.path, f"{field}.path'")
        packages += [path.parent, *path.parent.parents]
    else:
        share = _share_folder(field, source.package)
        path = _resolved(share / source.package / "robots" / source.path, f"{field}.path'")
        if not path.is_relative_to((share / source.package).resolve()):
            raise SpecError(f"{field}.path': {source.path!r} leads outside {source.package}")
        packages += [share]
    if not os.path.exists(path):
        raise SpecError(f"{field}.path': there is no URDF at {path}")
    return UrdfFile(path, tuple(packages))


def _resolved(path: Path, field: str) -> Path:
    """A path without links and ``..``.

    Raises:
        SpecError: If no file can have it: its links go in a circle, or it has a NUL.
    """
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise SpecError(f"{field}: {str(path)!r} is no path of a file: {error}") from error


def _share_folder(field: str, package: str) -> Path:
    """The ``share`` folder of a data package that ships no Python module."""
    site = Path(sysconfig.get_paths()["purelib"])
    candidates = [site / "cmeel.prefix" / "share", *_beside_pinocchio()]
    for share in candidates:
        if (share / package).is_dir():
            return share
    raise SpecError(
        f"{field}.package': {package} is not installed (looked in "
        f"{', '.join(map(str, candidates))}); install it with: pip install {package}"
    )


def _beside_pinocchio() -> list[Path]:
    import pinocchio

    # .../cmeel.prefix/lib/pythonX.Y/site-packages/pinocchio/__init__.py
    return [Path(pinocchio.__file__).parents[4] / "share"]
