"""The stages of the sliding laws alone, fed by hand, tick by tick."""

from __future__ import annotations

import numpy as np

from mobman.controllers.dynamic_stage import DynamicStage
from mobman.controllers.kinematic_stage import KinematicStage
from mobman.controllers.task_errors import TaskErrors
from mobman.kernels.program import program


class KinematicStageAlone:
    """A kinematic stage with J = I, of p errors, at the rest posture."""

    def __init__(self, gains, a, p, dt, discretization, boundary_layer):
        self.errors = TaskErrors(np.eye(p), np.zeros(p))
        self.stage = KinematicStage(gains, a, self.errors, dt, discretization, boundary_layer)
        self._z, at_rest = np.zeros(p), np.zeros(p)
        self._step = program(self.stage.steps(at_rest, at_rest, self._z))
        self._advance = program(self.stage.advance_steps())

    def step(self, e, e_dot, p_ddot, p_dddot, z):
        """v_ref' for a tick."""
        errors = self.errors
        errors.e[:], errors.e_dot[:] = e, e_dot
        errors.p_ddot[:], errors.p_dddot[:] = p_ddot, p_dddot
        self._z[:] = z
        assert self._step() == 0
        return self.stage.v_ref_dot.copy()

    def advance(self):
        """v_ref and its integral a tick later."""
        assert self._advance() == 0


class DynamicStageAlone:
    """A dynamic stage that supposes a constant inertia and actuation."""

    def __init__(self, gains, bound, dt, inertia, actuation, **options):
        nz = len(inertia)
        self.stage = DynamicStage(gains, bound, nz, dt, **options)
        self._given = [np.zeros(nz) for _ in range(5)]
        self._step = program(self.stage.steps(*self._given, inertia.copy(), actuation.copy()))

    def step(self, z, z_dot, v_ref, integral_v_ref, v_ref_dot):
        """The torque for a tick."""
        for array, value in zip(
            self._given, (z, z_dot, integral_v_ref, v_ref, v_ref_dot), strict=True
        ):
            array[:] = value
        assert self._step() == 0
        return self.stage.v.copy()
