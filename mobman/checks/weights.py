"""Check of the posture criterion's weights on long runs."""

from __future__ import annotations

from collections.abc import Iterator

from mobman.checks.checks import Remark, all_ok, check, does_not_apply, some, warning
from mobman.checks.subject import Subject
from mobman.model.posture_weights import conditioning, heading_weight
from mobman.robots.spec import DRIVEN

_WAY = 100.0  # m that are driven
_CIRCLE = 1.0  # m: radius of the circle on which the heading turns on the way
_POOR = 0.5  # of the conditioning that the rule gives


@check("weights", "the criterion pulls at nothing that grows with the way, and is well conditioned")
def weights(subject: Subject) -> Iterator[Remark]:
    robot = subject.robot
    base = robot.platform.base_joints
    if not base:
        yield does_not_apply("the base is fixed")
        return
    own = dict(zip(robot.joint_names, robot.criterion_weights.tolist(), strict=True))
    rule, heading = heading_weight(robot), base[-1]
    grown = {wheel.joint: _WAY / wheel.radius for wheel in robot.platform.wheels}
    if rule <= DRIVEN:
        grown[heading] = _WAY / _CIRCLE
    grown |= dict.fromkeys(base[:-1], _WAY)
    arm = max(own[robot.joint_names[i]] for i in robot.arm_index)
    pulling = [name for name, way in grown.items() if own[name] * way > arm]
    where = f"[criterion] of robot {robot.name!r}: see docs/robots.md#the-criterion"
    if pulling:
        yield warning(
            f"after {_WAY:g} m of way the criterion pulls harder at {some(map(repr, pulling))} than "
            "at a joint of the arm that is a radian from rest, and the longer the way the harder: it "
            "drives the arm into singularities",
            f"set 'platform', 'wheels' and 'heading' to {DRIVEN:g}, {DRIVEN:g} and {rule:g} in {where}",
        )
    found = conditioning(robot, robot.criterion_weights)
    by_rule = robot.criterion_weights.copy()
    by_rule[robot.joint_names.index(heading)] = rule
    best = conditioning(robot, by_rule)
    if found < _POOR * best:
        yield warning(
            f"the criterion is badly conditioned in the tip's null space at rest: {found:.2g}, where "
            f"the heading's weight {own[heading]:g} could be {rule:g} for {best:.2g}",
            f"set 'heading' to {rule:g} in {where}",
        )
    yield all_ok(
        f"conditioning of the criterion in the tip's null space at rest: {found:.2g}; after {_WAY:g} m "
        f"the platform pulls as {max(own[name] * way for name, way in grown.items()) / arm:.1g} rad "
        "of the arm do"
    )
