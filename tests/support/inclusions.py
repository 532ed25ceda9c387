"""The inclusion of the implicit unit vector, solved by other means than the project's."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq


def inclusion(metric, gram, b, boundary_layer=0.0) -> np.ndarray:
    """n with s + M^-1 K n = b, s = sigma n, sigma >= boundary_layer, |n| <= 1, |n| = 1 if it is above.

    By the generalised eigenvalues of (K, M) and a bracketing search over sigma.
    """
    if not np.any(b):
        return np.zeros_like(b)
    root = np.linalg.cholesky(metric)
    half = np.linalg.solve(root, np.linalg.solve(root, gram).T)
    values, vectors = np.linalg.eigh(0.5 * (half + half.T))
    coefficients = vectors.T @ (root.T @ b)

    def n(sigma):
        return np.linalg.solve(root.T, vectors @ (coefficients / (sigma + values)))

    least = max(boundary_layer, 1e-13 * np.linalg.norm(b))
    if values[0] + least > 0.0 and np.linalg.norm(n(least)) <= 1.0:
        return n(boundary_layer if values[0] + boundary_layer > 0.0 else least)
    high = 1.0
    while np.linalg.norm(n(high)) > 1.0:
        high *= 2.0
    return n(brentq(lambda s: np.linalg.norm(n(s)) - 1.0, least, high, xtol=1e-15, rtol=1e-14))
