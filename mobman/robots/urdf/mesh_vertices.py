"""The vertices of mesh files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mobman.arrays import Array


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
        import coal

        try:
            mesh = coal.MeshLoader().load(str(path), np.ones(3))
            vertices = np.array(mesh.vertices(), dtype=float).reshape(-1, 3)
        except (RuntimeError, ValueError) as error:
            self.unreadable[path] = f"cannot read the mesh {path}: {' '.join(str(error).split())}"
            return None
        if len(vertices) == 0 or not np.all(np.isfinite(vertices)):
            self.unreadable[path] = (
                f"the mesh {path} has {len(vertices)} vertices, or some that are no numbers"
            )
            return None
        return vertices
