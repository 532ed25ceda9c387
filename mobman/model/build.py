"""Build a :class:`MobileManipulator` from its description and URDF files."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from copy import deepcopy
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import SpecError, UnknownNameError
from mobman.model.mobile_manipulator import Geometry, MobileManipulator
from mobman.model.platforms.platform import Platform, Site, platforms
from mobman.robots.catalogue import as_spec, find_spec
from mobman.robots.spec import RobotSpec, UrdfSource
from mobman.robots.urdf.compose import LINK, Mounted, compose, flat_urdf
from mobman.robots.urdf.meshes import MeshError, absolute_meshes, read_triangles
from mobman.robots.urdf.read import UrdfFile, UrdfSources, urdf_sources
from mobman.robots.urdf.validate import too_large

_SHARE = 0.3  # of a direction of motion without inertia, in which a velocity is named


def load_robot(
    name_or_path: str | os.PathLike[str] | RobotSpec | Mapping[str, Any],
) -> MobileManipulator:
    """A robot by its name, its TOML file, or its description.

    Args:
        name_or_path: A name of :func:`list_robots`, the path of a TOML file, a :class:`RobotSpec`
            or a dictionary of its fields.

    >>> import mobman as mm
    >>> mm.load_robot("youbot")
    MobileManipulator('youbot', nq=8, nz=5, tip='tip')

    Raises:
        UnknownNameError: If no robot has the name.
        SpecError: If the description or its URDF is not valid; the message names file and field.
    """
    if isinstance(name_or_path, (RobotSpec, Mapping)):
        return build_robot(as_spec(name_or_path))
    return build_robot(find_spec(name_or_path))


def build_robot(spec: RobotSpec, sources: UrdfSources | None = None) -> MobileManipulator:
    """Build a robot from its specification.

    Args:
        spec: The description.
        sources: Its URDF files, where they are not those that it points at.

    Raises:
        SpecError: If a field does not fit the URDF.
    """
    where = spec.where
    sources = urdf_sources(spec) if sources is None else sources
    assembly = assemble(spec, sources)
    if fault := too_large(assembly.robot):
        raise SpecError(f"{where}: the robot with all that is mounted on it: {fault}")
    # where the wheels are says where the platform's frame is
    still = _parse(spec, flat_urdf(deepcopy(assembly.robot), where, base_joints=()))
    platform = platform_type(spec).build(Site(spec.platform.parameters, still, where, spec.folder))
    tree = _parse(spec, _flat(assembly.robot, where, platform))
    locked = _locked(spec, assembly, platform, tree)
    model = pin.buildReducedModel(tree, locked, _named_values(spec, tree, "rest", spec.rest))
    _give_back_names(model.frames)
    links = [str(link.get("name")) for link in assembly.robot.findall("link")]
    if spec.arm.tip not in links:
        raise SpecError(
            f"{where}: field 'arm.tip' is {spec.arm.tip!r}, which is no link of {sources}; its links: "
            f"{', '.join(links)}"
        )
    robot = MobileManipulator(
        spec=spec,
        urdf=sources,
        model=model,
        platform=platform,
        q_rest=_named_values(spec, model, "rest", spec.rest, known=list(tree.names)),
        criterion_weights=_criterion_weights(spec, platform, model, list(tree.names)),
        criterion_couplings=_criterion_couplings(spec, model),
    )
    return _checked(robot)


def load_geometry(robot: MobileManipulator) -> Geometry:
    """The robot's visual and collision geometry, in the frames of ``robot.model``.

    Raises:
        SpecError: If a mesh is missing or cannot be read.
    """
    spec, where = robot.spec, robot.spec.where
    assembly = assemble(spec, robot.urdf, with_meshes=True)
    try:
        for name in {str(mesh.get("filename")) for mesh in assembly.robot.iter("mesh")}:
            read_triangles(Path(name))  # elsewhere, since a damaged one may end the process
    except MeshError as error:
        raise SpecError(f"{where}: geometry of {robot.urdf}: {error}") from error
    xml = _flat(assembly.robot, where, robot.platform)
    tree = _parse(spec, xml)
    models = []
    for kind in (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION):
        try:
            models.append(pin.buildGeomFromUrdfString(tree, xml, kind))
        except (ValueError, RuntimeError) as error:
            raise SpecError(f"{where}: geometry of {robot.urdf}: {error}") from error
    _, reduced = pin.buildReducedModel(
        tree,
        models,
        _locked(spec, assembly, robot.platform, tree),
        _named_values(spec, tree, "rest", spec.rest),
    )
    for geometry in reduced:
        _give_back_names(geometry.geometryObjects)
    return Geometry(visual=reduced[0], collision=reduced[1])


class Assembly(NamedTuple):
    """The parts of a robot, mounted on each other."""

    robot: ET.Element
    """The ``<robot>`` element of all parts together."""
    locked: set[str]
    """Names of the joints that do not move."""


def assemble(spec: RobotSpec, sources: UrdfSources, with_meshes: bool = False) -> Assembly:
    """The platform's URDF with what is mounted on it.

    Args:
        spec: The description.
        sources: Its files.
        with_meshes: Whether meshes have absolute paths, and must be there.

    Raises:
        SpecError: If a file is no URDF that makes sense, the parts do not fit together, a pattern of
            ``lock`` matches nothing, a joint that follows another is not locked, or a mesh is missing.
    """
    where, files, locked = spec.where, list(sources.files), set[str]()
    if spec.urdf is None:
        platform = platform_type(spec).describe(spec.platform.parameters, where)
    elif "body" in spec.platform.parameters:
        raise SpecError(
            f"{where}: fields 'urdf' and 'platform.body' are both there; allowed: one of them"
        )
    else:
        field = f"{where}: field 'urdf"
        platform = _part(spec.urdf, files.pop(0), field, "", with_meshes, locked)
    mounted = []
    for i, (mount, file) in enumerate(zip(spec.mount, files, strict=True)):
        field = f"{where}: field 'mount[{i}]"
        part = _part(mount, file, field, mount.prefix, with_meshes, locked)
        mounted.append(Mounted(part, mount, field))
    robot = compose(platform, mounted)
    following = {name for name, joint in _movable(robot) if joint.find("mimic") is not None}
    if free := following - locked:
        raise SpecError(
            f"{where}: the joints {', '.join(sorted(free))} follow others (<mimic>), which a motor for "
            "each joint does not allow; lock them in field 'urdf.lock' (or that of the mount)"
        )
    return Assembly(robot, locked)


def _part(
    source: UrdfSource,
    file: UrdfFile,
    field: str,
    prefix: str,
    with_meshes: bool,
    locked: set[str],
) -> ET.Element:
    """A part's ``<robot>`` element; the joints that its source locks are added to ``locked``."""
    robot = file.parse()
    names = [name for name, _ in _movable(robot)]
    for pattern in source.lock:
        matching = {prefix + name for name in names if fnmatchcase(name, pattern)}
        if not matching:
            raise SpecError(
                f"{field}.lock': no movable joint matches {pattern!r}; the URDF has: "
                f"{', '.join(names)}"
            )
        locked |= matching
    if with_meshes:
        absolute_meshes(robot, file)
    return robot


def _movable(robot: ET.Element) -> list[tuple[str, ET.Element]]:
    """The joints that are not fixed, by name."""
    joints = robot.findall("joint")
    return [(str(one.get("name")), one) for one in joints if one.get("type") != "fixed"]


def platform_type(spec: RobotSpec) -> type[Platform]:
    """The platform's class.

    Raises:
        SpecError: If there is none of that name.
    """
    try:
        return platforms.get(spec.platform.type)
    except UnknownNameError as error:
        raise SpecError(f"{spec.where}: field 'platform.type': {error}") from error


def _give_back_names(named: Iterable[pin.Frame | pin.GeometryObject]) -> None:
    """Give frames or shapes the names that their links have in the URDF, see :data:`LINK`."""
    for one in named:
        one.name = one.name.removeprefix(LINK)


def _flat(robot: ET.Element, where: str, platform: Platform) -> str:
    return flat_urdf(robot, where, platform.root_offset, platform.heading, platform.base_joints)


def _parse(spec: RobotSpec, xml: str) -> pin.Model:
    try:
        return pin.buildModelFromXML(xml)
    except (ValueError, RuntimeError) as error:
        raise SpecError(f"{spec.where}: Pinocchio refuses the URDF: {error}") from error


def _locked(spec: RobotSpec, assembly: Assembly, platform: Platform, tree: pin.Model) -> list[int]:
    """Indices of the joints that the description locks."""
    if driven := assembly.locked & set(platform.coordinates):
        raise SpecError(
            f"{spec.where}: field 'urdf.lock' locks the platform's own {sorted(driven)}"
        )
    return [int(tree.getJointId(name)) for name in sorted(assembly.locked)]


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
                f"{spec.where}: field '{field}' names {name!r}, which is no movable joint; "
                f"allowed: {', '.join(model.names[1:])}"
            )
    return vector


def _criterion_weights(
    spec: RobotSpec, platform: Platform, model: pin.Model, known: list[str]
) -> Array:
    given = spec.criterion
    base = dict.fromkeys(platform.base_joints, given.platform)
    if given.wheels is not None:
        base |= {wheel.joint: given.wheels for wheel in platform.wheels}
    return _named_values(
        spec,
        model,
        "criterion.weights",
        {**base, **given.weights},
        default=given.default,
        known=known,
    )


def _criterion_couplings(spec: RobotSpec, model: pin.Model) -> Array:
    couplings = np.zeros((model.nq, model.nq))
    for i, coupling in enumerate(spec.criterion.couplings):
        field = f"criterion.couplings[{i}]"
        row = _named_values(spec, model, field, {coupling.joint: 1.0})
        row -= _named_values(spec, model, field, {coupling.to: coupling.ratio})
        couplings += coupling.weight * np.outer(row, row)
    return couplings


def _checked(robot: MobileManipulator) -> MobileManipulator:
    """The robot, if its numbers make sense.

    Raises:
        SpecError: If the rest posture is outside the limits, a weight is not positive, the arm has
            no joint, or the reduced inertia is not positive definite.
    """
    where = robot.spec.where
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
    with np.errstate(all="ignore"):  # what overflows is found by its result
        inertia = robot.reduced_inertia(robot.q_rest)
    if not np.all(np.isfinite(inertia)):
        raise SpecError(
            f"{where}: the reduced inertia M is not finite; check <inertial> in {robot.urdf}"
        )
    least, directions = np.linalg.eigh(inertia)
    if least[0] <= 0:
        worst = [
            robot.velocity_names[i]
            for i in np.argsort(-np.abs(directions[:, 0]))
            if abs(directions[i, 0]) > _SHARE
        ]
        raise SpecError(
            f"{where}: the reduced inertia M is not positive definite at rest: moving "
            f"{', '.join(worst)} meets no inertia; check mass and moments in the <inertial> elements of "
            f"the links behind, in {robot.urdf}"
        )
    return robot
