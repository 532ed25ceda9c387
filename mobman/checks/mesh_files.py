"""The meshes that a robot's URDFs name."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from mobman.robots.spec import RobotSpec
from mobman.robots.urdf.meshes import mesh_paths
from mobman.robots.urdf.read import UrdfFile, UrdfSources


class MeshFile(NamedTuple):
    """A mesh as a URDF names it."""

    link: str
    """With the prefix of its mount."""
    use: str
    """``"visual"`` or ``"collision"``."""
    filename: str
    """As written there."""
    path: Path | None
    """Where it is; None if it is missing."""
    urdf: UrdfFile
    """Who names it."""


def mesh_files(spec: RobotSpec, urdf: UrdfSources) -> list[MeshFile]:
    """Every mesh of a robot, in the order of its URDFs."""
    prefixes = [] if spec.urdf is None else [""]
    prefixes += [mount.prefix for mount in spec.mount]
    found = []
    for prefix, file in zip(prefixes, urdf.files, strict=True):
        for mesh in mesh_paths(file.parse(), file):
            found.append(MeshFile(f"{prefix}{mesh.link}", mesh.use, mesh.filename, mesh.path, file))
    return found
