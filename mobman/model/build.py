"""From a description and its URDF to a :class:`MobileManipulator`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import SpecError, UnknownNameError
from mobman.model.mobile_manipulator import Geometry, MobileManipulator
from mobman.model.platforms.platform import Platform, platforms
from mobman.robots.catalogue import as_spec, find_spec
from mobman.robots.spec import RobotSpec
from mobman.robots.urdf import BASE_JOINTS, UrdfFile, flat_urdf, urdf_of


def load_robot(
    name_or_path: str | os.PathLike[str] | RobotSpec | Mapping[str, Any],
) -> MobileManipulator:
    """A robot by its name, its TOML file, or its description.

    Args:
        name_or_path: A name of :func:`list_robots`, the path of a TOML file, a :class:`RobotSpec`
            or a dictionary of its fields.

    Raises:
        UnknownNameError: If no robot has the name.
        SpecError: If the description or its URDF is not valid; the message names file and field.
    """
    if isinstance(name_or_path, (RobotSpec, Mapping)):
        return build_robot(as_spec(name_or_path))
    return build_robot(find_spec(name_or_path))


def build_robot(spec: RobotSpec) -> MobileManipulator:
    """The robot that a description describes.

    Raises:
        SpecError: If a field does not fit the URDF.
    """
    urdf = urdf_of(spec)
    platform = _platform(spec, urdf)
    tree = _parse(spec, flat_urdf(urdf, platform.root_offset))
    locked = _locked(spec, urdf, tree)
    model = pin.buildReducedModel(tree, locked, _named_values(spec, tree, "rest", spec.rest))
    if not model.existFrame(spec.arm.tip):
        links = ", ".join(str(link.get("name")) for link in urdf.parse().findall("link"))
        raise SpecError(
            f"robot {spec.name!r}: field 'arm.tip' is {spec.arm.tip!r}, which is no link of "
            f"{urdf.path}; its links: {links}"
        )
    robot = MobileManipulator(
        spec=spec,
        urdf=urdf,
        model=model,
        platform=platform,
        q_rest=_named_values(spec, model, "rest", spec.rest, known=list(tree.names)),
        criterion_weights=_criterion_weights(spec, model, list(tree.names)),
    )
    return _checked(robot)


def load_geometry(robot: MobileManipulator) -> Geometry:
    """The robot's visual and collision geometry, in the frames of ``robot.model``.

    Raises:
        SpecError: If a mesh is missing or cannot be read.
    """
    spec, urdf = robot.spec, robot.urdf
    xml = flat_urdf(urdf, robot.platform.root_offset)
    tree = _parse(spec, xml)
    folders = [str(folder) for folder in urdf.package_folders]
    models = []
    for kind in (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION):
        try:
            models.append(pin.buildGeomFromUrdfString(tree, xml, kind, package_dirs=folders))
        except ValueError as error:
            raise SpecError(f"robot {spec.name!r}: geometry of {urdf.path}: {error}") from error
    _, reduced = pin.buildReducedModel(
        tree,
        models,
        _locked(spec, urdf, tree),
        _named_values(spec, tree, "rest", spec.rest),
    )
    return Geometry(visual=reduced[0], collision=reduced[1])


def _platform(spec: RobotSpec, urdf: UrdfFile) -> Platform:
    """The platform, placed by where the URDF's wheels are."""
    tree = _parse(spec, flat_urdf(urdf, (0.0, 0.0, 0.0)))
    try:
        kind = platforms.get(spec.platform.type)
    except UnknownNameError as error:
        raise SpecError(f"robot {spec.name!r}: field 'platform.type': {error}") from error
    return kind.build(spec.platform.parameters, tree, f"robot {spec.name!r}")


def _parse(spec: RobotSpec, xml: str) -> pin.Model:
    try:
        return pin.buildModelFromXML(xml)
    except (ValueError, RuntimeError) as error:
        raise SpecError(f"robot {spec.name!r}: Pinocchio refuses the URDF: {error}") from error


def _locked(spec: RobotSpec, urdf: UrdfFile, tree: pin.Model) -> list[int]:
    """Indices of the joints that the description locks."""
    names = [name for name in tree.names[1:] if name not in BASE_JOINTS]
    locked: set[str] = set()
    for pattern in spec.urdf.lock:
        matching = {name for name in names if fnmatchcase(name, pattern)}
        if not matching:
            raise SpecError(
                f"robot {spec.name!r}: field 'urdf.lock': no movable joint matches {pattern!r}; "
                f"the URDF has: {', '.join(names)}"
            )
        locked |= matching
    mimic = {
        str(joint.get("name"))
        for joint in urdf.parse().findall("joint")
        if joint.find("mimic") is not None
    }
    if free := mimic & set(names) - locked:
        raise SpecError(
            f"robot {spec.name!r}: the joints {', '.join(sorted(free))} follow others (<mimic>), which "
            "a motor for each joint does not allow; lock them in field 'urdf.lock'"
        )
    driven = locked & {
        value for value in spec.platform.parameters.values() if isinstance(value, str)
    }
    if driven:
        raise SpecError(
            f"robot {spec.name!r}: field 'urdf.lock' locks the platform's own {sorted(driven)}"
        )
    return [int(tree.getJointId(name)) for name in sorted(locked)]


def _named_values(
    spec: RobotSpec,
    model: pin.Model,
    field: str,
    values: Mapping[str, float],
    default: float = 0.0,
    known: list[str] | None = None,
) -> Array:
    """A vector over q from values by joint name; names in ``known`` may be absent from the model."""
    vector = np.full(model.nq, default)
    for name, value in values.items():
        if model.existJointName(name):
            vector[model.joints[model.getJointId(name)].idx_q] = value
        elif name not in (known or []):
            raise SpecError(
                f"robot {spec.name!r}: field '{field}' names {name!r}, which is no movable joint; "
                f"allowed: {', '.join(model.names[1:])}"
            )
    return vector


def _criterion_weights(spec: RobotSpec, model: pin.Model, known: list[str]) -> Array:
    given = spec.criterion
    base = dict.fromkeys(BASE_JOINTS, given.platform)
    return _named_values(
        spec,
        model,
        "criterion.weights",
        {**base, **given.weights},
        default=given.default,
        known=known,
    )


def _checked(robot: MobileManipulator) -> MobileManipulator:
    """The robot, if its numbers make sense.

    Raises:
        SpecError: If the rest posture is outside the limits, a weight is not positive, the arm has
            no joint, or the reduced inertia is not positive definite.
    """
    where = f"robot {robot.name!r}"
    if robot.n == 0:
        raise SpecError(f"{where}: no joint is left for the arm; see field 'urdf.lock'")
    lower, upper = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    for i in np.flatnonzero((robot.q_rest < lower) | (robot.q_rest > upper)):
        raise SpecError(
            f"{where}: field 'rest.{robot.joint_names[i]}' is {robot.q_rest[i]:g}; allowed: "
            f"{lower[i]:g} to {upper[i]:g}"
        )
    for i in np.flatnonzero(robot.criterion_weights <= 0):
        raise SpecError(
            f"{where}: field 'criterion.weights.{robot.joint_names[i]}' is "
            f"{robot.criterion_weights[i]:g}; allowed: above 0"
        )
    if not np.any(robot.tip_jacobian(robot.q_rest)[:, robot.arm_index]):
        raise SpecError(
            f"{where}: field 'arm.tip' is {robot.tip!r}, which no joint of the arm moves"
        )
    inertia = robot.dynamics(robot.q_rest, np.zeros(robot.nz)).M
    if not np.all(np.isfinite(inertia)) or np.linalg.eigvalsh(inertia)[0] <= 0:
        raise SpecError(
            f"{where}: the reduced inertia M is not positive definite at rest; check the <inertial> "
            f"elements of {robot.urdf.path}"
        )
    return robot
