"""The mesh files that the URDFs name."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from mobman.checks.check import Remark, check, does_not_apply, ok, some, warning
from mobman.checks.mesh_files import MeshFile
from mobman.checks.subject import Subject


@check("meshes", "every mesh that the URDFs name is there, can be read and travels with them")
def meshes(subject: Subject) -> Iterator[Remark]:
    if not subject.meshes:
        yield does_not_apply("the robot has no meshes")
        return
    # the equations need no mesh, so that none of this is worse than a warning
    missing = [mesh for mesh in subject.meshes if mesh.path is None]
    if missing:
        yield warning(
            f"{_count(missing)} missing: {_named(missing)}",
            f"put the files there, or name their packages' folder in field 'urdf.packages' of robot "
            f"{subject.robot.name!r}; the equations need none, the viewer does",
        )
    reader = subject.mesh_reader
    paths = dict.fromkeys(mesh.path for mesh in subject.meshes if mesh.path is not None)
    if reasons := [reader.unreadable[path] for path in paths if reader.vertices(path) is None]:
        yield warning(
            f"{len(reasons)} mesh{'es' if len(reasons) > 1 else ''} unreadable: {some(reasons, '; ')}",
            "replace these files: they are damaged, or of a format that is not read (STL, DAE and OBJ "
            "are)",
        )
    if outside := [mesh for mesh in subject.meshes if _does_not_travel(mesh)]:
        yield warning(
            f"{_count(outside)} outside the URDF's package: {_named(outside)}",
            "name these meshes by package://NAME/..., or relative to the URDF",
        )
    if not missing and not reasons and not outside:
        files = {mesh.path for mesh in subject.meshes}
        yield ok(f"{len(files)} files, all read")


def _does_not_travel(mesh: MeshFile) -> bool:
    """Whether a mesh is named by a place that is not in the package of its URDF."""
    scheme, separator, _ = mesh.filename.partition("://")
    if separator and scheme != "file":
        return False
    if scheme == "file" or Path(mesh.filename).is_absolute():
        return True
    package = _package(mesh.urdf.path.parent)
    return not (mesh.urdf.path.parent / mesh.filename).resolve().is_relative_to(package)


def _package(folder: Path) -> Path:
    """The folder of the package that a URDF is in; by custom ``NAME/urdf`` or ``NAME/robots``."""
    for above in (folder, *folder.parents):
        if (above / "package.xml").is_file():
            return above
    return folder.parent


def _count(meshes: list[MeshFile]) -> str:
    names = {mesh.filename for mesh in meshes}
    return f"{len(names)} mesh{'es' if len(names) > 1 else ''}"


def _named(meshes: list[MeshFile]) -> str:
    links: dict[str, str] = {}
    for mesh in meshes:
        links.setdefault(mesh.filename, f"{mesh.filename!r} of link {mesh.link!r} ({mesh.use})")
    return some(list(links.values()))
