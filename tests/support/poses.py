"""Placements that Pinocchio computes, to compare what is drawn with."""

from __future__ import annotations

import numpy as np
import pinocchio as pin


def placements(robot, q):
    """Of every joint and of the tip in the world at q, shape (4, 4) each, by name."""
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, np.asarray(q))
    found = {model.names[i]: data.oMi[i].homogeneous for i in range(1, model.njoints)}
    return {**found, "tip": robot.tip_pose(q).homogeneous}


def drawn(page, names, run=0):
    """What the page says of the same."""
    poses = page.evaluate("([names, run]) => mobman.poses(names, run)", [list(names), run])
    return {name: np.array(pose) for name, pose in poses.items()}


def largest_difference(page, robot, q, run=0):
    """Largest entry of the differences between what is drawn and Pinocchio's placements."""
    expected = placements(robot, q)
    found = drawn(page, expected, run)
    return max(float(np.abs(found[name] - pose).max()) for name, pose in expected.items())
