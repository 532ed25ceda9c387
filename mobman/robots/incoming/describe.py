"""A robot's description from what a user names: its URDFs, and what is inferred of them."""

from __future__ import annotations

import os
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from mobman.errors import SpecError
from mobman.robots.incoming.incoming import OnLink, UrdfPart, incoming
from mobman.robots.infer.findings import Inferred, Options, Undecided
from mobman.robots.infer.infer import Inference, infer
from mobman.robots.infer.write import choose_name, robot_toml
from mobman.robots.spec import Mount, RobotSpec, UrdfSource
from mobman.robots.urdf.compose import Mounted, compose
from mobman.robots.urdf.meshes import mesh_paths
from mobman.robots.urdf.read import UrdfFile
from mobman.robots.urdf.validate import listed
from mobman.toml_model import validate


class Described(NamedTuple):
    """A robot as it is found."""

    name: str  # a name for it
    parts: tuple[UrdfPart, ...]  # its URDFs: the platform's, then what is mounted
    found: Inference  # what was inferred of all of them together
    packages: tuple[Path, ...]  # folders that the user named for the meshes
    warnings: tuple[str, ...]
    """What was done to get the files, and what of them has no effect."""

    def toml(self, sources: Sequence[UrdfSource], heading: Inferred | None = None) -> str:
        """The text of its TOML, with these tables for its parts and the weight of the heading."""
        trees = [part.file.parse() for part in self.parts]
        names = [{one.get("name", "") for one in tree.findall("joint")} for tree in trees]
        origin = self.parts[0].origin or self.parts[0].file.path
        own = list(zip(sources, names, strict=True))
        return robot_toml(self.found, self.name, own, self.warnings, origin, heading)

    def spec(self) -> RobotSpec:
        """The description itself, its files where they are."""
        sources = [part.source(part.file.path, None, self.packages) for part in self.parts]
        content = tomllib.loads(self.toml(sources))
        where = f"{self.parts[0].file.named} as it is taken"
        return validate(RobotSpec, {**content, "folder": Path.cwd()}, where)


def describe(
    source: str | os.PathLike[str],
    options: Options | None = None,
    *,
    name: str | None = None,
    output: Path | None = None,
    up: str = "z",
    mounts: Sequence[OnLink] = (),
    packages: Sequence[Path] = (),
    arguments: Mapping[str, str] | None = None,
    made_of: str = "",
) -> Described:
    """Find out everything about a robot that its description needs.

    Args:
        source: As of :func:`incoming`.
        options: Facts that the user gives.
        name: Its name, if the user gives one; ``output`` and the files suggest others.
        output: The TOML that is to be written.
        up: Axis of the root link that points up.
        mounts: What is to be mounted on it.
        packages: Folders of packages of meshes, and of xacro files.
        arguments: Of xacro files.
        made_of: What the user gave, if the source was made of that.

    Raises:
        UsageError: If there is no such file, or several.
        SpecError: If a file is no URDF that makes sense.
        Undecided: If something takes an option; all that does is in the message.
    """
    parts = []
    for mount in (None, *mounts):
        named = source if mount is None else mount.source
        part = incoming(named, packages=packages, arguments=arguments)
        origin, axis = made_of or part.file.made_of, up if mount is None else "z"
        parts.append(replace(part, file=replace(part.file, up=axis, made_of=origin), mount=mount))
    base = parts[0]
    inside = base.file.parse().get("name", "")
    chosen = choose_name(name, output, inside, base.origin or base.file.path)
    found = infer(base.file if len(parts) == 1 else _mounted(parts), options or Options())
    said = [text for part in parts for text in (*part.said, *part.file.remarks)]
    if stated := [name for part in parts for name in part.file.friction]:
        said.append(
            f"<dynamics> gives damping or friction to {len(stated)} joints ({listed(stated)}), which "
            "the equations leave out: the scenario 'urdf-friction' has them"
        )
    warnings = tuple(dict.fromkeys((*said, *found.warnings)))
    return Described(chosen, tuple(parts), found, tuple(packages), warnings)


def _mounted(parts: Sequence[UrdfPart]) -> UrdfFile:
    """One URDF of all parts, as the description will have them, its meshes by absolute paths."""
    trees, mounted = [], []
    for part in parts:
        tree = part.file.parse()
        paths = {mesh.filename: mesh.path for mesh in mesh_paths(tree, part.file)}
        for mesh in tree.iter("mesh"):
            if (path := paths.get(mesh.get("filename", "").strip())) is not None:
                mesh.set("filename", str(path))
        trees.append(tree)
        if (on := part.mount) is not None:
            if on.link is None:
                links = ", ".join(link.get("name", "") for link in trees[0].findall("link"))
                raise Undecided(f"which link carries {on.source}? Give --on; links: {links}")
            mount = Mount(path=str(part.file.path), parent=on.link, prefix=on.prefix)
            mounted.append(Mounted(tree, mount, f"--mount {on.source}: field 'mount"))
    try:
        whole = compose(trees[0], mounted)
    except SpecError as error:
        raise Undecided(f"{error} (by --on, --prefix)") from error
    base = parts[0].file
    return UrdfFile(base.path, base.package_folders, ET.tostring(whole), made_of=base.made_of)
