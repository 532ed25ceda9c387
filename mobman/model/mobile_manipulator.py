"""A mobile manipulator: a Pinocchio model with its platform's constraints built in."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy as shallow_copy
from threading import local
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import SIZES, Array, beyond_sizes
from mobman.display import Displayed, Shown
from mobman.errors import ModelError, UsageError
from mobman.model.dynamics import Buffers
from mobman.model.platforms.platform import ArmJoints, Platform
from mobman.robots.spec import RobotSpec
from mobman.robots.urdf.read import UrdfSources

_WORLD_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_APART = 1e-6  # m, rad: by which a coordinate may differ from what others make it
_NO_BOUND = 1e8  # joints without limits have some 1e9 in the model


class Dynamics(NamedTuple):
    """The reduced dynamics M z' + bias + D = B v of (17) at one (q, z)."""

    M: Array  # inertia, shape (nz, nz), symmetric positive definite
    bias: Array  # Pz + G: Coriolis, centrifugal and gravity terms, shape (nz,)
    B: Array  # actuation, shape (nz, nz)


class Velocity(NamedTuple):
    """Motion of the coordinates at one (q, z), (9): q' = C z, q'' = C z' + C' z."""

    C: Array  # shape (nq, nz)
    q_dot: Array  # C z, shape (nq,)
    C_dot_z: Array  # C' z, shape (nq,)


class TipKinematics(NamedTuple):
    """Position and motion of the tip at one (q, z); linear rows first, world axes."""

    position: Array  # origin of the tip frame (m), shape (3,)
    jacobian: Array  # dp/dq and d(angular velocity)/dq', shape (6, nq)
    jacobian_rate: Array  # d/dt of jacobian along q', shape (6, nq)
    rotation: Array  # orientation of the tip frame, shape (3, 3)
    omega: Array  # angular velocity (rad/s), shape (3,)


class Follower(NamedTuple):
    """A joint without a motor that follows another one of the arm: ``<mimic>`` in a URDF."""

    joint: str  # its name
    of: str  # the joint that it follows, which has a motor
    ratio: float  # its rate over that joint's
    offset: float  # its position where that joint is at 0 (m, rad)


class Limits(NamedTuple):
    """Bounds; inf where a URDF states none (0 or a very large number, by convention)."""

    lower: Array  # least q (m, rad), shape (nq,)
    upper: Array  # largest q (m, rad), shape (nq,)
    velocity: Array  # largest entry of |z|, each alone (m/s, rad/s), shape (nz,)
    torque: Array  # largest entry of |v|, each alone (N, N m), shape (nz,)
    joint_velocity: Array  # largest |q'| (m/s, rad/s), shape (nq,); inf for the platform's pose


class Geometry(NamedTuple):
    """Visual and collision geometry of a robot, as Pinocchio's models."""

    visual: pin.GeometryModel
    collision: pin.GeometryModel


class MobileManipulator(Displayed):
    r"""An arm on a non-holonomic platform: everything that the equations need, from any URDF.

    The configuration :math:`q` is a plain vector in Pinocchio's joint order: the platform's
    coordinates x (pose and wheel angles) and the arm's y. Velocities are reduced,
    :math:`z = (\alpha, \dot y)` with :math:`\dot q = C z` (9). SI units: m, rad, kg, N, N m.

    A joint that follows another one is in q with a row of its own in A and in C, :math:`\dot q_f = r
    \dot q_m`; it has no entry in z, and its inertia is felt by the motor that it follows.

    Robots are made by :func:`mobman.load_robot`. Threads may share one: what its methods compute in
    is each thread's own. Vectors are arrays or lists; methods raise UsageError if one has another shape
    than is said, or not only finite numbers.

    >>> import mobman as mm
    >>> robot = mm.load_robot("youbot")
    >>> robot.velocity_map(robot.q_rest).shape  # C of (9)
    (8, 5)
    >>> slip = robot.constraint_matrix(robot.q_rest) @ robot.velocity_map(robot.q_rest)  # A N = 0
    >>> bool(abs(slip).max() < 1e-12)
    True

    Attributes:
        name: The robot's name.
        spec: The description it was made from.
        urdf: The URDF files it was made from.
        model: ``pinocchio.Model`` with ``nq == nv``.
        data: ``pinocchio.Data`` that the methods here use; another one in each thread.
        platform: The driving base.
        motors: The platform by whose B'' commands become torques of motors: ``platform``, or that which
            the controller supposes.
        tip: Name of the end-effector's frame.
        tip_frame: Its index in ``model.frames``.
        slides: Which coordinates are lengths and no angles, shape (nq,).
        q_rest: Preferred posture, shape (nq,); also the default start.
        criterion_weights: Diagonal of K_F in the posture criterion (12), shape (nq,).
        criterion_couplings: The rest of K_F, shape (nq, nq).
        followers: Joints that follow others.
    """

    def __init__(
        self,
        *,
        spec: RobotSpec,
        urdf: UrdfSources,
        model: pin.Model,
        platform: Platform,
        q_rest: Array,
        criterion_weights: Array,
        criterion_couplings: Array,
        followers: Sequence[Follower] = (),
    ) -> None:
        self.name, self.spec, self.urdf = spec.name, spec, urdf
        self.platform = self.motors = platform
        self.tip, self.q_rest = spec.arm.tip, q_rest
        self.criterion_weights = criterion_weights
        self.criterion_couplings = criterion_couplings
        self.followers = tuple(followers)
        self._take(model)
        index = {name: model.joints[i].idx_q for i, name in enumerate(model.names) if i}
        self.joint_names = sorted(index, key=index.__getitem__)
        x = [index[name] for name in platform.coordinates]
        self.platform_index = np.array(x, dtype=np.int64)
        driven = {index[one.joint]: (index[one.of], one.ratio) for one in self.followers}
        every = [i for i in range(model.nq) if i not in x]
        own = [i for i in every if i not in driven]
        self.arm_index = np.array(own, dtype=np.int64)
        of = [driven.get(i, (i, 1.0)) for i in every]
        self.arm = ArmJoints(
            np.array(every, dtype=np.int64),
            np.array([own.index(motor) for motor, _ in of], dtype=np.int64),
            np.array([ratio for _, ratio in of]),
        )
        self.following_rows = np.zeros((len(driven), model.nq))
        for row, (i, (motor, ratio)) in zip(self.following_rows, driven.items(), strict=True):
            row[i], row[motor] = 1.0, -ratio
        self.velocity_names = [*platform.velocity_names, *(self.joint_names[i] for i in own)]
        self.nq, self.n, self.n_alpha = int(model.nq), len(own), len(platform.velocity_names)
        self.nz = self.n_alpha + self.n
        self.k = self.nq - self.nz
        self._of_thread = local()

    def _take(self, model: pin.Model) -> None:
        """Take a model, and from it where the tip is."""
        self.model = model
        # a joint may have the same name
        self.tip_frame = int(model.getFrameId(self.tip, pin.FrameType.BODY))
        if self.tip_frame >= model.nframes:
            raise ModelError(f"robot {self.name!r}: no frame {self.tip!r}")
        tip = model.frames[self.tip_frame]
        self.tip_offset = np.array(tip.placement.translation)
        self.tip_rotation = np.array(tip.placement.rotation, order="C")
        self.slides = np.zeros(model.nq, dtype=bool)
        for joint in model.joints[1:]:
            self.slides[joint.idx_q] = joint.shortname().startswith("JointModelP")
        self.tip_chain = np.zeros(model.nq)
        self.tip_chain[[model.joints[i].idx_v for i in model.supports[tip.parentJoint] if i]] = 1.0

    def _shown(self) -> Shown:
        sizes = f"nq={self.nq}, nz={self.nz}, tip={self.tip!r}"
        facts: dict[str, object] = {
            "description": self.spec.description,
            "platform": self.spec.platform.type,
            "mass (kg)": float(sum(link.mass for link in self.model.inertias)),
            "q": ", ".join(self.joint_names),
            "z": ", ".join(self.velocity_names),
            "source": self.spec.source,
            "licence": self.spec.license,
        }
        return Shown(f"MobileManipulator({self.name!r}, {sizes})", facts)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_of_thread"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _of_thread=local())

    def with_model(self, model: pin.Model, platform: Platform | None = None) -> MobileManipulator:
        """The same robot on another Pinocchio model of the same joints (other inertias, say).

        Args:
            model: The model.
            platform: Another platform of the same coordinates (other wheels, say), whose motors get the
                torques that they would get on this one.

        Raises:
            UsageError: If it is no model.
            ModelError: If its joints are others.
        """
        if not isinstance(model, pin.Model):
            raise UsageError(f"model = {model!r}: expected a pinocchio.Model")
        if list(model.names) != list(self.model.names):
            raise ModelError(f"robot {self.name!r}: the other model has other joints")
        other = shallow_copy(self)
        other._take(model)
        for name in ("q_rest", "criterion_weights", "criterion_couplings"):
            setattr(other, name, getattr(self, name).copy())
        if platform is not None:
            other.platform = platform
        return other

    def copy(self) -> MobileManipulator:
        """A copy whose model, rest posture and weights are its own; the platform is shared."""
        return self.with_model(self.model.copy())

    def checked_configuration(self, q: Array) -> Array:
        """A copy of q as floats.

        Raises:
            UsageError: If it is not a configuration of this robot.
        """
        try:
            configuration = _vector("q0", q, self.nq).copy()
            if beyond_sizes(configuration):
                raise UsageError(f"q0 = {configuration.tolist()}: every entry must be {SIZES}")
        except UsageError as error:
            raise UsageError(
                f"{error}; robot {self.name!r}: the order is {', '.join(self.joint_names)}"
            ) from error
        needed = self.consistent(configuration)
        for i in np.flatnonzero(np.abs(needed - configuration) > _APART):
            raise UsageError(
                f"q0: {self.joint_names[i]} is {configuration[i]:g}; allowed with the other coordinates "
                f"of robot {self.name!r}: {needed[i]:.9g} (robot.consistent(q) gives them)"
            )
        return configuration

    def consistent(self, q: Array) -> Array:
        """A copy of q with the coordinates that others determine set accordingly: joints that follow
        others, the steering angles of a swerve platform. On other robots all are free.

        Raises:
            UsageError: If the others determine none.
        """
        result = _vector("q", q, self.nq).copy()
        result[self.platform_index] = self.platform.consistent(result[self.platform_index])
        for one, row in zip(self.followers, self.following_rows, strict=True):
            i = self.joint_names.index(one.joint)
            result[i] += one.offset - row @ result
        return result

    @property
    def limits(self) -> Limits:
        """Bounds of q, z and the torques that the URDF states; simulation does not enforce them.

        A joint of the platform that turns at N_ij for one of alpha_j bounds it by its own largest rate
        over |N_ij|, and likewise B'' the torques.
        """
        # the coordinates that joints of the URDF move: all but the pose, on which no wheel depends
        base, model = self.platform.base_joints, self.model
        joints = [i for i, name in enumerate(self.joint_names) if name not in base]
        lower, upper = model.lowerPositionLimit, model.upperPositionLimit
        C, B = self.velocity_map(self.q_rest), self.actuation(self.q_rest)  # where the steering is
        joint_velocity = np.full(self.nq, np.inf)
        joint_velocity[joints] = _stated(model.velocityLimit[joints])
        return Limits(
            lower=np.where(lower < -_NO_BOUND, -np.inf, lower),
            upper=np.where(upper > _NO_BOUND, np.inf, upper),
            velocity=_least(model.velocityLimit[joints], np.abs(C)[joints]),
            torque=_least(model.effortLimit[joints], np.abs(B)[joints]),
            joint_velocity=joint_velocity,
        )

    @property
    def data(self) -> pin.Data:
        """See the class."""
        return self._own.data

    # Kinematics of the constraints -------------------------------------------------------------

    def constraint_matrix(self, q: Array) -> Array:
        """[A(x) 0] of (1) and (16) in q's order, and below it a row for each joint that follows another,
        shape (k, nq)."""
        return self._rows(self.platform.constraint_matrix(self._x(q)), self.following_rows)

    def constraint_matrix_rate(self, q: Array, q_dot: Array) -> Array:
        """d/dt of :meth:`constraint_matrix` along q', shape (k, nq)."""
        rate = self.platform.constraint_matrix_rate(self._x(q), self._x(q_dot, "q_dot"))
        return self._rows(rate, np.zeros_like(self.following_rows))

    def constraint_hessian(self, q: Array, multiplier: Array) -> Array:
        """d([A 0]^T lam)/dq at fixed lam of shape (k,), shape (nq, nq)."""
        lam = _vector("multiplier", multiplier, self.k)[: self.k - len(self.followers)]
        return self._square(self.platform.constraint_hessian(self._x(q), lam))

    def constraint_hessian_rate(self, q: Array, q_dot: Array, multiplier: Array) -> Array:
        """d/dt of :meth:`constraint_hessian` along q' at fixed lam, shape (nq, nq)."""
        lam = _vector("multiplier", multiplier, self.k)[: self.k - len(self.followers)]
        given = self._x(q), self._x(q_dot, "q_dot"), lam
        return self._square(self.platform.constraint_hessian_rate(*given))

    def velocity_map(self, q: Array) -> Array:
        """C(q) = blkdiag(N, I) of (9), q' = C z, shape (nq, nz)."""
        matrix = self._by_velocity(self.platform.velocity_map(self._x(q)))
        matrix[self.arm.joints, self.n_alpha + self.arm.column] = self.arm.ratio
        return matrix

    def velocity_map_rate(self, q: Array, z: Array) -> Array:
        """dC/dt along q' = C z, shape (nq, nz)."""
        x = self._x(q)
        x_dot = self.platform.velocity_map(x) @ _vector("z", z, self.nz)[: self.n_alpha]
        return self._by_velocity(self.platform.velocity_map_rate(x, x_dot))

    def _x(self, q: Array, name: str = "q") -> Array:
        """The platform's part of q, or of another vector of that size."""
        part: Array = _vector(name, q, self.nq)[self.platform_index]
        return part

    def _rows(self, block: Array, below: Array) -> Array:
        """Rows over x as rows over q, and others below them."""
        matrix = np.zeros((len(block), self.nq))
        matrix[:, self.platform_index] = block
        return np.concatenate([matrix, below])

    def _square(self, block: Array) -> Array:
        """A matrix from x to x as one from q to q."""
        matrix = np.zeros((self.nq, self.nq))
        matrix[np.ix_(self.platform_index, self.platform_index)] = block
        return matrix

    def _by_velocity(self, block: Array) -> Array:
        """A matrix from alpha to x as one from z to q."""
        matrix = np.zeros((self.nq, self.nz))
        matrix[self.platform_index, : self.n_alpha] = block
        return matrix

    def velocity(self, q: Array, z: Array) -> Velocity:
        """C, C z and C' z at (q, z)."""
        now = self._at(q, z)
        return Velocity(now.C.copy(), now.q_dot.copy(), now.C_dot_z.copy())

    # Dynamics ----------------------------------------------------------------------------------

    def actuation(self, q: Array) -> Array:
        """B'(q) of (16): the generalised forces that each command makes, shape (nq, nz)."""
        matrix = self._by_velocity(self.motors.actuation(self._x(q)))
        matrix[self.arm_index, np.arange(self.n_alpha, self.nz)] = 1.0
        return matrix

    def reduced_inertia(self, q: Array) -> Array:
        """M = C^T M' C of (17) by itself, shape (nz, nz); :meth:`dynamics` is for many calls."""
        q = _vector("q", q, self.nq)
        upper = np.triu(pin.crba(self.model, self.data, q))
        c = self.velocity_map(q)
        reduced: Array = c.T @ (upper + np.triu(upper, 1).T) @ c
        return reduced

    def dynamics(self, q: Array, z: Array) -> Dynamics:
        """The reduced dynamics (17) at (q, z): each of Pinocchio's algorithms runs once.

        q in m and rad, shape (nq,); z in m/s and rad/s, shape (nz,).
        """
        now = self._at(q, z)
        now.run_dynamics()
        now.inertia()
        now.bias_terms()
        return Dynamics(M=now.M.copy(), bias=now.bias.copy(), B=now.B.copy())

    def motor_inertia(self, q: Array) -> Array:
        """Effective inertia at each actuator, diag(B^-1 M B^-T) (kg m^2, kg), shape (nz,)."""
        m, _, b = self.dynamics(q, np.zeros(self.nz))
        return np.diag(np.linalg.solve(b, np.linalg.solve(b, m).T)).copy()

    def holding_torque(self, q: Array) -> Array:
        """Torque of each motor that holds the robot still, B^-1 G of (17) (N m, N), shape (nz,)."""
        _, bias, b = self.dynamics(q, np.zeros(self.nz))
        return np.asarray(np.linalg.solve(b, bias), dtype=float)

    def energy(self, q: Array, z: Array) -> float:
        """Kinetic plus potential energy (J)."""
        q = _vector("q", q, self.nq)
        q_dot = self.velocity_map(q) @ _vector("z", z, self.nz)
        kinetic = pin.computeKineticEnergy(self.model, self.data, q, q_dot)
        return float(kinetic + pin.computePotentialEnergy(self.model, self.data, q))

    # Tip ---------------------------------------------------------------------------------------

    def tip_pose(self, q: Array) -> pin.SE3:
        """Placement of the tip frame in the world."""
        q = _vector("q", q, self.nq)
        pin.forwardKinematics(self.model, self.data, q)
        return pin.updateFramePlacement(self.model, self.data, self.tip_frame).copy()

    def arm_origin(self, q: Array) -> Array:
        """Position of the first joint that moves the tip and is not the platform's (m), shape (3,)."""
        pin.forwardKinematics(self.model, self.data, _vector("q", q, self.nq))
        chain = self.model.supports[self.model.frames[self.tip_frame].parentJoint]
        first = next(i for i in chain if self.model.joints[i].idx_q in self.arm.joints)
        return np.array(self.data.oMi[first].translation)

    def tip_jacobian(self, q: Array) -> Array:
        """Jacobian of the tip in world axes, linear rows first, shape (6, nq)."""
        given = (self.model, self.data, _vector("q", q, self.nq), self.tip_frame, _WORLD_AXES)
        return np.array(pin.computeFrameJacobian(*given))

    def tip_kinematics(self, q: Array, z: Array) -> TipKinematics:
        """Tip position, rotation, Jacobian and Jacobian rate at (q, z), from one pass over the tree.

        q in m and rad, shape (nq,); z of shape (nz,).
        """
        now = self._at(q, z)
        now.run_jacobians()
        now.tip_kinematics()
        now.tip_orientation()
        parts = (now.tip, now.tip_jacobian, now.tip_jacobian_rate, now.tip_rotation)
        position, jacobian, rate, rotation = (part.copy() for part in parts)
        return TipKinematics(position, jacobian, rate, rotation, omega=jacobian[3:] @ now.q_dot)

    # What the methods above work with ----------------------------------------------------------

    @property
    def _own(self) -> Buffers:
        """This thread's own buffers."""
        own: Buffers | None = getattr(self._of_thread, "own", None)
        if own is None:  # made when needed: most copies of a robot are never evaluated here
            own = self._of_thread.own = Buffers(self)
        return own

    def _at(self, q: Array, z: Array) -> Buffers:
        """This thread's own buffers at (q, z), their velocity terms computed."""
        own = self._own
        own.q[:] = _vector("q", q, self.nq)
        own.z[:] = _vector("z", z, self.nz)
        own.velocity()
        return own


def _stated(bounds: Array) -> Array:
    """Bounds, with inf for those that are none by convention."""
    return np.where((bounds <= 0.0) | (bounds > _NO_BOUND), np.inf, bounds)


def _least(bounds: Array, per_entry: Array) -> Array:
    """The least bound over the factor, for each column of factors; bounds that are none are left out."""
    bounds = _stated(bounds)
    with np.errstate(divide="ignore"):
        ratios = np.where(per_entry > 0.0, bounds[:, None] / per_entry, np.inf)
    least: Array = ratios.min(axis=0, initial=np.inf)
    return least


def _vector(name: str, value: Any, length: int) -> Array:
    """A vector that was given, as an array of floats; UsageError if it has another shape, or not only
    finite numbers."""
    try:
        vector = np.asarray(value).astype(float, casting="same_kind", copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise UsageError(f"{name} = {value!r}; needed: {length} numbers") from error
    if vector.shape != (length,):
        raise UsageError(f"{name} has shape {vector.shape}; needed: ({length},)")
    if not np.isfinite(vector).all():
        raise UsageError(f"{name} = {vector.tolist()}; needed: {length} finite numbers")
    return vector
