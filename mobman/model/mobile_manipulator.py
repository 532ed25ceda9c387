"""A mobile manipulator: a Pinocchio model with its platform's constraints built in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import ModelError, UsageError
from mobman.model.platforms.platform import Platform
from mobman.robots.spec import RobotSpec
from mobman.robots.urdf import UrdfFile

_WORLD_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Dynamics(NamedTuple):
    """The reduced dynamics M z' + bias + D = B v of (17) at one (q, z)."""

    M: Array
    """Inertia, shape (nz, nz), symmetric positive definite."""
    bias: Array
    """Pz + G: Coriolis, centrifugal and gravity terms, shape (nz,)."""
    B: Array
    """Actuation, shape (nz, nz)."""


class Velocity(NamedTuple):
    """How the coordinates move at one (q, z), (9): q' = C z, q'' = C z' + C' z."""

    C: Array
    """Shape (nq, nz)."""
    q_dot: Array
    """C z, shape (nq,)."""
    C_dot_z: Array
    """C' z, shape (nq,)."""


class TipKinematics(NamedTuple):
    """Where the tip is and how it moves at one (q, z); linear rows first, world axes."""

    position: Array
    """Origin of the tip frame (m), shape (3,)."""
    jacobian: Array
    """dp/dq and d(angular velocity)/dq', shape (6, nq)."""
    jacobian_rate: Array
    """d/dt of ``jacobian`` along q', shape (6, nq)."""


@dataclass(frozen=True)
class Geometry:
    """What a robot looks like and what it may collide with, in Pinocchio's terms."""

    visual: pin.GeometryModel
    collision: pin.GeometryModel


class MobileManipulator:
    r"""An arm on a non-holonomic platform: everything that the equations need, from any URDF.

    The configuration :math:`q` is a plain vector in Pinocchio's joint order: the platform's
    coordinates x (pose and wheel angles) and the arm's y. Velocities are reduced,
    :math:`z = (\alpha, \dot y)` with :math:`\dot q = C z` (9). SI units: m, rad, kg, N, N m.

    Robots are made by :func:`mobman.load_robot`.

    Attributes:
        name: The robot's name.
        spec: The description it was made from.
        urdf: The URDF file it was made from.
        model: ``pinocchio.Model`` with ``nq == nv``.
        data: Its workspace; used by the methods here, so not to be shared between threads.
        platform: The driving base.
        tip: Name of the end-effector's frame.
        q_rest: Preferred posture, shape (nq,); also the default start.
        criterion_weights: Diagonal of K_F in the posture criterion (12), shape (nq,).
    """

    def __init__(
        self,
        *,
        spec: RobotSpec,
        urdf: UrdfFile,
        model: pin.Model,
        platform: Platform,
        q_rest: Array,
        criterion_weights: Array,
    ) -> None:
        self.name = spec.name
        self.spec = spec
        self.urdf = urdf
        self.model = model
        self.data = model.createData()
        self.platform = platform
        self.tip = spec.arm.tip
        self.q_rest = q_rest
        self.criterion_weights = criterion_weights
        self._tip_frame = model.getFrameId(self.tip)
        if self._tip_frame >= model.nframes:
            raise ModelError(f"robot {self.name!r}: no frame {self.tip!r}")
        index = {name: model.joints[i].idx_q for i, name in enumerate(model.names) if i}
        self.joint_names = sorted(index, key=index.__getitem__)
        self.platform_index = np.array([index[name] for name in platform.coordinates], dtype=int)
        self.arm_index = np.array(
            [i for i in range(model.nq) if i not in set(self.platform_index)], dtype=int
        )
        self.velocity_names = [
            *platform.velocity_names,
            *(self.joint_names[i] for i in self.arm_index),
        ]
        self.nq = int(model.nq)
        self.n = len(self.arm_index)
        self.n_alpha = len(platform.velocity_names)
        self.nz = self.n_alpha + self.n
        self.k = self.nq - self.nz
        # C, C' and A differ from state to state in the platform's block only.
        self._platform_block = np.ix_(self.platform_index, np.arange(self.n_alpha))
        self._hessian_block = np.ix_(self.platform_index, self.platform_index)
        self._arm_part = np.zeros((self.nq, self.nz))
        self._arm_part[self.arm_index, np.arange(self.n_alpha, self.nz)] = 1.0
        self._actuation = self._arm_part.copy()
        self._actuation[self._platform_block] = platform.actuation

    def __repr__(self) -> str:
        return f"MobileManipulator({self.name!r}, nq={self.nq}, nz={self.nz}, tip={self.tip!r})"

    def with_model(self, model: pin.Model) -> MobileManipulator:
        """The same robot on another Pinocchio model of the same joints (other inertias, say)."""
        if list(model.names) != list(self.model.names):
            raise ModelError(f"robot {self.name!r}: the other model has other joints")
        return MobileManipulator(
            spec=self.spec,
            urdf=self.urdf,
            model=model,
            platform=self.platform,
            q_rest=self.q_rest,
            criterion_weights=self.criterion_weights,
        )

    def checked_configuration(self, q: Array) -> Array:
        """A copy of q as floats.

        Raises:
            UsageError: If it is not a configuration of this robot.
        """
        try:
            configuration = np.array(q, dtype=float)
        except (TypeError, ValueError) as error:
            raise UsageError(f"q0 = {q!r}: must be {self.nq} numbers") from error
        if configuration.shape != (self.nq,) or not np.all(np.isfinite(configuration)):
            raise UsageError(
                f"q0 has shape {configuration.shape}; robot {self.name!r} needs {self.nq} finite "
                f"numbers, in the order {', '.join(self.joint_names)}"
            )
        return configuration

    # Kinematics of the constraints -------------------------------------------------------------

    def constraint_matrix(self, q: Array) -> Array:
        """[A(x) 0] of (1) and (16) in q's order, shape (k, nq)."""
        matrix = np.zeros((self.k, self.nq))
        matrix[:, self.platform_index] = self.platform.constraint_matrix(q[self.platform_index])
        return matrix

    def constraint_matrix_rate(self, q: Array, q_dot: Array) -> Array:
        """d/dt of :meth:`constraint_matrix` along q', shape (k, nq)."""
        rate = np.zeros((self.k, self.nq))
        index = self.platform_index
        rate[:, index] = self.platform.constraint_matrix_rate(q[index], q_dot[index])
        return rate

    def constraint_hessian(self, q: Array, multiplier: Array) -> Array:
        """d([A 0]^T lam)/dq at fixed lam of shape (k,), shape (nq, nq)."""
        hessian = np.zeros((self.nq, self.nq))
        hessian[self._hessian_block] = self.platform.constraint_hessian(
            q[self.platform_index], multiplier
        )
        return hessian

    def constraint_hessian_rate(self, q: Array, q_dot: Array, multiplier: Array) -> Array:
        """d/dt of :meth:`constraint_hessian` along q' at fixed lam, shape (nq, nq)."""
        rate = np.zeros((self.nq, self.nq))
        index = self.platform_index
        rate[self._hessian_block] = self.platform.constraint_hessian_rate(
            q[index], q_dot[index], multiplier
        )
        return rate

    def velocity_map(self, q: Array) -> Array:
        """C(q) = blkdiag(N, I) of (9), q' = C z, shape (nq, nz)."""
        c = self._arm_part.copy()
        c[self._platform_block] = self.platform.velocity_map(q[self.platform_index])
        return c

    def velocity_map_rate(self, q: Array, z: Array) -> Array:
        """dC/dt along q' = C z, shape (nq, nz)."""
        rate = np.zeros((self.nq, self.nz))
        x = q[self.platform_index]
        x_dot = self.platform.velocity_map(x) @ z[: self.n_alpha]
        rate[self._platform_block] = self.platform.velocity_map_rate(x, x_dot)
        return rate

    def velocity(self, q: Array, z: Array) -> Velocity:
        """C, C z and C' z at (q, z); what :meth:`dynamics` and :meth:`tip_kinematics` start from."""
        c = self.velocity_map(q)
        q_dot = c @ z
        index = self.platform_index
        rate = self.platform.velocity_map_rate(q[index], q_dot[index])
        c_dot_z = np.zeros(self.nq)
        c_dot_z[index] = rate @ z[: self.n_alpha]
        return Velocity(c, q_dot, c_dot_z)

    # Dynamics ----------------------------------------------------------------------------------

    @property
    def actuation(self) -> Array:
        """B' of (16): which coordinates the motors drive, shape (nq, nz)."""
        return self._actuation

    def dynamics(self, q: Array, z: Array, velocity: Velocity | None = None) -> Dynamics:
        """The reduced dynamics (17) at (q, z): each of Pinocchio's algorithms runs once.

        Args:
            q: Configuration (m, rad), shape (nq,).
            z: Reduced velocity (m/s, rad/s), shape (nz,).
            velocity: ``self.velocity(q, z)``, if it is known already.
        """
        c, q_dot, c_dot_z = self.velocity(q, z) if velocity is None else velocity
        nonlinear = pin.nonLinearEffects(self.model, self.data, q, q_dot)
        inertia = pin.crba(self.model, self.data, q)
        return Dynamics(
            M=c.T @ inertia @ c,
            bias=c.T @ (inertia @ c_dot_z + nonlinear),
            B=c.T @ self._actuation,
        )

    def motor_inertia(self, q: Array) -> Array:
        """What each motor's axis feels, the diagonal of B^-1 M B^-T (kg m^2, kg), shape (nz,)."""
        m, _, b = self.dynamics(q, np.zeros(self.nz))
        return np.diag(np.linalg.solve(b, np.linalg.solve(b, m).T)).copy()

    def energy(self, q: Array, z: Array) -> float:
        """Kinetic plus potential energy (J)."""
        q_dot = self.velocity_map(q) @ z
        kinetic = pin.computeKineticEnergy(self.model, self.data, q, q_dot)
        return float(kinetic + pin.computePotentialEnergy(self.model, self.data, q))

    # Tip ---------------------------------------------------------------------------------------

    def tip_pose(self, q: Array) -> pin.SE3:
        """Placement of the tip frame in the world."""
        pin.forwardKinematics(self.model, self.data, q)
        return pin.updateFramePlacement(self.model, self.data, self._tip_frame).copy()

    def tip_jacobian(self, q: Array) -> Array:
        """Jacobian of the tip in world axes, linear rows first, shape (6, nq)."""
        return np.array(
            pin.computeFrameJacobian(self.model, self.data, q, self._tip_frame, _WORLD_AXES)
        )

    def tip_kinematics(self, q: Array, z: Array, velocity: Velocity | None = None) -> TipKinematics:
        """Tip position, Jacobian and Jacobian rate at (q, z), from one pass over the tree.

        Args:
            q: Configuration (m, rad), shape (nq,).
            z: Reduced velocity, shape (nz,).
            velocity: ``self.velocity(q, z)``, if it is known already.
        """
        model, data, frame = self.model, self.data, self._tip_frame
        q_dot = self.velocity_map(q) @ z if velocity is None else velocity.q_dot
        pin.computeJointJacobiansTimeVariation(model, data, q, q_dot)
        placement = pin.updateFramePlacement(model, data, frame)
        return TipKinematics(
            position=np.array(placement.translation),
            jacobian=pin.getFrameJacobian(model, data, frame, _WORLD_AXES),
            jacobian_rate=pin.getFrameJacobianTimeVariation(model, data, frame, _WORLD_AXES),
        )
