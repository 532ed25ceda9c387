"""The terminal sliding mode laws: ``tsm`` (34)-(35) and (55)-(56), ``tsm-simplified`` (43)-(44) and
(55)-(56), ``tsm-inverse-actuation`` (34)-(35) and (65)-(66).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.controllers.bounds import actuation_bound, inertia_bound, jacobian_bound
from mobman.controllers.dynamic_stage import NO_INVERSE, DynamicGains, DynamicStage
from mobman.controllers.gains import (
    Diagonal,
    as_settings,
    gain,
    require_choice,
    require_not_negative,
    require_positive,
    require_positive_diagonal,
)
from mobman.controllers.kinematic_stage import KinematicGains, KinematicStage
from mobman.controllers.protocol import controllers
from mobman.controllers.task_errors import (
    ExtendedTaskSpace,
    TaskSpace,
    TipTaskSpace,
    posture_criterion,
)
from mobman.controllers.unit_vector import DISCRETIZATIONS, NOT_DEFINITE, Discretization
from mobman.errors import SingularityError, UsageError
from mobman.kernels.program import program
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task

_REASONS = {
    NOT_DEFINITE: "the nominal inertia M is not positive definite",
    NO_INVERSE: "the actuation matrix B has no inverse",
}


@dataclass(frozen=True, kw_only=True)
class SlidingGains(KinematicGains, DynamicGains):
    """Gains of both stages, and how they are sampled."""

    c_F: float = gain(1.0, "1", "c_F of the criterion (12)")
    K_F: Diagonal | None = gain(
        None, "m^-2, rad^-2", "diagonal of K_F of (12), by default the robot's"
    )
    discretization: Discretization = gain("implicit", "", "of the unit vectors: implicit, explicit")
    boundary_layer: float = gain(
        0.0, "that of s, of S", "width in which s/|s| becomes s/width; 0: none"
    )
    metric_scale: float = gain(1.0, "1", "factor of the nominal M in the implicit form's metric")

    def __post_init__(self) -> None:
        KinematicGains.__post_init__(self)
        DynamicGains.__post_init__(self)
        require_positive(self, "c_F", "metric_scale")
        require_not_negative(self, "boundary_layer")
        require_choice(self, "discretization", DISCRETIZATIONS)
        if self.K_F is not None:
            require_positive_diagonal(self, "K_F")


class CascadedSlidingControl:
    """A kinematic stage that gives v_ref and a dynamic stage that makes z' follow it.

    Subclasses say which task errors the first stage drives to zero (:meth:`task_space`) and whether
    the second uses the actuation matrix's transpose or its inverse (``inverse_actuation``).
    """

    inverse_actuation = False
    signals_in_place = True

    def __init__(self, gains: SlidingGains) -> None:
        self.gains = gains
        self._settings: dict[str, Any] = as_settings(gains)

    def task_space(self, robot: MobileManipulator, task: Task) -> TaskSpace:
        """The errors that the kinematic stage drives to zero."""
        raise UsageError(f"{type(self).__name__} does not say what its task space is")

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again with v = 0, v_ref = 0 and empty integrals; "auto" bounds are found here.

        Raises:
            GainError: If a gain has the wrong length for the robot.
        """
        gains = self.gains
        self.criterion = posture_criterion(robot, gains.c_F, gains.K_F)
        a, bound = self._bounds(robot, task)
        self._settings = {**as_settings(gains), "a": a, "A": bound}
        space = self.task_space(robot, task)
        kinematic = KinematicStage(
            gains, a, space.errors, dt, gains.discretization, gains.boundary_layer
        )
        dynamic = DynamicStage(
            gains,
            bound,
            robot.nz,
            dt,
            inverse=self.inverse_actuation,
            discretization=gains.discretization,
            boundary_layer=gains.boundary_layer,
            metric_scale=gains.metric_scale,
        )
        now = space.workspace
        self._space, self._now = space, now
        self._kinematic, self._dynamic = kinematic, dynamic
        self._z_dot = np.zeros(robot.nz)
        self._velocity = program(now.velocity_steps())
        self._law = program(
            [
                *space.steps(),
                *now.inertia_steps(),
                *kinematic.steps(now.q, robot.q_rest, now.z),
                *dynamic.steps(
                    now.z,
                    self._z_dot,
                    kinematic.integral_v_ref,
                    kinematic.v_ref,
                    kinematic.v_ref_dot,
                    now.M,
                    now.B,
                ),
                *kinematic.advance_steps(),
            ]
        )

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque v for the tick, shape (nz,); see :class:`Controller`."""
        now = self._now
        now.q[:] = q
        now.z[:] = z
        self._z_dot[:] = z_dot
        self._space.t[0] = t
        self._velocity()
        now.run_jacobians()
        now.run_inertia()
        while status := self._law():
            if reason := _REASONS.get(status):
                raise SingularityError(reason)
            self._space.resolve(status)
        return self._dynamic.v.copy()

    def settings(self) -> dict[str, Any]:
        """The gains; after :meth:`reset`, with the numbers that "auto" became."""
        return self._settings

    def signals(self) -> dict[str, Array]:
        """The sliding variables of the last tick: s of (31) and S of (51)."""
        return {"sliding/s": self._kinematic.s, "sliding/S": self._dynamic.S}

    def _bounds(self, robot: MobileManipulator, task: Task) -> tuple[float, float]:
        a, bound = self.gains.a, self.gains.A
        if isinstance(a, str):
            a = jacobian_bound(robot, task, self.task_space(robot, task))
        if isinstance(bound, str):
            bound = (
                inertia_bound(robot, task)
                if self.inverse_actuation
                else actuation_bound(robot, task, self.gains.w_7)
            )
        return a, bound


class TerminalSlidingMode(CascadedSlidingControl):
    """Kinematic stage on the extended Jacobian's transpose, v_ref' = J^T u_ref (34)-(35); dynamic
    stage on the actuation matrix's transpose, v' = B^T u (55)-(56)."""

    name = "tsm"
    Gains = SlidingGains

    def task_space(self, robot: MobileManipulator, task: Task) -> ExtendedTaskSpace:
        """e = (e^e, e^a) of (13): the tip's errors and the criterion's transversality conditions."""
        return ExtendedTaskSpace(robot, task, self.criterion)


controllers.register(TerminalSlidingMode.name, TerminalSlidingMode)


class SimplifiedTerminalSlidingMode(CascadedSlidingControl):
    """Kinematic stage on the tip Jacobian's transpose, v_ref' = j_e^T u_ref (43)-(44); dynamic stage
    as in ``tsm`` (55)-(56). What the tip leaves free is not controlled: ``c_F`` and ``K_F`` have no
    effect here but on what is reported of the criterion."""

    name = "tsm-simplified"
    Gains = SlidingGains

    def task_space(self, robot: MobileManipulator, task: Task) -> TipTaskSpace:
        """e = e^e: the tip's errors alone."""
        return TipTaskSpace(robot, task)


controllers.register(SimplifiedTerminalSlidingMode.name, SimplifiedTerminalSlidingMode)


class InverseActuationSlidingMode(TerminalSlidingMode):
    """Kinematic stage as in ``tsm`` (34)-(35); dynamic stage v' = B^-1 u (65)-(66), with the gain
    ``A`` in the place of A' of (64)."""

    name = "tsm-inverse-actuation"
    inverse_actuation = True


controllers.register(InverseActuationSlidingMode.name, InverseActuationSlidingMode)
