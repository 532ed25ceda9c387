"""Where the meshes of a URDF are.

A mesh is named ``package://NAME/...`` (or ``model://NAME/...``, or with xacro's ``$(find NAME)``),
``file:///...``, by an absolute path, or by a path relative to the URDF's folder, to the folders above
it, or to those that packages are looked for in.
"""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from mobman.errors import SpecError
from mobman.robots.urdf.file import UrdfFile
from mobman.robots.urdf.packages import Packages, is_there
from mobman.robots.urdf.problems import listed

FORMATS = (".stl", ".dae", ".obj", ".ply", ".off", ".gltf", ".glb")
"""Formats of meshes that Pinocchio reads."""

_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://(.*)", re.DOTALL)
_FIND = re.compile(r"(?:file://)?\$\(find\s+([^\s()]+)\)/?(.*)", re.DOTALL)
_TOLD = 5


@dataclass(frozen=True)
class Mesh:
    """A mesh that a URDF names.

    Attributes:
        link: The link's name.
        use: ``"visual"`` or ``"collision"``.
        filename: As the URDF has it.
        path: The file, absolute; None if there is none that can be used.
        problem: Why there is none; empty if there is one.
    """

    link: str
    use: str
    filename: str
    path: Path | None
    problem: str


def mesh_paths(robot: ET.Element, urdf: UrdfFile) -> list[Mesh]:
    """Every mesh of a URDF and where it is, in the file's order; nothing is raised.

    Args:
        robot: The ``<robot>`` element.
        urdf: Its file.
    """
    return [mesh for mesh, _ in _located(robot, Packages(urdf), urdf.path.parent)]


def absolute_meshes(robot: ET.Element, urdf: UrdfFile) -> None:
    """Replace the file names of the meshes by absolute paths.

    Args:
        robot: The ``<robot>`` element; it is changed.
        urdf: Its file.

    Raises:
        SpecError: If meshes are missing, outside the package that they are named by, or of a format
            that is not read; the message says which, where they were looked for, and what to do.
    """
    packages = Packages(urdf)
    located = list(_located(robot, packages, urdf.path.parent))
    wrong: dict[str, Mesh] = {}
    for mesh, _ in located:
        if mesh.path is None:
            wrong.setdefault(mesh.filename, mesh)
    if wrong:
        total = len({mesh.filename for mesh, _ in located})
        said = [
            f"{mesh.filename!r} (link {mesh.link!r}, {mesh.use}) {mesh.problem}"
            for mesh in list(wrong.values())[:_TOLD]
        ]
        more = f"; ... and {len(wrong) - _TOLD} more" if len(wrong) > _TOLD else ""
        raise SpecError(
            f"the URDF {urdf.path}: {len(wrong)} of {total} meshes cannot be used: {'; '.join(said)}"
            f"{more}. Packages were looked for in {listed(map(str, packages.folders))}; more folders "
            "can be named in field 'urdf.packages' (for a mount: 'mount.packages')"
        )
    for mesh, element in located:
        element.set("filename", str(mesh.path))


def _located(
    robot: ET.Element, packages: Packages, folder: Path
) -> Iterator[tuple[Mesh, ET.Element]]:
    known: dict[str, tuple[Path | None, str]] = {}
    for link in robot.findall("link"):
        for use in ("visual", "collision"):
            for element in link.findall(f"{use}/geometry/mesh"):
                name = element.get("filename", "").strip()
                if name not in known:
                    known[name] = _locate(name, packages, folder)
                path, problem = known[name]
                yield Mesh(link.get("name", ""), use, name, path, problem), element


def _locate(name: str, packages: Packages, folder: Path) -> tuple[Path | None, str]:
    """The file of a mesh, or why there is none."""
    path, problem = _find(name, packages, folder)
    allowed = packages.within
    if path is not None and allowed is not None:
        place = path.resolve()
        if not any(place.is_relative_to(other.resolve()) for other in allowed):
            return None, "lies outside the folder of the run; register the robot to have it drawn"
    if path is not None and path.suffix.lower() not in FORMATS:
        kind = f"has the format {path.suffix!r}" if path.suffix else "has no format"
        return None, f"{kind}, which is not read; convert it to one of {', '.join(FORMATS)}"
    return path, problem


def _find(name: str, packages: Packages, folder: Path) -> tuple[Path | None, str]:
    if found := _FIND.fullmatch(name):
        return _in_package(found[1], found[2], packages)
    if found := _SCHEME.fullmatch(name):
        scheme, rest = found[1].lower(), found[2]
        if scheme in ("package", "model"):
            package, _, inner = rest.lstrip("/").partition("/")
            return _in_package(package, inner, packages)
        if scheme != "file":
            return None, f"begins with {scheme}://; allowed: package://, model://, file://, a path"
        name = rest
    candidates = [folder / name]
    if not os.path.isabs(name) and not _leads_out(name):
        candidates += [other / name for other in packages.folders]
    path = _first(candidates)
    return path, "" if path else "is not there"


def _in_package(package: str, inner: str, packages: Packages) -> tuple[Path | None, str]:
    inner = inner.lstrip("/")
    if not package or not inner:
        return None, "names no file of a package; allowed: package://NAME/FILE"
    if _leads_out(inner) or _leads_out(unquote(inner)):
        return None, f"leads outside its package {package!r}, which is not allowed"
    folders = packages.of(package)
    if not folders:
        return None, f"is missing: there is no package {package!r}"
    path = _first([folder / inner for folder in folders])
    return path, "" if path else f"is missing in {listed([str(f) for f in folders])}"


def _leads_out(inner: str) -> bool:
    """Whether a relative path goes up beyond where it starts."""
    return os.path.normpath(inner).split(os.sep)[0] == os.pardir


def _first(candidates: list[Path]) -> Path | None:
    """The first that is there, as it is written or with its %20 and the like decoded.

    A link keeps its own name, since that has the format.
    """
    for candidate in candidates:
        for path in (candidate, Path(unquote(str(candidate)))):
            if is_there(path):
                return path.parent.resolve() / path.name
    return None
