"""``tsm``: the paper's optimal two-stage law, (34)-(35) and (55)-(56)."""

from __future__ import annotations

from mobman.controllers.protocol import controllers
from mobman.controllers.sliding.cascade import CascadedSlidingControl, SlidingGains
from mobman.controllers.task_space import ExtendedTaskSpace
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task


class TerminalSlidingMode(CascadedSlidingControl):
    """Kinematic stage on the extended Jacobian's transpose, v_ref' = J^T u_ref (34)-(35); dynamic
    stage on the actuation matrix's transpose, v' = B^T u (55)-(56)."""

    name = "tsm"
    Gains = SlidingGains

    def task_space(self, robot: MobileManipulator, task: Task) -> ExtendedTaskSpace:
        """e = (e^e, e^a) of (13): the tip's errors and the criterion's transversality conditions."""
        return ExtendedTaskSpace(robot, task, self.criterion)


controllers.register(TerminalSlidingMode.name, TerminalSlidingMode)
