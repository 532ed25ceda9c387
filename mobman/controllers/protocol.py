"""Interface of a controller, the registry of controllers, and the base of mobman's laws."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from numbers import Real
from typing import Any, Protocol, runtime_checkable

import numpy as np

from mobman.arrays import Array
from mobman.compiled import bind, signature
from mobman.controllers.gains import as_settings
from mobman.controllers.task_errors import Entry, Stop, TaskSpace
from mobman.display import Displayed, Shown, line_of
from mobman.errors import GainError, UnknownNameError, UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.registry import Registry, made_by
from mobman.tasks.task import Task


@runtime_checkable
class Controller(Protocol):
    """A sampled control law; any object with these two methods is one.

    Optional: ``name``; ``settings() -> dict`` with the gains in force, for records; ``signals() ->
    dict`` with arrays of the last tick, recorded under their names (``"sliding/s"``, ...);
    ``monitored_signals()``, what :mod:`mobman.simulation.monitors` needs of a sliding law;
    ``signals_in_place``, true if those arrays stay the same from :meth:`reset` on and are overwritten;
    ``criterion``, what e^a is measured by, the robot's posture criterion if there is none; ``uses``, the
    keys of :data:`INFORMATION` that the law takes, for reports, which say nothing if there is none;
    ``limit_motors(acting)``, called before :meth:`reset` with the limits that act behind the law (see
    :class:`mobman.controllers.motors.LimitedMotors`).

    >>> import mobman as mm
    >>> import numpy as np
    >>> class Hold:  # gravity compensation with damping
    ...     def reset(self, robot, task, dt):
    ...         self.robot = robot
    ...
    ...     def step(self, t, q, z, z_dot):
    ...         M, bias, B = self.robot.dynamics(q, z)
    ...         return np.linalg.solve(B, bias - 5.0 * M @ z)
    >>> isinstance(Hold(), mm.Controller)
    True
    >>> mm.simulate("youbot", Hold(), "paper", duration=0.05).status
    'ok'
    """

    def reset(self, robot: MobileManipulator, task: Task, dt: float) -> None:
        """Start again with the nominal robot, the task and the sampling period (s)."""
        ...

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque to hold from t to t + dt.

        Args:
            t: Time (s).
            q: Measured configuration (m, rad), shape (nq,).
            z: Measured reduced velocity, shape (nz,).
            z_dot: Measured reduced acceleration under the torque held until now, shape (nz,).

        Returns:
            v of (17): torques of the wheels, then torques or forces of the arm (N m, N), shape (nz,).
        """
        ...


INFORMATION = {
    "z'": "the measured acceleration z'",
    "M": "the nominal inertia M",
    "bias": "the nominal bias Pz + G",
    "J'": "the rate of the task's Jacobian, J' z",
    "limits": "bounds of torques, velocities or positions",
    "preview": "the desired trajectory ahead of time",
}
"""Information that laws differ in, by its name in a law's ``uses``. What every law has is left out: q,
z, the task's coordinates and Jacobian J, N and B of the platform, and p_d with its derivatives."""

controllers: Registry[type[Any]] = Registry(
    "controller", "mobman.controllers", "mobman.controllers"
)
"""Classes that are made from an instance of their own ``Gains``, a dataclass, or without anything."""


def list_controllers() -> list[str]:
    """The names that :func:`make_controller` takes, sorted: mobman's and other packages'.

    >>> import mobman as mm
    >>> "tsm" in mm.list_controllers()
    True
    """
    return controllers.names()


def make_controller(name: str, **gains: Any) -> Controller:
    """A controller by name.

    Args:
        name: One of :func:`list_controllers`.
        **gains: Fields of the controller's ``Gains``, in the units that ``mobman controllers NAME``
            lists; underscores may be left out (``lambda0``).

    >>> import mobman as mm
    >>> mm.make_controller("tsm", a=0.2)
    TerminalSlidingMode('tsm', a=0.2)

    Raises:
        UnknownNameError: If there is no such controller, or it has no such gain.
        GainError: If a gain is outside what the theory allows.
    """
    law, fields = controllers.get(name), gains_by_field(name, gains)
    given = [law.Gains(**fields)] if hasattr(law, "Gains") else []
    made: Controller = made_by(law, f"controller {name!r} cannot be made of its gains", *given)
    return made


def settings_of(controller: Controller) -> dict[str, Any]:
    """The settings that a controller reports, if any; UsageError if they are no dictionary."""
    settings: Any = getattr(controller, "settings", dict)()
    if not isinstance(settings, Mapping):
        raise UsageError(f"the controller's settings are {settings!r}: expected a dictionary")
    return dict(settings)


def information_of(name: str, gains: Mapping[str, Any] | None = None) -> tuple[str, ...] | None:
    """The information that a controller uses, in the order of :data:`INFORMATION`.

    Args:
        name: A controller's; no package is loaded for it.
        gains: Those that are not the default; a law with the method ``uses_with`` says what it uses with
            them.

    Returns:
        None if it is not known here, or does not say.
    """
    law: Any = controllers.loaded().get(name)
    uses = getattr(law, "uses", None)
    if gains and hasattr(law, "uses_with"):
        uses = law.uses_with(gains)
    if not isinstance(uses, (tuple, list, set, frozenset)):
        return None
    return tuple(item for item in INFORMATION if item in uses)


def gains_by_field(name: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Gains of a controller by the names of its fields, also where underscores are left out.

    Raises:
        UnknownNameError: If there is no such controller, or it has no such gain.
        UsageError: If one is given twice.
    """
    kind = getattr(controllers.get(name), "Gains", None)
    fields = [] if kind is None else [field.name for field in dataclasses.fields(kind)]
    plain = {field.replace("_", ""): field for field in fields}
    found: dict[str, Any] = {}
    for key, value in given.items():
        field = key if key in fields else plain.get(key.replace("_", ""))
        if field is None:
            raise UnknownNameError(f"gain of {name!r}", key, fields)
        if field in found:
            raise UsageError(f"gain {field!r} of {name!r} is given twice")
        found[field] = value
    return found


# Base of mobman's laws --------------------------------------------------------------------------------


class NotResetError(UsageError, AttributeError):
    """An attribute of a law that :meth:`Controller.reset` has not made yet."""


class TaskSpaceLaw(Displayed):
    """Base of laws that drive a :class:`TaskSpace`; their ``reset`` makes what a tick needs.

    It shows a law's name and the gains that are not the defaults, and says what is wrong with the
    arguments of ``reset``, and that it comes first.
    """

    name: str
    gains: Any
    extended = False
    """True if e = (e^e, e^a) of (13) is driven to zero, the tip's errors and the criterion's
    transversality conditions; False if it is e^e alone."""
    values: dict[str, Any]
    """Arguments of kernels by their names, see :meth:`begin`."""
    _law: Entry
    """What a tick computes, up to ``_v``."""
    _v: Array
    """The torque, shape (nz,)."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if (reset := vars(cls).get("reset")) is None:
            return

        @functools.wraps(reset)
        def checked(self: Any, robot: Any, task: Any, dt: Any) -> None:
            if not isinstance(robot, MobileManipulator):
                raise UsageError(f"robot = {robot!r}: expected what mobman.load_robot gives")
            if not (isinstance(dt, Real) and 0.0 < float(dt) < math.inf):
                raise UsageError(f"dt = {dt!r}: expected a number above 0 (s)")
            reset(self, robot, task, dt)

        cls.reset = checked  # type: ignore[attr-defined]

    def __init__(self, gains: Any) -> None:
        self.gains = gains
        self._settings: dict[str, Any] = as_settings(gains)

    def begin(self, space: TaskSpace, dt: float) -> None:
        """Keep a task space, and what there is at a tick as ``values``: the gains that are numbers,
        ``dt``, ``at`` and ``J`` of the space, what its :class:`mobman.model.dynamics.Buffers` has
        (``M``, ``bias``, ``B``, ``C``, ``z``, ...), the z' that is given, ``measured``, shape (nz,), and
        ``force`` and ``work``, shapes (nz,) and (nz, nz), to compute in."""
        nz = len(space.now.z)
        self._space, self._measured = space, np.zeros(nz)
        gains: dict[str, Any] = vars(self.gains)
        known = {k: x for k, x in gains.items() if isinstance(x, Real | np.ndarray)}
        numbers = {k: float(x) for k, x in known.items() if getattr(x, "ndim", 0) == 0}
        self.values = {**numbers, **vars(space.now), "at": space.tracking, "J": space.J, "dt": dt}
        own = {"measured": self._measured, "force": np.zeros(nz), "work": np.zeros((nz, nz))}
        self.values |= own
        self._hidden = {k for k in numbers if self.values[k] is not numbers[k]}

    def entry(self, function: Callable[..., Any], **own: Any) -> Entry:
        """A kernel with its arguments, which are found by their names, first in ``own``.

        Raises:
            UnknownNameError: If there is nothing of such a name.
            GainError: If a gain has the name of another quantity of the tick.
        """
        values = self.values | own
        for name in signature(function).parameters:
            if name in self._hidden - own.keys():
                raise GainError(
                    f"{name} is a gain of {self.name!r} and a quantity of every tick, and the kernel "
                    f"{function.__name__!r} has an argument of that name; give the gain another name"
                )
            if name not in values:
                what = f"argument of the kernel {function.__name__!r}:"
                raise UnknownNameError(what, name, {key for key in values if key[0] != "_"})
        return bind(function, *(values[name] for name in signature(function).parameters))

    def step(self, t: float, q: Array, z: Array, z_dot: Array) -> Array:
        """The torque v for the tick, shape (nz,); see :class:`Controller`."""
        self._space.at(t, q, z)
        try:
            if len(z_dot) != len(self._measured):
                raise ValueError
            self._measured[...] = z_dot
        except (TypeError, ValueError):
            shape = self._measured.shape
            raise UsageError(
                f"z_dot has shape {np.shape(z_dot)}; expected {shape}, of numbers"
            ) from None
        if stop := self._law():
            raise Stop(stop).error(self.extended)
        return self._v.copy()

    def settings(self) -> dict[str, Any]:
        """The gains; after :meth:`reset`, with the numbers that defaults and "auto" became."""
        return self._settings

    def __getattr__(self, name: str) -> Any:
        raise NotResetError(
            f"{type(self).__name__} has no {name!r} before reset(robot, task, dt), which comes first"
        )

    def _shown(self) -> Shown:
        fields = dataclasses.fields(self.gains)
        values = {field.name: getattr(self.gains, field.name) for field in fields}
        defaults = type(self.gains)()
        usual = {name for name, v in values.items() if np.array_equal(v, getattr(defaults, name))}
        given = {name: v for name, v in values.items() if name not in usual}
        return Shown(line_of(type(self).__name__, self.name, given), values)
