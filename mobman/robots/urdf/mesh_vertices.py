"""The vertices and triangles of mesh files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from mobman.arrays import Array, Index
from mobman.errors import MobmanError
from mobman.isolation import helper, limits

# Processor time and memory that reading a mesh may take.
_SECONDS, _SECONDS_PER_MB = 6.0, 2.0
_MEGABYTES, _MEGABYTES_PER_MB = 600.0, 100.0
_MOST_MEGABYTES = 500.0


class MeshError(MobmanError):
    """A mesh that cannot be read; the message names the file."""


def read_isolated(function: str, path: Path, *arguments: Any) -> Any:
    """The answer of a function that reads a mesh, in a process that a damaged file may crash.

    Args:
        function: ``"module:name"``.
        path: The file.
        arguments: What it is called with, after the path.

    Raises:
        MeshError: If it cannot be read.
    """
    try:
        megabytes, seconds = limits(path, seconds=_SECONDS, per_megabyte=_SECONDS_PER_MB)
        if not path.is_file():
            raise MeshError(f"cannot read the mesh {path}: it is no file")
        if megabytes > _MOST_MEGABYTES:
            raise MeshError(
                f"the mesh {path} has {megabytes:.3g} MB; allowed: {_MOST_MEGABYTES:g} MB"
            )
        memory = _MEGABYTES + _MEGABYTES_PER_MB * megabytes
        return helper.call(function, str(path), *arguments, seconds=seconds, megabytes=memory)
    except OSError as error:
        raise MeshError(f"cannot read the mesh {path}: {error.strerror or error}") from error
    except MeshError:
        raise
    except MobmanError as error:
        raise MeshError(f"cannot read the mesh {path}: {error}") from error


def read_triangles(path: Path) -> tuple[Array, Index]:
    """The vertices of a mesh in its own unit, shape (n, 3), and the corners of its triangles, (m, 3).

    Raises:
        MeshError: If it cannot be read.
    """
    vertices, faces = read_isolated(f"{__name__}:load", path)
    return vertices, faces


def load(path: str) -> tuple[Array, Index]:
    """What :func:`read_triangles` gives, read in this process by Pinocchio's reader."""
    import coal

    _check_references(Path(path))
    model = coal.MeshLoader(coal.NODE_TYPE.BV_AABB).load(path, np.ones(3))
    corners = [(t[0], t[1], t[2]) for t in map(model.tri_indices, range(model.num_tris))]
    faces = np.array(corners, dtype=np.int64).reshape(-1, 3)
    return np.array(model.vertices(), dtype=float).reshape(-1, 3), faces


def _check_references(path: Path) -> None:
    """
    Raises:
        MobmanError: If a glTF takes its numbers from a file outside its folder.
    """
    if path.suffix.lower() not in (".gltf", ".glb"):
        return
    content = path.read_bytes()
    if content[:4] == b"glTF":  # its first chunk is the JSON
        content = content[20 : 20 + int.from_bytes(content[12:16], "little")]
    described = json.loads(content)
    for part in (*described.get("buffers", []), *described.get("images", [])):
        uri = unquote(str(part.get("uri", "data:")))
        place = (path.parent / uri).resolve()
        if not uri.startswith("data:") and not place.is_relative_to(path.parent.resolve()):
            raise MobmanError(f"it takes numbers from {uri!r}, outside its own folder")


class MeshReader:
    """Reads mesh files, each of them once.

    Attributes:
        unreadable: Why a mesh could not be read, by its path; filled as meshes are read.
    """

    def __init__(self) -> None:
        self.unreadable: dict[Path, str] = {}
        self._vertices: dict[Path, Array | None] = {}

    def vertices(self, path: Path) -> Array | None:
        """The vertices of a mesh in its own unit, shape (n, 3); None if it cannot be read."""
        if path not in self._vertices:
            self._vertices[path] = self._read(path)
        return self._vertices[path]

    def _read(self, path: Path) -> Array | None:
        try:
            vertices, _ = read_triangles(path)
        except MeshError as error:
            self.unreadable[path] = " ".join(str(error).split())
            return None
        if len(vertices) == 0 or not np.all(np.isfinite(vertices)):
            self.unreadable[path] = (
                f"the mesh {path} has {len(vertices)} vertices, or some that are no numbers"
            )
            return None
        return vertices
