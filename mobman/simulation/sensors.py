"""Sensors: errors of the measured state, estimators of z', and the measurement that the controller is
given."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin
from pydantic import Field

from mobman.arrays import Array, Index
from mobman.model.dynamics import Buffers
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.pieces import Each, Piece, Setting, checked, entries, types_of
from mobman.tasks.task import Task, task_entry

Measure = Callable[[Array, Array, Array], tuple[Array, Array, Array]]
"""The measured q, z and z', new arrays, from the true ones under the torque held until now, shapes
(nq,), (nz,), (nz,); called once at every tick."""

Estimate = Callable[[Array, Array], Array]
"""z' at a tick, a new array, from the measured z and the true z' under the torque held until now, shapes
(nz,); called once at every tick."""

estimators = types_of("acceleration estimator", "mobman.acceleration")
"""Types of estimators; each starts as an :data:`Estimate`."""


class Sensor(NamedTuple):
    """A piece at work: from the true state to the measured one. Both are called at every tick."""

    state: Callable[[Array, Array], None] = lambda q, z: None
    """Changes q and z, shapes (nq,) and (nz,), in place."""
    acceleration: Callable[[Array], None] = lambda z_dot: None
    """Changes z', shape (nz,), in place; called after the other."""


sensors = types_of("sensor type", "mobman.sensors")
"""Types of errors; each starts as a :class:`Sensor`, or None."""


def encoders(
    robot: MobileManipulator, true: MobileManipulator, dt: float
) -> Callable[[Array, Array, Array], tuple[Array, Array]]:
    """A function that gives z and z', shapes (nz,), as a law with the nominal robot takes them from the
    encoders of wheels and joints of the true one, which has the same coordinates; called every dt (s)
    with the true q, z and z'."""
    rows, last = telling_rows(robot), None

    def tell(q: Array, z: Array, z_dot: Array) -> tuple[Array, Array]:
        nonlocal last
        C, true_C = (one.velocity_map(q)[rows] for one in (robot, true))
        told: Array = np.asarray(np.linalg.lstsq(C, true_C, rcond=None)[0])
        rate: Any = 0.0 if last is None else (told - last) @ z / dt
        last = told
        return told @ z, told @ z_dot + rate

    return tell


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


# Errors -----------------------------------------------------------------------------------------------

_Deviation = Annotated[Each, checked("a standard deviation must not be negative", zero=True)]
_Resolution = Annotated[Each, checked("a resolution must not be negative", zero=True)]


@sensors.register("noise")
class WhiteNoise(Piece):
    """White Gaussian noise, new at every tick; each field is a standard deviation."""

    position: _Deviation = 0.0
    """Deviation at the joints and wheels (rad, m): a number for all, or a list for all of q."""
    pose: _Deviation = 0.0
    """Deviation of the platform's pose (m, m, rad), where ``position`` is no list."""
    velocity: _Deviation = 0.0
    """Deviation of z."""
    acceleration: _Deviation = 0.0
    """Deviation of z', in addition to what the noise of z does to a z' that is computed from it."""

    def start(self, setting: Setting) -> Sensor | None:
        names = list(setting.robot.velocity_names)
        deviations = (
            _of_coordinates(setting.robot, self.position, self.pose, "position"),
            entries(self.velocity, names, "velocity", "velocities"),
            entries(self.acceleration, names, "acceleration", "velocities"),
        )
        if not np.concatenate(deviations).any():
            return None
        # a stream for each, so that noise of one does not depend on whether another has any
        streams = zip(deviations, setting.random.spawn(3), strict=True)
        on_q, on_z, on_z_dot = (_noise(deviation, own) for deviation, own in streams)

        def state(q: Array, z: Array) -> None:
            on_q(q)
            on_z(z)

        return Sensor(state, on_z_dot)


def _noise(deviation: Array, random: np.random.Generator) -> Callable[[Array], None]:
    def add(values: Array) -> None:
        values += deviation * random.standard_normal(len(values))

    return add if deviation.any() else lambda values: None


@sensors.register("quantisation")
class Quantisation(Piece):
    """q is rounded to the nearest multiple of a resolution; z may be what its differences tell."""

    resolution: _Resolution
    """Resolution of joints and wheels (rad, m): a number for all, or a list for all of q."""
    pose: _Resolution = 0.0
    """Resolution of the platform's pose (m, m, rad), where ``resolution`` is no list; 0: not rounded."""
    velocity: Literal["measured", "difference"] = "measured"
    """z is measured by itself, or is (q_k - q_(k-1))/dt of the rounded q, as z."""

    def start(self, setting: Setting) -> Sensor | None:
        robot, measured = setting.robot, self.velocity == "measured"
        resolution = _of_coordinates(robot, self.resolution, self.pose, "resolution")
        if measured and not resolution.any():
            return None
        rounded, rows = np.flatnonzero(resolution), telling_rows(robot)
        step = resolution[rounded]
        last: Array | None = None

        def state(q: Array, z: Array) -> None:
            nonlocal last
            q[rounded] = step * np.round(q[rounded] / step)
            if measured:
                return
            before, last = last, q.copy()
            if before is None:
                z[:] = 0.0  # runs start at rest
            else:
                rate = (q - before)[rows] / setting.dt
                z[:] = np.linalg.lstsq(robot.velocity_map(q)[rows], rate, rcond=None)[0]

        return Sensor(state)


def telling_rows(robot: MobileManipulator) -> Index:
    """Places in q of what tells z: joints and wheels, or all where these leave something open."""
    every = np.arange(robot.nq, dtype=np.int64)
    own = np.setdiff1d(every, pose_index(robot))
    # the wheels tell how the platform moves, if they are coordinates at all
    tells = np.linalg.matrix_rank(robot.velocity_map(robot.q_rest)[own]) == robot.nz
    return own if tells else every


def pose_index(robot: MobileManipulator) -> list[int]:
    """Places of the platform's pose (x1, x2, theta) in q; none if it has no pose."""
    return [robot.joint_names.index(name) for name in robot.platform.base_joints]


def _of_coordinates(
    robot: MobileManipulator, encoders: float | list[float], pose: float | list[float], field: str
) -> Array:
    """A number for each coordinate, shape (nq,): ``field``'s for joints and wheels, and another for the
    pose, which no encoder measures, unless a list for all of q says this already."""
    values = entries(encoders, robot.joint_names, field, "coordinates")
    index = pose_index(robot)
    if index and not isinstance(encoders, list):
        values[index] = entries(pose, ["x1", "x2", "theta"], "pose", "coordinates of a pose")
    return values


# Estimators of z' -------------------------------------------------------------------------------------


@estimators.register("exact")
class Exact(Piece):
    """The true z' under the torque held until now: what an ideal sensor shows."""

    def start(self, setting: Setting) -> Estimate:
        return lambda z, true: true.copy()


@estimators.register("backward-difference")
class BackwardDifference(Piece):
    """(z_k - z_(k-1))/dt, 0 at the first tick."""

    def start(self, setting: Setting) -> Estimate:
        dt = setting.dt
        last: Array | None = None

        def difference(z: Array, true: Array) -> Array:
            nonlocal last
            before, last = last, z.copy()
            return np.zeros_like(z) if before is None else (z - before) / dt

        return difference


@estimators.register("filtered-difference")
class FilteredDifference(Piece):
    """The backward difference behind a first-order low pass, sampled with its step response exact."""

    cutoff: float = Field(gt=0)
    """Frequency at which its gain is 1/sqrt(2) (Hz)."""

    def start(self, setting: Setting) -> Estimate:
        difference = BackwardDifference().start(setting)
        gain = -math.expm1(-2.0 * math.pi * self.cutoff * setting.dt)
        value: Array | float = 0.0

        def filtered(z: Array, true: Array) -> Array:
            nonlocal value
            value = value + gain * (difference(z, true) - value)
            return value.copy()

        return filtered


@estimators.register("robust-differentiator")
class RobustDifferentiator(Piece):
    r"""The first-order robust exact differentiator of each component of z.

    A. Levant, "Robust exact differentiation via sliding mode technique", Automatica 34(3), 1998:
    with :math:`\sigma = \zeta_0 - z`,
    :math:`\dot\zeta_0 = \zeta_1 - 1.5 \sqrt L\,|\sigma|^{1/2} \mathrm{sign}\,\sigma`,
    :math:`\dot\zeta_1 = -1.1 L\,\mathrm{sign}\,\sigma`; exact after a finite time if
    :math:`|\ddot z| \le L`, with an error of the order of :math:`\sqrt{L\varepsilon}` under noise
    below :math:`\varepsilon`. The discrete one is its implicit Euler form, which does not chatter
    (B. Brogliato, A. Polyakov, D. Efimov, "The implicit discretization of the supertwisting
    sliding-mode control algorithm", IEEE Trans. Automatic Control 65(8), 2020): on the sliding surface
    it is the backward difference, and off it, its value changes by 1.1 L dt in a tick.
    """

    lipschitz: Annotated[Each, checked("a bound must be above 0")]
    """L, a bound of |z''| (rad/s^3, m/s^3): a number for all, or one for each component of z."""

    def start(self, setting: Setting) -> Estimate:
        """See :class:`Piece`; 0 at the first tick, where it begins at the measurement."""
        names = list(setting.robot.velocity_names)
        bound, dt = entries(self.lipschitz, names, "lipschitz", "velocities"), setting.dt
        root, step = 1.5 * dt * np.sqrt(bound), 1.1 * dt * bound
        value: Array | None = None
        rate = np.zeros_like(bound)

        def levant(z: Array, true: Array) -> Array:
            nonlocal value, rate
            if value is None:
                value = z.copy()
                return rate.copy()
            # sigma = b - root |sigma|^(1/2) n - dt step n with n in the sign of sigma, solved for
            # sigma and n
            b = value + dt * rate - z
            beyond = np.maximum(np.abs(b) - dt * step, 0.0)
            half = 0.5 * (np.sqrt(root**2 + 4.0 * beyond) - root)
            value = z + np.sign(b) * half**2
            rate = rate - step * np.clip(b / (dt * step), -1.0, 1.0)
            return rate.copy()

        return levant
