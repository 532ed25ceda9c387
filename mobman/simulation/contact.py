"""The robot on wheels that touch the ground, by MuJoCo: they may slip, lift off, and be compressed."""

from __future__ import annotations

import importlib
import importlib.util
import math
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from mobman.arrays import Array
from mobman.compiled import sequence
from mobman.errors import SpecError, UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation import mjcf
from mobman.simulation.mjcf import BASE, LEAST_FRICTION, TIP
from mobman.simulation.pieces import Setting
from mobman.simulation.plant import MakePlant, Plant, plants
from mobman.simulation.sensors import pose_index

_LESSER = 1e-4  # weight of the rates that tell of z only what the others leave open
_RUNAWAY = 1e5  # rad/s, m/s, and a thousandth of the accelerations: beyond it nothing is integrated
_SETTLED, _MOST_SETTLING = 1e-9, 20_000  # m/s, rad/s; steps
_HELD = 1e9  # kg m^2, kg: added to the joints while the tyres take the load
_SERVO = 200.0  # rad/s, of the drives that keep modules at their angles


@plants.register("mujoco")
class MuJoCo(mjcf.Ground):
    """The robot as a MuJoCo model whose wheels roll by friction, on springs and dampers.

    q is the measured pose, the wheels' and the joints' angles; z is what of the motion the platform's
    C can express, by least squares. What the constraints forbid is not impossible here: it is slip,
    which is recorded, as are forces and what lifts off.
    """

    def start(self, setting: Setting) -> MakePlant:
        """See :class:`Piece`; UsageError if MuJoCo is not installed."""
        if importlib.util.find_spec("mujoco") is None:
            raise UsageError(
                "the plant 'mujoco' needs MuJoCo; install it: pip install 'mobman[mujoco]'"
            )
        return partial(ContactPlant, self)


class Recorded(NamedTuple):
    """Records of the ground at a tick, of the step before: by wheel the normal force (N), friction (N),
    speed over the ground of the point that touches it, where friction acts (m/s), and the gap (m);
    height (m), roll, pitch (rad) of the platform's frame; the tip, tilted and sunk with it (m)."""

    normal: Array
    friction: Array
    slip: Array
    lift: Array
    base: Array
    tip: Array


class ContactPlant(Plant):
    """The plant on the ground; see :class:`MuJoCo` and :class:`Plant`.

    It is the state as well, with the interface of :class:`mobman.simulation.integrator.RungeKutta`,
    once :meth:`own_state` put it where a run starts.

    Attributes:
        recorded: What :meth:`look` found of the ground.
        h: Length of the next step (s), shape (1,).
        work: Integral of z^T (B v - D) since the start (J), shape (1,).

    Raises:
        SpecError: If the scenario has slip of its own, or the platform is none that can stand.
    """

    def __init__(self, given: MuJoCo, robot: MobileManipulator, *parts: Any) -> None:
        super().__init__(robot, *parts)
        if self._slip:
            raise SpecError(
                "field 'slip' is for the ideal plant: wheels in contact slip by themselves"
            )
        self._pose = pose_index(robot)
        self.slips, self.q_dot = bool(self._pose), np.zeros(robot.nq)
        self._mj, self._given = importlib.import_module("mujoco"), given
        self._feet = mjcf.feet_of(robot, given.scrub)
        self._wheels = [foot for foot in self._feet if foot.friction]
        n = len(self._wheels)
        sizes = (n, n, n, n, 3, 3)
        self.recorded = Recorded(*map(np.zeros, sizes))
        self.h, self.work = np.zeros(1), np.zeros(1)

    @cached_property
    def motion(self) -> Callable[[], int]:
        """See :class:`Plant`: q' is there."""
        return sequence()

    def accelerations(self, z_dot: Array) -> list[Callable[[], Any]]:
        """See :class:`Plant`: the mean z' over the last step."""
        return [self.look, partial(np.copyto, z_dot, self._z_dot)]

    def longest_step(self, h: float) -> float:
        """See :class:`Plant`."""
        return min(super().longest_step(h), self._given.step)

    def signals(self) -> dict[str, Array]:
        """See :class:`Plant`."""
        recorded = self.recorded._asdict() if self._feet else {}
        return {f"contact/{name}": value for name, value in recorded.items() if len(value)}

    def own_state(self, q: Array, h: float) -> ContactPlant:
        """See :class:`Plant`: itself, at rest on its tyres."""
        robot, given, now = self.robot, self._given, self.now
        self.h[0] = h
        start = q[self._pose] if self._pose else np.zeros(3)
        self._patches = [
            (
                mjcf.spot(start, one.ahead, one.left),
                one.radius**2,
                max(one.friction, LEAST_FRICTION),
            )
            for one in given.patches
        ]
        down = -math.sin(given.slope) * np.array([math.cos(given.uphill), math.sin(given.uphill)])
        g = float(np.linalg.norm(robot.model.gravity.linear))
        gravity = g * np.array([*down, -math.cos(given.slope)])
        xml = mjcf.mjcf(robot, self._feet, given, min(h, given.step), gravity, start)
        self._model, self._data = mjcf.make_model(robot, xml)
        if self._feet:
            mjcf.set_tyres(self._model, pin.computeTotalMass(robot.model), self._feet, given)
        self._index()
        now.q[:], now.z[:] = q, 0.0
        parts = self.resistances()
        self._resist = sequence(now.run_jacobians, now.inertia, *parts) if parts else None
        self._settle(q)
        self._measure()
        return self

    def _index(self) -> None:
        """Indices of q's coordinates in MuJoCo's, and of the rates that tell alpha."""
        robot, platform, model = self.robot, self.robot.platform, self._model
        places = robot.joint_names.index
        self._virtual = [places(name) for name in platform.virtual_joints]
        self._following = [places(name) for name in platform.following]
        told_not = {*self._pose, *self._virtual}
        own = [i for i in range(robot.nq) if i not in told_not]
        joints = [model.joint(robot.joint_names[i]) for i in own]
        self._own = np.array(own, dtype=int)
        self._at = np.array([joint.qposadr[0] for joint in joints], dtype=int)
        self._dof = np.array([joint.dofadr[0] for joint in joints], dtype=int)
        if self._pose:
            base = model.joint(BASE)
            self._base_at, self._base_dof = int(base.qposadr[0]), int(base.dofadr[0])
            self._base_body = int(model.body(BASE).id)
        self._tip = int(model.site(TIP).id)
        self._geoms = [model.geom(foot.name).id for foot in self._wheels]
        self._number = {geom: i for i, geom in enumerate(self._geoms)}
        self._edited = bool(self._patches) or any(foot.directed for foot in self._wheels)
        at = dict(zip(own, self._dof.tolist(), strict=True))
        self._modules = [(i, at[i], 1.0 / model.dof_invweight0[at[i]]) for i in self._following]
        others = [i for i in robot.platform_index if i not in told_not]
        by_pose = self._given.velocity == "pose" or not others
        first, second = (self._pose, others) if by_pose else (others, self._pose)
        self._told = np.array([*first, *second], dtype=int)
        self._weights = np.array([1.0] * len(first) + [_LESSER] * len(second))

    def _settle(self, q: Array) -> None:
        """Put the robot where q says and let it sink until the tyres carry it, its joints held."""
        model, data = self._model, self._data
        data.qpos[self._at] = q[self._own]
        if not self._pose:
            return
        at, dof = self._base_at, self._base_dof
        x, y, theta = q[self._pose]
        data.qpos[at : at + 7] = x, y, 0.0, math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2)
        held = [*self._dof, dof, dof + 1, dof + 5]
        armature, edited = model.dof_armature.copy(), self._edited
        model.dof_armature[held], self._edited = _HELD, False
        for count in range(_MOST_SETTLING):
            self._integrate(np.zeros(model.nv))
            data.qvel[held] = 0.0
            if count > 10 and np.abs(data.qvel).max() < _SETTLED:
                break
        data.qpos[self._at], data.qpos[at : at + 2] = q[self._own], (x, y)
        model.dof_armature[:], self._edited = armature, edited
        data.qvel[:] = data.qacc_warmstart[:] = data.time = 0.0
        if np.abs(data.qpos[at + 4 : at + 6]).max() > 0.25:
            raise SpecError(
                f"robot {self.robot.name!r} falls over where it starts: its centre of mass is not "
                "between its wheels"
            )
        self._mj.mj_fwdPosition(model, data)

    # Steps ---------------------------------------------------------------------------------------

    def evaluate(self, t: float) -> None:
        """See :class:`RungeKutta`: nothing is to be done before a step."""

    def step(self, t: float) -> None:
        """Go on from t to t + h under the plant's torque; q is NaN from where the state runs away."""
        if np.isnan(self.now.q[0]):
            return
        self.disturb(t)
        try:
            within = self._advance(float(self.h[0]))
        except UsageError:  # no angles of the steering belong to the state any more
            within = False
        if not within:
            self.now.q[:] = np.nan

    def _advance(self, h: float) -> bool:
        """A step of h; False, and none, where the state runs away."""
        data, now = self._data, self.now
        self._model.opt.timestep = h
        if self._resist is not None:
            self._resist()
        force = self._generalised(self.v + self.forces.d)
        if not (
            np.abs(data.qvel).max(initial=0.0) < _RUNAWAY
            and np.abs(force).max(initial=0.0) < 1e3 * _RUNAWAY
        ):
            return False
        before, power = now.z.copy(), float(force @ data.qvel)
        self._integrate(force)
        self.work[0] += 0.5 * h * (power + float(force @ data.qvel))
        self._measure()
        self._z_dot[:] = (now.z - before) / h
        return True

    def _generalised(self, total: Array) -> Array:
        """Forces on MuJoCo's degrees of freedom from those on the motors' axes."""
        robot, now, data = self.robot, self.now, self._data
        force, of_q = np.zeros(self._model.nv), np.zeros(robot.nq)
        of_q[robot.platform_index] = now.platform_B @ total[: robot.n_alpha]
        of_q[robot.arm_index] = total[robot.n_alpha :]
        if self._virtual:
            # drives keep the modules at the angles which the others ask for: the constraint of the
            # model that no ground enforces
            wanted, rates = robot.consistent(now.q), now.C @ now.z
            for i, dof, inertia in self._modules:
                away, faster = wanted[i] - now.q[i], rates[i] - data.qvel[dof]
                of_q[i] += inertia * _SERVO * (_SERVO * away + 2.0 * faster)
        force[self._dof] = of_q[self._own]
        if self._pose:
            x, y, theta = self._pose
            dof, rows = self._base_dof, data.xmat[self._base_body].reshape(3, 3)
            force[dof], force[dof + 1] = of_q[x], of_q[y]
            force[dof + 3 : dof + 6] = of_q[theta] * rows[2]
        return force

    def _integrate(self, force: Array) -> None:
        """A step of MuJoCo; as mj_step, but that contacts may be changed before they act, and that
        nothing is reset or printed where a state runs away."""
        mj, model, data = self._mj, self._model, self._data
        data.qfrc_applied[:] = force
        mj.mj_fwdPosition(model, data)
        if self._edited and data.ncon:
            self._edit()
            mj.mj_makeConstraint(model, data)
            mj.mj_projectConstraint(model, data)
        mj.mj_fwdVelocity(model, data)
        mj.mj_fwdActuation(model, data)
        mj.mj_fwdAcceleration(model, data)
        mj.mj_fwdConstraint(model, data)
        mj.mj_Euler(model, data)

    def _edit(self) -> None:
        """Turn the contacts of rollers to these, and change the friction on patches."""
        contacts = self._data.contact
        # of all contacts at once: each one's own object takes MuJoCo longer than its step
        frames, friction, places = contacts.frame, contacts.friction, contacts.pos
        for row, geom in enumerate(contacts.geom2.tolist()):
            i = self._number.get(geom)
            if i is None:
                continue
            if self._wheels[i].directed:
                normal, along = frames[row, :3], self._direction(i)
                along -= (along @ normal) * normal
                along /= math.sqrt(along @ along)
                (a, b, c), (x, y, z) = normal.tolist(), along.tolist()
                frames[row, 3:6] = along
                frames[row, 6:9] = b * z - c * y, c * x - a * z, a * y - b * x
            for centre, square, grip in self._patches:
                away = places[row, :2] - centre
                if away @ away < square:
                    across = friction[row, 1] / friction[row, 0]
                    friction[row, :2] = grip, max(across * grip, LEAST_FRICTION)
                    break

    def _direction(self, i: int) -> Array:
        """The direction in which a foot with rollers has friction, in world axes."""
        foot, body = self._wheels[i], self._model.geom_bodyid[self._geoms[i]]
        axis: Array = self._data.xmat[body].reshape(3, 3) @ foot.axis
        if foot.name != foot.joint:  # it does not turn
            return axis
        angle = foot.roller or 0.0
        c, s = math.cos(angle), math.sin(angle)
        x, y = axis[1], -axis[0]  # axis x z: ahead
        return np.array([c * x - s * y, s * x + c * y, 0.0])

    def grip(self, ways: Array) -> Array:
        """The friction that the driven wheels give under their present load (N), shape (N,), in the
        directions of horizontal unit vectors, shape (N, 2); SpecError if none is driven."""
        self.look()
        platform = self.robot.platform
        driven = {platform.coordinates[i] for i in np.flatnonzero(self.now.platform_B.any(axis=1))}
        driven |= {gear.joint for gear in platform.geared if gear.of in driven}
        wheels = [i for i, foot in enumerate(self._wheels) if foot.name in driven]
        if not wheels:
            name = self.robot.name
            raise SpecError(f"robot {name!r} has no driven wheels, by which it had traction")
        force = np.zeros(len(ways))
        for i in wheels:
            along = np.abs(ways @ self._direction(i)[:2]) if self._wheels[i].directed else 1.0
            force += self._given.friction * self.recorded.normal[i] * along
        return force

    def stance(self) -> tuple[Array, Array]:
        """Centres of all feet, shape (feet, 3), and the robot's centre of mass, shape (3,) (m)."""
        data = self._data
        feet = [data.geom_xpos[self._model.geom(foot.name).id] for foot in self._feet]
        return np.array(feet), data.subtree_com[0].copy()

    # Measurement ---------------------------------------------------------------------------------

    def _measure(self) -> None:
        """(q, z) and the true q' of MuJoCo's state."""
        robot, now, data = self.robot, self.now, self._data
        q_dot, n = self.q_dot, robot.n_alpha
        now.q[self._own], q_dot[self._own] = data.qpos[self._at], data.qvel[self._dof]
        if self._pose:
            at, dof, theta = self._base_at, self._base_dof, self._pose[2]
            w, x, y, z = data.qpos[at + 3 : at + 7]
            yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
            now.q[self._pose[:2]] = data.qpos[at : at + 2]
            now.q[theta] += math.remainder(yaw - now.q[theta], math.tau)
            q_dot[self._pose[:2]] = data.qvel[dof : dof + 2]
            turning = data.qvel[dof + 3 : dof + 6]
            q_dot[theta] = (
                2.0 * (x * z - w * y) * turning[0]
                + 2.0 * (y * z + w * x) * turning[1]
                + (1.0 - 2.0 * (x * x + y * y)) * turning[2]
            )
        now.velocity()
        if self._virtual:
            self._find_virtual()
        now.z[n:] = q_dot[robot.arm_index]
        if n:
            rows, weights = self._told, self._weights
            C, told = weights[:, None] * now.C[rows, :n], weights * q_dot[rows]
            now.z[:n] = np.linalg.lstsq(C, told, rcond=None)[0]
        now.velocity()
        q_dot[self._virtual] = now.q_dot[self._virtual]

    def _find_virtual(self) -> None:
        """The coordinates that no joint has, from those that follow them, by Gauss and Newton."""
        robot, now = self.robot, self.now
        followers, virtual = self._following, self._virtual
        for _ in range(3):
            away = (now.q - robot.consistent(now.q))[followers]
            c = now.C[:, : robot.n_alpha]
            now.q[virtual] += c[virtual] @ np.linalg.lstsq(c[followers], away, rcond=None)[0]
            now.velocity()

    def look(self) -> None:
        """Fill what is recorded of the ground."""
        if not self._pose:
            return
        mj, data, model, recorded = self._mj, self._data, self._model, self.recorded
        recorded.normal[:] = recorded.friction[:] = recorded.slip[:] = 0.0
        recorded.lift[:] = np.inf
        force, twist = np.zeros(6), np.zeros(6)
        frames, places = data.contact.frame, data.contact.pos
        for k, geom in enumerate(data.contact.geom2.tolist()):
            i = self._number.get(geom)
            if i is None:
                continue
            recorded.lift[i] = 0.0
            mj.mj_contactForce(model, data, k, force)
            recorded.normal[i] += force[0]
            recorded.friction[i] += math.hypot(force[1], force[2])
            mj.mj_objectVelocity(model, data, mj.mjtObj.mjOBJ_GEOM, geom, twist, 0)
            speed = twist[3:] + np.cross(twist[:3], places[k] - data.geom_xpos[geom])
            frame = frames[k].reshape(3, 3)
            across = 0.0 if self._wheels[i].directed else frame[2] @ speed
            recorded.slip[i] = max(recorded.slip[i], math.hypot(frame[1] @ speed, across))
        for i, (foot, geom) in enumerate(zip(self._wheels, self._geoms, strict=True)):
            if math.isinf(recorded.lift[i]):
                recorded.lift[i] = max(0.0, data.geom_xpos[geom][2] - foot.radius)
        w, x, y, z = data.qpos[self._base_at + 3 : self._base_at + 7]
        recorded.base[0] = data.qpos[self._base_at + 2]
        recorded.base[1] = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        recorded.base[2] = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
        recorded.tip[:] = data.site_xpos[self._tip]
