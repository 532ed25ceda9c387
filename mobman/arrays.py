"""The types of arrays in mobman: double precision, and indices.

The named shapes are for kernels (:mod:`mobman.kernels`), which are compiled for what their annotations
say; to a type checker they are all alike.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Vector = NDArray[np.float64]
"""Shape (n,)."""
Matrix = NDArray[np.float64]
"""Shape (n, m), by rows in memory."""
Columns = NDArray[np.float64]
"""Shape (n, m), by columns in memory, as Pinocchio's."""
Tensor = NDArray[np.float64]
"""Shape (n, m, l), by rows in memory."""
Index = NDArray[np.int64]
"""Shape (n,), of whole numbers."""
