"""The joints' limits: position, velocity and effort."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mobman.checks.check import Remark, check, ok, some, warning, wrong
from mobman.checks.subject import Subject
from mobman.robots.urdf.compose import BASE_JOINTS

_UNBOUNDED = 1e8  # what continuous joints have is above it
_NEAR = 0.01  # of the range
_TURNS = 4.0 * math.pi  # rad: joints that turn further are rare, limits in degrees are not
_SLIDES = 10.0  # m: the same for limits in millimetres
_FAST = 50.0  # rad/s: joints of arms that are faster are rare, limits in degrees a second are not
_STEERING = 0.5 * math.pi - 1e-3  # rad


@check("limits", "limits are there, in radians and metres, and the rest posture is inside them")
def limits(subject: Subject) -> Iterator[Remark]:
    remarks = [
        *_position(subject),
        *_missing(subject),
        *_units(subject),
        *_steering(subject),
    ]
    yield from remarks
    if not remarks:
        yield ok("positions, velocities and efforts are limited, and rest is inside")


def _position(subject: Subject) -> Iterator[Remark]:
    robot, model = subject.robot, subject.robot.model
    near = []
    for i in range(robot.nq):
        name, rest = robot.joint_names[i], float(robot.q_rest[i])
        lower, upper = float(model.lowerPositionLimit[i]), float(model.upperPositionLimit[i])
        if lower >= upper:
            yield wrong(
                f"joint {name!r} cannot move: its limits are {lower:g} and {upper:g}",
                f"check <limit lower upper> of joint {name!r} in the URDF, or lock it in 'urdf.lock'",
            )
        elif not lower <= rest <= upper:
            yield wrong(
                f"joint {name!r} rests at {rest:.4g}, outside {lower:.4g} to {upper:.4g}",
                f"choose another field 'rest.{name}' of robot {robot.name!r}",
            )
        elif upper - lower < _UNBOUNDED and min(rest - lower, upper - rest) < _NEAR * (
            upper - lower
        ):
            near.append(f"joint {name!r} at {rest:.4g} of {lower:.4g} to {upper:.4g}")
    if near:
        yield warning(
            f"rests at a limit: {some(near)}",
            f"move it away from there in [rest] of robot {robot.name!r}: nothing stops a joint there",
        )


def _missing(subject: Subject) -> Iterator[Remark]:
    robot, model = subject.robot, subject.robot.model
    driven = np.any(robot.actuation(robot.q_rest) != 0.0, axis=1)  # front wheels of cars are not
    for kind, values, needed in (
        ("velocity", model.velocityLimit, np.ones(robot.nq, dtype=bool)),
        ("effort", model.effortLimit, driven),
    ):
        lacking = [
            name
            for name, value, wanted in zip(robot.joint_names, values, needed, strict=True)
            if name not in BASE_JOINTS and wanted and not (math.isfinite(value) and value > 0.0)
        ]
        if lacking:
            yield warning(
                f"no {kind} limit: joints {some([repr(name) for name in lacking])}",
                f"give {kind} in <limit> of these joints in the URDF, if it is to be compared with",
            )


def _units(subject: Subject) -> Iterator[Remark]:
    robot, model = subject.robot, subject.robot.model
    wheels = {wheel.joint for wheel in robot.platform.wheels}
    for i, name in enumerate(robot.joint_names):
        if name in BASE_JOINTS:
            continue
        bounds = np.array([model.lowerPositionLimit[i], model.upperPositionLimit[i]])
        largest = float(np.max(np.abs(bounds[np.abs(bounds) < _UNBOUNDED]), initial=0.0))
        turns = subject.turns(name)
        # wheels turn on and on: huge limits are how some exporters write that
        if name not in wheels and largest > (_TURNS if turns else _SLIDES):
            unit, other = ("rad", "degrees") if turns else ("m", "millimetres")
            yield warning(
                f"joint {name!r} has a limit of {largest:g} {unit}",
                f"check <limit> of joint {name!r} in the URDF: {other} instead of {unit}?",
            )
        speed = float(model.velocityLimit[i])
        if turns and i in robot.arm_index and _FAST < speed < _UNBOUNDED:
            yield warning(
                f"joint {name!r} may turn at {speed:g} rad/s",
                f"check <limit velocity> of joint {name!r} in the URDF: degrees instead of rad?",
            )
        if turns and largest == 0.0 and abs(robot.q_rest[i]) > _TURNS:
            yield warning(
                f"joint {name!r} rests at {robot.q_rest[i]:g} rad",
                f"check field 'rest.{name}' of robot {robot.name!r}: degrees instead of rad?",
            )


def _steering(subject: Subject) -> Iterator[Remark]:
    robot, model = subject.robot, subject.robot.model
    for name in subject.steering:
        i = robot.joint_names.index(name)
        largest = max(abs(float(model.lowerPositionLimit[i])), float(model.upperPositionLimit[i]))
        if largest >= _STEERING:
            limit = f"{largest:.4g} rad" if largest < _UNBOUNDED else "any angle"
            yield warning(
                f"steering joint {name!r} may turn to {limit}; at pi/2 the model is singular",
                f"limit joint {name!r} in the URDF to what the mechanism can do, below 1.57 rad",
            )
