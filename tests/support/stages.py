"""The stages of the sliding laws alone, fed by hand, tick by tick."""

from __future__ import annotations

import numpy as np

from mobman.controllers.task_errors import Tracking
from mobman.controllers.tsm import (
    Held,
    SlidingGains,
    SlidingStage,
    dynamic_stage,
    in_force,
    integrate,
    kinematic_stage,
)


class StageAlone:
    """Both stages of p components, of which one is used; gains as those of SlidingGains."""

    def __init__(self, p, dt, *, inverse=False, **gains):
        gains = SlidingGains(**gains)
        self.kinematic = SlidingStage.of(gains, p, "lambda_0", "lambda_1", "lambda_2")
        self.dynamic = SlidingStage.of(gains, p, "Lambda_0", "Lambda_1")
        self.held = Held(*np.zeros((5, p)))
        self.k = in_force(gains, dt, gains.a, gains.A, inverse)


class KinematicStageAlone(StageAlone):
    """A kinematic stage with J = I, of p errors, at the rest posture."""

    def step(self, e, e_dot, p_ddot, p_dddot, z):
        """v_ref' for a tick, of which z is the measured velocity."""
        p = len(e)
        # f = e and J z = e' + p_d', whatever p_d and p_d' are
        p_d = np.array([np.zeros(p), z - e_dot, p_ddot, p_dddot])
        at_rest = np.zeros(p)
        at = Tracking(e.copy(), np.eye(p), at_rest, p_d, at_rest, z)
        stop = kinematic_stage(self.k, self.kinematic, self.held, at, at_rest)
        assert stop == 0
        return self.held.v_ref_dot.copy()

    def advance(self):
        """v_ref and all integrals a tick later."""
        integrate(self.k, self.kinematic, self.dynamic, self.held)


class DynamicStageAlone(StageAlone):
    """A dynamic stage that supposes a constant inertia and actuation."""

    def __init__(self, dt, inertia, actuation, **options):
        super().__init__(len(inertia), dt, **options)
        self._inertia, self._actuation = inertia, actuation

    def step(self, z, z_dot, v_ref, integral_v_ref, v_ref_dot):
        """The torque for a tick."""
        held = self.held
        held.v_ref[:], held.integral_v_ref[:], held.v_ref_dot[:] = v_ref, integral_v_ref, v_ref_dot
        robot = (self._inertia, self._actuation)
        assert dynamic_stage(self.k, self.dynamic, held, z, z_dot, *robot) == 0
        integrate(self.k, self.kinematic, self.dynamic, held)
        return held.v.copy()
