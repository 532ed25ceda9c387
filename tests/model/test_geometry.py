"""What robots look like and may collide with."""

from __future__ import annotations

import numpy as np
import pytest
from support.variants import youbot_urdf, youbot_with_urdf

import mobman as mm
from mobman.errors import SpecError
from mobman.model.build import load_geometry


def test_geometry_sits_on_the_robots_own_joints(robot):
    geometry = load_geometry(robot)
    for model in (geometry.visual, geometry.collision):
        assert model.ngeoms > 0
        for shape in model.geometryObjects:
            assert 0 <= shape.parentJoint < robot.model.njoints
    # wheels and arm are seen to move: some shape hangs on each of their joints
    seen = {robot.model.names[shape.parentJoint] for shape in geometry.visual.geometryObjects}
    moving = set(robot.platform.coordinates[3:]) - set(robot.platform.virtual_joints)
    assert moving <= seen
    assert robot.joint_names[robot.arm_index[-1]] in seen


def test_shapes_are_where_the_urdf_puts_them(youbot):
    """The right wheel's tyre: at its joint, about the y axis, 0.044 wide."""
    geometry = load_geometry(youbot)
    tyre = geometry.visual.geometryObjects[geometry.visual.getGeometryId("wheel_1_0")]
    assert youbot.model.names[tyre.parentJoint] == "phi_1"
    assert np.allclose(tyre.placement.translation, 0.0)
    assert np.allclose(np.abs(tyre.placement.rotation[:, 2]), [0.0, 1.0, 0.0])
    assert np.isclose(tyre.geometry.radius, youbot.platform.radius)


def test_missing_mesh_is_named(tmp_path):
    text = youbot_urdf().replace(
        '<box size="0.57 0.24 0.07"/>', '<mesh filename="package://nowhere/hull.stl"/>'
    )
    robot = mm.load_robot(youbot_with_urdf(tmp_path, text))  # its dynamics need no mesh
    with pytest.raises(SpecError, match=r"nowhere/hull\.stl"):
        load_geometry(robot)
