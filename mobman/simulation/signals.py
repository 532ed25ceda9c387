"""What a controller reports of itself while it runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from mobman.arrays import Array, Index
from mobman.controllers.protocol import Controller
from mobman.errors import UsageError
from mobman.kernels.program import Call, call
from mobman.simulation.record import OWN_PLACES
from mobman.simulation.samples import Samples, keep_from

APPLIED = "torque_applied"
"""The signal of the torque that acts, where the scenario's actuation makes it another one."""


class Signals:
    """Keeps a controller's signals, one row a tick, NaN where it does not give one.

    Args:
        controller: The controller; its method ``signals`` gives the values by name, if it has one.
        samples: Where they are kept.

    Attributes:
        asked: Whether :meth:`keep` has anything to do; not, once :meth:`steps` keep everything.
    """

    def __init__(self, controller: Controller, samples: Samples) -> None:
        self._controller, self._samples = controller, samples
        self._report: Callable[[], dict[str, Any]] = getattr(controller, "signals", dict)
        self.asked = self._report is not dict

    def steps(self, tick: Index) -> list[Call]:
        """The steps that keep the tick's row of signals that are overwritten in place.

        Args:
            tick: The tick, shape (1,); read when the steps run.

        Raises:
            UsageError: If a signal has the name of a part of the record.
        """
        if not getattr(self._controller, "signals_in_place", False):
            return []
        self.asked = False
        found = []
        for name, value in self._report().items():
            rows = self._rows_of(name, value.shape)
            flat = (value.reshape(-1), 0, rows.reshape(len(rows), -1))
            found.append(call(keep_from, tick, *flat))
        return found

    def keep(self, tick: int) -> None:
        """Keep the tick's row of every signal.

        Raises:
            UsageError: If a signal has the name of a part of the record.
        """
        for name, value in self._report().items():
            self._rows_of(name, np.shape(value))[tick] = value

    def _rows_of(self, name: str, shape: tuple[int, ...]) -> Array:
        kept = self._samples.signals
        if name not in kept:
            if name.split("/")[0] in {*OWN_PLACES, APPLIED}:
                raise UsageError(f"the signal {name!r} has the name of a record's own part")
            kept[name] = np.full((len(self._samples.q), *shape), np.nan)
        return kept[name]
