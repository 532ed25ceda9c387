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
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from pydantic import Field

from mobman.arrays import Array, Matrix, Tensor, Vector
from mobman.compiled import kernel
from mobman.errors import UsageError
from mobman.model.platforms.body import (
    Knuckle,
    WheeledBody,
    WheelPart,
    body_urdf,
    required,
    required_body,
)
from mobman.model.platforms.platform import (
    Equations,
    Platform,
    Site,
    Wheel,
    WheeledFields,
    platforms,
)
from mobman.model.platforms.wheels import (
    AXIS_TOLERANCE,
    LENGTH_TOLERANCE,
    JointPlace,
    Named,
    carriers,
    check_level,
    check_upright,
    joint_place,
)
from mobman.robots.urdf.compose import BASE_JOINTS, TRAVEL_JOINTS
from mobman.toml_model import validate

_ON_AXIS = 1e-6  # of |zeta|: below it the centre of rotation is on the steering axis
_CORNERS = tuple(f"{end}_{side}" for end in ("front", "rear") for side in ("left", "right"))


class SwerveBody(WheeledBody):
    """The fields of ``[platform.body]``: modules on a rectangle, or on a circle."""

    wheelbase: float | None = Field(None, gt=0)
    """Four modules: distance of the front and the rear ones (m)."""
    half_track: float | None = Field(None, gt=0)
    """Four modules: half the distance of the right and the left ones (m)."""
    circle: float | None = Field(None, gt=0)
    """Modules on a circle: its radius (m)."""
    angles: list[float] = []
    """Their places on the circle, from forward, anticlockwise (rad)."""
    steering_velocity: float = Field(0.0, ge=0)
    """Largest steering rate (rad/s); 0: not known."""
    steering_effort: float = Field(0.0, ge=0)
    """Largest steering torque (N m); 0: not known."""
    module_mass: float = Field(gt=0)
    """Mass of what a steering joint turns, without the wheel (kg)."""


class SwerveParameters(WheeledFields):
    """The fields of ``[platform]`` for ``type = "swerve"``."""

    steering: list[str] = []
    """URDF joints that steer, two or more."""
    wheels: list[str] = []
    """URDF joints of the driven wheels, one or more behind each of those."""
    body: SwerveBody | None = None
    """The platform by its numbers instead of by a URDF."""


class Module(NamedTuple):
    """A steering joint; or a place where wheels are that are not steered."""

    joint: str
    position: complex
    """rho, of its axis in the platform's axes from the reference point (m)."""
    zero: float
    """gamma, the direction in which its wheels roll at a joint angle of 0 (rad)."""
    sign: float
    """+1 where a positive angle turns them to the left, else -1; 0 where nothing is steered."""


class ModuleWheel(NamedTuple):
    """A wheel of a module."""

    joint: str
    module: int
    """The number of its module, from 0."""
    left: float
    """e, its distance from the steering axis to the left (m)."""
    sign: float
    """+1 where a positive rate rolls it forward, else -1."""
    driven: bool = True


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

    Args:
        modules: The steering joints, before the places where nothing is steered.
        rolling: The wheels.
        radius: R (m).
        root_offset, heading: See :class:`Platform`.
    """

    virtual_joints: tuple[str, ...] = TRAVEL_JOINTS
    velocity_names: tuple[str, ...] = ("v", "psi_dot", "kappa_dot")

    def __init__(
        self,
        modules: Sequence[Module],
        rolling: Sequence[ModuleWheel],
        radius: float,
        root_offset: Array | None = None,
        heading: float = 0.0,
    ) -> None:
        self.modules, self.radius = tuple(one for one in modules if one.sign), radius
        self.following = tuple(one.joint for one in self.modules)
        self.wheels = tuple(Wheel(one.joint, radius) for one in rolling)
        names = (one.joint for one in rolling)
        self.coordinates = (*BASE_JOINTS, *self.virtual_joints, *self.following, *names)
        self.root_offset = np.zeros(3) if root_offset is None else root_offset
        self.heading = heading
        self._free = len(self.virtual_joints) - 1
        counts = len(self.modules), len(rolling), self._free, len(modules)
        numbers = [(m.position.real, m.position.imag, m.zero, m.sign) for m in modules]
        more = [(w.module, w.left, w.sign * radius, w.driven) for w in rolling]
        self.equations = Equations(
            np.array([*counts, *np.ravel(numbers), *np.ravel(more)]),
            *(_velocity_map, _velocity_map_rate, _constraints),
            *(_constraint_derivative_rate, _actuation),
        )

    @classmethod
    def build(cls, site: Site) -> Swerve:
        """See :meth:`Platform.build`; the wheels say in which direction a module points."""
        given = site.read(SwerveParameters)
        own, named = _spots(given.body, "") if given.body is not None else {}, Named(site, given)
        steering = named.names("steering", [f"steering_{name}" for name in own])
        wheels = named.names("wheels", [f"wheel_{name}" for name in own])
        if len(set(steering)) < max(2, len(steering)):
            raise site.fault("steering", f" is {steering}; allowed: two or more different joints")
        axes, places = located(site, steering, wheels, given.heading)
        middle = complex(np.mean([complex(*place.centre[:2]) for place in axes]))
        modules, rolling = modules_of(site, axes, places, middle)
        return cls(modules, rolling, **placed(given, middle, places))

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """See :meth:`Platform.describe`: a box with modules on a rectangle or on a circle."""
        given = validate(SwerveParameters, parameters, f"{origin}: [platform]")
        body, R = required_body(origin, given.body), given.wheel_radius
        knuckles, wheels = [], []
        for name, (x, y) in _spots(body, origin).items():
            joint = f"steering_{name}"
            knuckles.append(
                Knuckle(
                    *(joint, (x, y, R), math.inf, body.steering_velocity, body.module_mass, R),
                    effort=body.steering_effort,
                )
            )
            wheels.append(WheelPart(f"wheel_{name}", (0.0, 0.0, 0.0), R, parent=f"{joint}_link"))
        return body_urdf(body, wheels, knuckles)

    def consistent(self, x: Array) -> Array:
        """See :meth:`Platform.consistent`: the steering angles that psi and kappa ask for, each on the
        turn that is nearest to where it is.

        Raises:
            UsageError: If the centre of rotation is on a steering axis.
        """
        result, last = x.copy(), 3 + self._free
        direction = np.exp(1j * x[3]) if self._free else 1.0
        for i, module in enumerate(self.modules, start=last + 1):
            zeta = direction + 1j * x[last] * module.position
            if abs(zeta) < _ON_AXIS:
                travel = zip(self.virtual_joints, x[3:], strict=False)
                raise UsageError(
                    f"{' and '.join(f'{name} = {value:g}' for name, value in travel)} put the centre of "
                    f"rotation on the axis of {module.joint!r}, where the module may point anywhere"
                )
            wanted = module.sign * (float(np.angle(zeta)) - module.zero)
            result[i] = wanted + math.tau * round((x[i] - wanted) / math.tau)
        return result


# Reading a description --------------------------------------------------------------------------------


def _spots(body: SwerveBody, origin: str) -> dict[str, tuple[float, float]]:
    """Places of the modules of a platform described by its numbers (m), by name."""
    if body.circle is not None or body.angles:
        circle = required(origin, "body.circle", body.circle, "the modules' angles are given")
        angles = required(origin, "body.angles", body.angles, "the modules' circle is given")
        spots = [(circle * math.cos(a), circle * math.sin(a)) for a in angles]
        return {str(i): spot for i, spot in enumerate(spots, start=1)}
    why = "give it with body.half_track, or body.circle and body.angles"
    x = 0.5 * required(origin, "body.wheelbase", body.wheelbase, why)
    y = required(origin, "body.half_track", body.half_track, "four modules need it")
    return dict(zip(_CORNERS, [(x, y), (x, -y), (-x, y), (-x, -y)], strict=True))


def located(
    site: Site, steering: Sequence[str], wheels: Sequence[str], heading: float
) -> tuple[list[JointPlace], list[JointPlace]]:
    """Locate steering joints and wheels.

    Raises:
        SpecError: If one is there twice, or not where it can steer or roll.
    """
    for field, names in (("steering", steering), ("wheels", wheels)):
        if len(set(names)) < len(names):
            raise site.fault(field, f" is {names}; one is there twice")
    axes = [joint_place(site, name, "steering", heading) for name in steering]
    check_upright(site, axes, "steering")
    places = [joint_place(site, name, "wheels", heading) for name in wheels]
    check_level(site, places)
    rho = np.array([complex(*place.centre[:2]) for place in axes])
    if np.min(np.abs(rho[:, None] - rho + np.eye(len(rho)))) < LENGTH_TOLERANCE:
        raise site.fault("steering", ": two axes are at one place")
    return axes, places


def placed(given: Any, middle: complex, wheels: Sequence[JointPlace]) -> dict[str, Any]:
    """Radius and place of a platform whose reference point is in the middle (m)."""
    height = given.wheel_radius - float(np.mean([place.centre[2] for place in wheels]))
    offset = np.array([-middle.real, -middle.imag, height])
    return {"radius": given.wheel_radius, "root_offset": offset, "heading": given.heading}


def modules_of(
    site: Site, axes: Sequence[JointPlace], places: Sequence[JointPlace], middle: complex
) -> tuple[list[Module], list[ModuleWheel]]:
    """The modules of steering joints and the wheels behind these, from a reference point (m).

    Raises:
        SpecError: If a wheel is carried by none of the joints or several, or is not beside its axis.
    """
    carried, steering = [], [place.joint for place in axes]
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
        zero, rho = _zero(site, axis, behind), complex(*axis.centre[:2]) - middle
        modules.append(Module(axis.joint, rho, zero, float(np.sign(axis.axis[2]))))
        rolling += [_wheel(site, one, i, axis, zero) for one in behind]
    return modules, rolling


def _zero(site: Site, axis: JointPlace, wheels: Sequence[JointPlace]) -> float:
    """The direction in which a module's wheels roll with all joints at zero (rad): of the two the one
    that is more to the front, or to the left."""
    if not wheels:
        raise site.fault(
            "wheels",
            f" names none behind {axis.joint!r} of field 'platform.steering'; a module that has no "
            "driven wheel is a caster: lock it",
        )
    x, y = wheels[0].axis[1], -wheels[0].axis[0]  # axis x z
    if x < -AXIS_TOLERANCE or (abs(x) <= AXIS_TOLERANCE and y < 0.0):
        x, y = -x, -y
    return math.atan2(y, x)


def _wheel(site: Site, place: JointPlace, i: int, axis: JointPlace, zero: float) -> ModuleWheel:
    forward = np.array([math.cos(zero), math.sin(zero), 0.0])
    left = np.array([-math.sin(zero), math.cos(zero), 0.0])
    if abs(place.axis @ forward) > AXIS_TOLERANCE:
        raise site.fault(
            "wheels",
            f": {place.joint!r} rolls in another direction than the other wheels behind "
            f"{axis.joint!r}",
        )
    apart = place.centre - axis.centre
    if abs(trail := float(apart @ forward)) > LENGTH_TOLERANCE:
        raise site.fault(
            "wheels",
            f": {place.joint!r} is {trail:+.4f} m ahead of the axis of {axis.joint!r}; allowed: beside "
            "it (what trails is a powered caster, which moves in every direction without turning "
            "first)",
        )
    return ModuleWheel(place.joint, i, float(apart @ left), float(np.sign(place.axis @ left)))


# Parameters of the kernels: n, w, 1 where psi is free or 0 where it is 0 and no coordinate, the number
# m of modules; x_i, y_i, gamma_i, sign_i of each module, the n that steer first; module, e, sign R and
# 1 where it is driven of each wheel. x = (x_1, x_2, theta, [psi,] kappa, delta_1 ..., phi_1 ...).


@kernel
def _counts(parameters: Vector) -> tuple[int, int, int, int]:
    """n, w, 1 or 0, m."""
    return int(parameters[0]), int(parameters[1]), int(parameters[2]), int(parameters[3])


@kernel
def _ways(parameters: Vector, i: int, psi: float, kappa: float) -> tuple[complex, complex, complex]:
    """L_psi, L_kappa and zeta_psipsi / zeta of a module's L = log(zeta), of which Im L is the angle.

    The higher derivatives are products of these: L_psipsi = third - L_psi^2, L_psikappa = -L_psi
    L_kappa, L_kappakappa = -L_kappa^2.
    """
    rho = complex(parameters[4 + 4 * i], parameters[5 + 4 * i])
    e = complex(math.cos(psi), math.sin(psi))
    zeta = e + 1j * kappa * rho
    # its inverse without a division by 0, which Python refuses where compiled code gives inf
    inverse = zeta.conjugate() / max(zeta.real**2 + zeta.imag**2, 1e-300)
    return 1j * e * inverse, 1j * rho * inverse, -e * inverse


@kernel
def _velocity_map(parameters: Vector, x: Vector, N: Matrix) -> None:
    """N of the class, with alpha = (v, [psi',] kappa')."""
    n, w, free, m = _counts(parameters)
    psi, kappa, first = x[3] if free else 0.0, x[3 + free], 4 + free
    N[:, :] = 0.0
    N[0, 0], N[1, 0], N[2, 0] = math.cos(x[2] + psi), math.sin(x[2] + psi), kappa
    for k in range(1 + free):
        N[3 + k, 1 + k] = 1.0
    for i in range(n):
        along, turning, _ = _ways(parameters, i, psi, kappa)
        sign = parameters[7 + 4 * i]
        if free:
            N[first + i, 1] = sign * along.imag
        N[first + i, 1 + free] = sign * turning.imag
    for j in range(w):
        at = 4 + 4 * m + 4 * j
        i, left, R = int(parameters[at]), parameters[at + 1], parameters[at + 2]
        a, b, sign = parameters[4 + 4 * i], parameters[5 + 4 * i], parameters[7 + 4 * i]
        d = first + min(i, n - 1)  # its sign is 0 where nothing is steered
        angle = parameters[6 + 4 * i] + sign * x[d]
        lever = a * math.sin(angle) - b * math.cos(angle) - left
        row = first + n + j
        N[row, 0] = (math.cos(angle - psi) + kappa * lever) / R
        for k in range(1, 2 + free):
            N[row, k] = -left * sign * N[d, k] / R


@kernel
def _velocity_map_rate(parameters: Vector, x: Vector, x_dot: Vector, N_rate: Matrix) -> None:
    """d/dt of the same."""
    n, w, free, m = _counts(parameters)
    psi, kappa, first = x[3] if free else 0.0, x[3 + free], 4 + free
    psi_dot, kappa_dot = x_dot[3] if free else 0.0, x_dot[3 + free]
    turn = x_dot[2] + psi_dot
    N_rate[:, :] = 0.0
    N_rate[0, 0] = -math.sin(x[2] + psi) * turn
    N_rate[1, 0] = math.cos(x[2] + psi) * turn
    N_rate[2, 0] = kappa_dot
    for i in range(n):
        along, turning, third = _ways(parameters, i, psi, kappa)
        sign = parameters[7 + 4 * i]
        change = along * psi_dot + turning * kappa_dot
        if free:
            N_rate[first + i, 1] = sign * (third * psi_dot - along * change).imag
        N_rate[first + i, 1 + free] = -sign * (turning * change).imag
    for j in range(w):
        at = 4 + 4 * m + 4 * j
        i, left, R = int(parameters[at]), parameters[at + 1], parameters[at + 2]
        a, b, sign = parameters[4 + 4 * i], parameters[5 + 4 * i], parameters[7 + 4 * i]
        d = first + min(i, n - 1)
        angle, rate = parameters[6 + 4 * i] + sign * x[d], sign * x_dot[d]
        c, s = math.cos(angle), math.sin(angle)
        row = first + n + j
        N_rate[row, 0] = (
            -math.sin(angle - psi) * (rate - psi_dot)
            + kappa_dot * (a * s - b * c - left)
            + kappa * (a * c + b * s) * rate
        ) / R
        for k in range(1, 2 + free):
            N_rate[row, k] = -left * sign * N_rate[d, k] / R


@kernel
def _actuation(parameters: Vector, x: Vector, B: Matrix) -> None:
    """B'' = S (S^T S)^-1 for the motors' rates S alpha: of all torques that make the commands, those
    with the least sum of squares."""
    n, w, free, m = _counts(parameters)
    first, last = 4 + free, 1 + free
    _velocity_map(parameters, x, B)
    for j in range(w):
        if parameters[7 + 4 * m + 4 * j] == 0.0:
            B[first + n + j, :] = 0.0
    g00 = g01 = g02 = g12 = g22 = 0.0
    g11 = 1.0 - free
    for i in range(first, B.shape[0]):
        p, q, r = B[i, 0], B[i, 1] if free else 0.0, B[i, last]
        g00, g01, g02 = g00 + p * p, g01 + p * q, g02 + p * r
        g11, g12, g22 = g11 + q * q, g12 + q * r, g22 + r * r
    # the adjugate
    h00, h01, h02 = g11 * g22 - g12 * g12, g02 * g12 - g01 * g22, g01 * g12 - g02 * g11
    h11, h12, h22 = g00 * g22 - g02 * g02, g01 * g02 - g00 * g12, g00 * g11 - g01 * g01
    determinant = g00 * h00 + g01 * h01 + g02 * h02
    B[:first, :] = 0.0
    for i in range(first, B.shape[0]):
        p, q, r = B[i, 0], B[i, 1] if free else 0.0, B[i, last]
        B[i, 0] = (p * h00 + q * h01 + r * h02) / determinant
        if free:
            B[i, 1] = (p * h01 + q * h11 + r * h12) / determinant
        B[i, last] = (p * h02 + q * h12 + r * h22) / determinant


@kernel
def _constraints(parameters: Vector, x: Vector, A: Matrix, A_x: Tensor) -> None:
    """Travel along psi, turning by kappa, steering that follows, wheels that roll."""
    n, w, free, m = _counts(parameters)
    psi, kappa, first, last = x[3] if free else 0.0, x[3 + free], 4 + free, 3 + free
    c, s = math.cos(x[2] + psi), math.sin(x[2] + psi)
    A[:, :] = 0.0
    A_x[:, :, :] = 0.0
    A[0, 0], A[0, 1] = s, -c
    A[1, 0], A[1, 1], A[1, 2] = kappa * c, kappa * s, -1.0
    for k in range(2, last):
        A_x[0, 0, k], A_x[0, 1, k] = c, s
        A_x[1, 0, k], A_x[1, 1, k] = -kappa * s, kappa * c
    A_x[1, 0, last], A_x[1, 1, last] = c, s
    for i in range(n):
        along, turning, third = _ways(parameters, i, psi, kappa)
        A[2 + i, last], A[2 + i, first + i] = -turning.imag, parameters[7 + 4 * i]
        A_x[2 + i, last, last] = (turning * turning).imag
        if free:
            A[2 + i, 3] = -along.imag
            A_x[2 + i, 3, 3] = (along * along - third).imag
            A_x[2 + i, 3, 4] = A_x[2 + i, 4, 3] = (along * turning).imag
    for j in range(w):
        at = 4 + 4 * m + 4 * j
        i, left, R = int(parameters[at]), parameters[at + 1], parameters[at + 2]
        a, b, sign = parameters[4 + 4 * i], parameters[5 + 4 * i], parameters[7 + 4 * i]
        row, d = 2 + n + j, first + min(i, n - 1)
        angle = parameters[6 + 4 * i] + sign * x[d]
        c, s = math.cos(angle), math.sin(angle)
        cw, sw = math.cos(x[2] + angle), math.sin(x[2] + angle)
        A[row, 0], A[row, 1], A[row, 2] = cw, sw, a * s - b * c - left
        A[row, d], A[row, first + n + j] = -left * sign, -R
        A_x[row, 0, 2], A_x[row, 1, 2] = -sw, cw
        A_x[row, 0, d], A_x[row, 1, d] = -sign * sw, sign * cw
        A_x[row, 2, d] = sign * (a * c + b * s)


@kernel
def _constraint_derivative_rate(
    parameters: Vector, x: Vector, x_dot: Vector, A_x_rate: Tensor
) -> None:
    """d/dt of the derivatives of A."""
    n, w, free, m = _counts(parameters)
    psi, kappa, first, last = x[3] if free else 0.0, x[3 + free], 4 + free, 3 + free
    psi_dot, kappa_dot = x_dot[3] if free else 0.0, x_dot[last]
    turn = x_dot[2] + psi_dot
    c, s = math.cos(x[2] + psi), math.sin(x[2] + psi)
    A_x_rate[:, :, :] = 0.0
    for k in range(2, last):
        A_x_rate[0, 0, k], A_x_rate[0, 1, k] = -s * turn, c * turn
        A_x_rate[1, 0, k] = -kappa_dot * s - kappa * c * turn
        A_x_rate[1, 1, k] = kappa_dot * c - kappa * s * turn
    A_x_rate[1, 0, last], A_x_rate[1, 1, last] = -s * turn, c * turn
    for i in range(n):
        along, turning, third = _ways(parameters, i, psi, kappa)
        change = along * psi_dot + turning * kappa_dot
        along_rate, turning_rate = third * psi_dot - along * change, -turning * change
        A_x_rate[2 + i, last, last] = (2.0 * turning * turning_rate).imag
        if free:
            # zeta_psipsi = -e, whose own derivative is that of e: zeta_psipsipsi / zeta = -L_psi
            third_rate = -along * psi_dot - third * change
            A_x_rate[2 + i, 3, 3] = (2.0 * along * along_rate - third_rate).imag
            mixed = (along_rate * turning + along * turning_rate).imag
            A_x_rate[2 + i, 3, 4] = A_x_rate[2 + i, 4, 3] = mixed
    for j in range(w):
        i = int(parameters[4 + 4 * m + 4 * j])
        a, b, sign = parameters[4 + 4 * i], parameters[5 + 4 * i], parameters[7 + 4 * i]
        row, d = 2 + n + j, first + min(i, n - 1)
        angle, rate = parameters[6 + 4 * i] + sign * x[d], sign * x_dot[d]
        both = x_dot[2] + rate
        c, s = math.cos(x[2] + angle) * both, math.sin(x[2] + angle) * both
        A_x_rate[row, 0, 2], A_x_rate[row, 1, 2] = -c, -s
        A_x_rate[row, 0, d], A_x_rate[row, 1, d] = -sign * c, -sign * s
        A_x_rate[row, 2, d] = sign * (b * math.cos(angle) - a * math.sin(angle)) * rate
