"""A platform of the user's own: A and N in Python."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, runtime_checkable

import numpy as np
from pydantic import Field

from mobman.arrays import Array
from mobman.errors import FOREIGN_ERRORS, SpecError
from mobman.model.platforms.platform import Equations, Platform, Wheel, platforms
from mobman.model.platforms.wheels import Site
from mobman.robots.urdf.compose import BASE_JOINTS
from mobman.toml_model import Strict

# Central differences of order 8: with such steps the truncation, 1e-16 of a ninth and 1e-15 of a tenth
# derivative, is below rounding.
_STEP, _WEIGHTS = 0.02, (4 / 5, -1 / 5, 4 / 105, -1 / 280)
_SECOND_STEP, _SECOND_WEIGHTS = 0.04, (8 / 5, -1 / 5, 8 / 315, -1 / 560)


_no_code: ContextVar[bool] = ContextVar("no_code", default=False)


@contextmanager
def without_code() -> Iterator[None]:
    """Refuse platforms that are Python code within a block that only looks at robots."""
    token = _no_code.set(True)
    try:
        yield
    finally:
        _no_code.reset(token)


class CustomParameters(Strict):
    """The fields of ``[platform]`` for ``type = "custom"``."""

    definition: str = Field(pattern=r"^.+:[A-Za-z_][A-Za-z0-9_]*$")
    """The class: ``"file.py:Class"``, relative to the TOML, or ``"package.module:Class"``."""
    options: dict[str, Any] = {}  # arguments that it is called with, by name


@runtime_checkable
class PlatformDefinition(Protocol):
    """Interface of a user's platform class.

    Optional: ``root_offset`` (3,), ``heading`` and ``wheels`` (pairs of a joint and a radius), as of
    :class:`Platform`; ``actuation(x)``, B'' of
    (16), shape (l, l-k), by default N (N^T N)^-1, so that the commands are the forces that belong to
    alpha and B is the identity; and exact derivatives, each found by finite differences (to rounding,
    but slowly) where it is missing: ``velocity_map_rate(x, x_dot)``, shape (l, l-k),
    ``constraint_derivative(x)`` dA_ij/dx_m, shape (k, l, l), and its rate
    ``constraint_derivative_rate(x, x_dot)``.
    """

    coordinates: Sequence[str]
    """Joint names of x: ``base_x``, ``base_y``, ``base_theta`` first, then joints of the URDF."""
    velocity_names: Sequence[str]  # names of alpha

    def constraint_matrix(self, x: Array) -> Array:
        """A(x), shape (k, l); smooth."""
        ...

    def velocity_map(self, x: Array) -> Array:
        """N(x), shape (l, l-k); smooth."""
        ...


@platforms.register("custom")
class Custom(Platform):
    """A platform defined by the user's A(x) and N(x); SpecError if the definition lacks something, gives
    wrong shapes, or A N is not 0."""

    fields = CustomParameters

    def __init__(self, site: Site, given: CustomParameters) -> None:
        where = f"{site.origin}: field 'platform.definition' is {given.definition!r}"
        if _no_code.get():
            raise SpecError(
                f"{where}: Python code, which runs when the robot is loaded for a run or a check, not "
                "when it is only looked at"
            )
        made = load_code(given.definition, site.folder, where)
        step = "calling it"
        try:
            definition = made(**given.options)
            step = "reading its attributes"
            self._take(definition, where)
        except SpecError:
            raise
        except FOREIGN_ERRORS as error:
            raise SpecError(f"{where}: {step} failed: {error!r}") from error
        movable = list(site.tree.names)[1:]
        for name in self.coordinates[3:]:
            if name not in movable:
                raise SpecError(
                    f"{where}: its coordinate {name!r} is no movable joint; there are: "
                    f"{', '.join(movable)}"
                )
        self._check(where)

    def _take(self, definition: PlatformDefinition, where: str) -> None:
        """Take the attributes of the user's object."""
        if not isinstance(definition, PlatformDefinition):
            raise SpecError(
                f"{where}: {type(definition).__name__} needs coordinates, velocity_names, "
                "constraint_matrix(x) and velocity_map(x)"
            )
        self._definition = definition
        coordinates = tuple(definition.coordinates)
        if coordinates[:3] != BASE_JOINTS:
            raise SpecError(
                f"{where}: its coordinates are {coordinates}; the first three are to be "
                f"{', '.join(BASE_JOINTS)}"
            )
        try:
            offset = np.array(getattr(definition, "root_offset", np.zeros(3)), dtype=float)
            heading = float(getattr(definition, "heading", 0.0))
            pairs = getattr(definition, "wheels", ())
            wheels = [Wheel(str(joint), float(radius)) for joint, radius in pairs]
        except (TypeError, ValueError) as error:
            raise SpecError(
                f"{where}: root_offset is to be 3 numbers (m), heading a number (rad), wheels pairs of "
                f"a joint and a radius (m): {error}"
            ) from error
        if offset.shape != (3,) or not np.all(np.isfinite([*offset, heading])):
            raise SpecError(
                f"{where}: root_offset is {offset} and heading {heading}; needed: 3 finite numbers (m) "
                "and a finite angle (rad)"
            )
        for wheel in wheels:
            if wheel.joint not in coordinates or not 0.0 < wheel.radius < np.inf:
                raise SpecError(
                    f"{where}: wheels has {tuple(wheel)}; needed: one of its coordinates, and a radius "
                    "above 0 (m)"
                )
        names = tuple(definition.velocity_names)
        if not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
            raise SpecError(f"{where}: its velocity_names are {names}; needed: different names")
        equations = Equations(
            np.zeros(0),
            partial(self._fill, "velocity_map"),
            partial(self._fill, "velocity_map_rate"),
            self._fill_constraints,
            partial(self._fill, "constraint_derivative_rate"),
            partial(self._fill, "actuation"),
        )
        super().__init__(coordinates[3:], names, equations, offset, heading, wheels)

    def _value(self, name: str, *arguments: Array) -> Array:
        """The value of one of the user's functions, or of what is here instead of it."""
        function = getattr(self._definition, name, None) or getattr(self, f"_{name}")
        return np.asarray(function(*(argument.copy() for argument in arguments)), dtype=float)

    def _fill(self, name: str, parameters: Array, *given: Array) -> None:
        *arguments, matrix = given
        matrix[:] = self._value(name, *arguments)

    def _fill_constraints(self, parameters: Array, x: Array, A: Array, A_x: Array) -> None:
        A[:], A_x[:] = self._value("constraint_matrix", x), self._value("constraint_derivative", x)

    def _velocity_map_rate(self, x: Array, x_dot: Array) -> Array:
        return _along(self._definition.velocity_map, x, x_dot)

    def _constraint_derivative(self, x: Array) -> Array:
        matrix = self._definition.constraint_matrix
        return np.stack([_along(matrix, x, e) for e in np.eye(len(x))], axis=-1)

    def _constraint_derivative_rate(self, x: Array, x_dot: Array) -> Array:
        matrix = self._definition.constraint_matrix
        return np.stack([_mixed(matrix, x, e, x_dot) for e in np.eye(len(x))], axis=-1)

    def _actuation(self, x: Array) -> Array:
        N = self._value("velocity_map", x)
        B: Array = N @ np.linalg.inv(N.T @ N)
        return B

    def _check(self, where: str) -> None:
        l, p = len(self.coordinates), len(self.velocity_names)
        k, x, x_dot = l - p, np.linspace(0.1, 0.5, l), np.linspace(-0.3, 0.2, l)
        values = {}
        for name, shape, arguments in (
            ("constraint_matrix", (k, l), (x,)),
            ("velocity_map", (l, p), (x,)),
            ("actuation", (l, p), (x,)),
            ("velocity_map_rate", (l, p), (x, x_dot)),
            ("constraint_derivative", (k, l, l), (x,)),
            ("constraint_derivative_rate", (k, l, l), (x, x_dot)),
        ):
            if not hasattr(self._definition, name):
                continue
            try:
                found = values[name] = self._value(name, *arguments)
            except FOREIGN_ERRORS as error:
                raise SpecError(f"{where}: {name} failed: {error!r}") from error
            if found.shape != shape or not np.all(np.isfinite(found)):
                raise SpecError(
                    f"{where}: {name} gives shape {found.shape}; needed: {shape}, finite numbers, for "
                    f"{l} coordinates and {p} velocities"
                )
        a, n = values["constraint_matrix"], values["velocity_map"]
        size = max(1.0, float(np.abs(a).max(initial=0.0) * np.abs(n).max(initial=0.0)))
        if (residual := float(np.abs(a @ n).max(initial=0.0))) > 1e-9 * size:
            raise SpecError(
                f"{where}: A(x) N(x) is not 0 but {residual:.2g}, at x = {x.tolist()}: the velocities "
                "break the constraints (4)"
            )
        for what, matrix, rank in (("columns of N(x)", n, p), ("rows of A(x)", a, k)):
            if rank and np.linalg.matrix_rank(matrix) < rank:
                raise SpecError(f"{where}: the {what} depend on each other, at x = {x.tolist()}")


def _along(function: Callable[[Array], Array], x: Array, direction: Array) -> Array:
    """Derivative of a smooth function at x along a direction."""
    size = float(np.linalg.norm(direction)) or 1.0
    return size / _STEP * _stencil(function, x, _STEP / size * direction, _WEIGHTS, -1.0)


def _mixed(function: Callable[[Array], Array], x: Array, first: Array, second: Array) -> Array:
    """Second derivative of a smooth function at x along one direction, then another."""
    size = float(np.linalg.norm(second)) or 1.0
    unit = second / size
    return 0.25 * size * (_twice(function, x, first + unit) - _twice(function, x, first - unit))


def _twice(function: Callable[[Array], Array], x: Array, direction: Array) -> Array:
    """Second derivative of a smooth function at x along a direction."""
    around = _stencil(function, x, _SECOND_STEP * direction, _SECOND_WEIGHTS, 1.0)
    here = 2.0 * sum(_SECOND_WEIGHTS) * np.asarray(function(x.copy()), dtype=float)
    return (around - here) / _SECOND_STEP**2


def _stencil(
    function: Callable[[Array], Array], x: Array, step: Array, weights: Sequence[float], sign: float
) -> Array:
    """Weighted sum of a function's values ahead and, times the sign, behind."""
    parts = [
        weight * (np.asarray(function(x + k * step)) + sign * np.asarray(function(x - k * step)))
        for k, weight in enumerate(weights, start=1)
    ]
    total: Array = np.sum(parts, axis=0)
    return total


def load_code(definition: str, folder: Path, where: str) -> Any:
    """Import what a definition of the user names, ``"file.py:NAME"``, relative to a folder, or
    ``"package.module:NAME"``; SpecError, in which it is called ``where``, if it cannot be imported."""
    module_name, _, name = definition.rpartition(":")
    path = folder / module_name if module_name.endswith(".py") else None
    if path is not None and not path.is_file():
        raise SpecError(f"{where}: there is no file {path}")
    try:
        module = (
            importlib.import_module(module_name) if path is None else _import_file(path.resolve())
        )
        found = getattr(module, name, None)
    except FOREIGN_ERRORS as error:
        raise SpecError(f"{where}: importing it failed: {error!r}") from error
    if found is None:
        raise SpecError(f"{where}: {module_name} has no {name!r}")
    return found


def _import_file(path: Path) -> ModuleType:
    """The module in a file, under a name of its own, which dataclasses and pickles look it up by."""
    name = f"mobman_platform_{hashlib.sha256(str(path).encode()).hexdigest()[:12]}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
