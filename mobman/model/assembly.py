"""From a description to one URDF: the platform's, with what is mounted on it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from fnmatch import fnmatchcase

from mobman.errors import SpecError, UnknownNameError
from mobman.model.platforms.platform import Platform, platforms
from mobman.robots.spec import RobotSpec, UrdfSource
from mobman.robots.urdf.compose import Mounted, compose
from mobman.robots.urdf.meshes import absolute_meshes
from mobman.robots.urdf.read import UrdfFile, UrdfSources


def platform_type(spec: RobotSpec) -> type[Platform]:
    """The platform's class.

    Raises:
        SpecError: If there is none of that name.
    """
    try:
        return platforms.get(spec.platform.type)
    except UnknownNameError as error:
        raise SpecError(f"{spec.where}: field 'platform.type': {error}") from error


class Assembly:
    """The parts of a robot.

    Args:
        spec: The description.
        sources: Its files.

    Raises:
        SpecError: If a file is no URDF that makes sense, the parts do not fit together, or a pattern
            of ``lock`` matches nothing.

    Attributes:
        robot: The ``<robot>`` element of all parts together.
        links: Names of its links.
        locked: Names of the joints that do not move.
    """

    def __init__(self, spec: RobotSpec, sources: UrdfSources) -> None:
        self._spec = spec
        self._sources = sources
        self.locked: set[str] = set()
        self.robot = self._compose(with_meshes=False)
        self.links = [str(link.get("name")) for link in self.robot.findall("link")]
        self._check_mimics()

    def with_meshes(self) -> ET.Element:
        """A new ``<robot>`` element whose meshes have absolute paths.

        Raises:
            SpecError: If a mesh is missing.
        """
        return self._compose(with_meshes=True)

    def _compose(self, with_meshes: bool) -> ET.Element:
        spec, where = self._spec, self._spec.where
        files = list(self._sources.files)
        if spec.urdf is not None:
            if "body" in spec.platform.parameters:
                raise SpecError(
                    f"{where}: fields 'urdf' and 'platform.body' are both there; allowed: one of them"
                )
            platform = self._part(spec.urdf, files.pop(0), f"{where}: field 'urdf", "", with_meshes)
        else:
            platform = platform_type(spec).describe(spec.platform.parameters, where)
        mounted = [
            Mounted(
                self._part(mount, file, f"{where}: field 'mount[{i}]", mount.prefix, with_meshes),
                mount,
                f"{where}: field 'mount[{i}]",
            )
            for i, (mount, file) in enumerate(zip(spec.mount, files, strict=True))
        ]
        return compose(platform, mounted)

    def _part(
        self, source: UrdfSource, file: UrdfFile, field: str, prefix: str, with_meshes: bool
    ) -> ET.Element:
        robot = file.parse()
        names = [
            str(joint.get("name"))
            for joint in robot.findall("joint")
            if joint.get("type") != "fixed"
        ]
        for pattern in source.lock:
            matching = {prefix + name for name in names if fnmatchcase(name, pattern)}
            if not matching:
                raise SpecError(
                    f"{field}.lock': no movable joint matches {pattern!r}; the URDF has: "
                    f"{', '.join(names)}"
                )
            self.locked |= matching
        if with_meshes:
            absolute_meshes(robot, file)
        return robot

    def _check_mimics(self) -> None:
        mimic = {
            str(joint.get("name"))
            for joint in self.robot.findall("joint")
            if joint.find("mimic") is not None and joint.get("type") != "fixed"
        }
        if free := mimic - self.locked:
            raise SpecError(
                f"{self._spec.where}: the joints {', '.join(sorted(free))} follow others "
                "(<mimic>), which a motor for each joint does not allow; lock them in field 'urdf.lock' "
                "(or that of the mount)"
            )
