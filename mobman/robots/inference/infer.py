"""From a URDF to everything that its TOML says."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.robots.inference import hints
from mobman.robots.inference.arms import Arm, Branches, choose_arm
from mobman.robots.inference.chain import Chain
from mobman.robots.inference.couplings import Following, steering_couplings
from mobman.robots.inference.criterion import weights
from mobman.robots.inference.drive import Drive
from mobman.robots.inference.findings import Finding, Lock, Options, Undecided
from mobman.robots.inference.geometry import Geometry
from mobman.robots.inference.ground import Ground, footprint, lowest_point, settle_radius
from mobman.robots.inference.held import held, lost_to_mimics, posed
from mobman.robots.inference.posture import Place, rest_posture
from mobman.robots.inference.recognise import find_drive
from mobman.robots.inference.tree import Joint, Tree
from mobman.robots.inference.virtual import virtual_joints
from mobman.robots.inference.wheels import Rolling, rolling_wheels
from mobman.robots.urdf.read import UrdfFile
from mobman.robots.urdf.shapes import USES, bounds


@dataclass(frozen=True)
class Inference:
    """What was found out about a robot.

    Attributes:
        urdf: Its file.
        robot_name: As the URDF names it.
        joints: Names of all movable joints, in the file's order.
        platform: The platform and its wheels.
        fields: The fields of ``[platform]`` beside its type.
        ground: The ground in the root link's frame.
        arm: The chain to the tip.
        free: Movable joints that are neither locked nor the platform's.
        locks: What does not move, and why.
        rest: Positions of joints that do not rest at zero (m, rad), and why.
        weights: Of the posture criterion, where they are not the default.
        couplings: Of the same: what steers follows the arm.
        uncertain: What the user should look at.
    """

    urdf: UrdfFile
    robot_name: str
    joints: tuple[str, ...]
    platform: Drive
    fields: dict[str, Finding]
    ground: Ground
    arm: Arm
    free: tuple[str, ...]
    locks: tuple[Lock, ...]
    rest: dict[str, Finding]
    weights: dict[str, Finding]
    couplings: tuple[Following, ...]
    uncertain: tuple[str, ...]


def infer(urdf: UrdfFile, options: Options) -> Inference:
    """Find out what a URDF does not say outright.

    Raises:
        SpecError: If the file is no URDF that makes sense.
        Undecided: If something takes an option; all that does is in the message.
    """
    robot = urdf.parse()
    _no_macros(robot, urdf)
    tree = Tree(robot, str(urdf.path))
    geometry = Geometry(robot, urdf, tree)
    virtual = virtual_joints(tree)
    ignored = {joint.name for joint in virtual}
    wheels = rolling_wheels(tree, geometry, ignored)
    questions: list[str] = []
    around = Branches(tree, ignored | _wheel_joints(wheels))
    ends = np.array([tree.position[end.child] for end in around.ends]).reshape(-1, 3)
    drive, radius, uncertain = None, None, list[str]()
    try:
        drive = find_drive(tree, wheels, geometry, options, ignored, ends, _hint(robot))
        uncertain += drive.uncertain
        if drive.rolling:
            radius, doubts = settle_radius(tree, _driven(drive), options, geometry)
            uncertain += doubts
    except Undecided as error:
        questions.append(str(error))
    taken = ignored | _wheel_joints(wheels)
    if drive is not None:
        taken |= drive.own | {name for lock in drive.locks for name in lock.joints}
    locked_by_user = _matching(tree, options.lock)
    branches = Branches(tree, taken | set(locked_by_user))
    arm = None
    try:
        arm = choose_arm(tree, branches, options.tip)
    except Undecided as error:
        questions.append(str(error))
    if questions or drive is None or arm is None:
        raise Undecided(f"{urdf.path}: {'; and '.join(questions)}")
    locks = _locks(tree, virtual, drive, branches, arm, locked_by_user)
    ground = _ground(tree, drive, radius, geometry)
    if virtual:
        uncertain.append(
            f"the virtual joints {', '.join(j.name for j in virtual)} in front of the base are locked: "
            "the platform takes their place"
        )
    fixed = {name for lock in locks for name in lock.joints}
    free = tuple(j.name for j in tree.movable if j.name not in fixed | drive.own)
    uncertain += lost_to_mimics(tree, arm.tip.value, taken)
    place = Place(ground.height, drive.forward.direction, _box(tree, geometry))
    rest = _rest(tree, arm, free, fixed, place)
    couplings = _couplings(tree, drive, arm, rest)
    if drive.steering and not couplings:
        uncertain.append(
            "no joint of the arm turns it about the vertical, so that nothing says where to steer: "
            "add couplings under [criterion] (a steering angle does not move the tip at once; without "
            "them the steering rests for ever and the task is lost)"
        )
    return Inference(
        urdf=urdf,
        robot_name=robot.get("name", ""),
        joints=tuple(joint.name for joint in tree.movable),
        platform=drive,
        fields=_fields(drive, radius, ground),
        ground=ground,
        arm=arm,
        free=free,
        locks=tuple(locks),
        rest=rest,
        weights=weights(
            [w.name for w in drive.rolling],
            None if radius is None else float(radius.value),
            [joint for joint in arm.joints if joint.prismatic],
            arm.reach,
        ),
        couplings=couplings,
        uncertain=tuple(dict.fromkeys(uncertain)),
    )


def _no_macros(robot: ET.Element, urdf: UrdfFile) -> None:
    if any("xacro" in str(element.tag) for element in robot.iter()):
        raise SpecError(
            f"{urdf.path} has xacro macros, which are not expanded yet; do: xacro {urdf.path.name} > "
            "robot.urdf"
        )


def _wheel_joints(wheels: Iterable[Rolling]) -> set[str]:
    return {
        joint.name
        for w in wheels
        for joint in (w.joint, w.swivel, w.steering, *w.suspension, *w.rollers)
        if joint is not None
    }


def _driven(drive: Drive) -> list[Rolling]:
    return [*drive.right, *drive.left, *drive.wheels]


def _hint(robot: ET.Element) -> str:
    """What in the robot's name or in its simulator's plug-ins speaks of wheels with rollers."""
    name = robot.get("name", "")
    if hints.says(hints.MECANUM, name):
        return f"robot {name!r}"
    for plugin in robot.iter("plugin"):
        for text in (plugin.get("filename", ""), plugin.get("name", "")):
            if hints.says(hints.PLANAR_DRIVE, text):
                return f"plug-in {text!r}"
    return ""


def _matching(tree: Tree, wanted: Sequence[str]) -> tuple[str, ...]:
    """The joints that the user locks."""
    found: dict[str, None] = {}
    for pattern in wanted:
        names = [joint.name for joint in tree.movable if fnmatchcase(joint.name, pattern)]
        if not names:
            raise Undecided(
                f"--lock {pattern!r} matches no movable joint; the URDF has: "
                f"{', '.join(joint.name for joint in tree.movable)}"
            )
        found |= dict.fromkeys(names)
    return tuple(found)


def _locks(
    tree: Tree,
    virtual: Sequence[Joint],
    drive: Drive,
    branches: Branches,
    arm: Arm,
    by_user: Sequence[str],
) -> list[Lock]:
    """Everything that is neither the platform's nor on the way to the tip."""
    if own := [name for name in by_user if name in drive.own]:
        raise Undecided(f"--lock matches the platform's own {', '.join(own)}")
    on_chain = {joint.name for joint in arm.joints}
    heads = [joint.name for joint in branches.heads()]
    others = [
        joint.name for other in branches.arms() for joint in other.joints if other.tip != arm.tip
    ]
    fingers = [joint.name for joint in tree.movable if joint.name in branches.fingers]
    mimics = [joint.name for joint in tree.movable if joint.mimic]
    groups = [
        Lock(tuple(joint.name for joint in virtual), "virtual joints in front of the base"),
        *drive.locks,
        Lock(tuple(by_user), "as asked for"),
        Lock(tuple(fingers), "fingers"),
        Lock(tuple(mimics), "follow other joints (mimic)"),
        Lock(tuple(heads), "head"),
        Lock(tuple(others), "another arm; without this it is free and holds its rest posture"),
        Lock(tuple(joint.name for joint in tree.movable), "not between the platform and the tip"),
    ]
    found, done = [], on_chain | drive.own
    for group in groups:
        names = tuple(dict.fromkeys(name for name in group.joints if name not in done))
        done.update(names)
        if names:
            found.append(Lock(names, group.why))
    return found


def _ground(tree: Tree, drive: Drive, radius: Finding | None, geometry: Geometry) -> Ground:
    centre = drive.centre
    if radius is not None and centre is not None:
        return Ground(float(centre[2]) - float(radius.value), "where the wheels stand")
    links = tree.rigid(tree.root)
    lowest = lowest_point([*links, *(w.joint.child for w in _driven(drive))], geometry)
    named = footprint(tree, np.inf if lowest is None else lowest.height + 0.5)
    return named or lowest or Ground(0.0, f"the origin of {tree.root}")


def _fields(drive: Drive, radius: Finding | None, ground: Ground) -> dict[str, Finding]:
    fields: dict[str, Finding] = {}
    kind = drive.type.value
    if kind != "fixed" and drive.forward.heading != 0.0:
        fields["heading"] = Finding(drive.forward.heading, f"forward: {drive.forward.why}")
    right, left = [w.name for w in drive.right], [w.name for w in drive.left]
    if kind == "differential":
        fields |= {"right_wheel": Finding(right[0]), "left_wheel": Finding(left[0])}
    elif kind == "skid-steer":
        fields |= {"right_wheels": Finding(right), "left_wheels": Finding(left)}
    elif kind == "omnidirectional":
        fields |= {"kind": drive.kind, "wheels": Finding([w.name for w in drive.wheels])}
    elif kind == "car-like":
        fields |= {"rear_right_wheel": Finding(right[0]), "rear_left_wheel": Finding(left[0])}
        fields["steering"] = Finding([joint.name for joint in drive.steering])
        if drive.front:
            fields["front_wheels"] = Finding([w.name for w in drive.front])
    elif kind == "unicycle":
        centre = drive.centre
        where = [0.0, 0.0] if centre is None else [round(float(x), 5) + 0.0 for x in centre[:2]]
        what = "the root link's origin" if centre is None else "the middle of the wheels' axle"
        fields["axle"] = Finding(where, f"{what}, where it does not slip sideways")
        fields["height"] = Finding(round(-ground.height, 5) + 0.0, f"ground: {ground.why}")
    if radius is not None:
        fields["wheel_radius"] = radius
    return fields


def _rest(
    tree: Tree, arm: Arm, free: Sequence[str], fixed: set[str], place: Place
) -> dict[str, Finding]:
    """Where joints rest that do not rest at zero."""
    still = fixed | (set(free) - {joint.name for joint in arm.joints})
    on_chain = {joint.name for joint in tree.chain(arm.tip.value)} & still
    at = held(tree, still, {})
    values: dict[str, float] = {}
    # a mimic joint on the way to the tip moves it to where its master rests: once more from there
    for _ in range(2):
        joints, tip = posed(tree, arm.joints, arm.tip.value, at)
        values = rest_posture(joints, tip, place)
        before, at = at, held(tree, still, values)
        if all(at.get(name) == before.get(name) for name in on_chain):
            break
    return {name: Finding(value) for name, value in values.items()} | at


def _couplings(
    tree: Tree, drive: Drive, arm: Arm, rest: dict[str, Finding]
) -> tuple[Following, ...]:
    """What steers follows the arm's yaw."""
    if not drive.steering:
        return ()
    joints, tip = posed(tree, arm.joints, arm.tip.value, rest)
    values = [float(rest[joint.name].value) for joint in joints]
    return tuple(steering_couplings(drive.steering, Chain(joints, tip), values))


def _box(tree: Tree, geometry: Geometry) -> Array | None:
    """Corners of what is fixed to the root link (m), shape (2, 3)."""
    for use in USES:
        shapes = [s for link in tree.rigid(tree.root) for s in geometry.shapes(link, use)]
        if known := [shape for shape in shapes if shape.known]:
            return np.array(bounds(known))
    return None
