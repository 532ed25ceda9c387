"""Inference of everything that a robot's TOML says from its URDF."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.robots.infer.arm import (
    Arm,
    Branches,
    Surroundings,
    choose_arm,
    rest_posture,
    steering_couplings,
)
from mobman.robots.infer.base import find_drive
from mobman.robots.infer.drive import Drive
from mobman.robots.infer.findings import (
    FOOTPRINT,
    MECANUM,
    PLANAR_DRIVE,
    Inferred,
    Lock,
    Options,
    Undecided,
    lock_once,
    says,
)
from mobman.robots.infer.kinematics import (
    Chain,
    Tree,
    followers,
    held,
    lost_to_mimics,
    names_of,
)
from mobman.robots.infer.wheels import (
    footprint,
    lowest_point,
    pairs_of,
    rolling_wheels,
    settle_radius,
)
from mobman.robots.spec import Coupling, CriterionSource
from mobman.robots.urdf.compose import TRAVEL_JOINTS
from mobman.robots.urdf.read import UrdfFile
from mobman.robots.urdf.shapes import USES, bounds

_EXACT = 5e-4  # m
_NO_CURVATURE = 0.001  # weight of the curvature of a swerve platform's path
_AXES = ("y", "-y", "x", "-x", "z")  # of a root link, the likeliest first


@dataclass(frozen=True)
class Inference:
    """Everything that was inferred of a robot.

    Attributes:
        urdf: Its file.
        robot_name: As the URDF names it.
        joints: Names of all movable joints, in the file's order.
        platform: The platform and its wheels.
        fields: The fields of ``[platform]`` in addition to its type.
        arm: The chain to the tip.
        following: Names of the mimic joints that follow joints of it.
        locks: What does not move, and why.
        rest: Positions of joints that do not rest at zero (m, rad), and why.
        weights: Of the posture criterion, where they are not the default.
        couplings: Of the criterion, too: what steers follows the arm.
        uncertain: What the user should look at.
        warnings: What is not taken quite as the URDF has it.
    """

    urdf: UrdfFile
    robot_name: str
    joints: tuple[str, ...]
    platform: Drive
    fields: dict[str, Inferred]
    arm: Arm
    following: tuple[str, ...]
    locks: tuple[Lock, ...]
    rest: dict[str, Inferred]
    weights: dict[str, Inferred]
    couplings: tuple[Coupling, ...]
    uncertain: tuple[str, ...]
    warnings: tuple[str, ...]

    def summary(self) -> dict[str, Any]:
        """The facts that a user looks at first, in values that JSON knows."""
        drive, radius = self.platform, self.fields.get("wheel_radius")
        return {
            "urdf": str(self.urdf.path),
            "platform": drive.type.value,
            "wheels": [w.name for w in drive.rolling],
            "wheel_radius": None if radius is None else radius.value,
            "half_track": drive.half_track if drive.rolling else None,
            "heading": drive.forward.heading,
            "tip": self.arm.tip.value,
            "arm_joints": [joint.name for joint in self.arm.joints],
            "reach": self.arm.reach,
            "following": list(self.following),
            "locked": [joint for lock in self.locks for joint in lock.joints],
            "rest": {joint: value.value for joint, value in self.rest.items()},
        }


def infer(urdf: UrdfFile, options: Options) -> Inference:
    """Find out what a URDF does not say outright.

    Raises:
        SpecError: If the file is no URDF that makes sense.
        Undecided: If something takes an option; all that does is in the message.
    """
    robot = urdf.parse()
    tree = Tree(robot, urdf)
    wheels, high = rolling_wheels(tree)
    questions: list[str] = []
    taken = {joint.name for wheel in wheels for joint in wheel.joints}
    ends = [tree.position[end.child] for end in Branches(tree, taken).ends]
    drive, radius, uncertain = None, None, list[str]()
    try:
        arms = np.array(ends).reshape(-1, 3)
        drive = find_drive(tree, wheels, options, arms, _hint(robot))
        # on wheels that it has in the air, or on none, it may stand if it is turned
        turns = (high or not wheels) and options.platform is None
        if turns and (side := _lies_on_its_side(urdf, tree, len(wheels))):
            raise Undecided(side)
        uncertain += drive.uncertain
        if drive.rolling:
            others = [wheel for wheel in wheels if wheel.name not in drive.own]
            radius, doubts = settle_radius(tree, drive.driven, others, options)
            uncertain += doubts
            ground = wheels[0].joint.centre[2] - radius.value
            # most of the robot is below the ground
            if _middle(tree) < ground and (side := _lies_on_its_side(urdf, tree, len(wheels) - 1)):
                raise Undecided(side)
    except Undecided as error:
        side = "" if wheels else _lies_on_its_side(urdf, tree, 0)
        questions.append(side or str(error))
    if drive is not None:
        taken |= drive.own | {name for lock in drive.locks for name in lock.joints}
    locked_by_user = _matching(tree, options.lock)
    branches = Branches(tree, taken | set(locked_by_user))
    arm = None
    try:
        arm = choose_arm(tree, branches, options.tip)
    except Undecided as error:
        known = "" if drive is None or questions else f" (found: {_told(drive, radius)})"
        questions.append(f"{error}{known}")
    if questions or drive is None or arm is None:
        calls = dict.fromkeys(part.tag for part in robot if part.tag.startswith("xacro:"))
        left = f" (xacro did not expand {', '.join(calls)})" if calls else ""
        raise Undecided(f"{urdf.path}: {'; and '.join(questions)}{left}")
    free = _free_followers(tree, branches, arm, drive.own | set(locked_by_user))
    locks = _locks(tree, drive, branches, arm, locked_by_user, free)
    ground = _ground(tree, drive, radius)
    if not (drive.driven or drive.type.value == "fixed" or says(FOOTPRINT, ground.why)):
        uncertain.append(
            f"nothing rolls on the ground, so that it is taken as {ground.why} says: platform.height"
        )
    if tree.virtual:
        uncertain.append(
            f"the virtual joints {names_of(tree.virtual)} in front of the base are locked: the platform "
            "takes their place"
        )
    uncertain += lost_to_mimics(tree, arm.tip.value, taken | free)
    around = Surroundings(float(ground.value), drive.forward.direction, _box(tree))
    still = {joint.name for joint in tree.movable if joint not in arm.joints} - drive.own - free
    rest = _rest(tree, arm, still, around)
    couplings: list[Coupling] = []
    if drive.steering:
        chain = Chain(tree, arm.joints, arm.tip.value, rest)
        posture = np.array([float(rest[joint.name].value) for joint in arm.joints])
        turning = {joint.name: float(np.sign(joint.axis[2])) for joint in drive.steering}
        ahead = drive.steering[0].centre[:2] - (0.0 if drive.centre is None else drive.centre[:2])
        wheelbase: float | None = abs(float(ahead @ drive.forward.direction))
        if drive.wheels:  # a swerve platform's joints follow the curvature of its path
            turning, wheelbase = {TRAVEL_JOINTS[1]: 1.0}, None
        couplings = steering_couplings(turning, chain, posture, wheelbase)
        if not couplings:
            uncertain.append(
                "no joint of the arm turns it about the vertical, so that nothing says where to steer: "
                "add couplings under [criterion] (a steering angle does not move the tip at once; "
                "without them the steering rests for ever and the task is lost)"
            )
    return Inference(
        urdf=urdf,
        robot_name=robot.get("name", ""),
        joints=tuple(joint.name for joint in (*tree.virtual, *tree.movable)),
        platform=drive,
        fields=_fields(drive, radius, ground, options.fields(drive.type.value)),
        arm=arm,
        following=tuple(joint.name for joint in tree.movable if joint.name in free),
        locks=tuple(locks),
        rest=rest,
        weights=_weights(drive, arm),
        couplings=tuple(couplings),
        uncertain=tuple(dict.fromkeys(uncertain)),
        warnings=tuple(drive.rounded()),
    )


def _told(drive: Drive, radius: Inferred | None) -> str:
    """A platform in a clause."""
    wheels = f", wheels {', '.join(w.name for w in drive.rolling)}" if drive.rolling else ""
    return f"{drive.type.value} platform{wheels}" + (
        "" if radius is None else f", radius {radius.value:.4g} m"
    )


def _lies_on_its_side(urdf: UrdfFile, tree: Tree, standing: int) -> str:
    """The question where more wheels than stand would if another axis of the root link pointed up; else
    empty."""
    axes = {joint.name: joint.axis for joint in tree.movable}
    turned = ((axis, replace(urdf, up=axis)) for axis in _AXES if axis != urdf.up)
    for axis, file in turned:
        upright = Tree(file.parse(), file)
        wheels, _ = rolling_wheels(upright)
        pairs = pairs_of(wheels)
        if len(wheels) <= standing or not (pairs or len(wheels) >= 3):
            continue
        one, other = pairs[0] if pairs else (wheels[0], wheels[1])
        if _middle(upright) > 0.5 * (one.joint.centre + other.joint.centre)[2]:
            about = "xyz"[int(np.argmax(np.abs(axes[one.name])))]
            axles = f" (wheel axes about {about})" if pairs else ""
            return (
                f"the root link lies on its side{axles}: {one.name} and {other.name} would roll "
                f"with its {axis} axis up; give --up {axis}"
            )
    return ""


def _middle(tree: Tree) -> float:
    """The mean height of the links above the root link (m)."""
    return float(np.mean([place[2] for place in tree.position.values()]))


def _hint(robot: ET.Element) -> str:
    """The robot's name or the simulator's plug-in that speaks of wheels with rollers; else empty."""
    name = robot.get("name", "")
    if says(MECANUM, name):
        return f"robot {name!r}"
    for plugin in robot.iter("plugin"):
        for text in (plugin.get("filename", ""), plugin.get("name", "")):
            if says(PLANAR_DRIVE, text):
                return f"plug-in {text!r}"
    return ""


def _matching(tree: Tree, wanted: Sequence[str]) -> tuple[str, ...]:
    """The joints that the user locks."""
    movable = [joint.name for joint in (*tree.virtual, *tree.movable)]
    found = {pattern: [n for n in movable if fnmatchcase(n, pattern)] for pattern in wanted}
    for pattern, names in found.items():
        if not names:
            raise Undecided(
                f"--lock {pattern!r} matches no movable joint; the URDF has: {', '.join(movable)}"
            )
    return tuple(dict.fromkeys(name for names in found.values() for name in names))


def _free_followers(tree: Tree, branches: Branches, arm: Arm, taken: set[str]) -> set[str]:
    """The mimic joints that follow the arm's and are no fingers: they are modelled."""
    names = {joint.name for joint in followers(tree, arm.joints)}
    return names - branches.fingers - taken


def _locks(
    tree: Tree,
    drive: Drive,
    branches: Branches,
    arm: Arm,
    by_user: Sequence[str],
    free: set[str],
) -> list[Lock]:
    """Everything that is neither the platform's nor on the way to the tip."""
    if own := [name for name in by_user if name in drive.own]:
        raise Undecided(f"--lock matches the platform's own {', '.join(own)}")

    others = [j.name for other in branches.arms() if other.tip != arm.tip for j in other.joints]
    movable = [joint.name for joint in tree.movable]
    return lock_once(
        {joint.name for joint in arm.joints} | drive.own | free,
        ([joint.name for joint in tree.virtual], "virtual joints in front of the base"),
        *((lock.joints, lock.why) for lock in drive.locks),
        (by_user, "as asked for"),
        ([name for name in movable if name in branches.fingers], "fingers"),
        (
            [joint.name for joint in tree.movable if joint.follows],
            "follow joints (mimic) that do not move",
        ),
        ([joint.name for joint in branches.heads()], "head"),
        (others, "another arm; without this it is free and holds its rest posture"),
        (movable, "not between the platform and the tip"),
    )


def _ground(tree: Tree, drive: Drive, radius: Inferred | None) -> Inferred:
    """The height of the ground in the root link's frame (m)."""
    centre = drive.centre
    if radius is not None and centre is not None:
        return Inferred(float(centre[2]) - float(radius.value), "where the wheels stand")
    lowest = lowest_point(tree, [*tree.rigid(tree.root), *(w.joint.child for w in drive.driven)])
    named = footprint(tree, math.inf if lowest is None else lowest.value + 0.5)
    return named or lowest or Inferred(0.0, f"the origin of {tree.root}")


def _fields(
    drive: Drive, radius: Inferred | None, ground: Inferred, wanted: Iterable[str]
) -> dict[str, Inferred]:
    """The fields of a platform's type, as far as they are found."""
    right, left, wheels, front = (
        [w.name for w in some] for some in (drive.right, drive.left, drive.wheels, drive.front)
    )
    centre, heading = drive.centre, drive.forward.heading
    where = [0.0, 0.0] if centre is None else [round(float(x), 5) + 0.0 for x in centre[:2]]
    what = "the root link's origin" if centre is None else "the middle of the wheels' axle"
    facts: dict[str, Inferred | None] = {
        "heading": Inferred(heading, f"forward: {drive.forward.why}") if heading else None,
        "right_wheels": Inferred(right),
        "left_wheels": Inferred(left),
        "wheels": Inferred(wheels),
        "kind": drive.kind,
        "steering": Inferred([joint.name for joint in drive.steering]),
        "turret": None if drive.turret is None else Inferred(drive.turret.name),
        "front_wheels": Inferred(front) if front else None,
        "axle": Inferred(where, f"{what}, where it does not slip sideways"),
        "centre": Inferred(where, f"{what}, on which the commands act"),
        "height": Inferred(round(-ground.value, 5) + 0.0, f"ground: {ground.why}"),
        "wheel_radius": radius,
        "half_track": _half_track(drive),
    }
    for side, names in (("right", right), ("left", left)):
        facts[f"{side}_wheel"] = facts[f"rear_{side}_wheel"] = Inferred(names[0]) if names else None
    return {name: fact for name in wanted if (fact := facts.get(name)) is not None}


def _half_track(drive: Drive) -> Inferred | None:
    """Half the distance of the tyres (m), where it is not that of their joints."""
    if drive.half_track is None or drive.beside < _EXACT:
        return None
    why = f"of the tyres, {drive.beside:.4g} m beside the frames of their joints"
    return Inferred(round(drive.half_track, 5), why)


def _rest(tree: Tree, arm: Arm, still: set[str], around: Surroundings) -> dict[str, Inferred]:
    """Positions of all joints that do not rest at zero (m, rad)."""
    tip = arm.tip.value
    at = held(tree, still, {})
    values: dict[str, float] = {}
    # a mimic joint on the way to the tip moves it to where its master rests: once more from there
    for _ in range(2):
        values = rest_posture(Chain(tree, arm.joints, tip, at), around)
        before, at = at, held(tree, still, values)
        if all(at.get(j.name) == before.get(j.name) for j in tree.chain(tip) if j.name in still):
            break
    return {name: Inferred(value) for name, value in values.items()} | at


def _weights(drive: Drive, arm: Arm) -> dict[str, Inferred]:
    """Weights of the posture criterion that are not the default; a slide's whole way weighs a radian."""
    found = {}
    default = CriterionSource().default
    if drive.wheels and drive.steering:
        why = "small: the curvature of the path follows the arm, and none is preferred"
        found[TRAVEL_JOINTS[1]] = Inferred(_NO_CURVATURE, why)
    for joint in arm.joints:
        if joint.prismatic and 0.0 < joint.width < math.inf:
            why = f"default / ({joint.width:.3g} m)^2: its way"
            found[joint.name] = Inferred(float(f"{default / joint.width**2:.2g}"), why)
    return found


def _box(tree: Tree) -> Array | None:
    """Corners of what is fixed to the root link (m), shape (2, 3)."""
    for use in USES:
        shapes = [shape for link in tree.rigid(tree.root) for shape in tree.shapes(link, use)]
        if known := [shape for shape in shapes if shape.known]:
            return np.array(bounds(known))
    return None
