"""Check of the default task for singularities that its motion leads to."""

from __future__ import annotations

from collections.abc import Iterator

from mobman.checks.checks import Remark, all_ok, check, does_not_apply, warning
from mobman.checks.closed_loop import circle
from mobman.checks.subject import Subject
from mobman.model.task_map import TaskMap
from mobman.simulation.singularity import predict_singularity

_DURATION = 120.0  # s
_TASK = "circle"


@check(
    "fold",
    f"the motion on the task {_TASK!r} leads to no singularity within {_DURATION:g} s",
    simulates=True,
)
def fold(subject: Subject) -> Iterator[Remark]:
    robot, m = subject.robot, TaskMap().m
    if robot.nz < m:
        yield does_not_apply(f"{robot.nz} degrees of freedom, fewer than the tip's {m}")
        return
    found = predict_singularity(robot, circle(subject), duration=_DURATION)
    if found.singular is not None:
        yield warning(
            f"laws on the extended task (13) that follow the task {_TASK!r} become singular at "
            f"t = {found.singular.time:.3g} s: {found.singular}",
            f"lower the weights of wheels and platform in [criterion] of robot {robot.name!r}, choose "
            "another posture in [rest], or a law without the extended Jacobian",
        )
        return
    least = int(found.sigma.argmin())
    yield all_ok(
        f"{_DURATION:g} s of the task {_TASK!r}: sigma_min(J) at least {found.sigma[least]:.2g}, at "
        f"t = {found.t[least]:.3g} s; sigma_min(J_e) at least {found.sigma_tip.min():.2g}"
    )
