"""The kinematic tree of a URDF: where joints, links and shapes are, and postures of its chains."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from mobman.arrays import Array
from mobman.robots.infer.findings import Inferred
from mobman.robots.urdf.compose import root_link
from mobman.robots.urdf.meshes import MeshReader, mesh_paths
from mobman.robots.urdf.read import UrdfFile
from mobman.robots.urdf.shapes import Shape, Use, placement, read_shapes, scalar, vector

_WIDE = 30.0  # rad; limits so far apart are a way to write "none"
_FULL_TURN = 4.0  # rad; a vertical joint that turns further is a swivel, one that does not steers
_VERTICAL = _HORIZONTAL = 0.02  # rad


@dataclass(frozen=True)
class Follows:
    """The law of a mimic joint: multiplier * position of another joint + offset (m, rad)."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint in the root link's frame, all joints at zero.

    Attributes:
        name, kind, parent, child: As the URDF has them.
        lower, upper: Limits (m, rad), infinite where there are none.
        follows: Which other joint it follows, and how (mimic).
        centre: Its origin (m), shape (3,).
        axis: Unit vector, shape (3,).
    """

    name: str
    kind: str
    parent: str
    child: str
    lower: float
    upper: float
    follows: Follows | None
    centre: Array
    axis: Array

    @property
    def movable(self) -> bool:
        """True if it has a degree of freedom."""
        return self.kind != "fixed"

    @property
    def prismatic(self) -> bool:
        """True if it slides."""
        return self.kind == "prismatic"

    @property
    def width(self) -> float:
        """Between its limits (m, rad)."""
        return self.upper - self.lower

    @property
    def endless(self) -> bool:
        """True if it turns without limits, or with limits that amount to none."""
        return self.kind == "continuous" or (self.kind == "revolute" and self.width > _WIDE)

    @property
    def vertical(self) -> bool:
        """True if its axis is along the root link's z."""
        return abs(float(self.axis[2])) > math.cos(_VERTICAL)

    @property
    def horizontal(self) -> bool:
        """True if its axis is across the root link's z."""
        return abs(float(self.axis[2])) < math.sin(_HORIZONTAL)

    @property
    def swivels(self) -> bool:
        """True if it turns freely about the vertical, as a caster's does."""
        return not self.prismatic and self.vertical and (self.endless or self.width > _FULL_TURN)

    @property
    def steers(self) -> bool:
        """True if it turns about the vertical, within limits."""
        return not self.prismatic and self.vertical and not self.swivels


class Tree:
    """Links and joints of a URDF with all joints at zero, and the shapes of the links.

    Args:
        robot: The checked ``<robot>`` element.
        urdf: Its file.

    Attributes:
        root: Name of the root link.
        links: ``<link>`` elements by name.
        joints: In the file's order.
        movable: Those with a degree of freedom, mimic joints included.
        position: Of each link's frame in the root's (m), by name.
    """

    def __init__(self, robot: ET.Element, urdf: UrdfFile) -> None:
        self.root = root_link(robot, str(urdf.path))
        self.links = {link.get("name", ""): link for link in robot.findall("link")}
        self.position = {self.root: np.zeros(3)}
        self._rotation = {self.root: np.eye(3)}
        self._robot, self._urdf = robot, urdf
        self._meshes = MeshReader()
        self._shapes: dict[tuple[str, Use], list[Shape]] = {}
        self._children: dict[str, list[Joint]] = {name: [] for name in self.links}
        self._above: dict[str, Joint] = {}
        elements = robot.findall("joint")
        behind: dict[str, list[ET.Element]] = {}
        for element in elements:
            behind.setdefault(_end(element, "parent"), []).append(element)
        found: dict[ET.Element, Joint] = {}
        open_links = [self.root]
        for parent in open_links:
            for element in behind.get(parent, []):
                joint = found[element] = self._joint(element, parent)
                self._children[parent].append(joint)
                self._above[joint.child] = joint
                open_links.append(joint.child)
        self.joints = [found[element] for element in elements]
        self.movable = [joint for joint in self.joints if joint.movable]

    def _joint(self, element: ET.Element, parent: str) -> Joint:
        """The joint of an element; its child link is placed."""
        child, kind = _end(element, "child"), element.get("type", "")
        axis = vector(element.find("axis"), "xyz", (1.0, 0.0, 0.0))
        limit, mimic = element.find("limit"), element.find("mimic")
        endless = kind == "continuous"
        turn, xyz = placement(element)
        self._rotation[child] = self._rotation[parent] @ turn
        self.position[child] = self.position[parent] + self._rotation[parent] @ xyz
        return Joint(
            name=element.get("name", ""),
            kind=kind,
            parent=parent,
            child=child,
            lower=-math.inf if endless else scalar(limit, "lower"),
            upper=math.inf if endless else scalar(limit, "upper"),
            follows=None
            if mimic is None
            else Follows(
                mimic.get("joint", ""), scalar(mimic, "multiplier", 1.0), scalar(mimic, "offset")
            ),
            centre=self.position[child],
            axis=self._rotation[child] @ (axis / np.linalg.norm(axis)),
        )

    def joint(self, name: str) -> Joint | None:
        """The movable joint of that name."""
        return next((joint for joint in self.movable if joint.name == name), None)

    def chain(self, link: str) -> list[Joint]:
        """The movable joints from the root to a link."""
        return [joint for joint in self._way(link) if joint.movable]

    def depth(self, link: str) -> int:
        """The number of joints of any kind between the root and a link."""
        return len(self._way(link))

    def _way(self, link: str) -> list[Joint]:
        way: list[Joint] = []
        while link in self._above:
            way.insert(0, self._above[link])
            link = way[0].parent
        return way

    def rigid(self, link: str) -> list[str]:
        """A link and what is fixed to it further out, from the inside outwards."""
        body = [link]
        for name in body:
            body += [joint.child for joint in self._children[name] if not joint.movable]
        return body

    def next_joints(self, link: str) -> list[Joint]:
        """The first movable joints behind a link."""
        return [j for name in self.rigid(link) for j in self._children[name] if j.movable]

    def behind(self, joint: Joint) -> Iterator[Joint]:
        """The movable joints behind a joint, however far."""
        for following in self.next_joints(joint.child):
            yield following
            yield from self.behind(following)

    def shapes(self, link: str, use: Use) -> list[Shape]:
        """The shapes of a link in the root's frame; those of missing or unreadable meshes as well."""
        if (link, use) not in self._shapes:
            self._shapes[link, use] = [
                shape.placed(self._rotation[link], self.position[link])
                for shape in read_shapes(self.links[link], use, self._vertices)
            ]
        return self._shapes[link, use]

    def lacks(self, filename: str) -> bool:
        """True if a mesh of the URDF is missing, as many are of manufacturers' URDFs."""
        return self._paths.get(filename) is None

    @cached_property
    def _paths(self) -> dict[str, Path | None]:
        return {mesh.filename: mesh.path for mesh in mesh_paths(self._robot, self._urdf)}

    def _vertices(self, filename: str) -> Array | None:
        path = self._paths.get(filename)
        return None if path is None else self._meshes.vertices(path)


def _end(joint: ET.Element, tag: str) -> str:
    found = joint.find(tag)
    return "" if found is None else found.get("link", "")


def names_of(joints: Iterable[Joint]) -> str:
    """The names of joints, for messages."""
    return ", ".join(joint.name for joint in joints) or "none"


def virtual_joints(tree: Tree) -> list[Joint]:
    """The planar joints (x, y, turning) between the root and the platform's first real link.

    Simulators that know no wheels want them. They follow each other, nothing branches off, and the
    links between them are bare.
    """
    found: list[Joint] = []
    link = tree.root
    while True:
        following = tree.next_joints(link)
        bodies = [tree.links[name].find(use) for name in tree.rigid(link) for use in _BODIES]
        if len(following) != 1 or any(body is not None for body in bodies):
            break
        joint = following[0]
        if not (joint.horizontal if joint.prismatic else joint.vertical):
            break
        if not joint.prismatic and not (joint.endless or joint.swivels):
            break
        found.append(joint)
        link = joint.child
    return found if len({joint.prismatic for joint in found}) == 2 else []


_BODIES = ("visual", "collision")


class Chain:
    """Kinematics of some joints on the way to a tip, for many postures at once.

    Args:
        tree: The robot.
        joints: Those that move, in order.
        tip: A link.
        held: Where other joints are held (m, rad); at zero if they are not in it.
    """

    def __init__(
        self, tree: Tree, joints: Sequence[Joint], tip: str, held: Mapping[str, Inferred]
    ) -> None:
        self.joints = tuple(joints)
        own = {joint.name: i for i, joint in enumerate(joints)}
        self._way = [
            (
                joint,
                own.get(joint.name),
                float(held[joint.name].value) if joint.name in held else 0.0,
            )
            for joint in tree.chain(tip)
        ]
        self._tip = tree.position[tip]

    def places(self, q: Array) -> tuple[Array, Array, Array]:
        """Places of the joints and the tip.

        Args:
            q: Postures (m, rad), shape (m, n).

        Returns:
            Origins of the joints, shape (m, n, 3); their axes, shape (m, n, 3); the tip, (m, 3). All
            in the root's frame (m).
        """
        count = len(q)
        turn, shift = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))
        centres, axes = np.empty((2, count, len(self.joints), 3))
        for joint, i, at in self._way:
            centre, axis = turn @ joint.centre + shift, turn @ joint.axis
            values = np.full(count, at) if i is None else q[:, i]
            if i is not None:
                centres[:, i], axes[:, i] = centre, axis
            if joint.prismatic:
                shift = shift + axis * values[:, None]
            else:
                turn = turn @ Rotation.from_rotvec(values[:, None] * joint.axis).as_matrix()
                shift = centre - turn @ joint.centre
        return centres, axes, turn @ self._tip + shift

    def jacobian(self, centres: Array, axes: Array, tip: Array) -> Array:
        """The tip's linear Jacobian for each posture of :meth:`places` (m/m, m/rad), (m, 3, n)."""
        sliding = np.array([joint.prismatic for joint in self.joints])[None, :, None]
        columns = np.where(sliding, axes, np.cross(axes, tip[:, None] - centres))
        result: Array = columns.transpose(0, 2, 1)
        return result


def held(tree: Tree, names: Iterable[str], rest: Mapping[str, float]) -> dict[str, Inferred]:
    """Positions of held joints that are not held at zero (m, rad), by name.

    Args:
        tree: The robot.
        names: The joints that do not move.
        rest: Where the others rest; zero if they are not in it.
    """
    found = {
        joint.name: _held_at(tree, joint, rest, frozenset())
        for joint in tree.movable
        if joint.name in set(names) and joint.name not in rest
    }
    return {name: finding for name, finding in found.items() if finding.value != 0.0}


def _held_at(tree: Tree, joint: Joint, rest: Mapping[str, float], seen: frozenset[str]) -> Inferred:
    """The position of a held joint: with its master, else at zero; within its limits."""
    if joint.name in rest:
        return Inferred(rest[joint.name])
    wanted, why = 0.0, "0 is outside its limits"
    follows = joint.follows
    if follows is not None and joint.name not in seen:
        master = tree.joint(follows.joint)
        at = 0.0 if master is None else _held_at(tree, master, rest, seen | {joint.name}).value
        wanted = round(follows.multiplier * at + follows.offset, 9) + 0.0
        why = f"where {follows.joint} at {at:.4g} takes it (mimic)"
    value = float(min(max(wanted, joint.lower), joint.upper))
    if value != wanted and follows is not None:
        why += ", within its limits"
    return Inferred(value, why)


def lost_to_mimics(tree: Tree, tip: str, ignored: set[str]) -> list[str]:
    """Messages about the motion that is lost since mimic joints on the way to a tip are held.

    Args:
        tree: The robot.
        tip: A link.
        ignored: Joints that are the platform's.
    """
    groups: dict[str, list[Joint]] = {}
    for joint in tree.chain(tip):
        if joint.follows is not None and joint.name not in ignored:
            groups.setdefault(joint.follows.joint, []).append(joint)
    said = []
    for name, joints in groups.items():
        master = tree.joint(name)
        width = 0.0 if master is None else master.width
        lost = {True: 0.0, False: 0.0}  # of slides and of turns
        for joint in joints:
            gain = 0.0 if joint.follows is None else abs(joint.follows.multiplier)
            lost[joint.prismatic] += min(joint.width, gain * width) if gain else 0.0
        parts = []
        if slides := lost[True]:
            parts.append("much of reach" if math.isinf(slides) else f"{slides:.3g} m of reach")
        if turns := lost[False]:
            endless = math.isinf(turns)
            parts.append("turns without limits" if endless else f"{turns:.3g} rad of turning")
        one = len(joints) == 1
        said.append(
            f"{names_of(joints)} {'follows' if one else 'follow'} {name} by <mimic>, which is not "
            f"modelled: {'it is' if one else 'they are'} held, which takes "
            + (" and ".join(parts) or "nothing, as their limits leave no way")
        )
    return said
