"""The kinematic tree of a URDF, as Pinocchio has it: joints, links, shapes, and postures of chains."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.robots.infer.findings import Inferred, says
from mobman.robots.urdf.compose import flat_urdf, frame_of, root_link
from mobman.robots.urdf.meshes import MeshReader, mesh_paths
from mobman.robots.urdf.read import UrdfFile
from mobman.robots.urdf.shapes import USES, Shape, Use, read_shapes, scalar

_NO_BOUND = 1e8
_WIDE = 30.0  # rad; limits so far apart are a way to write "none"
_FULL_TURN = 4.0  # rad; a vertical joint that turns further is a swivel, one that does not steers
_VERTICAL = _HORIZONTAL = 0.02  # rad


class Follows(NamedTuple):
    """The law of a mimic joint: multiplier * position of another joint + offset (m, rad)."""

    joint: str
    multiplier: float
    offset: float


@dataclass(eq=False)
class Joint:
    """A joint in the root link's frame, all joints at zero."""

    name: str
    kind: str  # as the URDF has it, like the links
    parent: str
    child: str
    lower: float  # limits (m, rad), infinite where there are none
    upper: float
    follows: Follows | None  # which other joint it follows, and how (mimic)
    centre: Array  # its origin (m), shape (3,)
    axis: Array  # unit vector, shape (3,); zero if it is fixed
    virtual: bool = False  # as if it were fixed

    @property
    def movable(self) -> bool:
        return self.kind != "fixed" and not self.virtual

    @property
    def prismatic(self) -> bool:
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
        """True if the axis points up or down, nearly."""
        return abs(float(self.axis[2])) > math.cos(_VERTICAL)

    @property
    def horizontal(self) -> bool:
        """True if the axis is level, nearly."""
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
    """Links and joints of a checked URDF with all joints at zero, and the shapes of the links."""

    def __init__(self, robot: ET.Element, urdf: UrdfFile) -> None:
        where = urdf.named
        mesh_paths(robot, urdf)
        self.robot, self._meshes = robot, MeshReader()
        self.root = root_link(robot, where)  # name of the root link
        self.links = {link.get("name", ""): link for link in robot.findall("link")}
        xml = flat_urdf(deepcopy(robot), where, base_joints=())
        try:  # root link at the world's origin, one coordinate a joint
            self.model = pin.buildModelFromXML(xml)
        except (ValueError, RuntimeError) as error:
            raise SpecError(f"{where}: Pinocchio refuses the URDF: {error}") from error
        data, rest = self.model.createData(), np.zeros(self.model.nq)
        pin.computeJointJacobians(self.model, data, rest)
        pin.updateFramePlacements(self.model, data)
        self._places = {name: data.oMf[frame_of(self.model, name)].copy() for name in self.links}
        # of each link's frame in the root's (m)
        self.position = {name: place.translation for name, place in self._places.items()}
        self._shapes: dict[tuple[str, Use], list[Shape]] = {}
        self.joints = [self._joint(joint, data) for joint in robot.findall("joint")]
        self._above = {joint.child: joint for joint in self.joints}
        self._children = {name: [j for j in self.joints if j.parent == name] for name in self.links}
        # in front of the base, which simulators that know no wheels want
        self.virtual = self._virtual()
        for joint in self.virtual:
            joint.virtual = True
        # limits that leave no way make a joint a fixed one
        self.stuck = self._stuck()
        for joint in self.stuck:
            joint.virtual = True
        # with a degree of freedom, mimic joints included, virtual ones not
        self.movable = [joint for joint in self.joints if joint.movable]

    def _joint(self, element: ET.Element, data: pin.Data) -> Joint:
        name, kind = element.get("name", ""), element.get("type", "")
        parent, child = (next(element.iter(end)).get("link", "") for end in ("parent", "child"))
        limit, mimic = element.find("limit"), element.find("mimic")
        axis, follows = np.zeros(3), None
        if mimic is not None:
            law = scalar(mimic, "multiplier", 1.0), scalar(mimic, "offset")
            follows = Follows(mimic.get("joint", ""), *law)
        if kind != "fixed":
            columns = np.reshape(data.J, (6, -1))  # of one joint Pinocchio gives a vector
            column = columns[:, self.model.joints[self.model.getJointId(name)].idx_v]
            axis = np.array(column[:3] if kind == "prismatic" else column[3:])
        ends = [scalar(limit, "lower"), scalar(limit, "upper")]
        if kind == "continuous":
            ends = [-math.inf, math.inf]
        lower, upper = (x if abs(x) < _NO_BOUND else math.copysign(math.inf, x) for x in ends)
        return Joint(name, kind, parent, child, lower, upper, follows, self.position[child], axis)

    def _virtual(self) -> list[Joint]:
        """The planar joints (x, y, turning) between the root and the platform's first real link, which
        follow each other, with bare links between and nothing that branches off."""
        found: list[Joint] = []
        link = self.root
        while len(following := self.next_joints(link)) == 1:
            (joint,) = following
            bodies = (self.links[name].find(use) for name in self.rigid(link) for use in USES)
            planar = joint.horizontal if joint.prismatic else joint.swivels
            if not planar or any(body is not None for body in bodies):
                break
            found.append(joint)
            link = joint.child
        return found if len({joint.prismatic for joint in found}) == 2 else []

    def _stuck(self) -> list[Joint]:
        """The joints whose limits are both 0, those of wheels and fingers aside; none if all have such
        limits, which nobody has written then."""
        limited = [j for j in self.joints if j.movable and not j.endless and not j.follows]
        found = [
            joint
            for joint in limited
            if joint.lower == joint.upper == 0.0
            and not any(says(what, joint.name, joint.child) for what in ("wheel", "finger"))
            and not any(j.endless or says("wheel", j.name, j.child) for j in self.behind(joint))
        ]
        return found if len(found) < len(limited) else []

    def joint(self, name: str) -> Joint | None:
        """The movable joint of a name; None if there is none."""
        return next((joint for joint in self.movable if joint.name == name), None)

    def way(self, link: str) -> list[Joint]:
        """The joints of any kind from the root to a link."""
        way: list[Joint] = []
        while link in self._above:
            way.insert(0, self._above[link])
            link = way[0].parent
        return way

    def chain(self, link: str) -> list[Joint]:
        """The movable joints from the root to a link."""
        return [joint for joint in self.way(link) if joint.movable]

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

    def shapes(self, *links: str, use: Use) -> list[tuple[str, Shape]]:
        """Shapes of links in the root's frame, with the links; of unreadable meshes as well."""
        for link in links:
            if (link, use) not in self._shapes:
                place, own = self._places[link], read_shapes(self.links[link], use, self._meshes.of)
                self._shapes[link, use] = [s.placed(place.rotation, place.translation) for s in own]
        return [(link, shape) for link in links for shape in self._shapes[link, use]]


def names_of(things: Iterable[Any]) -> str:
    """The names of joints or wheels, for messages."""
    return ", ".join(thing.name for thing in things) or "none"


def followed(tree: Tree, joint: Joint) -> Follows:
    """The joint that one follows at last, through those in between: itself if it follows none."""
    law, seen = Follows(joint.name, 1.0, 0.0), {joint.name}
    while (at := tree.joint(law.joint)) is not None and (own := at.follows) is not None:
        offset = law.offset + law.multiplier * own.offset
        law = Follows(own.joint, law.multiplier * own.multiplier, offset)
        if own.joint in seen:
            break  # in a circle
        seen.add(own.joint)
    return law


def followers(tree: Tree, joints: Iterable[Joint]) -> list[Joint]:
    """The mimic joints that follow some of these, in the file's order."""
    names = {joint.name for joint in joints}
    mimics = [joint for joint in tree.movable if joint.follows and joint.name not in names]
    return [joint for joint in mimics if followed(tree, joint).joint in names]


class Chain:
    """Kinematics of the joints that move a tip, in order, for many postures at once.

    Mimic joints follow them. The others are where ``held`` says (m, rad), or at zero.
    """

    def __init__(
        self, tree: Tree, joints: Sequence[Joint], tip: str, held: Mapping[str, Inferred]
    ) -> None:
        self.joints = tuple(joints)
        every, names = [*joints, *followers(tree, joints)], [joint.name for joint in joints]
        q, own = np.zeros(tree.model.nq), {joint.name for joint in every}
        for name, at in held.items():
            q[tree.model.joints[tree.model.getJointId(name)].idx_q] = float(at.value)
        others = [i for i, name in enumerate(tree.model.names) if i and name not in own]
        self._model = pin.buildReducedModel(tree.model, others, q)
        self._data = self._model.createData()
        self._tip = frame_of(self._model, tip)
        self._sliding = np.array([joint.prismatic for joint in joints])[:, None]
        index = [int(self._model.joints[self._model.getJointId(one.name)].idx_q) for one in every]
        self._own = index[: len(joints)]
        # all positions from those of the joints
        self._laws, self._offsets = np.zeros((len(every), len(joints))), np.zeros(len(every))
        bounds = np.array([[joint.lower, joint.upper] for joint in joints])
        for i, joint in zip(index, every, strict=True):
            law = followed(tree, joint)
            at_law = names.index(law.joint)
            self._laws[i, at_law], self._offsets[i] = law.multiplier, law.offset
            if law.multiplier:
                ends = (np.array([joint.lower, joint.upper]) - law.offset) / law.multiplier
                within = np.clip(np.sort(ends), *bounds[at_law])
                bounds[at_law] = within if within[0] < within[1] else bounds[at_law]
        self.limits = bounds
        """Limits of the joints (m, rad) within which those that follow them keep theirs, (n, 2)."""
        carrying = self._model.supports[self._model.frames[self._tip].parentJoint]
        self._moving = self._laws * np.isin(np.arange(len(every)) + 1, list(carrying))[:, None]

    def places(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """Places for postures q (m, rad), shape (m, n), in the root's frame (m).

        Returns:
            Origins of the joints (of slides: where they start), shape (m, n, 3); their axes, shape
            (m, n, 3); the tip, shape (m, 3); its linear Jacobian (m/m, m/rad), shape (m, 3, n).
        """
        model, data = self._model, self._data
        centres, tip = np.empty((*q.shape, 3)), np.empty((len(q), 3))
        columns = np.empty((len(q), model.nv, 6))
        for k, at in enumerate(q @ self._laws.T + self._offsets):
            columns[k] = np.reshape(pin.computeJointJacobians(model, data, at), (6, -1)).T
            centres[k] = [data.oMi[i + 1].translation for i in self._own]
            tip[k] = pin.updateFramePlacement(model, data, self._tip).translation
        own = columns[:, self._own]
        axes = np.where(self._sliding, own[..., :3], own[..., 3:])
        moved = columns[..., :3] + np.cross(columns[..., 3:], tip[:, None])
        moved = np.swapaxes(moved, 1, 2) @ self._moving
        return centres - np.where(self._sliding, axes * q[:, :, None], 0.0), axes, tip, moved

    def loads(self, q: Array) -> Array:
        """The largest share of its effort limit that a joint needs to hold postures of :meth:`places`,
        shape (m,); 0 where no limit is known."""
        model, effort = self._model, np.array(self._model.effortLimit)[self._own]
        most, found = np.where(effort > 0.0, effort, np.inf), np.empty(len(q))
        for k, posture in enumerate(q):
            at = self._laws @ posture + self._offsets
            held_by = self._laws.T @ pin.computeGeneralizedGravity(model, self._data, at)
            found[k] = np.max(np.abs(held_by) / most)
        return found


def held(tree: Tree, names: Iterable[str], rest: Mapping[str, float]) -> dict[str, Inferred]:
    """Positions of held joints that are not held at zero (m, rad), by name; ``rest`` has the others'."""
    wanted = set(names) - rest.keys()
    found = {j.name: _held_at(tree, j, rest, frozenset()) for j in tree.movable if j.name in wanted}
    return {name: finding for name, finding in found.items() if finding.value != 0.0}


def _held_at(tree: Tree, joint: Joint, rest: Mapping[str, float], seen: frozenset[str]) -> Inferred:
    """The position of a held joint: with its master, else at zero; within its limits."""
    if joint.name in rest:
        return Inferred(rest[joint.name])
    wanted, why, follows = 0.0, "0 is outside its limits", joint.follows
    if follows is not None and joint.name not in seen:
        master = tree.joint(follows.joint)
        at = 0.0 if master is None else _held_at(tree, master, rest, seen | {joint.name}).value
        wanted = round(follows.multiplier * at + follows.offset, 9) + 0.0
        why = f"where {follows.joint} at {at:.4g} takes it (mimic)"
    value = float(min(max(wanted, joint.lower), joint.upper))
    return Inferred(value, f"{why}, within its limits" if value != wanted and follows else why)


def lost_to_mimics(tree: Tree, tip: str, ignored: set[str]) -> list[str]:
    """Messages about the motion that is lost where mimic joints on the way to a tip are held."""
    groups: dict[str, list[tuple[Joint, float]]] = {}
    for joint in tree.chain(tip):
        if (follows := joint.follows) is not None and joint.name not in ignored:
            master = tree.joint(follows.joint)
            way = abs(follows.multiplier) * master.width if master and follows.multiplier else 0.0
            groups.setdefault(follows.joint, []).append((joint, min(joint.width, way)))
    said = []
    for name, found in groups.items():
        slides = sum(way for joint, way in found if joint.prismatic)
        turns = sum(way for joint, way in found if not joint.prismatic)
        parts = []
        if slides:
            parts.append("much of reach" if math.isinf(slides) else f"{slides:.3g} m of reach")
        if turns:
            endless = math.isinf(turns)
            parts.append("turns without limits" if endless else f"{turns:.3g} rad of turning")
        follow, they = ("follows", "it is") if len(found) == 1 else ("follow", "they are")
        said.append(
            f"{names_of(joint for joint, _ in found)} {follow} {name} by <mimic>, which is none "
            f"of the arm's free joints: {they} held, which takes "
            + (" and ".join(parts) or "nothing, as their limits leave no way")
        )
    return said
