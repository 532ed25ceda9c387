"""Robots that a worker has loaded already: loading takes longer than a short run.

Runs write to nothing of them, so they stay as they were loaded. One run at a time looks here:
:mod:`mobman.benchmark.running.perform`.
"""

from __future__ import annotations

from collections import OrderedDict

from mobman.benchmark.running.job import Job
from mobman.errors import MobmanError, SpecError
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.robots.catalogue import find_spec
from mobman.robots.spec import RobotSpec
from mobman.simulation.run_spec import fingerprint

_KEPT = 8
_robots: OrderedDict[str, MobileManipulator] = OrderedDict()


def robot_of(job: Job) -> MobileManipulator:
    """The robot of a job, loaded now or before.

    Raises:
        SpecError: If it does not load.
        MobmanError: If it is not here, or is not what it was where the suite was started.
    """
    key = job.run.robot_sha256
    if key not in _robots:
        _robots[key] = load_robot(_spec(job))
        if len(_robots) > _KEPT:
            _robots.popitem(last=False)
    _robots.move_to_end(key)
    return _robots[key]


def forget_robots() -> None:
    """Load them anew from now on: a run that broke off may have left anything in them."""
    _robots.clear()


def _spec(job: Job) -> RobotSpec:
    """The description as it was sent; or this machine's own, if its files are elsewhere here."""
    sent: RobotSpec = job.robot.open()
    found = None
    try:
        found = fingerprint(sent)
        if found == job.run.robot_sha256:
            return sent
    except SpecError as error:
        missing = error
    try:
        own = find_spec(job.run.robot)
        if fingerprint(own) == job.run.robot_sha256:
            return own
    except MobmanError:
        pass  # not known here: the description that was sent is what to speak of
    if found is None:
        raise MobmanError(
            f"{missing} on the worker; put the robot's files in the same place there, or install there "
            "the package that brings them"
        )
    raise MobmanError(
        f"robot {job.run.robot!r}: its URDF is not what it was when the suite was started, or its "
        "platform's code is not (edited meanwhile, or another one on the worker)"
    )
