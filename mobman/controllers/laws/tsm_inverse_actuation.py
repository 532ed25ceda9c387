"""``tsm-inverse-actuation``: the paper's law on the inverse of B, (34)-(35) and (65)-(66)."""

from __future__ import annotations

from mobman.controllers.laws.tsm import TerminalSlidingMode
from mobman.controllers.protocol import controllers


class InverseActuationSlidingMode(TerminalSlidingMode):
    """Kinematic stage as in ``tsm`` (34)-(35); dynamic stage v' = B^-1 u (65)-(66), with the gain
    ``A`` in the place of A' of (64)."""

    name = "tsm-inverse-actuation"
    inverse_actuation = True


controllers.register(InverseActuationSlidingMode.name, InverseActuationSlidingMode)
