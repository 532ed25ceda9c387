"""Meshes of a URDF: where the files are, and their vertices.

A mesh is named ``package://NAME/...`` (or ``model://NAME/...``, or with xacro's ``$(find NAME)``),
``file:///...``, by an absolute path, or by a path relative to the URDF's folder, to the folders above
it, or to those that packages are looked for in.
"""

from __future__ import annotations

import html
import json
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.sax.saxutils import quoteattr

import numpy as np

from mobman.arrays import Array, Index
from mobman.errors import MobmanError, SpecError
from mobman.isolation import helper
from mobman.robots.urdf.read import UrdfFile, share_folders, text_of
from mobman.robots.urdf.validate import listed

FORMATS = (".stl", ".dae", ".obj", ".ply", ".off", ".gltf", ".glb")
"""Formats of meshes that Pinocchio reads."""

_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://(.*)", re.DOTALL)
_FIND = re.compile(r"(?:file://)?\$\(find\s+([^\s()]+)\)/?(.*)", re.DOTALL)
_MESH = re.compile(r"""(<mesh\b[^<>]*?\bfilename\s*=\s*)(["'])(.*?)\2""", re.DOTALL)
_ENCODING = re.compile(r"""(\A<\?xml[^>]*?encoding\s*=\s*["'])[A-Za-z0-9._-]+(["'])""")
_NAME = re.compile(rb"<name>\s*([^<\s]+)\s*</name>")
_MANIFEST_BYTES = 65536
_DEEP = 4  # folders that are looked through for a name like one that is missing
_LOOKED_AT = 10_000  # names in each
# Processor time and memory that reading a mesh may take.
_SECONDS, _SECONDS_PER_MB = 6.0, 2.0
_MEGABYTES, _MEGABYTES_PER_MB = 600.0, 100.0
_MOST_MEGABYTES = 500.0


@dataclass(frozen=True)
class MeshReference:
    """A mesh that a URDF names."""

    link: str  # the link's name
    use: str  # "visual" or "collision"
    filename: str  # as the URDF has it
    path: Path | None  # the file, absolute; None if there is none that can be used
    problem: str  # why there is none; empty if there is one


def mesh_paths(robot: ET.Element, urdf: UrdfFile) -> list[MeshReference]:
    """Every mesh of a URDF and where it is, in the file's order; nothing is raised. Each ``<mesh>`` gets
    the attribute ``path``, or ``problem``."""
    locate, found = cache(MeshFinder(urdf).locate), []
    for link in robot.findall("link"):
        for use in ("visual", "collision"):
            for element in link.findall(f"{use}/geometry/mesh"):
                name = element.get("filename", "").strip()
                path, problem = locate(name)
                element.attrib |= {"problem": problem} if path is None else {"path": str(path)}
                found.append(MeshReference(link.get("name", ""), use, name, path, problem))
    return found


def absolute_meshes(robot: ET.Element, urdf: UrdfFile) -> None:
    """Replace the file names of a URDF's meshes by absolute paths; SpecError if some are missing,
    outside the package that they are named by, or of a format that is not read."""
    by_name: dict[str, MeshReference] = {}  # the first of each
    for mesh in mesh_paths(robot, urdf):
        by_name.setdefault(mesh.filename, mesh)
    if wrong := [mesh for mesh in by_name.values() if mesh.path is None]:
        told = (f"{m.filename!r} (link {m.link!r}, {m.use}) {m.problem}" for m in wrong)
        raise SpecError(
            f"the URDF {urdf.path}: {len(wrong)} of {len(by_name)} meshes cannot be used: "
            f"{listed(told, '; ')}. Packages were looked for in "
            f"{listed(map(str, MeshFinder(urdf).folders))}; more folders can be named in field "
            "'urdf.packages' (for a mount: 'mount.packages')"
        )
    for element in robot.findall("link/*/geometry/mesh[@path]"):
        element.set("filename", element.attrib["path"])


Locate = Callable[[ET.Element, UrdfFile], object] | None
"""One of these two, or neither."""


def with_absolute_meshes(urdf: UrdfFile) -> bytes:
    """A URDF's text, in UTF-8, with the file names of the meshes that are found as absolute paths; all
    else is as it was, comments included."""
    paths = {mesh.filename: mesh.path for mesh in mesh_paths(urdf.parse(), urdf)}

    def replaced(match: re.Match[str]) -> str:
        path = paths.get(html.unescape(match[3]).strip())
        return match[0] if path is None else match[1] + quoteattr(str(path))

    text = _MESH.sub(replaced, text_of(urdf.content, f"the URDF {urdf.path}"))
    return _ENCODING.sub(r"\1UTF-8\2", text.lstrip("\ufeff"), count=1).encode()


class MeshFinder:
    """Finds the files of a URDF's meshes, in its ``folders``.

    A package NAME is a folder of that name, or one whose ``package.xml`` says so. It is looked for in
    the folders that the description gives, the folders above the URDF, those of ``ROS_PACKAGE_PATH``
    (and the folders in these), ``share`` of those of ``AMENT_PREFIX_PATH``, and that of installed data
    packages (example-robot-data), in this order; each of these folders may be the package itself.
    """

    def __init__(self, urdf: UrdfFile) -> None:
        installed = [*_ros_folders(), *share_folders()]
        self.folders = list(dict.fromkeys([*urdf.package_folders, *urdf.path.parents, *installed]))
        self._beside = urdf.path.parent
        self._within = None if urdf.within is None else (*urdf.within, *installed)

    def locate(self, name: str) -> tuple[Path | None, str]:
        """The file of a mesh, or why there is none that can be used."""
        path, problem = self._find(name.replace("\\", "/"))  # as some programs write on Windows
        if path is None:
            return None, problem
        within = [path.resolve().is_relative_to(one.resolve()) for one in self._within or ()]
        if self._within is not None and not any(within):
            return None, "lies outside the folder of the run; register the robot to have it drawn"
        if path.suffix.lower() not in FORMATS:
            kind = f"has the format {path.suffix!r}" if path.suffix else "has no format"
            return None, f"{kind}, which is not read; convert it to one of {', '.join(FORMATS)}"
        return path, ""

    def _find(self, name: str) -> tuple[Path | None, str]:
        package = None
        if found := _FIND.fullmatch(name):
            package, name = found.groups()
        elif found := _SCHEME.fullmatch(name):
            scheme, name = found[1].lower(), found[2]
            if scheme in ("package", "model"):
                package, _, name = name.lstrip("/").partition("/")
            elif scheme != "file":
                allowed = "package://, model://, file://, a path"
                return None, f"begins with {scheme}://; allowed: {allowed}"
        if package is None:
            folders, missing = [self._beside], "is not there"
            if not os.path.isabs(name) and not _leads_out(name):
                folders += self.folders
        else:
            name = name.lstrip("/")
            if not package or not name:
                return None, "names no file of a package; allowed: package://NAME/FILE"
            if _leads_out(name) or _leads_out(unquote(name)):
                return None, f"leads outside its package {package!r}, which is not allowed"
            if not (folders := self.package(package)):
                return None, f"is missing: there is no package {package!r}"
            missing = f"is missing in {listed(map(str, folders))}"
        places = [folder / name for folder in folders]
        path = _first(places)
        return path, "" if path else f"{missing}{_near(places)}"

    def package(self, name: str) -> list[Path]:
        """The folders of a package ``package://NAME/...``, the first preferred; none if not found."""
        if name in (".", ".."):
            return []
        named = (place for folder in self.folders for place in (folder / name, folder))
        found = [place for place in named if place.name == name and _is_there(place, folder=True)]
        return list(dict.fromkeys(found)) or [f for f in self.folders if _declared_name(f) == name]


def _leads_out(inner: str) -> bool:
    """True if a relative path goes up beyond where it starts."""
    return os.path.normpath(inner).split(os.sep)[0] == os.pardir


def _first(candidates: Sequence[Path]) -> Path | None:
    """The first that is there, as it is written or with its %20 and the like decoded; a link keeps its
    own name, since that has the format."""
    for candidate in candidates:
        for path in (candidate, Path(unquote(str(candidate)))):
            if _is_there(path):
                return path.parent.resolve() / path.name
    return None


def _near(candidates: Sequence[Path]) -> str:
    """The end of a message about files that are not there: one whose name differs in case or format."""
    for wanted in candidates:
        start = next((up for up in wanted.parents if _is_there(up, folder=True)), wanted)
        missing = wanted.relative_to(start).parts
        if not missing or missing[0] == ".." or len(missing) > _DEEP:
            continue
        place = start
        for name in missing:
            found: list[Path] = []
            with suppress(OSError):
                found = sorted(Path(one.path) for one in islice(os.scandir(place), _LOOKED_AT))
            alike = [one for one in found if one.name.lower() == name.lower()]
            if not alike and name == wanted.name:
                meshes = (one for one in found if one.suffix.lower() in FORMATS)
                alike = [one for one in meshes if one.stem.lower() == wanted.stem.lower()]
            if not alike:
                break
            place = alike[0]
        else:
            return f"; there is {place.relative_to(start)}"
    return ""


def _is_there(path: Path, *, folder: bool = False) -> bool:
    """True if there is such a file (or folder); a name that no file can have is not there."""
    try:
        return path.is_dir() if folder else path.is_file()
    except (OSError, ValueError):
        return False


def _ros_folders() -> list[Path]:
    """The folders that the environment of ROS 1 and ROS 2 names."""
    ros, ament = (
        [Path(one).absolute() for one in os.environ.get(variable, "").split(os.pathsep) if one]
        for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
    )
    folders = []
    for folder in ros:
        with suppress(OSError):
            folders += [folder, *sorted(path for path in folder.iterdir() if path.is_dir())]
    return folders + [folder / "share" for folder in ament]


def _declared_name(folder: Path) -> str | None:
    manifest = folder / "package.xml"
    with suppress(OSError):
        if _is_there(manifest):
            with manifest.open("rb") as file:
                found = _NAME.search(file.read(_MANIFEST_BYTES))
            return None if found is None else found[1].decode("utf-8", errors="replace")
    return None


class MeshError(MobmanError):
    """A mesh that cannot be read; the message names the file."""


def read_isolated(function: str, path: Path, *arguments: Any) -> Any:
    """The answer of a function ``"module:name"`` of a mesh's path and further arguments, in a process
    that a damaged file may crash; MeshError if it cannot be read."""
    fault = f"cannot read the mesh {path}: it is no file"
    try:
        size = path.stat().st_size / 1e6
        if path.is_file():
            fault = f"the mesh {path} has {size:.3g} MB; allowed: {_MOST_MEGABYTES:g} MB"
        if path.is_file() and size <= _MOST_MEGABYTES:
            seconds = _SECONDS + _SECONDS_PER_MB * size
            memory = _MEGABYTES + _MEGABYTES_PER_MB * size
            return helper.call(function, str(path), *arguments, seconds=seconds, megabytes=memory)
    except (OSError, MobmanError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or error
        raise MeshError(f"cannot read the mesh {path}: {reason}") from error
    raise MeshError(fault)


def read_triangles(path: Path) -> tuple[Array, Index]:
    """The vertices of a mesh in its own unit, shape (n, 3), and the corners of its triangles, (m, 3);
    MeshError if it cannot be read."""
    vertices, faces = read_isolated(f"{__name__}:load", path)
    return vertices, faces


def load(path: str) -> tuple[Array, Index]:
    """Do the work of :func:`read_triangles` in this process, by Pinocchio's reader."""
    import coal

    _check_references(Path(path))
    model = coal.MeshLoader(coal.NODE_TYPE.BV_AABB).load(path, np.ones(3))
    corners = [(t[0], t[1], t[2]) for t in map(model.tri_indices, range(model.num_tris))]
    faces = np.array(corners, dtype=np.int64).reshape(-1, 3)
    return np.array(model.vertices(), dtype=float).reshape(-1, 3), faces


def _check_references(path: Path) -> None:
    """Refuse a glTF with numbers from a file outside its folder (MobmanError), or with a key of its JSON
    twice (ValueError): readers take the first or the last."""
    if path.suffix.lower() not in (".gltf", ".glb"):
        return

    def read_object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len(found := dict(pairs)) < len(pairs):
            raise ValueError("a key of its JSON is there twice")
        return found

    content = path.read_bytes()
    if content[:4] == b"glTF":  # its first chunk is the JSON
        content = content[20 : 20 + int.from_bytes(content[12:16], "little")]
    described = json.loads(content, object_pairs_hook=read_object)
    for part in (*described.get("buffers", []), *described.get("images", [])):
        uri = unquote(str(part.get("uri", "data:")))
        place = (path.parent / uri).resolve()
        if not uri.startswith("data:") and not place.is_relative_to(path.parent.resolve()):
            raise MobmanError(f"it takes numbers from {uri!r}, outside its own folder")


class MeshReader:
    """Reads mesh files, each of them once."""

    def __init__(self) -> None:
        self.unreadable: dict[Path, str] = {}  # why a mesh could not be read, by its path
        self._vertices: dict[Path, Array] = {}

    def vertices(self, path: Path) -> Array | None:
        """The vertices of a mesh in its own unit, shape (n, 3); None if it cannot be read."""
        if path not in self._vertices and path not in self.unreadable:
            try:
                found, _ = read_triangles(path)
                if len(found) == 0 or not np.all(np.isfinite(found)):
                    fault = f"has {len(found)} vertices, or some that are not finite"
                    raise MeshError(f"the mesh {path} {fault}")
                self._vertices[path] = found
            except MeshError as error:
                self.unreadable[path] = " ".join(str(error).split())
        return self._vertices.get(path)

    def of(self, mesh: ET.Element) -> Array | None:
        """The same of a ``<mesh>`` as :func:`mesh_paths` leaves it; None if there is no file."""
        path = mesh.get("path")
        return None if path is None else self.vertices(Path(path))
