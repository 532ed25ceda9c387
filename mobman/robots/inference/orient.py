"""Forward of a platform, and with it which wheels are right, left, in front and behind."""

from __future__ import annotations

import numpy as np

from mobman.arrays import Array
from mobman.robots.inference.drive import WITHOUT_WHEELS, Drive
from mobman.robots.inference.findings import Lock, Options
from mobman.robots.inference.forward import Forward, find_forward, heading_of
from mobman.robots.inference.tree import Tree
from mobman.robots.inference.wheels import SAME_PLACE, Rolling


def orient(tree: Tree, drive: Drive, wheels: list[Rolling], options: Options, arms: Array) -> None:
    """Forward, and with it right and left and the order of wheels."""
    driven = [*drive.right, *drive.left, *drive.wheels]
    if options.heading is not None:
        drive.forward = Forward(float(options.heading), "as asked for")
    elif drive.steering and driven:
        axle = np.mean([w.joint.centre[:2] for w in driven], axis=0)
        ahead = np.mean([joint.centre[:2] for joint in drive.steering], axis=0) - axle
        across = driven[0].across
        ahead = np.array([across[1], -across[0]]) * np.sign(
            ahead @ np.array([across[1], -across[0]])
        )
        drive.forward = Forward(heading_of(ahead), "the steered wheels are in front")
    elif driven and all(driven[0].parallel(w) for w in driven):
        others = [w for w in wheels if w not in driven]
        drive.forward = find_forward(tree, driven, others, arms)
        if not drive.forward.clear:
            drive.uncertain.append(
                f"which way is forward ({drive.forward.why}); the other way: --heading "
                f"{heading_of(-drive.forward.direction):.10g}"
            )
    else:
        drive.forward = Forward(0.0, "the root link's x axis")
    left, ahead = drive.forward.left, drive.forward.direction
    if not options.right_wheels:
        for i, (one, other) in enumerate(zip(drive.right, drive.left, strict=True)):
            if one.joint.centre[:2] @ left > other.joint.centre[:2] @ left:
                drive.right[i], drive.left[i] = other, one
        order = np.argsort([-(w.joint.centre[:2] @ ahead) for w in drive.right], kind="stable")
        drive.right = [drive.right[i] for i in order]
        drive.left = [drive.left[i] for i in order]
    if not options.wheels:
        drive.wheels.sort(
            key=lambda w: (
                -round(float(w.joint.centre[:2] @ ahead) / SAME_PLACE),
                -float(w.joint.centre[:2] @ left),
            )
        )
    drive.steering.sort(key=lambda joint: float(joint.centre[:2] @ left))
    drive.front.sort(key=lambda w: float(w.joint.centre[:2] @ left))
    if drive.type.value in WITHOUT_WHEELS:
        # they stay where they are for the axle's place, but are no coordinates
        drive.locks.append(
            Lock(tuple(w.name for w in wheels), f"wheels: {drive.type.value} platforms have none")
        )
