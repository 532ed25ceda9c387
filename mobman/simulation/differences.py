"""Differences of the true robot from the one that the controller supposes: dimensions, masses and
inertias."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fnmatch import fnmatchcase
from typing import Annotated, Literal, Self

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.model.build import assemble, make_platform
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.mjcf import unit_twist
from mobman.simulation.pieces import Factor, Piece, Setting, Spread, Triple, some_given, types_of

Remake = Callable[[MobileManipulator], MobileManipulator]
"""Makes of a robot the one with the true dimensions."""

kinematics = types_of("type of kinematics", "mobman.kinematics")
"""Types of other dimensions; each starts as a :data:`Remake`, or None."""


class _Joints(Piece):
    """Base of pieces that change some of the arm's joints, each by a draw of its own."""

    links: str | Annotated[list[str], Field(min_length=1)] = "*"
    """Names of the joints, or of the links behind them; ``*``, ``?`` and ``[...]`` as in file names."""

    def start(self, setting: Setting) -> Remake:
        robot = setting.robot
        arm = [i for i in range(1, robot.nq + 1) if robot.model.joints[i].idx_q in robot.arm.joints]
        chosen = bodies_named(robot, self.links, arm, "joint of the arm")
        draws = setting.random.uniform(-1.0, 1.0, robot.nq + 1)  # for all, whatever is chosen

        def remake(true: MobileManipulator) -> MobileManipulator:
            model = true.model.copy()
            for i in chosen:
                self.change(model, i, float(draws[i]))
            return true.with_model(model)

        return remake

    def change(self, model: pin.Model, joint: int, draw: float) -> None:
        """Change a joint's placement, by a draw from [-1, 1]."""
        raise NotImplementedError


@kinematics.register("links")
class LinkLengths(_Joints):
    """Factors of the links' lengths: of how far each joint of the arm is from the one before it.

    Masses and inertias stay with the joints.
    """

    factor: Factor = 1.0
    """True length over the nominal one."""
    spread: Spread = 0.0
    """The factor times a number from [1 - spread, 1 + spread], for each joint its own."""

    def change(self, model: pin.Model, joint: int, draw: float) -> None:
        place = model.jointPlacements[joint]
        place.translation = self.factor * (1.0 + self.spread * draw) * place.translation


@kinematics.register("zeros")
class Zeros(_Joints):
    """Other zeros of the arm's joints than those that the controller supposes."""

    offset: float = 0.0
    """True angle (or way) of each joint less the measured one (rad, m)."""
    spread: float = Field(0.0, ge=0)
    """The offset plus a number from [-spread, spread], for each joint its own (rad, m)."""

    def change(self, model: pin.Model, joint: int, draw: float) -> None:
        twist = pin.Motion((self.offset + self.spread * draw) * unit_twist(model, joint))
        model.jointPlacements[joint] = model.jointPlacements[joint] * pin.exp6(twist)


@kinematics.register("tool")
class Tool(Piece):
    """Another place of the tip on the link that carries it."""

    factor: Factor = 1.0
    """True distance of the tip from the last joint over the nominal one."""
    spread: Spread = 0.0
    """The factor times a number from [1 - spread, 1 + spread]."""
    offset: Triple = [0.0, 0.0, 0.0]
    """Shift of the tip, in its own axes, in addition (m)."""

    def start(self, setting: Setting) -> Remake:
        factor = self.factor * (1.0 + self.spread * setting.random.uniform(-1.0, 1.0))

        def remake(true: MobileManipulator) -> MobileManipulator:
            model = true.model.copy()
            placement = model.frames[true.tip_frame].placement
            shift = placement.rotation @ np.array(self.offset)
            placement.translation = factor * placement.translation + shift
            return true.with_model(model)

        return remake


@kinematics.register("wheels")
class Wheels(Piece):
    """Another radius and another track of the platform's wheels, on platforms that have them.

    What the controller commands are the torques of the motors that it would have on the nominal wheels,
    and what tells it z are the encoders of wheels and joints.
    """

    radius: Factor = 1.0
    """True radius over the nominal one."""
    radius_spread: Spread = 0.0
    """The factor times a number from [1 - spread, 1 + spread]."""
    track: Factor = 1.0
    """True distance of the right and the left wheels over the nominal one."""
    track_spread: Spread = 0.0
    """The factor times such a number."""

    def start(self, setting: Setting) -> Remake | None:
        """See :class:`Piece`; SpecError if the wheels' radius is no field of the description."""
        robot = setting.robot
        spec, fields = robot.spec, dict(robot.spec.platform.parameters)
        if not robot.platform.wheels:
            return None
        if "wheel_radius" not in fields:
            raise SpecError(
                f"a platform of type {spec.platform.type!r} has no field 'wheel_radius' of which "
                "another one could be made; give the true robot as the run's plant"
            )
        draw = setting.random.uniform(-1.0, 1.0, 2)
        track = self.track * (1.0 + self.track_spread * draw[1])
        fields["wheel_radius"] *= self.radius * (1.0 + self.radius_spread * draw[0])
        if "half_track" in fields:
            fields["half_track"] *= track
        platform = make_platform(spec, assemble(spec, robot.urdf), fields, track)

        def remake(true: MobileManipulator) -> MobileManipulator:
            model, base = true.model.copy(), true.model.getJointId(platform.base_joints[-1])
            rolling = set(platform.coordinates)
            shift, middle = platform.root_offset - true.platform.root_offset, platform.root_offset
            body = model.inertias[base]
            model.inertias[base] = pin.Inertia(body.mass, body.lever + shift, body.inertia)
            for i in range(1, model.njoints):
                if model.parents[i] != base:
                    continue
                place = model.jointPlacements[i].translation + shift
                if model.names[i] in rolling:
                    place[1] = middle[1] + track * (place[1] - middle[1])
                model.jointPlacements[i].translation = place
            for frame in model.frames:
                if frame.parentJoint == base:
                    frame.placement.translation = frame.placement.translation + shift
            return true.with_model(model, platform)

        return remake


# Masses and inertias -----------------------------------------------------------------------------------

Change = Callable[[pin.Model], None]
"""Changes the true robot's inertias in place."""

inertias = types_of("type of inertias", "mobman.inertias")
"""Types of other inertias; each starts as a :data:`Change`, or None."""


@inertias.register("links")
class Links(Piece):
    """Factors of the masses and inertias of some links, fixed or at random, and their balance.

    Links that are fixed to each other move as one body and are treated as one. What results could be
    built: a body's inertia about its centre of mass is scaled as a whole, and the centre is moved.
    """

    links: str | Annotated[list[str], Field(min_length=1)] = "*"
    """Names of links or of the joints that move them; ``*``, ``?`` and ``[...]`` as in file names."""
    part: Literal["all", "platform", "arm"] = "all"
    """Only those of the arm or of the platform, whatever their names."""
    mass_factor: Factor = 1.0
    """Factor of each body's mass and inertia."""
    mass_spread: Spread = 0.0
    """The mass factor times a number from [1 - spread, 1 + spread], for each body its own."""
    inertia_factor: Factor = 1.0
    """Factor of each body's inertia about its centre of mass, in addition to the mass factor."""
    inertia_spread: Spread = 0.0
    """The inertia factor times such a number."""
    centre_offset: Triple = [0.0, 0.0, 0.0]
    """Shift of the centre of mass, in the axes of the joint that moves the body (m)."""
    centre_spread: float = Field(0.0, ge=0)
    """The centre of mass is also moved at random by up to so many of the body's radii of gyration,
    along each axis."""

    def start(self, setting: Setting) -> Change:
        robot, random, moved = setting.robot, setting.random, set(setting.robot.arm.joints)
        joints, links = range(1, robot.model.njoints), robot.model.inertias
        what = "link that has a mass and no joint"
        chosen = bodies_named(robot, self.links, [i for i in joints if links[i].mass > 0], what)
        arm = {i for i in chosen if robot.model.joints[i].idx_q in moved}
        chosen = {"all": chosen, "arm": arm, "platform": chosen - arm}[self.part]

        def change(model: pin.Model) -> None:
            for i in range(1, model.njoints):
                # drawn for all bodies, so that a choice of fewer leaves the others' as they are
                mass_draw, inertia_draw, *shift = random.uniform(-1.0, 1.0, 5)
                body = model.inertias[i]
                if i not in chosen or body.mass <= 0.0:
                    continue
                mass = self.mass_factor * (1.0 + self.mass_spread * mass_draw)
                turning = mass * self.inertia_factor * (1.0 + self.inertia_spread * inertia_draw)
                gyration = np.sqrt(max(np.trace(body.inertia), 0.0) / (2.0 * body.mass))
                spread = self.centre_spread * gyration * np.array(shift)
                lever = body.lever + (np.array(self.centre_offset) + spread)
                model.inertias[i] = pin.Inertia(body.mass * mass, lever, body.inertia * turning)

        return change


def bodies_named(
    robot: MobileManipulator, links: str | list[str], among: Iterable[int], what: str
) -> set[int]:
    """Joints of those ``among`` the robot's whose name, or that of a link that they move, fits a pattern
    as of file names; SpecError if a pattern fits none, ``what`` it fits none of."""
    model = robot.model
    names = {i: {model.names[i]} for i in among}
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY and frame.parentJoint in names:
            names[frame.parentJoint].add(frame.name)
    chosen: set[int] = set()
    for pattern in [links] if isinstance(links, str) else links:
        fits = {i for i in names if any(fnmatchcase(name, pattern) for name in names[i])}
        if not fits:
            listing = ", ".join(sorted(set().union(*names.values())))
            raise SpecError(
                f"field 'links': {pattern!r} fits no {what} of robot {robot.name!r}, which has "
                f"{listing}"
            )
        chosen |= fits
    return chosen


@inertias.register("payload")
class Payload(Piece):
    """A rigid body that is fixed to the tip, of which the controller does not know."""

    mass: float | None = Field(None, ge=0)
    """kg."""
    share: float | None = Field(None, ge=0)
    """Mass over that of the links between the platform and the tip: instead of ``mass``, for a
    scenario that means the same to a small arm and to a large one."""
    offset: Triple = [0.0, 0.0, 0.0]
    """Centre of mass in the tip's frame (m)."""
    inertia: Annotated[list[float], Field(min_length=3, max_length=6)] | None = None
    """About the centre of mass, in the tip's axes (kg m^2): ixx, iyy, izz, or the six of a URDF, ixx,
    ixy, ixz, iyy, iyz, izz. A point mass by default."""

    @model_validator(mode="after")
    def _physical(self) -> Self:
        some_given(self, "mass", "share", most=1)
        if self.inertia is None:
            return self
        if len(self.inertia) not in (3, 6):
            raise ValueError("'inertia' has 3 entries (ixx, iyy, izz) or 6, as in a URDF")
        moments = np.linalg.eigvalsh(self._tensor())
        # no body has a moment above the sum of the others
        if moments[0] < 0.0 or moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
            listing = ", ".join(f"{moment:.3g}" for moment in moments)
            raise ValueError(
                f"'inertia' is that of no body: its principal moments are {listing} kg m^2; none may "
                "be negative or above the sum of the others"
            )
        return self

    def _tensor(self) -> Array:
        if self.inertia is None or len(self.inertia) == 3:
            return np.diag(self.inertia or [0.0, 0.0, 0.0])
        xx, xy, xz, yy, yz, zz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def start(self, setting: Setting) -> Change | None:
        robot = setting.robot
        mass = self.mass if self.share is None else self.share * carried_mass(robot)
        if not mass:
            return None
        load = pin.Inertia(mass, np.array(self.offset), self._tensor())
        return lambda model: add_to_tip(model, robot, load)


def carried_mass(robot: MobileManipulator) -> float:
    """Mass of the links between the platform and the tip (kg)."""
    model, arm = robot.model, set(robot.arm.joints)
    chain = model.supports[model.frames[robot.tip_frame].parentJoint]
    return float(sum(model.inertias[i].mass for i in chain if model.joints[i].idx_q in arm))


def add_to_tip(model: pin.Model, robot: MobileManipulator, load: pin.Inertia) -> None:
    """Fix a body, in the tip's frame, to the tip of a model."""
    tip = model.frames[robot.tip_frame]
    model.appendBodyToJoint(tip.parentJoint, load, tip.placement)
