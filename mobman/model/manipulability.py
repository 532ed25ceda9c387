r"""Yoshikawa's measure of manipulability, :math:`\sqrt{\det(J J^T)}`, as a term of the criterion."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.criterion import ByComplexStep, Criterion, Term, criteria
from mobman.model.joint_tree import JointTree, TreePose
from mobman.model.mobile_manipulator import MobileManipulator

_RANK = 1e-12  # det(J J^T) over that of a matrix of equal singular values


@criteria.register("manipulability")
class Manipulability(Term):
    r"""Distance from singularities of the arm, :math:`F = -w\ln\sqrt{\det(J_a J_a^T)}`.

    :math:`J_a` has the columns of the tip's position (m) by the arm's motors, shape (3, n), the platform
    standing still (Yoshikawa, Int. J. Robotics Research 4(2), 1985). w has the unit of F. F is infinite
    where the arm alone is singular, and repels from there.
    """

    def on(self, robot: MobileManipulator) -> Criterion:
        """The term for a robot; UsageError if its arm alone cannot move the tip in all directions at
        rest."""
        term = _Arm(robot, self.weight)
        A = term.inertia_like(robot.q_rest)
        if not np.linalg.det(A) > _RANK * (np.trace(A) / 3.0) ** 3:
            raise UsageError(
                f"criterion 'manipulability': the arm of {robot.name!r} alone does not move its tip in "
                "all directions at rest, so that the measure is 0"
            )
        return term


class _Arm(ByComplexStep):
    """See :class:`Manipulability`; kinematics of the arm alone, from real or complex q."""

    def __init__(self, robot: MobileManipulator, weight: float) -> None:
        model, frame = robot.model, robot.model.frames[robot.model.getFrameId(robot.tip)]
        own = set(robot.arm.joints.tolist())
        supports = model.supports[frame.parentJoint]
        self._chain = JointTree(model, [i for i in supports if i and model.idx_qs[i] in own])
        self._weight = weight
        self._index = self._chain.index
        self._tip = frame.placement.homogeneous
        moved = robot.velocity_map(robot.q_rest)[self._index]  # followers at their ratios
        arm = moved[:, robot.nz - robot.n :]
        self._share = arm @ arm.T

    def _pose(self, q: Array) -> tuple[TreePose, Array]:
        """The chain, and J of the tip, shape (joints, 3), in the arm's first frame."""
        pose = self._chain.at(q)
        return pose, pose.jacobian((pose.frames[-1] @ self._tip)[None, :3, 3])[0]

    def inertia_like(self, q: Array) -> Array:
        """J_a J_a^T (m^2), shape (3, 3)."""
        _, J = self._pose(q)
        A: Array = J.T @ self._share @ J
        return A

    def value(self, q: Array) -> float:
        """F(q)."""
        return float(-0.5 * self._weight * np.linalg.slogdet(self.inertia_like(q))[1])

    def derivatives(self, q: Array, along: Array) -> tuple[Array, Array]:
        """dF/dq and d2F/dq2.

        With K_ki = dJ_k/dq_i = a_min x J_max, the smaller and the larger of k and i, and dA_i = K_i^T R
        J + J^T R K_i for A = J^T R J: F_i = -w/2 tr(A^-1 dA_i).
        """
        pose, J = self._pose(along)
        a, (first, last) = pose.axes, pose.pairs()
        K = np.cross(a[first], J[last])  # d J_k/dq_i, (k, i, 3)
        k, i = np.indices(K.shape[:2])
        # d a_m/dq_j = a_j x a_m for j before m
        turned = np.where((k > i)[..., None], np.cross(a[i], a[k]), 0.0)  # (m, j, 3)
        second = np.cross(turned[first], J[last][:, :, None]) + np.cross(
            a[first][:, :, None], K[last]
        )  # d K_ki/dq_j, (k, i, j, 3)
        inverse = np.linalg.inv(J.T @ self._share @ J)
        P = self._share @ J @ inverse  # (k, 3)
        gradient = np.zeros(len(q), dtype=along.dtype)
        gradient[self._index] = -self._weight * np.einsum("kc,kic->i", P, K)
        dA = np.einsum("kic,kl,ld->icd", K, self._share, J)
        dA = dA + dA.transpose(0, 2, 1)
        dP = np.einsum("kl,ljc,cd->jkd", self._share, K, inverse) - np.einsum(
            "kc,jcd,de->jke", P, dA, inverse
        )
        hessian = np.zeros((len(q), len(q)), dtype=along.dtype)
        hessian[np.ix_(self._index, self._index)] = -self._weight * (
            np.einsum("jkc,kic->ij", dP, K) + np.einsum("kc,kijc->ij", P, second)
        )
        return gradient, hessian
