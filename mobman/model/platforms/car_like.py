"""Car-like platforms: rear-wheel drive, the steering angle as a coordinate."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from pydantic import Field, field_validator

from mobman.arrays import Matrix, Vector
from mobman.compiled import kernel
from mobman.model.platforms.body import Knuckle, WheeledBody, WheelPart, required
from mobman.model.platforms.platform import (
    Equations,
    Gear,
    Platform,
    Wheel,
    WheeledFields,
    platforms,
)
from mobman.model.platforms.rolling import (
    constraint_derivative_rate,
    constraints,
    row,
    wheel_rates,
    wheel_rates_rate,
)
from mobman.model.platforms.wheels import LENGTH_TOLERANCE, Site, joints_of, sides, wheel_place

# names of a platform described by its numbers
_REAR = ("wheel_rear_right", "wheel_rear_left")
_STEERING = ("steering_right", "steering_left")
_FRONT = ("wheel_front_right", "wheel_front_left")


class CarBody(WheeledBody):
    """The fields of ``[platform.body]`` for a car: four wheels, the front ones on knuckles."""

    steering_limit: float = Field(gt=0, lt=0.5 * math.pi)  # largest steering angle (rad)
    steering_velocity: float = Field(0.0, ge=0)  # largest steering rate (rad/s); 0: not known
    knuckle_mass: float = Field(gt=0)  # mass of one knuckle (kg)


class CarLikeParameters(WheeledFields):
    """The fields of ``[platform]`` for ``type = "car-like"``."""

    rear_right_wheel: str | None = None  # URDF joint of the driven wheel on the right
    rear_left_wheel: str | None = None  # URDF joint of the driven wheel on the left
    steering: list[str] = Field([], max_length=2)
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

    @field_validator("front_wheels")
    @classmethod
    def _pair(cls, wheels: list[str]) -> list[str]:
        if len(wheels) not in (0, 2):
            raise ValueError(f"{len(wheels)} joints; allowed: 2")
        return wheels


@platforms.register("car-like")
class CarLike(Platform):
    r"""A car with a differential on its rear axle; one front wheel in the middle stands for two.

    Coordinates :math:`x = (x_1, x_2, \theta, \delta, \dots)`: the middle of the rear axle, the
    heading, the steering angle (of one joint, or of two that turn alike), the rear wheels (right,
    left) and, if they are named, the front wheels. :math:`\alpha = (\alpha_1, \dot\delta)` with
    :math:`\alpha_1` the mean rate of the rear wheels (rad/s): :math:`v = R\alpha_1`,
    :math:`\dot\theta = v\tan\delta/L`, :math:`\dot\phi = \alpha_1(1 \pm W\tan\delta/L)`. The
    engine's torque is shared equally between the rear wheels, a second motor steers: B is the
    identity. At :math:`|\delta| = \pi/2` the model has a singularity; the limits of the steering
    joint are to exclude it. SpecError if the wheels are not on one axle, or the steering joints not
    ahead of it.
    """

    fields = CarLikeParameters

    def __init__(self, site: Site, given: CarLikeParameters) -> None:
        rear = site.pair("rear_right_wheel", "rear_left_wheel", *_REAR)
        axle, half_track = sides(site, rear[:1], rear[1:])
        knuckles = site.steering("steering", *_STEERING)
        ahead = [float(place.centre[0] - axle[0]) for place in knuckles]
        if min(ahead) <= 0.0 or max(ahead) - min(ahead) > LENGTH_TOLERANCE:
            raise site.fault(
                "steering",
                f": the joints are {np.round(ahead, 4)} m ahead of the rear axle; allowed: one "
                "positive distance",
            )
        names = given.front_wheels or ([] if given.body is None else _FRONT)
        front = [wheel_place(site, name, "front_wheels", given.heading) for name in names]
        if front:
            sides(site, front[:1], front[1:])
        self.radius = R = given.wheel_radius
        W, L = given.half_track or half_track, given.wheelbase or ahead[0]
        self.half_track, self.wheelbase = W, L
        wheels, n = [*rear, *front], len(knuckles)
        l = 3 + n + len(wheels)
        turning = [place.turn for place in knuckles]
        steered = 3, turning[0]  # the first steering joint is delta
        # no lateral slip behind and in front, one angle of all knuckles, no slip of the rolling wheels
        rows = [row(l, -1j), row(l, -1j, L, steered)]
        rows += [row(l, others={3: turning[0], 3 + i: -turning[i]}) for i in range(1, n)]
        for i, place in enumerate(wheels):
            at, own = complex(0.0, W if i % 2 else -W), {3 + n + i: -R * place.sign}
            rows.append(row(l, 1.0, L + at, steered, own) if i > 1 else row(l, 1.0, at, others=own))
        numbers = [R, L, n, *turning, *(place.sign for place in rear)]
        super().__init__(
            joints_of([*knuckles, *wheels]),
            ("alpha_1", "delta_dot"),
            Equations(
                np.array([*np.ravel(rows), *numbers]),
                *(_velocity_map, _velocity_map_rate, constraints),
                *(constraint_derivative_rate, _actuation),
            ),
            wheels=[Wheel(joint, R) for joint in joints_of(wheels)],
            root_offset=np.array([0.0, 0.0, R]) - axle,
            heading=given.heading,
        )
        first = knuckles[0]
        self.geared = tuple(
            Gear(place.joint, first.joint, place.turn * first.turn) for place in knuckles[1:]
        )

    @classmethod
    def parts(cls, given: Any, origin: str) -> Iterable[WheelPart | Knuckle]:
        """Two wheels behind and two on knuckles in front."""
        body, R = given.body, given.wheel_radius
        W = required(origin, "half_track", given.half_track)
        L = required(origin, "wheelbase", given.wheelbase)
        motion = body.knuckle_mass, body.steering_limit, body.steering_velocity
        for rear, joint, front, y in zip(_REAR, _STEERING, _FRONT, (-W, W), strict=True):
            yield WheelPart(rear, (0.0, y, R))
            yield Knuckle(joint, (L, y, R), *motion)
            yield WheelPart(front, parent=f"{joint}_link")


# Parameters of the kernels: the table of constraints; R, L, number of steering joints, the signs of
# these and of the rear wheels.


@kernel
def _velocity_map(parameters: Vector, x: Vector, N: Matrix) -> None:
    """The columns of the engine and of the steering."""
    l, p = N.shape
    own = parameters[(l - p) * (6 + l) :]
    R, L, n = own[0], own[1], int(own[2])
    N[:, :] = 0.0
    N[0, 0], N[1, 0] = R * math.cos(x[2]), R * math.sin(x[2])
    N[2, 0] = R * math.tan(own[3] * x[3]) / L
    for i in range(n):
        N[3 + i, 1] = own[3 + i]
    wheel_rates(parameters, x, 1 + n, N)


@kernel
def _velocity_map_rate(parameters: Vector, x: Vector, x_dot: Vector, N_rate: Matrix) -> None:
    """d/dt of the same: the heading and the steering angle change it."""
    l, p = N_rate.shape
    own = parameters[(l - p) * (6 + l) :]
    R, L, n = own[0], own[1], int(own[2])
    delta, rate = own[3] * x[3], own[3] * x_dot[3]
    c, s = R * math.cos(x[2]), R * math.sin(x[2])
    N_rate[:, :] = 0.0
    N_rate[0, 0], N_rate[1, 0] = -s * x_dot[2], c * x_dot[2]
    N_rate[2, 0] = R / (L * math.cos(delta) ** 2) * rate
    pose = (c, s, R * math.tan(delta) / L)
    wheel_rates_rate(parameters, x, x_dot, 1 + n, pose, N_rate)


@kernel
def _actuation(parameters: Vector, x: Vector, B: Matrix) -> None:
    """Half the engine's torque on either rear wheel; the steering motor on the first joint."""
    l, p = B.shape
    own = parameters[(l - p) * (6 + l) :]
    n = int(own[2])
    B[:, :] = 0.0
    B[3, 1] = own[3]
    for i in range(2):
        B[3 + n + i, 0] = 0.5 * own[3 + n + i]
