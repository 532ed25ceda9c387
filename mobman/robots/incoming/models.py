"""Models of MuJoCo (MJCF, read by MuJoCo itself where it is installed) and of Pinocchio as URDFs."""

from __future__ import annotations

import importlib
import importlib.util
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.errors import MobmanError, SpecError, UsageError
from mobman.isolation import helper
from mobman.robots.urdf.compose import add_dynamics, add_inertial, add_shape, place_joint, text_of
from mobman.robots.urdf.validate import listed

_SECONDS, _MEGABYTES = 60.0, 2000.0
_NONE = 1e-9
_BASES = ("JointModelFreeFlyer", "JointModelPlanar")


def urdf_of_mjcf(content: bytes, path: Path) -> tuple[str, list[str], dict[str, bytes]]:
    """The URDF of an MJCF file, what of it a URDF cannot hold, and the meshes that it names; UsageError
    if MuJoCo is not installed, SpecError if it refuses the file, or there is no robot or several."""
    if importlib.util.find_spec("mujoco") is None:
        raise UsageError(
            f"{path} is an MJCF file, which MuJoCo reads; install it: pip install 'mobman[mujoco]'"
        )
    if not path.is_file() or path.read_bytes() != content:
        raise SpecError("MJCF cannot be read from a pipe, since it includes files; name the file")
    try:
        text, said, meshes = helper.call(
            f"{__name__}:convert", str(path), seconds=_SECONDS, megabytes=_MEGABYTES
        )
    except MobmanError as error:
        raise SpecError(f"the MJCF file {path} cannot be taken: {error}") from error
    return text, said, meshes


def convert(path: str) -> list[Any]:
    """Do the work of :func:`urdf_of_mjcf` in this process."""
    mujoco: Any = importlib.import_module("mujoco")
    try:
        model = mujoco.MjModel.from_xml_path(path)
    except ValueError as error:
        raise MobmanError(" ".join(str(error).split())) from error
    made = _Conversion(mujoco, model, Path(path).stem)
    return [ET.tostring(made.robot, encoding="unicode"), made.said, made.meshes]


class _Conversion:
    """A URDF that grows from a model's bodies.

    MuJoCo gives a body several joints, each at a point of the body; a URDF gives every joint a link. The
    frame of a body's link is where its last joint is, and links without mass stand between the joints.
    """

    def __init__(self, mujoco: Any, model: Any, name: str) -> None:
        self._mujoco, self._model = mujoco, model
        self.robot = ET.Element("robot", name=name)
        self.said: list[str] = []
        self.meshes: dict[str, bytes] = {}
        self._links: dict[str, ET.Element] = {}
        self._at: dict[int, tuple[str, Array]] = {}  # link of a body; its frame in the body's (m)
        self._left_out: dict[str, list[str]] = {}
        roots = [b for b in range(1, model.nbody) if model.body_parentid[b] == 0]
        moving = [b for b in roots if any(self._hinges(k) for k in self._tree(b))]
        if len(moving) != 1:
            named = (
                listed(self._name("body", b) for b in moving) or "no body has a hinge or a slide"
            )
            raise MobmanError(f"it has {len(moving)} robots ({named}); allowed: one")
        root, bodies = moving[0], list(self._tree(moving[0]))
        if self._joints(root) and not self._free(root):
            self._link("world")
            self._at[0] = ("world", np.zeros(3))
        for body in bodies:
            self._add_body(body, body == root)
        if others := [self._name("body", b) for b in roots if b != root]:
            self.said.append(f"left out, since they are no part of the robot: {listed(others)}")
        self._add_couplings({j for b in bodies for j in self._joints(b)})
        self.said += [
            f"a URDF has no {what}: {listed(who)}" for what, who in self._left_out.items()
        ]
        for what, count in (("tendons", model.ntendon), ("flexible bodies", model.nflex)):
            if count:
                self.said.append(f"a URDF has no {what}: {count} are left out")

    # Bodies and joints ----------------------------------------------------------------------------

    def _tree(self, body: int) -> Iterator[int]:
        yield body
        for other in range(body + 1, self._model.nbody):
            if self._model.body_parentid[other] == body:
                yield from self._tree(other)

    def _joints(self, body: int) -> list[int]:
        start, count = self._model.body_jntadr[body], self._model.body_jntnum[body]
        return list(range(start, start + count)) if count else []

    def _free(self, body: int) -> bool:
        return any(self._is("jnt", j, "mjtJoint.mjJNT_FREE") for j in self._joints(body))

    def _hinges(self, body: int) -> list[int]:
        kinds = ("mjtJoint.mjJNT_HINGE", "mjtJoint.mjJNT_SLIDE")
        return [j for j in self._joints(body) if self._is("jnt", j, *kinds)]

    def _is(self, of: str, index: int, *kinds: str) -> bool:
        """True if a joint (``jnt``), shape (``geom``), ... is of one of these kinds of MuJoCo's."""
        kind = getattr(self._model, f"{of}_type")[index]
        return any(kind == int(attrgetter(name)(self._mujoco)) for name in kinds)

    def _name(self, kind: str, index: int) -> str:
        of = getattr(self._mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
        return self._mujoco.mj_id2name(self._model, of, index) or f"{kind}{index}"

    def _leave_out(self, what: str, kind: str, index: int) -> None:
        self._left_out.setdefault(what, []).append(self._name(kind, index))

    def _link(self, name: str) -> str:
        while name in self._links:
            name += "_"
        self._links[name] = ET.SubElement(self.robot, "link", name=name)
        return name

    def _add_body(self, body: int, root: bool) -> None:
        model, name, hinges = self._model, self._name("body", body), self._hinges(body)
        free = root and self._free(body)
        for joint in set(self._joints(body)) - set(hinges):
            if not free:
                self._leave_out("ball joint (held)", "joint", joint)
        if free:
            self.said.append("the free joint of the base is left out: the platform takes its place")
        if root and not hinges:
            link, frame = self._link(name), np.zeros(3)
        else:
            link, frame = self._chain(body, name, hinges)
        self._at[body], element = (link, frame), self._links[link]
        if model.body_mass[body] > 0.0:
            at = _pose(model.body_ipos[body] - frame, model.body_iquat[body])
            moments = np.diag(model.body_inertia[body])
            add_inertial(element, model.body_mass[body], at, moments)
        start, count = model.body_geomadr[body], model.body_geomnum[body]
        for geom in range(start, start + count) if count else ():
            self._add_geom(element, geom, frame)
        for site in np.flatnonzero(model.site_bodyid == body).tolist():
            at = _pose(model.site_pos[site] - frame, model.site_quat[site])
            own = self._link(self._name("site", site))
            place_joint(self.robot, f"{own}_fixed", "fixed", link, own, at)

    def _chain(self, body: int, name: str, hinges: Sequence[int]) -> tuple[str, Array]:
        """Links and joints from a body's parent to the body."""
        model, frame = self._model, np.zeros(3)
        link, offset = self._at[int(model.body_parentid[body])]
        place = _pose(model.body_pos[body] - offset, model.body_quat[body])
        for joint in hinges:
            own, at = self._name("joint", joint), np.array(model.jnt_pos[joint])
            child = self._link(name if joint == hinges[-1] else f"{name}__{own}")
            kind = "revolute" if model.jnt_limited[joint] else "continuous"
            if self._is("jnt", joint, "mjtJoint.mjJNT_SLIDE"):
                kind = "prismatic"
            element = place_joint(self.robot, own, kind, link, child, place * _pose(at - frame))
            self._add_motion(element, joint)
            link, frame, place = child, at, pin.SE3.Identity()
        if not hinges:
            child = self._link(name)
            place_joint(self.robot, f"{child}_fixed", "fixed", link, child, place)
            link = child
        return link, frame

    def _add_motion(self, element: ET.Element, joint: int) -> None:
        model, dof = self._model, int(self._model.jnt_dofadr[joint])
        ET.SubElement(element, "axis", xyz=text_of(model.jnt_axis[joint]))
        limit = {"effort": repr(self._effort(joint)), "velocity": "inf"}
        if element.get("type") != "continuous":
            bounds = np.array([-np.inf, np.inf])
            if model.jnt_limited[joint]:
                # the pose of the file, a URDF's zero, is where MuJoCo has qpos0
                bounds = model.jnt_range[joint] - model.qpos0[model.jnt_qposadr[joint]]
            limit |= {"lower": repr(float(bounds[0])), "upper": repr(float(bounds[1]))}
        ET.SubElement(element, "limit", limit)
        damping = float(np.ravel(model.dof_damping[dof])[0])
        add_dynamics(element, damping, float(model.dof_frictionloss[dof]))
        if model.dof_armature[dof] > 0.0:
            self._leave_out("armature (inertia of a motor)", "joint", joint)
        if float(np.ravel(model.jnt_stiffness[joint])[0]) > 0.0:
            self._leave_out("spring", "joint", joint)

    def _effort(self, joint: int) -> float:
        """The largest torque of a joint's motors; inf if nothing limits it."""
        model, mujoco = self._model, self._mujoco
        limits = []
        if model.jnt_actfrclimited[joint]:
            limits.append(float(np.abs(model.jnt_actfrcrange[joint]).max()))
        own = model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)
        for motor in np.flatnonzero(own & (model.actuator_trnid[:, 0] == joint)):
            gear = abs(float(model.actuator_gear[motor, 0]))
            fixed = model.actuator_gaintype[motor] == int(mujoco.mjtGain.mjGAIN_FIXED)
            plain = model.actuator_biastype[motor] == int(mujoco.mjtBias.mjBIAS_NONE)
            if model.actuator_forcelimited[motor]:
                limits.append(gear * float(np.abs(model.actuator_forcerange[motor]).max()))
            elif model.actuator_ctrllimited[motor] and fixed and plain:
                gain = abs(float(model.actuator_gainprm[motor, 0]))
                limits.append(gear * gain * float(np.abs(model.actuator_ctrlrange[motor]).max()))
        return min(limits, default=np.inf)

    # Shapes and couplings --------------------------------------------------------------------------

    def _add_geom(self, link: ET.Element, geom: int, frame: Array) -> None:
        model = self._model
        seen = not (model.geom_contype[geom] or model.geom_conaffinity[geom])
        place = _pose(model.geom_pos[geom] - frame, model.geom_quat[geom])
        size = [float(s) for s in model.geom_size[geom]]
        tube = {"radius": repr(size[0]), "length": repr(2.0 * size[1])}
        for kind, own in (
            ("box", {"size": text_of([2.0 * s for s in size])}),
            ("sphere", {"radius": repr(size[0])}),
            ("cylinder", tube),
            ("capsule", tube),
            ("mesh", {}),
        ):
            if self._is("geom", geom, f"mjtGeom.mjGEOM_{kind.upper()}"):
                own = own or {"filename": self._mesh(int(model.geom_dataid[geom]))}
                add_shape(link, "visual" if seen else "collision", kind, own, place)
                return
        self._leave_out("ellipsoid, plane, height field or the like", "geom", geom)

    def _mesh(self, mesh: int) -> str:
        """The file of a mesh as MuJoCo has it, with its origin and scale, written as STL."""
        model = self._model
        clean = re.sub(r"[^A-Za-z0-9_.-]", "_", self._name("mesh", mesh))
        name = f"meshes/{mesh}_{clean}.stl"
        if name not in self.meshes:
            first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            vertices = np.asarray(model.mesh_vert[first : first + count], dtype="<f4")
            first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
            faces = vertices[np.asarray(model.mesh_face[first : first + count])]
            rows = np.zeros(len(faces), dtype=[("numbers", "<f4", (4, 3)), ("colour", "<u2")])
            rows["numbers"][:, 1:] = faces
            head = b"\0" * 80 + len(faces).to_bytes(4, "little")
            self.meshes[name] = head + rows.tobytes()
        return name

    def _add_couplings(self, own: set[int]) -> None:
        """Joints that follow others; what else is tied together is said."""
        model = self._model
        for i in range(model.neq):
            first, second = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
            offset, ratio, *curve = (float(x) for x in model.eq_data[i][:5])
            straight = self._is("eq", i, "mjtEq.mjEQ_JOINT") and max(map(abs, curve)) < _NONE
            if straight and {first, second} <= own:
                name = self._name("joint", first)
                joint = next(e for e in self.robot.iter("joint") if e.get("name") == name)
                law = {"multiplier": repr(ratio), "offset": repr(offset)}
                ET.SubElement(joint, "mimic", {"joint": self._name("joint", second), **law})
            else:
                what = "constraint between bodies, or joints that follow others by a curve"
                self._leave_out(what, "equality", i)


def _pose(position: Array, quaternion: Array | None = None) -> pin.SE3:
    rotation = np.eye(3)
    if quaternion is not None:
        w, x, y, z = (float(part) for part in quaternion)
        rotation = pin.Quaternion(w, x, y, z).normalized().toRotationMatrix()
    return pin.SE3(rotation, np.array(position, dtype=float))


# Pinocchio -------------------------------------------------------------------------------------------


def urdf_of_model(model: pin.Model) -> str:
    """The URDF of a model: its joints and links have the model's names.

    A joint's link is the first body frame at the joint, or else is named after it; the other body and
    operational frames are links that are fixed to it. A free-flyer or planar joint at the root is left
    out, since the platform takes its place.

    Raises:
        SpecError: If a joint is neither a revolute nor a prismatic one.
    """
    names = [str(name) for name in model.names]
    robot = ET.Element("robot", name=str(model.name) or "robot")
    links = _links(model, names)
    taken, data = set(links), model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    for name, inertia in zip(links, model.inertias, strict=True):
        link = ET.SubElement(robot, "link", name=name)
        if inertia.mass > 0.0:
            add_inertial(link, inertia.mass, pin.SE3(np.eye(3), inertia.lever), inertia.inertia)
    for i in range(1, model.njoints):
        parent, kind = int(model.parents[i]), model.joints[i].shortname()
        ends, place = (links[parent], links[i]), model.jointPlacements[i]
        if kind in _BASES and parent == 0:
            place_joint(robot, names[i], "fixed", *ends, place)
        else:
            column = pin.getJointJacobian(model, data, i, pin.ReferenceFrame.LOCAL)
            moves, axis = _motion(model, np.reshape(column, (6, -1))[:, model.joints[i].idx_v], i)
            joint = place_joint(robot, names[i], moves, *ends, place)
            _add_limits(joint, model, i, moves, axis)
    for frame in model.frames:
        own = str(frame.name)
        if frame.type in (pin.FrameType.BODY, pin.FrameType.OP_FRAME) and own not in taken:
            taken.add(own)
            ET.SubElement(robot, "link", name=own)
            at = links[int(frame.parentJoint)]
            place_joint(robot, f"{own}_fixed", "fixed", at, own, frame.placement)
    return ET.tostring(robot, encoding="unicode")


def _links(model: pin.Model, names: Sequence[str]) -> list[str]:
    """A link's name for each joint, the universe first."""
    found: list[str] = []
    bodies = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]
    for i, name in enumerate(names):
        at_joint = [
            str(frame.name)
            for frame in bodies
            if int(frame.parentJoint) == i
            and frame.placement.isIdentity(1e-12)
            and frame.name not in found
        ]
        own = at_joint[0] if at_joint else ("base" if i == 0 else f"{name}_link")
        while own in found:
            own += "_"
        found.append(own)
    return found


def _motion(model: pin.Model, column: Array, i: int) -> tuple[str, Array]:
    """The type of a joint in a URDF, and its axis, from its columns of the Jacobian in its own frame."""
    joint = model.joints[i]
    if joint.nv == 1:
        linear, angular = column[:3], column[3:]
        if not np.any(angular):
            return "prismatic", linear
        if not np.any(linear):
            return ("continuous" if joint.nq == 2 else "revolute"), angular
    raise SpecError(
        f"joint {model.names[i]!r} of the model is a {joint.shortname()}; allowed: revolute and "
        "prismatic joints, and a free-flyer or planar one at the root"
    )


def _add_limits(joint: ET.Element, model: pin.Model, i: int, kind: str, axis: Array) -> None:
    q, v = model.joints[i].idx_q, model.joints[i].idx_v
    ET.SubElement(joint, "axis", xyz=text_of(axis))
    limits = {"effort": model.effortLimit[v], "velocity": model.velocityLimit[v]}
    if kind != "continuous":
        limits |= {"lower": model.lowerPositionLimit[q], "upper": model.upperPositionLimit[q]}
    # what is as large as the largest numbers is no limit
    ends = {key: np.copysign(np.inf, x) if abs(x) > 1e15 else x for key, x in limits.items()}
    ET.SubElement(joint, "limit", {key: repr(float(value)) for key, value in ends.items()})
    add_dynamics(joint, float(model.damping[v]), float(model.friction[v]))
