"""Inference of everything that a robot's TOML says from its URDF."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import combinations
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.robots.infer.arm import Arm, Branches, Surroundings, choose_arm, rest_of
from mobman.robots.infer.base import find_drive
from mobman.robots.infer.drive import Drive
from mobman.robots.infer.findings import (
    MOST_OF_BASE,
    MOST_RADIUS,
    MOST_REACH,
    MOST_TRACK,
    Inferred,
    Lock,
    Options,
    Undecided,
    lock_once,
)
from mobman.robots.infer.kinematics import Chain, Tree, followers, lost_to_mimics, names_of
from mobman.robots.infer.wheels import pairs_of, rolling_wheels, settle_radius
from mobman.robots.spec import Coupling, CriterionSource
from mobman.robots.urdf.compose import TRAVEL_JOINTS
from mobman.robots.urdf.read import UrdfFile
from mobman.robots.urdf.shapes import USES, bounds

_EXACT = 5e-4  # m
_NO_CURVATURE = 0.001  # weight of the curvature of a swerve platform's path
_UPRIGHT = math.cos(0.1)  # an axis that is less tilted than 0.1 rad is vertical
_TURN_A_LAP = 0.01  # rad by which steering may turn a car on a lap of the circle below
_CIRCLE = 0.5  # m: radius of the task `circle`
_MOST_STEERED = 0.5  # of the arm's yaw
_LEVER_ARM = 0.05  # m; a tip that is nearer to an axis is not moved by it
_AXES = ("y", "-y", "x", "-x", "z")  # of a root link, the likeliest first


@dataclass(frozen=True)
class Inference:
    """Everything that was inferred of a robot."""

    urdf: UrdfFile  # its file
    robot_name: str  # as the URDF names it
    joints: tuple[str, ...]  # names of all movable joints, in the file's order
    platform: Drive  # the platform and its wheels
    fields: dict[str, Inferred]  # the fields of [platform] in addition to its type
    arm: Arm  # the chain to the tip
    following: tuple[str, ...]  # names of the mimic joints that follow joints of it
    locks: tuple[Lock, ...]  # what does not move, and why
    rest: dict[str, Inferred]  # positions of joints that do not rest at zero (m, rad), and why
    weights: dict[str, Inferred]  # of the posture criterion, where they are not the default
    couplings: tuple[Coupling, ...]  # of the criterion, too: what steers follows the arm
    uncertain: tuple[str, ...]  # what the user should look at
    warnings: tuple[str, ...]  # what is not taken quite as the URDF has it

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
    """Find out what a URDF does not say outright; SpecError if it makes no sense, Undecided if something
    takes an option, with all that does."""
    robot = urdf.parse()
    tree = Tree(robot, urdf)
    wheels, high = rolling_wheels(tree)
    taken = {joint.name for wheel in wheels for joint in wheel.joints}
    ends = [tree.position[end.child] for end in Branches(tree, taken).ends]
    drive, radius, arm = None, None, None
    questions, uncertain = list[str](), list[str]()
    if tree.stuck:
        uncertain.append(
            f"{names_of(tree.stuck)} cannot move, since both limits are 0: held; correct <limit> of "
            "what moves"
        )
    try:
        drive = find_drive(tree, wheels, options, np.array(ends).reshape(-1, 3))
        # on wheels that it has in the air, or on none, it may stand if it is turned
        named = options.platform or options.right_wheels or options.wheels
        turns = (high or not wheels) and not named
        if turns and (side := _lies_on_its_side(urdf, tree, len(wheels))):
            raise Undecided(side)
        uncertain += drive.uncertain
        uncertain += [
            f"{one.name} ends above the ground, and so {other.name} on the same axle has no partner: "
            "correct the radius or <origin> of one, or name both by --right-wheel and --left-wheel"
            for one in high
            for other in wheels
            if one.beside(other) and not {one.name, other.name} & drive.own
        ]
        if drive.rolling:
            others = [wheel for wheel in wheels if wheel.name not in drive.own]
            radius, doubts = settle_radius(tree, drive.driven, others, options)
            uncertain += doubts
            floor = wheels[0].centre[2] - radius.value
            # most of the robot is below the ground
            if _middle(tree) < floor and (side := _lies_on_its_side(urdf, tree, len(wheels) - 1)):
                raise Undecided(side)
    except Undecided as error:
        side = "" if wheels else _lies_on_its_side(urdf, tree, 0)
        questions.append(side or str(error))
    if drive is not None:
        taken |= drive.own | {name for lock in drive.locks for name in lock.joints}
    by_user = _matching(tree, options.lock)
    branches = Branches(tree, taken | set(by_user))
    try:
        arm = choose_arm(tree, branches, options.tip)
    except Undecided as error:
        known = ""
        if drive is not None and not questions:
            rolling = f", wheels {names_of(drive.rolling)}" if drive.rolling else ""
            size = "" if radius is None else f", radius {radius.value:.4g} m"
            known = f" (found: {drive.type.value} platform{rolling}{size})"
        questions.append(f"{error}{known}")
    if questions or drive is None or arm is None:
        calls = dict.fromkeys(part.tag for part in robot if part.tag.startswith("xacro:"))
        left = [f"xacro did not expand {', '.join(calls)}"] if calls else []
        left += uncertain[:1] if tree.stuck else []
        also = f" ({'; '.join(left)})" if left else ""
        raise Undecided(f"{urdf.made_of or urdf.path}: {'; and '.join(questions)}{also}")
    if not options.as_it_is and (size := _in_another_unit(tree, drive, radius, arm)):
        raise Undecided(f"{urdf.made_of or urdf.path}: {size}")
    # mimic joints that follow the arm's and are no fingers: they are modelled
    following = {joint.name for joint in followers(tree, arm.joints)} - branches.fingers
    following -= drive.own | set(by_user)
    locks = _locks(tree, drive, branches, arm, by_user, following)
    ground, doubts = drive.ground(tree, radius)
    uncertain += doubts
    if tree.virtual:
        uncertain.append(
            f"the virtual joints {names_of(tree.virtual)} in front of the base are locked: the platform "
            "takes their place"
        )
    uncertain += lost_to_mimics(tree, arm.tip.value, taken | following)
    around = Surroundings(float(ground.value), drive.forward.direction, _box(tree))
    still = {joint.name for joint in tree.movable if joint not in arm.joints}
    rest = rest_of(tree, arm, still - drive.own - following, around)
    couplings = _couplings(tree, drive, arm, rest)
    if drive.steering and not couplings:
        uncertain.append(
            "no joint of the arm turns it about the vertical, so that nothing says where to steer: "
            "add couplings under [criterion] (a steering angle does not move the tip at once; "
            "without them the steering rests for ever and the task is lost)"
        )
    return Inference(
        urdf=urdf,
        robot_name=robot.get("name", ""),
        joints=tuple(joint.name for joint in (*tree.virtual, *tree.stuck, *tree.movable)),
        platform=drive,
        fields=_fields(drive, radius, ground, options.fields(drive.type.value)),
        arm=arm,
        following=tuple(joint.name for joint in tree.movable if joint.name in following),
        locks=tuple(locks),
        rest=rest,
        weights=_weights(drive, arm),
        couplings=tuple(couplings),
        uncertain=tuple(dict.fromkeys(uncertain)),
        warnings=tuple(drive.rounded()),
    )


def _lies_on_its_side(urdf: UrdfFile, tree: Tree, standing: int) -> str:
    """The question where more wheels would stand if another axis of the root link pointed up."""
    axes = {joint.name: joint.axis for joint in tree.movable}
    for axis in (axis for axis in _AXES if axis != urdf.up):
        file = replace(urdf, up=axis)
        upright = Tree(file.parse(), file)
        wheels, _ = rolling_wheels(upright)
        pairs = pairs_of(wheels)
        if len(wheels) <= standing or not (pairs or len(wheels) >= 3):
            continue
        one, other = pairs[0] if pairs else (wheels[0], wheels[1])
        if _middle(upright) > 0.5 * (one.centre + other.centre)[2]:
            about = "xyz"[int(np.argmax(np.abs(axes[one.name])))]
            axles = f" (wheel axes about {about})" if pairs else ""
            return (
                f"the root link lies on its side{axles}: {one.name} and {other.name} would roll "
                f"with its {axis} axis up; give --up {axis}"
            )
    return ""


def _in_another_unit(tree: Tree, drive: Drive, radius: Inferred | None, arm: Arm) -> str:
    """The question where something is larger than such things are; else empty."""
    box, centres = _box(tree), np.array([wheel.centre[:2] for wheel in drive.driven]).reshape(-1, 2)
    track = max((float(np.linalg.norm(a - b)) for a, b in combinations(centres, 2)), default=0.0)
    wide = max(track, 0.0 if box is None else float(np.ptp(box, axis=0).max()))
    said = []
    if radius is not None and radius.value > MOST_RADIUS:
        said.append(f"the wheels' radius would be {radius.value:.4g} m ({radius.why})")
    if track > MOST_TRACK:
        said.append(f"the wheels would be {track:.4g} m apart")
    if arm.reach > MOST_REACH:
        said.append(f"the arm would reach {arm.reach:.4g} m")
    elif wide and arm.reach > MOST_OF_BASE * wide:
        said.append(f"the arm would reach {arm.reach:.4g} m from a platform of {wide:.4g} m")
    advice = (
        "a URDF is in metres: scale its origins, shapes and meshes by 0.001, or give --as-it-is"
    )
    return f"{', '.join(said)}: is it in millimetres? {advice}" if said else ""


def _middle(tree: Tree) -> float:
    """The mean height of the links above the root link (m)."""
    return float(np.mean([place[2] for place in tree.position.values()]))


def _matching(tree: Tree, wanted: Sequence[str]) -> tuple[str, ...]:
    """The joints that the user locks."""
    movable = [joint.name for joint in (*tree.virtual, *tree.stuck, *tree.movable)]
    found: list[str] = []
    for pattern in wanted:
        if not (names := [name for name in movable if fnmatchcase(name, pattern)]):
            has = ", ".join(movable)
            raise Undecided(f"--lock {pattern!r} matches no movable joint; the URDF has: {has}")
        found += names
    return tuple(dict.fromkeys(found))


def _locks(
    tree: Tree, drive: Drive, branches: Branches, arm: Arm, by_user: Sequence[str], free: set[str]
) -> list[Lock]:
    """Everything that is neither the platform's nor on the way to the tip."""
    if own := [name for name in by_user if name in drive.own]:
        raise Undecided(f"--lock matches the platform's own {', '.join(own)}")
    others = [j.name for other in branches.arms() if other.tip != arm.tip for j in other.joints]
    movable = [joint.name for joint in tree.movable]
    mimics = [joint.name for joint in tree.movable if joint.follows]
    return lock_once(
        {joint.name for joint in arm.joints} | drive.own | free,
        ([joint.name for joint in tree.virtual], "virtual joints in front of the base"),
        ([joint.name for joint in tree.stuck], "both limits are 0"),
        *((lock.joints, lock.why) for lock in drive.locks),
        (by_user, "as asked for"),
        ([name for name in movable if name in branches.fingers], "fingers"),
        (mimics, "follow joints (mimic) that do not move"),
        ([joint.name for joint in branches.heads()], "head"),
        (others, "another arm; without this it is free and holds its rest posture"),
        (movable, "not between the platform and the tip"),
    )


def _couplings(tree: Tree, drive: Drive, arm: Arm, rest: Mapping[str, Inferred]) -> list[Coupling]:
    """Couplings that let all that steers follow a yaw of the arm at rest; none if it has no yaw.

    Their weight is for runs that last. Where the arm goes round the default circle of area A while a
    car drives to and fro, steering by the share c of the arm's yaw turns it by c A / (reach wheelbase) a
    lap, and c is small. An arm that would turn by more than 45 degrees cannot: the car goes round.
    Where the curvature of the path itself steers, it is the yaw over the reach: the platform goes round.
    """
    if (wheelbase := drive.wheelbase) is None:
        return []
    turning = {joint.name: float(np.sign(joint.axis[2])) for joint in drive.steering}
    posture = np.array([[float(rest[joint.name].value) for joint in arm.joints]])
    places = Chain(tree, arm.joints, arm.tip.value, rest).places(posture)
    centres, axes, tip, _ = (values[0] for values in places)
    for joint, centre, axis in zip(arm.joints, centres, axes, strict=True):
        reach = float(np.linalg.norm(tip[:2] - centre[:2]))
        if joint.prismatic or abs(axis[2]) < _UPRIGHT or reach < _LEVER_ARM:
            continue  # no yaw that moves the tip
        ratio, weight = float(np.sign(axis[2])), CriterionSource().default
        if drive.wheels:  # a swerve platform's joints follow the curvature of its path
            turning, ratio = {TRAVEL_JOINTS[1]: 1.0}, float(f"{ratio / reach:.2g}")
        else:
            share = _MOST_STEERED
            if reach > math.sqrt(2.0) * _CIRCLE:
                share = min(share, _TURN_A_LAP * reach * abs(wheelbase) / (math.pi * _CIRCLE**2))
            weight = float(f"{weight * share / (1.0 - share):.2g}")
        return [
            Coupling(joint=name, to=joint.name, ratio=left * ratio, weight=weight)
            for name, left in turning.items()
        ]
    return []


def _fields(
    drive: Drive, radius: Inferred | None, ground: Inferred, wanted: Iterable[str]
) -> dict[str, Inferred]:
    """The fields of a platform's type, as far as they are found."""
    right, left, wheels, front = (
        [w.name for w in some] for some in (drive.right, drive.left, drive.wheels, drive.front)
    )
    centre, heading, track = drive.centre, drive.forward.heading, drive.half_track
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
    }
    if track is not None and drive.beside >= _EXACT:  # that of the tyres, not of their joints
        why = f"of the tyres, {drive.beside:.4g} m beside the frames of their joints"
        facts["half_track"] = Inferred(round(track, 5), why)
    for side, names in (("right", right), ("left", left)):
        facts[f"{side}_wheel"] = facts[f"rear_{side}_wheel"] = Inferred(names[0]) if names else None
    return {name: fact for name in wanted if (fact := facts.get(name)) is not None}


def _weights(drive: Drive, arm: Arm) -> dict[str, Inferred]:
    """Weights of the posture criterion that are not the default; a slide's whole way weighs a radian."""
    found, default = {}, CriterionSource().default
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
        shapes = tree.shapes(*tree.rigid(tree.root), use=use)
        if known := [shape for _, shape in shapes if shape.known]:
            return np.array(bounds(known))
    return None
