r"""Swerve platforms: two or more modules of wheels that are steered and driven.

All axles meet in one point at any time, the instantaneous centre of rotation, so that the platform has
one direction of motion at once, and two ways to change it: type (1,2) of Campion, Bastin and
d'Andrea-Novel (IEEE Trans. Robotics and Automation 12(1), 1996). The two are coordinates here: the
direction of travel :math:`\psi` of the reference point in the platform's axes, and the curvature
:math:`\kappa = \dot\theta/v` of its path. With the complex numbers
:math:`\rho_i = x_i + \mathrm{i}y_i` for the steering axes, a module stands at the angle of

.. math:: \zeta_i = e^{\mathrm{i}\psi} + \mathrm{i}\kappa\rho_i,

the velocity of its axis over :math:`v`. It is singular where :math:`\zeta_i = 0`: the centre of rotation
is on the steering axis, and the module may point anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from mobman.arrays import Array, Matrix, Tensor, Vector
from mobman.compiled import kernel
from mobman.errors import UsageError
from mobman.linalg import cholesky, cholesky_solve
from mobman.model.platforms.body import Knuckle, SpreadBody, WheelPart
from mobman.model.platforms.platform import Equations, Platform, Wheel, WheeledFields, platforms
from mobman.model.platforms.rolling import (
    constraint_derivative_rate,
    constraints,
    row,
    wheel_rates,
    wheel_rates_rate,
)
from mobman.model.platforms.wheels import (
    AXIS_TOLERANCE,
    LENGTH_TOLERANCE,
    JointPlace,
    Site,
    carriers,
    joints_of,
)
from mobman.robots.urdf.compose import TRAVEL_JOINTS

_ON_AXIS = 1e-6  # of |zeta|: below it the centre of rotation is on the steering axis


class SwerveBody(SpreadBody):
    """The fields of ``[platform.body]``: modules on a rectangle, or on a circle."""

    steering_velocity: float = Field(0.0, ge=0)  # largest steering rate (rad/s); 0: not known
    steering_effort: float = Field(0.0, ge=0)  # largest steering torque (N m); 0: not known
    module_mass: float = Field(gt=0)  # mass of what a steering joint turns, without the wheel (kg)


class SwerveParameters(WheeledFields):
    """The fields of ``[platform]`` for ``type = "swerve"``."""

    steering: list[str] = []  # URDF joints that steer, two or more
    wheels: list[str] = []  # URDF joints of the driven wheels, one or more behind each of those
    body: SwerveBody | None = None  # the platform by its numbers instead of by a URDF


class Module(NamedTuple):
    """A steering joint; or a place where wheels are that are not steered."""

    joint: str
    position: complex  # rho, of its axis in the platform's axes from the reference point (m)
    forward: complex  # the direction in which its wheels roll at a joint angle of 0, of length 1
    sign: float
    """+1 where a positive angle turns them to the left, else -1; 0 where nothing is steered."""


class ModuleWheel(NamedTuple):
    """A wheel of a module."""

    joint: str
    module: int  # the number of its module, from 0
    left: float  # e, its distance from the steering axis to the left (m)
    sign: float  # +1 where a positive rate rolls it forward, else -1
    driven: bool = True


class Modules(NamedTuple):
    """The modules of a platform, from its reference point."""

    middle: complex  # the reference point, from the root link's origin (m)
    steered: list[Module]  # and behind them the places where nothing is steered
    rolling: list[ModuleWheel]
    places: list[JointPlace]  # of the wheels


@platforms.register("swerve")
class Swerve(Platform):
    r"""n modules that are steered, with w driven wheels: :math:`l = 5 + n + w`, :math:`k = 2 + n + w`.

    Coordinates :math:`x = (x_1, x_2, \theta, \psi, \kappa, \delta_1, \dots, \delta_n, \phi_1,
    \dots, \phi_w)` with (x1, x2) in the middle of the steering axes. No joint of the URDF moves
    :math:`\psi` and :math:`\kappa`; the steering angles follow them, :math:`\delta_i = \arg\zeta_i`.
    :math:`\alpha = (v, \dot\psi, \dot\kappa)` (m/s, rad/s, 1/(m s)); the commands are the forces that
    belong to them, which n + w motors make with the least sum of squares, so that B is the identity.

    Steering moves no tip at once, as a car's: it takes couplings in the criterion. A rotation on the
    spot, :math:`\kappa \to \infty`, is not among the coordinates' values.

    Attributes:
        modules: The steering joints.
    """

    fields: type[WheeledFields] = SwerveParameters
    virtual_joints: tuple[str, ...] = TRAVEL_JOINTS
    velocity_names: tuple[str, ...] = ("v", "psi_dot", "kappa_dot")

    def __init__(self, site: Site, given: Any) -> None:
        middle, modules, rolling, places = self.found(site, given)
        self.radius = R = given.wheel_radius
        self.modules = tuple(one for one in modules if one.sign)
        self.following = tuple(one.joint for one in self.modules)
        n, last = len(self.modules), 2 + len(self.virtual_joints)  # kappa's place
        l = last + 1 + n + len(rolling)
        # travel along psi; then, with what the kernels add, turning by kappa and steering that follows
        rows = [row(l, -1j, steered=(3, 1.0) if last > 3 else (2, 0.0)), row(l, others={2: -1.0})]
        rows += [row(l, others={last + i: one.sign}) for i, one in enumerate(self.modules, 1)]
        for j, wheel in enumerate(rolling, last + 1 + n):
            module = modules[wheel.module]
            steered = (last + 1 + wheel.module, module.sign) if module.sign else (2, 0.0)
            lever = {steered[0]: -wheel.left * module.sign, 2: -wheel.left}
            others = {**lever, j: -wheel.sign * R}
            rows.append(row(l, module.forward, module.position, steered, others))
        numbers = [(m.position.real, m.position.imag, m.sign) for m in self.modules]
        height = float(np.mean([place.centre[2] for place in places]))
        own = [n, *np.ravel(numbers), *(wheel.driven for wheel in rolling)]
        super().__init__(
            (*self.following, *(wheel.joint for wheel in rolling)),
            self.velocity_names,
            Equations(
                np.array([*np.ravel(rows), *own]),
                *(_velocity_map, _velocity_map_rate, _constraints),
                *(_constraint_derivative_rate, _actuation),
            ),
            wheels=[Wheel(wheel.joint, R) for wheel in rolling],
            root_offset=np.array([-middle.real, -middle.imag, R - height]),
            heading=given.heading,
        )

    def found(self, site: Site, given: Any) -> Modules:
        """The platform's modules, by its description."""
        own = _spots(given.body) if given.body is not None else {}
        axes, places = located(site, own, own)
        if len(axes) < 2:
            field = "steering" if given.steering else "body.angles"
            names = ", ".join(joints_of(axes))
            raise site.fault(field, f" gives {names}; allowed: two or more different joints")
        middle = complex(np.mean([place.at for place in axes]))
        return Modules(middle, *modules_of(site, axes, places, middle), places)

    @classmethod
    def parts(cls, given: Any, origin: str) -> Iterable[WheelPart | Knuckle]:
        """Modules on a rectangle or on a circle."""
        body, R = given.body, given.wheel_radius
        motor = {"velocity": body.steering_velocity, "effort": body.steering_effort}
        for name, (x, y) in _spots(body, origin).items():
            yield Knuckle(f"steering_{name}", (x, y, R), body.module_mass, **motor)
            yield WheelPart(f"wheel_{name}", parent=f"steering_{name}_link")

    def consistent(self, x: Array) -> Array:
        """See :meth:`Platform.consistent`: the steering angles that psi and kappa ask for, each on the
        turn that is nearest to where it is.

        Raises:
            UsageError: If the centre of rotation is on a steering axis.
        """
        result, last = x.copy(), 2 + len(self.virtual_joints)
        direction = np.exp(1j * x[3]) if last > 3 else 1.0
        for i, module in enumerate(self.modules, start=last + 1):
            zeta = direction + 1j * x[last] * module.position
            if abs(zeta) < _ON_AXIS:
                travel = zip(self.virtual_joints, x[3:], strict=False)
                raise UsageError(
                    f"{' and '.join(f'{name} = {value:g}' for name, value in travel)} put the centre of "
                    f"rotation on the axis of {module.joint!r}, where the module may point anywhere"
                )
            wanted = module.sign * float(np.angle(zeta / module.forward))
            result[i] = wanted + math.tau * round((x[i] - wanted) / math.tau)
        return result


# Reading a description --------------------------------------------------------------------------------


def _spots(body: SwerveBody, origin: str = "") -> dict[str, tuple[float, float]]:
    """Places of the modules of a platform described by its numbers (m), by name."""
    why = "modules need body.wheelbase and body.half_track, or body.circle and body.angles"
    return body.spots(origin, body.circle is not None or bool(body.angles), why)


def located(
    site: Site, steering: Iterable[str], wheels: Iterable[str]
) -> tuple[list[JointPlace], list[JointPlace]]:
    """Locate steering joints and wheels, which on a platform by its numbers are called after places;
    SpecError if one is not where it can steer or roll, or two axes are at one place."""
    axes = site.steering("steering", *(f"steering_{name}" for name in steering))
    places = site.rolling(*(f"wheel_{name}" for name in wheels))
    for one, other in combinations(axes, 2):
        if abs(one.at - other.at) < LENGTH_TOLERANCE:
            raise site.fault("steering", f": {one.joint!r} and {other.joint!r} are at one place")
    return axes, places


def modules_of(
    site: Site, axes: Sequence[JointPlace], places: Sequence[JointPlace], middle: complex
) -> tuple[list[Module], list[ModuleWheel]]:
    """The modules of steering joints and the wheels behind these, from a reference point (m); SpecError
    if a wheel is carried by none of the joints or several, or is not beside its axis."""
    carried, steering = [], joints_of(axes)
    for place in places:
        above = carriers(site, place)
        found = [i for i, name in enumerate(steering) if name in above]
        if len(found) != 1:
            raise site.fault(
                "wheels",
                f": {place.joint!r} is carried by {len(found)} of the joints in field "
                f"'platform.steering' ({', '.join(steering)}); allowed: one",
            )
        carried += found
    modules, rolling = list[Module](), list[ModuleWheel]()
    for i, axis in enumerate(axes):
        behind = [one for one, module in zip(places, carried, strict=True) if module == i]
        if not behind:
            raise site.fault(
                "wheels",
                f" names none behind {axis.joint!r} of field 'platform.steering'; a module that has no "
                "driven wheel is a caster: lock it",
            )
        # of the two directions in which the wheels roll, the one more to the front, or to the left
        forward = behind[0].forward
        if forward.real < -AXIS_TOLERANCE or (
            abs(forward.real) <= AXIS_TOLERANCE and forward.imag < 0.0
        ):
            forward = -forward
        modules.append(Module(axis.joint, axis.at - middle, forward, axis.turn))
        for place in behind:
            ahead, apart = (one / forward for one in (place.forward, place.at - axis.at))
            if abs(ahead.imag) > AXIS_TOLERANCE:
                raise site.fault(
                    "wheels",
                    f": {place.joint!r} rolls in another direction than the other wheels behind "
                    f"{axis.joint!r}",
                )
            if abs(apart.real) > LENGTH_TOLERANCE:
                raise site.fault(
                    "wheels",
                    f": {place.joint!r} is {apart.real:+.4f} m ahead of the axis of {axis.joint!r}; "
                    "allowed: beside it (what trails is a powered caster, which moves in every "
                    "direction without turning first)",
                )
            rolling.append(ModuleWheel(place.joint, i, apart.imag, math.copysign(1.0, ahead.real)))
    return modules, rolling


# Parameters of the kernels: the table of constraints; n; x_i, y_i, sign_i of each module that steers;
# 1 for each wheel that is driven, else 0. x = (x_1, x_2, theta, [psi,] kappa, delta_1 ..., phi_1 ...),
# and p, the number of velocities, says whether psi is free.


@kernel
def _ways(own: Vector, i: int, psi: float, kappa: float) -> tuple[complex, complex, complex]:
    """L_psi, L_kappa and zeta_psipsi / zeta of a module's L = log(zeta), of which Im L is the angle.

    The higher derivatives are products of these: L_psipsi = third - L_psi^2, L_psikappa = -L_psi
    L_kappa, L_kappakappa = -L_kappa^2.
    """
    rho = complex(own[1 + 3 * i], own[2 + 3 * i])
    e = complex(math.cos(psi), math.sin(psi))
    zeta = e + 1j * kappa * rho
    # its inverse without a division by 0, which Python refuses where compiled code gives inf
    inverse = zeta.conjugate() / max(zeta.real**2 + zeta.imag**2, 1e-300)
    return 1j * e * inverse, 1j * rho * inverse, -e * inverse


@kernel
def _velocity_map(parameters: Vector, x: Vector, N: Matrix) -> None:
    """N of the class, with alpha = (v, [psi',] kappa')."""
    l, p = N.shape
    own = parameters[(l - p) * (6 + l) :]
    n, psi, kappa = int(own[0]), x[3] if p > 2 else 0.0, x[p + 1]
    N[:, :] = 0.0
    N[0, 0], N[1, 0], N[2, 0] = math.cos(x[2] + psi), math.sin(x[2] + psi), kappa
    for m in range(1, p):
        N[2 + m, m] = 1.0
    for i in range(n):
        along, turning, _ = _ways(own, i, psi, kappa)
        sign = own[3 + 3 * i]
        if p > 2:
            N[p + 2 + i, 1] = sign * along.imag
        N[p + 2 + i, p - 1] = sign * turning.imag
    wheel_rates(parameters, x, 2 + n, N)


@kernel
def _velocity_map_rate(parameters: Vector, x: Vector, x_dot: Vector, N_rate: Matrix) -> None:
    """d/dt of the same."""
    l, p = N_rate.shape
    own = parameters[(l - p) * (6 + l) :]
    n, psi, kappa = int(own[0]), x[3] if p > 2 else 0.0, x[p + 1]
    psi_dot, kappa_dot = x_dot[3] if p > 2 else 0.0, x_dot[p + 1]
    c, s = math.cos(x[2] + psi), math.sin(x[2] + psi)
    turn = x_dot[2] + psi_dot
    N_rate[:, :] = 0.0
    N_rate[0, 0], N_rate[1, 0], N_rate[2, 0] = -s * turn, c * turn, kappa_dot
    for i in range(n):
        along, turning, third = _ways(own, i, psi, kappa)
        sign = own[3 + 3 * i]
        change = along * psi_dot + turning * kappa_dot
        if p > 2:
            N_rate[p + 2 + i, 1] = sign * (third * psi_dot - along * change).imag
        N_rate[p + 2 + i, p - 1] = -sign * (turning * change).imag
    wheel_rates_rate(parameters, x, x_dot, 2 + n, (c, s, kappa), N_rate)


@kernel
def _actuation(parameters: Vector, x: Vector, B: Matrix) -> None:
    """B'' = S (S^T S)^-1 for the motors' rates S alpha: of all torques that make the commands, those
    with the least sum of squares."""
    l, p = B.shape
    own = parameters[(l - p) * (6 + l) :]
    first, wheels = p + 2, p + 2 + int(own[0])
    _velocity_map(parameters, x, B)
    B[:first, :] = 0.0
    for i in range(wheels, l):
        if own[1 + 3 * (wheels - first) + i - wheels] == 0.0:
            B[i, :] = 0.0
    # S^T S, where B'' is 0 in the end
    square = B[:p]
    for i in range(first, l):
        for a in range(p):
            for b in range(p):
                square[a, b] += B[i, a] * B[i, b]
    cholesky(square, square)
    for i in range(first, l):
        cholesky_solve(square, B[i], B[i])
    square[:, :] = 0.0


@kernel
def _constraints(parameters: Vector, x: Vector, A: Matrix, A_x: Tensor) -> None:
    """Travel along psi, turning by kappa, steering that follows, wheels that roll."""
    k, l = A.shape
    own, p = parameters[k * (6 + l) :], l - k
    last, psi, kappa = p + 1, x[3] if p > 2 else 0.0, x[p + 1]
    c, s = math.cos(x[2] + psi), math.sin(x[2] + psi)
    constraints(parameters, x, A, A_x)
    A[1, 0], A[1, 1] = kappa * c, kappa * s
    for m in range(2, last):
        A_x[1, 0, m], A_x[1, 1, m] = -kappa * s, kappa * c
    A_x[1, 0, last], A_x[1, 1, last] = c, s
    for i in range(int(own[0])):
        along, turning, third = _ways(own, i, psi, kappa)
        A[2 + i, last] = -turning.imag
        A_x[2 + i, last, last] = (turning * turning).imag
        if p > 2:
            A[2 + i, 3] = -along.imag
            A_x[2 + i, 3, 3] = (along * along - third).imag
            A_x[2 + i, 3, 4] = A_x[2 + i, 4, 3] = (along * turning).imag


@kernel
def _constraint_derivative_rate(
    parameters: Vector, x: Vector, x_dot: Vector, A_x_rate: Tensor
) -> None:
    """d/dt of the derivatives of A."""
    k, l, _ = A_x_rate.shape
    own, p = parameters[k * (6 + l) :], l - k
    last, psi, kappa = p + 1, x[3] if p > 2 else 0.0, x[p + 1]
    psi_dot, kappa_dot = x_dot[3] if p > 2 else 0.0, x_dot[last]
    turn = x_dot[2] + psi_dot
    c, s = math.cos(x[2] + psi), math.sin(x[2] + psi)
    constraint_derivative_rate(parameters, x, x_dot, A_x_rate)
    for m in range(2, last):
        A_x_rate[1, 0, m] = -kappa_dot * s - kappa * c * turn
        A_x_rate[1, 1, m] = kappa_dot * c - kappa * s * turn
    A_x_rate[1, 0, last], A_x_rate[1, 1, last] = -s * turn, c * turn
    for i in range(int(own[0])):
        along, turning, third = _ways(own, i, psi, kappa)
        change = along * psi_dot + turning * kappa_dot
        along_rate, turning_rate = third * psi_dot - along * change, -turning * change
        A_x_rate[2 + i, last, last] = (2.0 * turning * turning_rate).imag
        if p > 2:
            # zeta_psipsi = -e, whose own derivative is that of e: zeta_psipsipsi / zeta = -L_psi
            third_rate = -along * psi_dot - third * change
            A_x_rate[2 + i, 3, 3] = (2.0 * along * along_rate - third_rate).imag
            mixed = (along_rate * turning + along * turning_rate).imag
            A_x_rate[2 + i, 3, 4] = A_x_rate[2 + i, 4, 3] = mixed
