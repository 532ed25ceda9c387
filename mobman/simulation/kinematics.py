"""Differences between the true robot's dimensions and those that the controller supposes, and what may
tell a law of them: encoders, and a tip that is measured."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from pydantic import Field

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.model.build import platform_with
from mobman.model.dynamics import Buffers
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.inertias import bodies_named
from mobman.simulation.mjcf import unit_twist
from mobman.simulation.pieces import Factor, Piece, Setting, Spread, Triple, types_of
from mobman.simulation.sensors import telling_rows
from mobman.tasks.task import Task, task_entry

Remake = Callable[[MobileManipulator], MobileManipulator]
"""Makes of a robot the one with the true dimensions."""

kinematics = types_of("type of kinematics", "mobman.kinematics")
"""Types of differences; each starts as a :data:`Remake`, or None."""


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
        platform = platform_with(robot, fields, track)

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


class Encoders:
    """Values of z that a law with the nominal robot takes from the encoders of wheels and joints of the
    true one, which has the same coordinates, every dt (s)."""

    def __init__(self, robot: MobileManipulator, true: MobileManipulator, dt: float) -> None:
        self._robot, self._true, self._dt = robot, true, dt
        self._rows = telling_rows(robot)
        self._last: Array | None = None

    def __call__(self, q: Array, z: Array, z_dot: Array) -> tuple[Array, Array]:
        """z and z' that fit the coordinates' rates, shapes (nz,); once a tick."""
        nominal, true = (one.velocity_map(q)[self._rows] for one in (self._robot, self._true))
        told: Array = np.asarray(np.linalg.lstsq(nominal, true, rcond=None)[0])
        rate: Any = 0.0 if self._last is None else (told - self._last) @ z / self._dt
        self._last = told
        return told @ z, told @ z_dot + rate


class MeasuredTip:
    r"""A task for a law whose tip is measured: the desired motion, less what the law's model errs by.

    A law finds :math:`f(q) - p_d` and :math:`J z - \dot p_d` with a model's f and J. With
    :math:`p_d - (p - f)` and :math:`\dot p_d - (\dot p - J z)` for what it takes for desired, these are
    the errors of the measured position p and velocity :math:`\dot p`, for any law, and its Jacobian
    is the model's. The same of a pose with the rotation :math:`R_d R^T R_f` and the velocity
    :math:`\Omega_d - R_d R^T (\omega - \omega_f)` of the tip's R and the model's R_f; the axis of a
    pointing task turns by :math:`R_f R^T`.

    What a task may have in addition is that of ``task``; the robot is the law's.
    """

    def __init__(self, task: Task, robot: MobileManipulator) -> None:
        self.task = task
        self._model, self._pose = Buffers(robot), len(task.desired(0.0)[0]) == 7
        self._away, self._turn, self._spin = np.zeros((2, 3)), np.eye(3), np.zeros(3)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or "task" not in vars(self):
            raise AttributeError(name)
        return getattr(self.task, name)

    def look(self, q: Array, z: Array, true: Buffers, q_dot: Array) -> None:
        """Measure the tip of the true robot at its state, whose ``tip_kinematics`` are called before,
        and its q', shape (nq,), where the law is given q and z, shapes (nq,) and (nz,)."""
        model = self._model
        model.q[:], model.z[:] = q, z
        model.velocity()
        model.run_jacobians()
        model.tip_kinematics()
        model.tip_orientation()
        true.tip_orientation()
        velocity, supposed = true.tip_jacobian @ q_dot, model.tip_jacobian @ model.q_dot
        self._away[0] = true.tip - model.tip
        self._away[1] = velocity[:3] - supposed[:3]
        R, R_f, omega, omega_f = true.tip_rotation, model.tip_rotation, velocity[3:], supposed[3:]
        if self._pose:
            self._turn, self._spin = R.T @ R_f, R.T @ (omega - omega_f)
        else:
            self._turn = R_f @ R.T
            self._spin = omega_f - self._turn @ omega

    def desired(self, t: float) -> tuple[Array, Array, Array, Array]:
        """See :class:`Task`."""
        parts = [np.array(part, dtype=float) for part in self.task.desired(t)]
        self._shift(*parts[:2])
        return parts[0], parts[1], parts[2], parts[3]

    def entry(self, t: Array, p_d: Array) -> Callable[[], None]:
        """See :class:`Task`."""
        own = task_entry(self.task, t, p_d)

        def desire() -> None:
            own()
            self._shift(p_d[0], p_d[1])

        return desire

    def _shift(self, place: Array, rate: Array) -> None:
        """Change p_d and p_d' in place."""
        m = min(3, len(place))
        place[:m] -= self._away[0, :m]
        rate[:m] -= self._away[1, :m]
        if self._pose:
            w, x, y, z = place[3:7]
            R_d = pin.Quaternion(w, x, y, z).matrix()
            rate[3:6] -= R_d @ self._spin
            x, y, z, w = pin.Quaternion(R_d @ self._turn).coeffs()
            place[3:7] = w, x, y, z
        elif len(place) > 3:
            rate[3:6] = self._turn @ rate[3:6]
            place[3:6] = self._turn @ place[3:6]
            rate[3:6] += np.cross(self._spin, place[3:6])
