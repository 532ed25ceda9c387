"""The auxiliary map f_a of (11) by other means than the project's: SVD and Procrustes."""

from __future__ import annotations

import numpy as np


def stacked_jacobian(robot, rows, q) -> np.ndarray:
    """j = [df_e/dq; A 0] under (11)."""
    return np.vstack((robot.tip_jacobian(q)[list(rows)], robot.constraint_matrix(q)))


def kernel(j: np.ndarray) -> np.ndarray:
    """Orthonormal rows of ker j, from the SVD; their orientation is arbitrary."""
    return np.linalg.svd(j)[2][len(j) :]


def aligned_kernel(j: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """The orthonormal basis of ker j that is nearest to ``reference`` (orthogonal Procrustes).

    As a function of j it is smooth, and its rate at ``reference`` has no component within the kernel
    itself: that is the parallel transport which J_a and its rate are defined by.
    """
    basis = kernel(j)
    left, _, right = np.linalg.svd(reference @ basis.T)
    return (left @ right) @ basis
