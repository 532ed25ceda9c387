"""MuJoCo's step of 1 ms on the robots of this project.

The MuJoCo model is written from ``robot.model``: the same bodies, joints, masses and inertias, but
a free joint instead of the base's three, so that the base stands on the ground by contacts:

- each driven wheel is a sphere of its radius with sliding friction: one contact, the fewest there
  can be, and no slip but what MuJoCo's soft contacts allow;
- two frictionless spheres before and behind the axle stand for casters, which a base must not tip
  over; they weigh nothing.

Velocity actuators turn the wheels, stiff position actuators with the gravity's torque in their
command hold the arm. Joint limits, joint friction and contacts among the robot's own bodies are left
out, as in this project's simulation. Solver and integrator are MuJoCo's defaults, and a steady circle
with the arm at rest is a motion that costs them little: four contacts, one iteration a step.

Masses, the inertia matrix and gravity's torques are Pinocchio's to 1e-13; at 0.3 m/s straight ahead
the way is what the wheels roll to 0.2 %, the base tilts by less than 0.001 rad, and the arm stays
within 0.0005 rad of rest (tests/benchmark/test_peers.py).
"""

from __future__ import annotations

import functools
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.mjcf import jointed_body

if TYPE_CHECKING:
    import mujoco

DT = 1e-3
"""Time of a step (s)."""

SPEED = 0.3
"""How fast the base drives forward (m/s)."""

TURNING = 0.3
"""How fast it turns meanwhile (rad/s)."""

SPEEDING = 0.2
"""Time constant of the base's speed (s), which the gain of the wheels' actuators follows from."""

BASE = "base"
"""Name of the base's body and free joint; other joints and their bodies have the robot's names."""

_SETTLING = 3.0  # s, until contacts and speeds are steady
_FRICTION = 1.0  # of the wheels on the ground
_HOLDING = 60.0  # rad/s: natural frequency of a held joint, critically damped
_CASTER_HEIGHT = 0.5  # a caster's radius by the wheel's


def make_mujoco_step(robot: MobileManipulator) -> Callable[[], None]:
    """What does one ``mujoco.mj_step`` of DT each time it is called.

    The robot drives along a circle with its arm held at ``q_rest``.

    Raises:
        UsageError: If MuJoCo is missing, the platform not differential, or a joint follows another.
    """
    mujoco = _mujoco()
    model, data = make_mujoco_model(robot)
    drive(robot, model, data, SPEED, TURNING)
    mujoco.mj_step(model, data, round(_SETTLING / DT))
    return functools.partial(mujoco.mj_step, model, data)


def make_mujoco_model(robot: MobileManipulator) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The robot in MuJoCo, standing at ``q_rest`` and told to stay so.

    Raises:
        UsageError: If MuJoCo is missing, the platform not differential, or a joint follows another.
    """
    mujoco = _mujoco()
    model = mujoco.MjModel.from_xml_string(mujoco_xml(robot))
    data = mujoco.MjData(model)
    set_configuration(robot, model, data, robot.q_rest)
    gravity = pin.computeGeneralizedGravity(robot.model, robot.model.createData(), robot.q_rest)
    for i in robot.arm_index:
        actuator = model.actuator(robot.joint_names[i])
        data.ctrl[actuator.id] = robot.q_rest[i] + gravity[i] / actuator.gainprm[0]
    return model, data


def set_configuration(
    robot: MobileManipulator, model: mujoco.MjModel, data: mujoco.MjData, q: Array
) -> None:
    """Put MuJoCo's robot where q says (m, rad), base upright on the ground; forward kinematics."""
    x, y, theta = q[robot.platform_index[:3]]
    base = model.joint(BASE).qposadr[0]
    data.qpos[base : base + 7] = x, y, 0.0, np.cos(theta / 2), 0.0, 0.0, np.sin(theta / 2)
    for i in _jointed(robot):
        data.qpos[model.joint(robot.joint_names[i]).qposadr[0]] = q[i]
    _mujoco().mj_forward(model, data)


def drive(
    robot: MobileManipulator,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    speed: float,
    turning: float,
) -> Array:
    """Command the wheels to drive forward (m/s) and turn (rad/s).

    Returns:
        The wheels' rates (rad/s), in the platform's order, shape (2,).
    """
    level = robot.q_rest.copy()
    x, _, theta, *wheels = robot.platform_index
    level[theta] = 0.0
    c = robot.velocity_map(level)
    z = np.linalg.lstsq(c[[x, theta]], np.array([speed, turning]), rcond=None)[0]
    for i in wheels:
        data.ctrl[model.actuator(robot.joint_names[i]).id] = c[i] @ z
    return np.array(c[wheels] @ z)


def dof_index(robot: MobileManipulator, model: mujoco.MjModel) -> list[int]:
    """Which of MuJoCo's degrees of freedom are q', with an upright base, shape (nq,)."""
    base = model.joint(BASE).dofadr[0]
    of_base = dict(zip(robot.platform_index[:3], (base, base + 1, base + 5), strict=True))
    return [
        of_base[i] if i in of_base else model.joint(name).dofadr[0]
        for i, name in enumerate(robot.joint_names)
    ]


def mujoco_xml(robot: MobileManipulator) -> str:
    """The robot and the ground as MJCF.

    Raises:
        UsageError: If the platform is not differential, or a joint follows another.
    """
    if robot.spec.platform.type != "differential":
        raise UsageError(
            f"robot {robot.name!r} has a {robot.spec.platform.type!r} platform; the comparison with "
            "MuJoCo knows 'differential'"
        )
    if robot.followers:
        raise UsageError(
            f"joint {robot.followers[0].joint!r} of robot {robot.name!r} follows another; the "
            "comparison with MuJoCo knows no joints that follow"
        )
    root = ET.Element("mujoco", model=robot.name)
    ET.SubElement(root, "compiler", angle="radian", inertiafromgeom="false")
    gravity = _text(robot.model.gravity.linear)
    ET.SubElement(root, "option", timestep=repr(DT), gravity=gravity)
    world = ET.SubElement(root, "worldbody")
    ground = {"type": "plane", "size": "0 0 1", "contype": "0", "conaffinity": "1"}
    ET.SubElement(world, "geom", {"name": "ground", "condim": "1", **ground})
    actuators = ET.SubElement(root, "actuator")
    base_joint = robot.model.getJointId(robot.joint_names[robot.platform_index[2]])
    base = ET.SubElement(world, "body", name=BASE)
    ET.SubElement(base, "freejoint", name=BASE)
    _inertial(base, robot.model.inertias[base_joint])
    bodies = {base_joint: base}
    for i in _jointed(robot):
        joint = robot.model.getJointId(robot.joint_names[i])
        parent = bodies[robot.model.parents[joint]]
        bodies[joint] = jointed_body(parent, robot.model, joint)
        _inertial(bodies[joint], robot.model.inertias[joint])
    _stand(robot, base, bodies)
    _actuate(robot, actuators)
    return ET.tostring(root, encoding="unicode")


def _jointed(robot: MobileManipulator) -> list[int]:
    """Indices in q of what has a joint in MuJoCo too: wheels and arm; parents come first."""
    of_base = set(robot.platform_index[:3])
    return [i for i in range(robot.nq) if i not in of_base]


def _inertial(body: ET.Element, inertia: pin.Inertia) -> None:
    i = inertia.inertia
    ET.SubElement(
        body,
        "inertial",
        pos=_text(inertia.lever),
        mass=repr(float(inertia.mass)),
        fullinertia=_text([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]),
    )


def _stand(robot: MobileManipulator, base: ET.Element, bodies: dict[int, ET.Element]) -> None:
    """What the robot stands on: spheres for its wheels, and for casters before and behind."""
    model = robot.model
    wheels = [model.getJointId(robot.joint_names[i]) for i in robot.platform_index[3:]]
    centres = np.array([model.jointPlacements[joint].translation for joint in wheels])
    shape = {"type": "sphere", "contype": "1", "conaffinity": "0"}
    for joint, centre in zip(wheels, centres, strict=True):
        rolling = {"condim": "3", "friction": _text([_FRICTION, 0.0, 0.0])}
        ET.SubElement(bodies[joint], "geom", {**shape, **rolling, "size": _text(centre[2:])})
    axle = centres.mean(axis=0)
    reach, radius = float(np.ptp(centres[:, 1])) / 2.0, _CASTER_HEIGHT * float(axle[2])
    for side in (1.0, -1.0):
        place = _text([axle[0] + side * reach, axle[1], radius])
        ET.SubElement(base, "geom", {**shape, "pos": place, "size": repr(radius), "condim": "1"})


def _actuate(robot: MobileManipulator, actuators: ET.Element) -> None:
    """A velocity actuator for each wheel, a position actuator for each joint of the arm."""
    model = robot.model
    felt = dict(zip(robot.arm_index, _felt_inertia(robot), strict=True))
    mass = pin.computeTotalMass(model)
    for i in _jointed(robot):
        name = robot.joint_names[i]
        if i in robot.platform_index:
            radius = float(model.jointPlacements[model.getJointId(name)].translation[2])
            gain = mass * radius**2 / (2.0 * SPEEDING)  # half the mass for each wheel
            ET.SubElement(actuators, "velocity", name=name, joint=name, kv=repr(gain))
        else:
            kp, kv = _HOLDING**2 * felt[i], 2.0 * _HOLDING * felt[i]
            ET.SubElement(actuators, "position", name=name, joint=name, kp=repr(kp), kv=repr(kv))


def _felt_inertia(robot: MobileManipulator) -> list[float]:
    """What each joint of the arm feels at rest while all others are free (kg m^2, kg).

    Gains in proportion to it are stable in explicit integration; with the diagonal of the inertia,
    which is larger, they need not be.
    """
    upper = np.triu(pin.crba(robot.model, robot.model.createData(), robot.q_rest))
    c = robot.velocity_map(robot.q_rest)
    inertia = c.T @ (upper + np.triu(upper, 1).T) @ c
    arm = np.linalg.inv(inertia).diagonal()[-len(robot.arm_index) :]
    return [float(value) for value in 1.0 / arm]


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _mujoco() -> Any:
    """The package, if it is installed."""
    try:
        import mujoco
    except ImportError as error:
        raise UsageError(
            "the comparison with MuJoCo needs mujoco; install it with: pip install 'mobman[speed]'"
        ) from error
    return mujoco
