"""What gravity asks of the motors at rest."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from mobman.checks.check import Remark, check, ok, some, warning, wrong
from mobman.checks.differences import derivative, relative
from mobman.checks.subject import Subject

_GRADIENT = 1e-6
_STEP = 1e-2
_STATES = 5
_PLATFORM = 1e-6  # of the robot's weight, at a lever of 1 m
_EARTH = (9.0, 10.0)  # m/s^2


@check("gravity", "gravity pulls down, and the motors can hold the rest posture")
def gravity(subject: Subject) -> Iterator[Remark]:
    robot = subject.robot
    remarks = [*_direction(subject), *_gradient(subject), *_on_the_platform(subject)]
    holding = _holding_forces(subject)
    remarks += _efforts(subject, holding)
    yield from remarks
    if not remarks:
        arm = {robot.joint_names[i]: abs(float(holding[i])) for i in robot.arm_index}
        name = max(arm, key=arm.__getitem__)
        yield ok(
            f"held at rest by at most {arm[name]:.3g} {_unit(subject, name)}, of joint {name!r}"
        )


def _unit(subject: Subject, joint: str) -> str:
    return "N m" if subject.turns(joint) else "N"


def _holding_forces(subject: Subject) -> np.ndarray:
    """Generalised forces of the motors that hold the rest posture, shape (nq,)."""
    robot = subject.robot
    _, bias, b = robot.dynamics(robot.q_rest, np.zeros(robot.nz))
    commands = np.linalg.solve(b, bias)
    forces: np.ndarray = robot.actuation(robot.q_rest) @ commands
    return forces


def _direction(subject: Subject) -> Iterator[Remark]:
    pull = np.array(subject.robot.model.gravity.linear)
    if np.any(np.abs(pull[:2]) > 1e-9) or not _EARTH[0] <= -pull[2] <= _EARTH[1]:
        yield wrong(
            f"gravity is {pull.round(4).tolist()} m/s^2",
            "set model.gravity to 9.81 m/s^2 along -z: the platform drives on level ground",
        )


def _gradient(subject: Subject) -> Iterator[Remark]:
    robot = subject.robot
    data = robot.model.createData()
    worst = 0.0
    for q, z in subject.states(_STATES):
        c = robot.velocity_map(q)
        _, bias, _ = robot.dynamics(q, np.zeros(robot.nz))

        def potential(s: float, q: np.ndarray = q, d: np.ndarray = c @ z) -> np.ndarray:
            return np.array([pin.computePotentialEnergy(robot.model, data, q + s * d)])

        rise = derivative(potential, _STEP / max(1.0, float(np.abs(c @ z).max())))
        worst = max(worst, relative(np.array([bias @ z]), rise))
    if worst > _GRADIENT:
        yield wrong(
            f"the gravity term differs from the potential energy's gradient by {worst:.2g} of it",
            f"check the <inertial> elements of {subject.files} and the platform's N",
        )


def _on_the_platform(subject: Subject) -> Iterator[Remark]:
    robot = subject.robot
    _, bias, _ = robot.dynamics(robot.q_rest, np.zeros(robot.nz))
    pull = float(np.linalg.norm(np.array(robot.model.gravity.linear)))
    weight = pull * sum(float(link.mass) for link in robot.model.inertias)
    # a motion of alpha counts for as much as it moves the coordinates
    size = np.abs(robot.velocity_map(robot.q_rest)[:, : robot.n_alpha]).max(axis=0, initial=0.0)
    unbalanced = [
        f"{name} {force:.3g}"
        for name, force, lever in zip(
            robot.velocity_names, bias[: robot.n_alpha], size, strict=False
        )
        if abs(force) > _PLATFORM * weight * max(float(lever), 1e-12)
    ]
    if unbalanced:
        yield warning(
            f"gravity drives the platform on level ground: {some(unbalanced)} N m or N",
            f"check <inertial><origin> of the wheels in {subject.files}: their centre of mass is "
            "off the axle",
        )


def _efforts(subject: Subject, holding: np.ndarray) -> Iterator[Remark]:
    robot = subject.robot
    efforts = np.array(robot.model.effortLimit)
    weak = [
        f"joint {robot.joint_names[i]!r} needs {abs(holding[i]):.3g} of {efforts[i]:.3g} "
        f"{_unit(subject, robot.joint_names[i])}"
        for i in robot.arm_index
        if 0.0 < efforts[i] < abs(holding[i])
    ]
    if weak:
        yield warning(
            f"the motors cannot hold the rest posture: {some(weak)}",
            f"choose another [rest] of robot {robot.name!r}, or check <limit effort> of these joints "
            f"and the masses behind them in {subject.files}",
        )
