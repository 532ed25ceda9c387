"""Joints about the wheels that do not move: casters, suspensions, rollers."""

from __future__ import annotations

from mobman.robots.inference import hints
from mobman.robots.inference.drive import Drive
from mobman.robots.inference.findings import Lock
from mobman.robots.inference.wheels import Rolling


def lock_passive(drive: Drive, wheels: list[Rolling]) -> None:
    """Everything about wheels that is no coordinate of the platform."""
    own = drive.own
    done = {name for lock in drive.locks for name in lock.joints} | own

    def add(names: list[str], why: str) -> None:
        new = tuple(dict.fromkeys(name for name in names if name not in done))
        done.update(new)
        if new:
            drive.locks.append(Lock(new, why))

    turning = [w for w in wheels if w.name not in own]
    every = [*drive.rolling, *turning]
    add(
        [
            j.name
            for w in turning
            for j in (w.swivel, w.joint, *w.rollers)
            if j is not None and (w.swivel is not None or w.says(hints.CASTER))
        ],
        "casters",
    )
    add(
        [j.name for w in turning for j in (w.steering, w.joint, *w.rollers) if j is not None],
        "wheels that do not drive",
    )
    add([j.name for w in every for j in w.suspension], "suspension")
    add([w.swivel.name for w in every if w.swivel is not None], "swivels of the wheels")
    add([j.name for w in every for j in w.rollers], "rollers")
