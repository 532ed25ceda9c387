"""Build a :class:`MobileManipulator` from its description and URDF files."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import SpecError, UnknownNameError, UsageError
from mobman.model.metric import heading_weight
from mobman.model.mobile_manipulator import Follower, Geometry, MobileManipulator
from mobman.model.platforms.platform import Platform, platforms
from mobman.model.platforms.wheels import Site
from mobman.robots.catalogue import as_spec, find_spec
from mobman.robots.incoming.incoming import keep_urdf
from mobman.robots.incoming.models import urdf_of_model
from mobman.robots.spec import RobotSpec, UrdfSource
from mobman.robots.urdf.compose import LINK, Mounted, compose, flat_urdf
from mobman.robots.urdf.meshes import Locate, MeshError, absolute_meshes, read_triangles
from mobman.robots.urdf.read import UrdfFile, UrdfSources, urdf_sources
from mobman.robots.urdf.shapes import scalar
from mobman.robots.urdf.validate import too_large

_FOLLOWING = 1e-9  # weight of coordinates that others determine: next to none
_SHARE = 0.3  # of a direction of motion without inertia, in which a velocity is named
_STILL = 1e-9  # rate of a joint for a unit of a velocity: rounding
_NEAR = 0.5  # rad or m from rest: states at which a platform's rates are compared with <mimic>
_DIGITS = 1e-3  # of a rate: what a URDF's ratio may be rounded to


def load_robot(
    name_or_path: str | os.PathLike[str] | RobotSpec | Mapping[str, Any] | pin.Model, **facts: Any
) -> MobileManipulator:
    """A robot by its name, its TOML file, its description, or its URDF.

    Args:
        name_or_path: A name of :func:`list_robots`, the path of a TOML file, a :class:`RobotSpec`
            or a dictionary of its fields; the path of a URDF (or a file of xacro or MJCF, a folder or
            an archive with one), or a ``pinocchio.Model``: what a TOML would say is inferred then, and
            said in a warning.
        facts: For a URDF and a model, what is not to be inferred: the fields of :class:`Options`, such
            as ``tip="tool0"``, ``right_wheels="wheel_r"``, ``wheel_radius=0.1``.

    >>> import mobman as mm
    >>> mm.load_robot("youbot")
    MobileManipulator('youbot', nq=8, nz=5, tip='tip')

    Raises:
        UnknownNameError: If no robot has the name.
        SpecError: If the description or its URDF is not valid; the message names file and field.
        UsageError: If a URDF or a model does not tell enough.
    """
    if isinstance(name_or_path, pin.Model):
        kept = keep_urdf("robot.urdf", urdf_of_model(name_or_path).encode())
        return build_robot(find_spec(kept, f"the model {name_or_path.name!r}", **facts))
    if facts and isinstance(name_or_path, (RobotSpec, Mapping)):
        raise UsageError(f"{', '.join(facts)}: only for a URDF or a model; change the description")
    if isinstance(name_or_path, (RobotSpec, Mapping)):
        return build_robot(as_spec(name_or_path))
    return build_robot(find_spec(name_or_path, **facts))


def build_robot(spec: RobotSpec, sources: UrdfSources | None = None) -> MobileManipulator:
    """Build a robot from its specification, and the URDF files that it points at or ``sources``;
    SpecError if a field does not fit the URDF."""
    where = spec.where
    sources = urdf_sources(spec) if sources is None else sources
    assembly = assemble(spec, sources)
    if fault := too_large(assembly.robot):
        raise SpecError(f"{where}: the robot with all that is mounted on it: {fault}")
    # before what is added there, and before links that share a joint's name get another
    links = [str(link.get("name")) for link in assembly.robot.findall("link")]
    platform = make_platform(spec, assembly, spec.platform.parameters)
    tree = _parse(spec, _flat(assembly.robot, where, platform))
    followers = _followers(spec, assembly, platform)
    model = pin.buildReducedModel(tree, *_locked(spec, assembly, platform, tree))
    _give_back_names(model.frames)
    if spec.arm.tip not in links:
        raise SpecError(
            f"{where}: field 'arm.tip' is {spec.arm.tip!r}, which is no link of {sources}; its links: "
            f"{', '.join(links)}"
        )
    known = list(tree.names)
    robot = MobileManipulator(
        spec=spec,
        urdf=sources,
        model=model,
        platform=platform,
        q_rest=_named_values(spec, model, "rest", spec.rest, known=known),
        criterion_weights=_criterion_weights(spec, platform, followers, model, known),
        criterion_couplings=_criterion_couplings(spec, model),
        followers=followers,
    )
    _make_rest_consistent(robot)
    _check_couplings(robot, assembly)
    _check(robot)
    given, base = spec.criterion, platform.base_joints
    if base and given.heading is None and base[-1] not in given.weights:
        robot.criterion_weights[robot.joint_names.index(base[-1])] = heading_weight(robot)
    return robot


def make_platform(
    spec: RobotSpec, assembly: Assembly, parameters: dict[str, Any], track: float = 1.0
) -> Platform:
    """A robot's platform from fields of ``[platform]``; where the wheels are says where its frame is,
    and ``track`` is a factor of their distances. SpecError if a field is wrong."""
    still = _parse(spec, flat_urdf(deepcopy(assembly.robot), spec.where, base_joints=()))
    site = Site(parameters, still, spec.where, spec.folder, track)
    platform = platform_type(spec).build(site)
    for i, name in enumerate(platform.coordinates):
        if name in platform.coordinates[:i]:
            raise SpecError(
                f"{spec.where}: [platform]: joint {name!r} is there twice; allowed: once"
            )
    return platform


def load_geometry(robot: MobileManipulator) -> Geometry:
    """The robot's visual and collision geometry, in the frames of ``robot.model``; SpecError if a mesh
    is missing or cannot be read."""
    spec, where = robot.spec, robot.spec.where
    assembly = assemble(spec, robot.urdf, absolute_meshes)
    try:
        for name in {str(mesh.get("filename")) for mesh in assembly.robot.iter("mesh")}:
            read_triangles(Path(name))  # elsewhere, since a damaged one may end the process
    except MeshError as error:
        raise SpecError(f"{where}: geometry of {robot.urdf}: {error}") from error
    xml = _flat(assembly.robot, where, robot.platform)
    tree = _parse(spec, xml)
    kinds = pin.GeometryType.VISUAL, pin.GeometryType.COLLISION
    try:
        models = [pin.buildGeomFromUrdfString(tree, xml, kind) for kind in kinds]
    except (ValueError, RuntimeError) as error:
        raise SpecError(f"{where}: geometry of {robot.urdf}: {error}") from error
    _, reduced = pin.buildReducedModel(tree, models, *_locked(spec, assembly, robot.platform, tree))
    for geometry in reduced:
        _give_back_names(geometry.geometryObjects)
    return Geometry(*reduced)


class Assembly(NamedTuple):
    """The parts of a robot, mounted on each other."""

    robot: ET.Element  # the <robot> element of all parts together
    locked: set[str]  # names of the joints that do not move
    rest: dict[str, float]
    """[rest], and where joints are held that follow one that does not move (m, rad)."""
    following: tuple[Follower, ...]  # joints that follow one that moves


def assemble(spec: RobotSpec, sources: UrdfSources, meshes: Locate = None) -> Assembly:
    """The platform's URDF with what is mounted on it, from the description's files; ``meshes`` finds the
    meshes of each. SpecError if a file is no URDF that makes sense, the parts do not fit together, a
    pattern of ``lock`` matches nothing, joints follow each other, or a mesh is missing."""
    where, files, locked = spec.where, list(sources.files), set[str]()
    if spec.urdf is None:
        platform = platform_type(spec).describe(spec.platform.parameters, where)
    elif "body" in spec.platform.parameters:
        raise SpecError(
            f"{where}: fields 'urdf' and 'platform.body' are both there; allowed: one of them"
        )
    else:
        field = f"{where}: field 'urdf"
        platform = _part(spec.urdf, files.pop(0), field, "", meshes, locked)
    mounted = []
    for i, (mount, file) in enumerate(zip(spec.mount, files, strict=True)):
        field = f"{where}: field 'mount[{i}]"
        part = _part(mount, file, field, mount.prefix, meshes, locked)
        mounted.append(Mounted(part, mount, field))
    robot = compose(platform, mounted)
    rest, following = dict(spec.rest), list[Follower]()
    movable = _movable(robot)
    for name in movable:
        one = _followed(name, movable, locked, where)
        if one is None:
            continue
        if one.of in movable and one.of not in locked:
            following.append(one)
        else:  # what it follows does not move
            at = spec.rest.get(one.of, 0.0) if one.of in movable else 0.0
            rest.setdefault(name, one.ratio * at + one.offset)
            locked.add(name)
    return Assembly(robot, locked, rest, tuple(following))


def _followed(
    name: str, movable: Mapping[str, ET.Element], locked: set[str], where: str
) -> Follower | None:
    """The joint that one follows at last, through those in between; None if it follows none."""
    ratio, offset, of, seen = 1.0, 0.0, name, [name]
    while of in movable and of not in locked and (law := movable[of].find("mimic")) is not None:
        offset += ratio * scalar(law, "offset")
        ratio *= scalar(law, "multiplier", 1.0)
        of = law.get("joint", "")
        if of in seen:
            raise SpecError(
                f"{where}: the joints {', '.join(seen)} follow each other in a circle (<mimic>); "
                "remove one of these elements"
            )
        seen.append(of)
    return None if of == name else Follower(name, of, ratio, offset)


def _followers(spec: RobotSpec, assembly: Assembly, platform: Platform) -> list[Follower]:
    """The joints that follow one of the arm; those of the platform follow by its own equations, see
    :func:`_check_couplings`."""
    own = set(platform.coordinates)
    for one in assembly.following:
        if one.of in own and one.joint not in own:
            raise SpecError(
                f"{spec.where}: joint {one.joint!r} follows {one.of!r} of the platform (<mimic>), which "
                "is not modelled; lock it in field 'urdf.lock' (or that of the mount)"
            )
        if one.joint in own and one.of not in own:
            raise SpecError(
                f"{spec.where}: joint {one.joint!r} of the platform follows {one.of!r}, which is none "
                "of its joints (<mimic>): no platform type has that; remove <mimic> if it has a motor "
                "of its own, or name other joints in [platform]"
            )
    return [one for one in assembly.following if one.joint not in own]


def not_coupled(robot: MobileManipulator, following: Iterable[Follower], at: Array) -> list[str]:
    """Sentences about joints of the platform that follow another one by the URDF, and whose rates at a
    consistent q, shape (nq,), are not those that ``<mimic>`` asks for."""
    rates, said = robot.velocity_map(at), list[str]()
    own, rolling = set(robot.platform.coordinates), {w.joint for w in robot.platform.wheels}
    for one in (one for one in following if one.joint in own and one.of in own):
        i, j = robot.joint_names.index(one.joint), robot.joint_names.index(one.of)
        law = f"joint {one.joint!r} follows {one.of!r} at {one.ratio:g} of its rate (<mimic>)"
        size = max(float(np.abs(rates[[i, j]]).max()), np.finfo(float).tiny)
        gap = np.abs(rates[i] - one.ratio * rates[j])
        column = int(np.argmax(gap))
        if gap[column] > _DIGITS * size:
            said.append(
                f"{law}, but on a {robot.spec.platform.type} platform {robot.velocity_names[column]} "
                f"moves them at {rates[i, column]:.4g} and {rates[j, column]:.4g}"
            )
        elif one.joint not in rolling and abs(at[i] - one.ratio * at[j] - one.offset) > _DIGITS:
            said.append(
                f"{law} from {one.offset:g} on, but on a {robot.spec.platform.type} platform it is at "
                f"{at[i]:.4g} where that is at {at[j]:.4g}"
            )
    return said


def _check_couplings(robot: MobileManipulator, assembly: Assembly) -> None:
    """Refuse joints of the platform that follow each other otherwise than its equations have it."""
    own, random = set(robot.platform.coordinates), np.random.default_rng(0)
    if own.isdisjoint(one.joint for one in assembly.following):
        return
    lower, upper = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    for scale in (0.0, _NEAR, _NEAR):
        q = robot.q_rest + scale * random.uniform(-1.0, 1.0, robot.nq)
        try:
            q = robot.consistent(np.clip(q, lower, upper))
        except UsageError:
            continue  # no state: its coordinates do not tell the others
        if said := not_coupled(robot, assembly.following, q):
            raise SpecError(
                f"{robot.spec.where}: {'; '.join(said)}; remove <mimic> where each has a motor of its "
                "own, choose a 'platform.type' that has this coupling, or lock what is steered in "
                "field 'urdf.lock'"
            )


def _part(
    source: UrdfSource, file: UrdfFile, field: str, prefix: str, meshes: Locate, locked: set[str]
) -> ET.Element:
    """A part's ``<robot>`` element; the joints that its source locks are added to ``locked``."""
    robot = file.parse()
    names = list(_movable(robot))
    for pattern in source.lock:
        matching = {prefix + name for name in names if fnmatchcase(name, pattern)}
        if not matching:
            raise SpecError(
                f"{field}.lock': no movable joint matches {pattern!r}; the URDF has: "
                f"{', '.join(names)}"
            )
        locked |= matching
    if meshes is not None:
        meshes(robot, file)
    return robot


def _movable(robot: ET.Element) -> dict[str, ET.Element]:
    """The joints that are not fixed, by name."""
    joints = robot.findall("joint")
    return {str(one.get("name")): one for one in joints if one.get("type") != "fixed"}


def platform_type(spec: RobotSpec) -> type[Platform]:
    """The platform's class; SpecError if there is none of that name."""
    try:
        return platforms.get(spec.platform.type)
    except UnknownNameError as error:
        raise SpecError(f"{spec.where}: field 'platform.type': {error}") from error


def _give_back_names(named: Iterable[pin.Frame | pin.GeometryObject]) -> None:
    """Give frames or shapes the names that their links have in the URDF, see :data:`LINK`."""
    for one in named:
        one.name = one.name.removeprefix(LINK)


def _flat(robot: ET.Element, where: str, platform: Platform) -> str:
    joints = platform.base_joints, platform.virtual_joints
    return flat_urdf(robot, where, platform.root_offset, platform.heading, *joints)


def _parse(spec: RobotSpec, xml: str) -> pin.Model:
    try:
        return pin.buildModelFromXML(xml)
    except (ValueError, RuntimeError) as error:
        raise SpecError(f"{spec.where}: Pinocchio refuses the URDF: {error}") from error


def _locked(
    spec: RobotSpec, assembly: Assembly, platform: Platform, tree: pin.Model
) -> tuple[list[int], Array]:
    """Indices of the joints that the description locks, and q with where they are held."""
    if driven := assembly.locked & set(platform.coordinates):
        raise SpecError(
            f"{spec.where}: field 'urdf.lock' locks the platform's own {sorted(driven)}"
        )
    locked = [int(tree.getJointId(name)) for name in sorted(assembly.locked)]
    return locked, _named_values(spec, tree, "rest", assembly.rest)


def _named_values(
    spec: RobotSpec,
    model: pin.Model,
    field: str,
    values: Mapping[str, float],
    default: float = 0.0,
    known: Sequence[str] = (),
) -> Array:
    """A vector over q from values by joint name; names in ``known`` may be absent from the model."""
    vector = np.full(model.nq, default)
    for name, value in values.items():
        if model.existJointName(name):
            vector[model.joints[model.getJointId(name)].idx_q] = value
        elif name not in known:
            raise SpecError(
                f"{spec.where}: field '{field}' names {name!r}, which is no movable joint; "
                f"allowed: {', '.join(model.names[1:])}"
            )
    return vector


def _criterion_weights(
    spec: RobotSpec,
    platform: Platform,
    followers: list[Follower],
    model: pin.Model,
    known: list[str],
) -> Array:
    given = spec.criterion
    base = dict.fromkeys(platform.base_joints, given.platform)
    if given.heading is not None and platform.base_joints:
        base[platform.base_joints[-1]] = given.heading
    following = (*platform.following, *(one.joint for one in followers))
    base |= dict.fromkeys(following, _FOLLOWING)
    if given.wheels is not None:
        base |= {wheel.joint: given.wheels for wheel in platform.wheels}
    weights = {**base, **given.weights}
    return _named_values(spec, model, "criterion.weights", weights, given.default, known)


def _criterion_couplings(spec: RobotSpec, model: pin.Model) -> Array:
    couplings = np.zeros((model.nq, model.nq))
    for i, coupling in enumerate(spec.criterion.couplings):
        field = f"criterion.couplings[{i}]"
        row = _named_values(spec, model, field, {coupling.joint: 1.0})
        row -= _named_values(spec, model, field, {coupling.to: coupling.ratio})
        couplings += coupling.weight * np.outer(row, row)
    return couplings


def _make_rest_consistent(robot: MobileManipulator) -> None:
    """Set what [rest] leaves out as the other coordinates make it, or refuse what it says."""
    try:
        robot.q_rest = robot.consistent(robot.q_rest)
        given = robot.q_rest.copy()
        for name in robot.spec.rest.keys() & set(robot.joint_names):
            given[robot.joint_names.index(name)] = robot.spec.rest[name]
        robot.checked_configuration(given)
    except UsageError as error:
        text = str(error).removeprefix("q0: ")
        raise SpecError(f"{robot.spec.where}: [rest]: {text}") from error


def _check(robot: MobileManipulator) -> None:
    """Refuse a rest posture outside the limits, weights that are not positive, an arm without joints,
    and a reduced inertia that is not positive definite."""
    where = robot.spec.where
    if robot.n == 0:
        raise SpecError(f"{where}: no joint is left for the arm; see field 'urdf.lock'")
    if robot.nq < 2:
        raise SpecError(
            f"{where}: {robot.joint_names[0]!r} is its only joint; needed: two or more, since a task of "
            "the tip has two coordinates or more"
        )
    lower, upper = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    followed = {one.joint: f" (it follows {one.of!r})" for one in robot.followers}
    for i in np.flatnonzero((robot.q_rest < lower) | (robot.q_rest > upper)):
        name = robot.joint_names[i]
        raise SpecError(
            f"{where}: field 'rest.{name}' is {robot.q_rest[i]:g}{followed.get(name, '')}; allowed: "
            f"{lower[i]:g} to {upper[i]:g}"
        )
    for i in np.flatnonzero(robot.criterion_weights <= 0):
        raise SpecError(
            f"{where}: field 'criterion.weights.{robot.joint_names[i]}' is "
            f"{robot.criterion_weights[i]:g}; allowed: above 0"
        )
    if not np.any(robot.tip_jacobian(robot.q_rest)[:, robot.arm.joints]):
        raise SpecError(
            f"{where}: field 'arm.tip' is {robot.tip!r}, which no joint of the arm moves"
        )
    own, virtual = robot.platform.following, robot.platform.virtual_joints
    joints = [i for i, name in enumerate(robot.joint_names) if name not in virtual]
    fastest = np.abs(robot.velocity_map(robot.q_rest)[joints]).max(axis=0)
    for i in np.flatnonzero(fastest <= _STILL) if virtual else ():
        raise SpecError(
            f"{where}: the platform is singular at rest: {robot.velocity_names[i]} turns none of its "
            f"joints, since the steering axes ({', '.join(own)}) are in one line across the direction "
            "of travel: turn 'platform.heading' (--heading) by a quarter, so that it drives along that "
            f"line, rest it in another direction by 'rest.{virtual[0]}', or take another platform type"
        )
    with np.errstate(all="ignore"):  # what overflows is found by its result
        inertia = robot.reduced_inertia(robot.q_rest)
    if not np.all(np.isfinite(inertia)):
        raise SpecError(
            f"{where}: the reduced inertia M is not finite; check <inertial> in {robot.urdf}"
        )
    least, directions = np.linalg.eigh(inertia)
    if least[0] <= 0:
        share = np.abs(directions[:, 0])
        worst = [robot.velocity_names[i] for i in np.argsort(-share) if share[i] > _SHARE]
        raise SpecError(
            f"{where}: the reduced inertia M is not positive definite at rest: moving "
            f"{', '.join(worst)} meets no inertia; check mass and moments in the <inertial> elements of "
            f"the links behind, in {robot.urdf}"
        )
