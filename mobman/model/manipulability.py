r"""Yoshikawa's measure of manipulability, :math:`\sqrt{\det(J J^T)}`, as a term of the criterion."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.criterion import Criterion, Term, criteria
from mobman.model.mobile_manipulator import MobileManipulator

_STEP = 1e-30  # of the complex step: its square is below the rounding of anything
_RANK = 1e-12  # det(J J^T) over that of a matrix of equal singular values


class Manipulability(Term):
    r"""Distance from singularities of the arm, :math:`F = -w\ln\sqrt{\det(J_a J_a^T)}`.

    :math:`J_a` has the columns of the tip's position (m) by the arm's motors, shape (3, n), the platform
    standing still (Yoshikawa, Int. J. Robotics Research 4(2), 1985). w has the unit of F. F is infinite
    where the arm alone is singular, and repels from there.
    """

    def on(self, robot: MobileManipulator) -> Criterion:
        """The term for a robot.

        Raises:
            UsageError: If its arm alone cannot move the tip in all directions at rest.
        """
        term = _Arm(robot, self.weight)
        A = term.inertia_like(robot.q_rest)
        if not np.linalg.det(A) > _RANK * (np.trace(A) / 3.0) ** 3:
            raise UsageError(
                f"criterion 'manipulability': the arm of {robot.name!r} alone does not move its tip in "
                "all directions at rest, so that the measure is 0"
            )
        return term


class _Arm:
    """See :class:`Manipulability`; kinematics of the arm alone, from real or complex q."""

    def __init__(self, robot: MobileManipulator, weight: float) -> None:
        model, frame = robot.model, robot.model.frames[robot.model.getFrameId(robot.tip)]
        data, own = model.createData(), set(robot.arm.joints.tolist())
        chain = [i for i in model.supports[frame.parentJoint] if i and model.idx_qs[i] in own]
        self._weight, self._nq = weight, robot.nq
        self._index = np.array([model.idx_qs[i] for i in chain])
        self._placements = [model.jointPlacements[i].homogeneous for i in chain]
        motions = [np.asarray(data.joints[i].S).reshape(6) for i in chain]
        self._slides = np.array([motion[:3] for motion in motions])
        self._turns = np.array([motion[3:] for motion in motions])
        self._tip = frame.placement.homogeneous
        moved = robot.velocity_map(robot.q_rest)[self._index]  # followers at their ratios
        arm = moved[:, robot.nz - robot.n :]
        self._share = arm @ arm.T

    def _axes(self, q: Array) -> tuple[Array, Array]:
        """Axes of rotation (0 of slides) and J, shapes (joints, 3), in the arm's first frame."""
        pose = np.eye(4, dtype=q.dtype)
        axes, slides, centres = [], [], []
        for i, place in enumerate(self._placements):
            pose = pose @ place
            x, u = q[self._index[i]], self._turns[i]
            axes.append(pose[:3, :3] @ u)
            slides.append(pose[:3, :3] @ self._slides[i])
            centres.append(pose[:3, 3])
            cross = pin.skew(u)
            moved = np.eye(4, dtype=q.dtype)
            moved[:3, :3] += np.sin(x) * cross + (1.0 - np.cos(x)) * (cross @ cross)
            moved[:3, 3] = x * self._slides[i]
            pose = pose @ moved
        tip = (pose @ self._tip)[:3, 3]
        a = np.array(axes)
        return a, np.array(slides) + np.cross(a, tip - np.array(centres))

    def inertia_like(self, q: Array) -> Array:
        """J_a J_a^T (m^2), shape (3, 3)."""
        _, J = self._axes(q)
        A: Array = J.T @ self._share @ J
        return A

    def value(self, q: Array) -> float:
        """F(q)."""
        return float(-0.5 * self._weight * np.linalg.slogdet(self.inertia_like(q))[1])

    def gradient(self, q: Array) -> Array:
        """dF/dq, shape (nq,)."""
        gradient = np.zeros(self._nq)
        gradient[self._index] = self._derivatives(q)[0]
        return gradient

    def hessian(self, q: Array) -> Array:
        """d2F/dq2, shape (nq, nq)."""
        return self._whole(self._derivatives(q)[1])

    def hessian_rate(self, q: Array, q_dot: Array) -> Array:
        """dH/dt along q', shape (nq, nq): the complex step, which has no error of differences."""
        return self._whole(self._derivatives(q + 1j * _STEP * q_dot)[1].imag / _STEP)

    def _whole(self, own: Array) -> Array:
        whole = np.zeros((self._nq, self._nq))
        whole[np.ix_(self._index, self._index)] = own
        return whole

    def _derivatives(self, q: Array) -> tuple[Array, Array]:
        """dF/dq and d2F/dq2 of the chain's joints.

        With K_ki = dJ_k/dq_i = a_min x J_max, the smaller and the larger of k and i, and dA_i = K_i^T R
        J + J^T R K_i for A = J^T R J: F_i = -w/2 tr(A^-1 dA_i).
        """
        a, J = self._axes(q)
        n = len(a)
        k, i = np.indices((n, n))
        first, last = np.minimum(k, i), np.maximum(k, i)
        K = np.cross(a[first], J[last])  # (k, i, 3)
        # d a_m/dq_j = a_j x a_m for j before m
        turned = np.where((k > i)[..., None], np.cross(a[i], a[k]), 0.0)  # (m, j, 3)
        second = np.cross(turned[first], J[last][:, :, None]) + np.cross(
            a[first][:, :, None], K[last]
        )  # d K_ki/dq_j, (k, i, j, 3)
        inverse = np.linalg.inv(J.T @ self._share @ J)
        P = self._share @ J @ inverse  # (k, 3)
        gradient = -self._weight * np.einsum("kc,kic->i", P, K)
        dA = np.einsum("kic,kl,ld->icd", K, self._share, J)
        dA = dA + dA.transpose(0, 2, 1)
        dP = np.einsum("kl,ljc,cd->jkd", self._share, K, inverse) - np.einsum(
            "kc,jcd,de->jke", P, dA, inverse
        )
        hessian = -self._weight * (
            np.einsum("jkc,kic->ij", dP, K) + np.einsum("kc,kijc->ij", P, second)
        )
        return gradient, hessian


criteria.register("manipulability", Manipulability)
