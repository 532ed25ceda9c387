"""``tsm-simplified``: the paper's law without a criterion, (43)-(44) and (55)-(56)."""

from __future__ import annotations

from mobman.controllers.protocol import controllers
from mobman.controllers.sliding.cascade import CascadedSlidingControl, SlidingGains
from mobman.controllers.task_space import TipTaskSpace
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.tasks.task import Task


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
