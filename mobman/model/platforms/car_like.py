"""Car-like platforms: rear-wheel drive, the steering angle as a coordinate."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import Field

from mobman.arrays import Array, Matrix, Tensor, Vector
from mobman.compiled import kernel
from mobman.errors import SpecError
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
    Gear,
    Platform,
    Site,
    Wheel,
    WheeledFields,
    platforms,
)
from mobman.model.platforms.wheels import (
    LENGTH_TOLERANCE,
    JointPlace,
    Named,
    check_upright,
    joint_place,
    sides,
    wheel_place,
)
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.toml_model import validate

_RIGHT, _LEFT = "wheel_rear_right", "wheel_rear_left"  # of a platform described by its numbers
_STEERING = ("steering_right", "steering_left")
_FRONT = ("wheel_front_right", "wheel_front_left")


class CarBody(WheeledBody):
    """The fields of ``[platform.body]`` for a car: four wheels, the front ones on knuckles."""

    steering_limit: float = Field(gt=0, lt=0.5 * math.pi)
    """Largest steering angle (rad)."""
    steering_velocity: float = Field(0.0, ge=0)
    """Largest steering rate (rad/s); 0: not known."""
    knuckle_mass: float = Field(gt=0)
    """Mass of one knuckle (kg)."""


class CarLikeParameters(WheeledFields):
    """The fields of ``[platform]`` for ``type = "car-like"``."""

    rear_right_wheel: str | None = None
    """URDF joint of the driven wheel on the right."""
    rear_left_wheel: str | None = None
    """URDF joint of the driven wheel on the left."""
    steering: list[str] = []
    """URDF joint of the steering, or those of two knuckles, which turn by the same angle."""
    front_wheels: list[str] = []
    """URDF joints of the wheels that are steered, the right one first, if they are to roll."""
    half_track: float | None = Field(None, gt=0)
    """W (m); by default half the distance of the rear wheels in the URDF."""
    wheelbase: float | None = Field(None, gt=0)
    """L (m); by default the distance of the steering joints from the rear axle in the URDF."""
    body: CarBody | None = None
    """The platform by its numbers instead of by a URDF; ``half_track`` and ``wheelbase`` are required
    then, and ``platform`` is under the middle of the rear axle."""


@platforms.register("car-like")
class CarLike(Platform):
    r"""A car with a differential on its rear axle; one front wheel in the middle stands for two.

    Coordinates :math:`x = (x_1, x_2, \theta, \delta, \dots)`: the middle of the rear axle, the
    heading, the steering angle (of one joint, or of two that turn alike), the rear wheels (right,
    left) and, if they are named, the front wheels. :math:`\alpha = (\alpha_1, \dot\delta)` with
    :math:`\alpha_1` the mean rate of the rear wheels (rad/s): :math:`v = R\alpha_1`,
    :math:`\dot\theta = v\tan\delta/L`, :math:`\dot\phi = \alpha_1(1 \pm W\tan\delta/L)`. The engine's
    torque is shared equally between the rear wheels, a second motor steers: B is the identity. At
    :math:`|\delta| = \pi/2` the model has a singularity; the limits of the steering joint are to
    exclude it.

    Args:
        steering: Names of the steering joints, one or two.
        rear: Names of the rear wheels, right and left.
        front: Names of the front wheels, right and left; or none.
        radius: R (m).
        half_track: W (m).
        wheelbase: L (m).
        steering_signs: +1 where a positive angle turns to the left, for each steering joint.
        signs: +1 where a wheel's positive rate drives forward; rear, then front.
        root_offset, heading: See :class:`Platform`.
    """

    def __init__(
        self,
        steering: Sequence[str],
        rear: tuple[str, str],
        front: Sequence[str],
        radius: float,
        half_track: float,
        wheelbase: float,
        steering_signs: Sequence[float] | None = None,
        signs: Sequence[float] | None = None,
        root_offset: Array | None = None,
        heading: float = 0.0,
    ) -> None:
        wheels = (*rear, *front)
        self.coordinates = (*BASE_JOINTS, *steering, *wheels)
        self.velocity_names = ("alpha_1", "delta_dot")
        self.radius, self.half_track, self.wheelbase = radius, half_track, wheelbase
        self.root_offset = np.zeros(3) if root_offset is None else root_offset
        self.heading = heading
        self.wheels = tuple(Wheel(joint, radius) for joint in wheels)
        n = len(steering)
        turning = (1.0,) * n if steering_signs is None else steering_signs
        rolling = (1.0,) * len(wheels) if signs is None else signs
        self.geared = tuple(
            Gear(joint, steering[0], sign * turning[0])
            for joint, sign in zip(steering[1:], turning[1:], strict=True)
        )
        self.equations = Equations(
            np.array([radius, half_track, wheelbase, n, len(front), *turning, *rolling]),
            *(_velocity_map, _velocity_map_rate, _constraints),
            *(_constraint_derivative_rate, _actuation),
        )

    @classmethod
    def build(cls, site: Site) -> CarLike:
        given = _parameters(site.parameters, site.origin)
        named = Named(site, given)
        right, left = named.pair("rear_right_wheel", "rear_left_wheel", _RIGHT, _LEFT)
        axle, half_track = sides(site, [right], [left])
        steering = named.names("steering", _STEERING)
        front = given.front_wheels or ([] if given.body is None else list(_FRONT))
        knuckles = [joint_place(site, name, "steering", given.heading) for name in steering]
        rolling = [wheel_place(site, name, "front_wheels", given.heading) for name in front]
        wheelbase = _wheelbase(site, axle, knuckles)
        if rolling:
            sides(site, rolling[:1], rolling[1:])
        return cls(
            steering=steering,
            rear=(right.joint, left.joint),
            front=front,
            radius=given.wheel_radius,
            half_track=half_track if given.half_track is None else given.half_track,
            wheelbase=wheelbase if given.wheelbase is None else given.wheelbase,
            steering_signs=[float(np.sign(place.axis[2])) for place in knuckles],
            signs=[place.sign for place in (right, left, *rolling)],
            root_offset=np.array([0.0, 0.0, given.wheel_radius]) - axle,
            heading=given.heading,
        )

    @classmethod
    def describe(cls, parameters: dict[str, Any], origin: str) -> ET.Element:
        """See :meth:`Platform.describe`: a box, two wheels behind and two on knuckles in front."""
        given = _parameters(parameters, origin)
        body, R = required_body(origin, given.body), given.wheel_radius
        W = required(origin, "half_track", given.half_track)
        L = required(origin, "wheelbase", given.wheelbase)
        wheels = [WheelPart(name, (0.0, y, R), R) for name, y in ((_RIGHT, -W), (_LEFT, W))]
        knuckles = []
        for joint, wheel, y in zip(_STEERING, _FRONT, (-W, W), strict=True):
            limit, velocity = body.steering_limit, body.steering_velocity
            knuckles.append(Knuckle(joint, (L, y, R), limit, velocity, body.knuckle_mass, R))
            wheels.append(WheelPart(wheel, (0.0, 0.0, 0.0), R, parent=f"{joint}_link"))
        return body_urdf(body, wheels, knuckles)


def _wheelbase(site: Site, axle: Array, knuckles: Sequence[JointPlace]) -> float:
    """Distance of the steering joints from the rear axle (m).

    Raises:
        SpecError: If an axis is not vertical, or they are not ahead of it at one distance.
    """
    check_upright(site, knuckles, "steering")
    ahead = [float(place.centre[0] - axle[0]) for place in knuckles]
    if min(ahead) <= 0.0 or max(ahead) - min(ahead) > LENGTH_TOLERANCE:
        raise site.fault(
            "steering",
            f": the joints are {np.round(ahead, 4)} m ahead of the rear axle; allowed: one positive "
            "distance",
        )
    return ahead[0]


# Parameters of the kernels: R, W, L, number of steering joints, number of front wheels, the signs of
# the steering joints, of the rear wheels and of the front wheels. The first steering joint is delta.


@kernel
def _velocity_map(parameters: Vector, x: Vector, N: Matrix) -> None:
    """The columns of the engine and of the steering."""
    R, W, L = parameters[0], parameters[1], parameters[2]
    n, front = int(parameters[3]), int(parameters[4])
    delta = parameters[5] * x[3]
    t = math.tan(delta)
    N[0, 0], N[1, 0], N[2, 0] = R * math.cos(x[2]), R * math.sin(x[2]), R * t / L
    for i in range(3):
        N[i, 1] = 0.0
    for i in range(n):
        N[3 + i, 0] = 0.0
        N[3 + i, 1] = parameters[5 + i]
    for i in range(2 + front):
        side = 1.0 - 2.0 * (i % 2)  # right, left
        row, sign = 3 + n + i, parameters[5 + n + i]
        if i < 2:
            N[row, 0] = sign * (1.0 + side * W * t / L)
        else:
            N[row, 0] = sign * (1.0 / math.cos(delta) + side * W * math.sin(delta) / L)
        N[row, 1] = 0.0


@kernel
def _velocity_map_rate(parameters: Vector, x: Vector, x_dot: Vector, N_rate: Matrix) -> None:
    """d/dt of the same: the heading and the steering angle change it."""
    R, W, L = parameters[0], parameters[1], parameters[2]
    n, front = int(parameters[3]), int(parameters[4])
    delta, rate = parameters[5] * x[3], parameters[5] * x_dot[3]
    c, s = math.cos(delta), math.sin(delta)
    N_rate[:, :] = 0.0
    N_rate[0, 0] = -R * math.sin(x[2]) * x_dot[2]
    N_rate[1, 0] = R * math.cos(x[2]) * x_dot[2]
    N_rate[2, 0] = R / (L * c**2) * rate
    for i in range(2 + front):
        side = 1.0 - 2.0 * (i % 2)
        row, sign = 3 + n + i, parameters[5 + n + i]
        if i < 2:
            N_rate[row, 0] = sign * side * W / (L * c**2) * rate
        else:
            N_rate[row, 0] = sign * (s / c**2 + side * W * c / L) * rate


@kernel
def _actuation(parameters: Vector, x: Vector, B: Matrix) -> None:
    """Half the engine's torque on either rear wheel; the steering motor on the first joint."""
    n = int(parameters[3])
    B[:, :] = 0.0
    B[3, 1] = parameters[5]
    for i in range(2):
        B[3 + n + i, 0] = 0.5 * parameters[5 + n + i]


@kernel
def _constraints(parameters: Vector, x: Vector, A: Matrix, A_x: Tensor) -> None:
    """No lateral slip behind and in front, one angle of all knuckles, no slip of the rolling wheels."""
    R, W, L = parameters[0], parameters[1], parameters[2]
    n, front = int(parameters[3]), int(parameters[4])
    own = parameters[5]
    delta = own * x[3]
    c, s = math.cos(x[2]), math.sin(x[2])
    cf, sf = math.cos(x[2] + delta), math.sin(x[2] + delta)
    cd, sd = math.cos(delta), math.sin(delta)
    A[:, :] = 0.0
    A_x[:, :, :] = 0.0
    A[0, 0], A[0, 1] = s, -c
    A_x[0, 0, 2], A_x[0, 1, 2] = c, s
    A[1, 0], A[1, 1], A[1, 2] = sf, -cf, -L * cd
    A_x[1, 0, 2], A_x[1, 1, 2] = cf, sf
    A_x[1, 0, 3], A_x[1, 1, 3], A_x[1, 2, 3] = own * cf, own * sf, own * L * sd
    for i in range(1, n):
        A[1 + i, 3], A[1 + i, 3 + i] = own, -parameters[5 + i]
    for i in range(2 + front):
        side = 1.0 - 2.0 * (i % 2)
        row = 1 + n + i
        A[row, 3 + n + i] = -R * parameters[5 + n + i]
        if i < 2:
            A[row, 0], A[row, 1], A[row, 2] = c, s, side * W
            A_x[row, 0, 2], A_x[row, 1, 2] = -s, c
        else:
            A[row, 0], A[row, 1], A[row, 2] = cf, sf, side * W * cd + L * sd
            A_x[row, 0, 2], A_x[row, 1, 2] = -sf, cf
            A_x[row, 0, 3], A_x[row, 1, 3] = -own * sf, own * cf
            A_x[row, 2, 3] = own * (L * cd - side * W * sd)


@kernel
def _constraint_derivative_rate(
    parameters: Vector, x: Vector, x_dot: Vector, A_x_rate: Tensor
) -> None:
    """d/dt of the derivatives of A."""
    W, L = parameters[1], parameters[2]
    n, front = int(parameters[3]), int(parameters[4])
    own = parameters[5]
    delta, turning = own * x[3], own * x_dot[3]
    c, s = math.cos(x[2]) * x_dot[2], math.sin(x[2]) * x_dot[2]
    both = x_dot[2] + turning
    cf, sf = math.cos(x[2] + delta) * both, math.sin(x[2] + delta) * both
    cd, sd = math.cos(delta) * turning, math.sin(delta) * turning
    A_x_rate[:, :, :] = 0.0
    A_x_rate[0, 0, 2], A_x_rate[0, 1, 2] = -s, c
    A_x_rate[1, 0, 2], A_x_rate[1, 1, 2] = -sf, cf
    A_x_rate[1, 0, 3], A_x_rate[1, 1, 3], A_x_rate[1, 2, 3] = -own * sf, own * cf, own * L * cd
    for i in range(2 + front):
        side = 1.0 - 2.0 * (i % 2)
        row = 1 + n + i
        if i < 2:
            A_x_rate[row, 0, 2], A_x_rate[row, 1, 2] = -c, -s
        else:
            A_x_rate[row, 0, 2], A_x_rate[row, 1, 2] = -cf, -sf
            A_x_rate[row, 0, 3], A_x_rate[row, 1, 3] = -own * cf, -own * sf
            A_x_rate[row, 2, 3] = -own * (L * sd + side * W * cd)


def _parameters(parameters: dict[str, Any], origin: str) -> CarLikeParameters:
    given = validate(CarLikeParameters, parameters, f"{origin}: [platform]")
    for field, allowed in (("steering", (0, 1, 2)), ("front_wheels", (0, 2))):
        if len(getattr(given, field)) not in allowed:
            raise SpecError(
                f"{origin}: field 'platform.{field}' has {len(getattr(given, field))} joints; allowed: "
                f"{' or '.join(map(str, allowed[1:]))}"
            )
    return given
