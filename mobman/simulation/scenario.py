"""Scenarios: differences of the plant and its sensors from what the controller supposes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextvars import ContextVar
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import (
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    field_validator,
    model_serializer,
    model_validator,
)

from mobman.arrays import Array
from mobman.display import Displayed, Shown, line_of
from mobman.errors import MobmanError, SpecError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.actuation import ActuationChain, actuations
from mobman.simulation.disturbances import Torque, disturbances
from mobman.simulation.estimators import estimators
from mobman.simulation.friction import frictions
from mobman.simulation.inertias import inertias, true_robot
from mobman.simulation.kinematics import Encoders, kinematics
from mobman.simulation.pieces import Piece, Setting, Source, started
from mobman.simulation.plant import Plant, plants
from mobman.simulation.sensors import Measurement, pose_index, sensors
from mobman.simulation.slip import slips
from mobman.simulation.stops import stops
from mobman.toml_model import Strict, describe, named_file, read_toml, validate


class KinematicsSource(Source):
    """A difference of the robot's dimensions."""

    group, what, kinds = "kinematics", "kinematics", kinematics


class InertiaSource(Source):
    """A difference of the links' masses and inertias."""

    group, what, kinds = "inertias", "inertia", inertias


class FrictionSource(Source):
    """A friction."""

    group, what, kinds = "friction", "friction", frictions


class DisturbanceSource(Source):
    """A disturbance torque."""

    group, what, kinds = "disturbances", "disturbance", disturbances


class ActuationSource(Source):
    """A stage between the commanded torque and the one that acts."""

    group, what, kinds = "actuation", "actuation", actuations


class SensorSource(Source):
    """An error of the measurements."""

    group, what, kinds = "sensors", "sensor", sensors


class SlipSource(Source):
    """A slip of the platform."""

    group, what, kinds = "slip", "slip", slips


class StopSource(Source):
    """Stops at limits of the joints."""

    group, what, kinds = "stops", "stop", stops


class AccelerationSource(Source):
    """An estimator of z', with its parameters."""

    group, what, kinds = "acceleration", "acceleration", estimators


class PlantSource(Source):
    """A plant, with its parameters."""

    group, what, kinds = "plant", "plant", plants


S = TypeVar("S", bound=Source)


def _single(kind: type[S], value: Any) -> S | str:
    """A piece by the name of its type, if it needs no parameters, or as a table."""
    if isinstance(value, kind):
        return value
    fields = {"type": value} if isinstance(value, str) else value
    names = kind.kinds.names()
    if not isinstance(fields, dict) or fields.get("type") not in names:
        choices = ", ".join(map(repr, names))
        raise ValueError(f"must be one of {choices}, or a table with such a 'type'")
    parameters = {name: given for name, given in fields.items() if name != "type"}
    validate(kind.kinds.get(fields["type"]), parameters, f"{kind.what} {fields['type']!r}")
    source = kind(**fields)
    return source if source.__pydantic_extra__ else source.type


Number = Annotated[float, Field(strict=True)]


MOST_PIECES = 100
"""Pieces of one kind in a scenario."""


class Scenario(Displayed, Strict):
    """A scenario: the content of a file ``mobman/simulation/scenarios/NAME.toml``.

    >>> import mobman as mm
    >>> late = mm.Scenario(
    ...     name="late", payload=0.5, actuation=[{"type": "delay", "delay": 0.001}]
    ... )
    >>> mm.simulate("youbot", "pseudo-inverse", "paper", duration=0.05, scenario=late).scenario
    'late'

    Raises:
        SpecError: With every field that is wrong: what was found and what is allowed.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    description: str = ""
    extends: list[str] = []
    """Scenarios by name or file that this one begins with: their lists come before its own, and of a
    single value the last one given counts. Empty once they are in it."""
    mass_factor: Number = Field(1.0, gt=0)
    """True mass of every link over the nominal one."""
    inertia_factor: Number | None = Field(None, gt=0)
    """True rotational inertia of every link over the nominal one; the mass factor by default."""
    payload: Number = Field(0.0, ge=0)
    """Point mass at the tip that the controller does not know (kg)."""
    kinematics: list[KinematicsSource] = Field([], max_length=MOST_PIECES)
    """Wrong dimensions: J, and N of the platform; one after the other."""
    tip: Literal["modelled", "measured"] = "modelled"
    """A law's knowledge of its tip: its model at the measured q and z, or the true tip's position and
    velocity; its Jacobian is the model's in either case."""
    inertias: list[InertiaSource] = Field([], max_length=MOST_PIECES)
    """More of the kind, one after the other, before the payload."""
    friction: list[FrictionSource] = Field([], max_length=MOST_PIECES)
    """On the motors' axes; they add up."""
    disturbances: list[DisturbanceSource] = Field([], max_length=MOST_PIECES)
    """Torques added to the motors'; D = -B d in (17)."""
    actuation: list[ActuationSource] = Field([], max_length=MOST_PIECES)
    """From the commanded torque to the one that acts, in the order of the signal."""
    sensors: list[SensorSource] = Field([], max_length=MOST_PIECES)
    """Errors of q, z and z', in the order in which they happen."""
    acceleration: Annotated[
        str | AccelerationSource, BeforeValidator(partial(_single, AccelerationSource))
    ] = "exact"
    """Estimator of z': ``"exact"``, ``"backward-difference"``, or a table with a type."""
    slip: list[SlipSource] = Field([], max_length=MOST_PIECES)
    """Velocities of the platform's pose in addition to that of rolling; they add up."""
    stops: list[StopSource] = Field([], max_length=MOST_PIECES)
    """Forces that keep joints from leaving their limits; they add up."""
    plant: Annotated[str | PlantSource, BeforeValidator(partial(_single, PlantSource))] = "ideal"
    """``"ideal"``, where wheels roll by construction, or a table with a type."""
    start_offset: Number = Field(0.0, ge=0)
    """Distance of the platform behind the start that the task is made for (m), along its heading; a
    start that is given as ``q0`` counts as it is, and a robot that does not drive stays."""

    def __init__(self, **fields: Any) -> None:
        try:
            super().__init__(**fields)
        except ValidationError as error:
            what = f"scenario {fields.get('name', '')!r}"
            raise SpecError(f"{what}: {describe(Scenario, error)}") from error

    @model_validator(mode="before")
    @classmethod
    def _extended(cls, content: Any) -> Any:
        if not isinstance(content, dict) or not content.get("extends"):
            return content
        try:
            bases = [load_scenario(name) for name in content["extends"]]
        except (MobmanError, TypeError):
            return content  # reported with the field, together with whatever else is wrong
        merged: dict[str, Any] = {}
        for part in [*map(_given, bases), content]:
            for name, value in part.items():
                lists = isinstance(value, list) and isinstance(merged.get(name), list)
                merged[name] = merged[name] + value if lists else value
        return {**merged, "extends": []}

    @field_validator("extends")
    @classmethod
    def _loads(cls, names: list[str]) -> list[str]:
        for name in names:
            load_scenario(name)
        return names

    @model_serializer(mode="wrap")
    def _without_the_usual(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Scenarios, and with them the identity of runs, stay what they were without the field."""
        fields: dict[str, Any] = plain(self)
        for name, usual in (("plant", "ideal"), ("kinematics", []), ("tip", "modelled")):
            if fields.get(name) == usual:
                del fields[name]
        return fields

    def _shown(self) -> Shown:
        given = _given(self)
        line = line_of("Scenario", self.name, given)
        return Shown(line, {"description": self.description, **given})

    def types(self) -> list[type[Piece]]:
        """The types of its pieces."""
        lists = (
            self.kinematics,
            self.inertias,
            self.friction,
            self.disturbances,
            self.actuation,
            self.sensors,
            self.slip,
            self.stops,
        )
        singles = self._source(AccelerationSource, self.acceleration), self._plant
        return [piece.kinds.get(piece.type) for piece in (*chain(*lists), *singles)]

    @staticmethod
    def _source(kind: type[S], own: S | str) -> S:
        return kind(type=own) if isinstance(own, str) else own

    @property
    def _plant(self) -> PlantSource:
        return self._source(PlantSource, self.plant)

    # Parts of a run. Each takes its setting, and raises SpecError if a piece does not fit the robot.

    def true_robot(self, setting: Setting) -> MobileManipulator:
        """The setting's robot with the true dimensions and inertias; the same object if nothing
        changes."""
        robot = setting.robot
        for remake in self._started(self.kinematics, setting):
            robot = remake(robot)
        scaled = true_robot(robot, self.mass_factor, self.inertia_factor)
        if self.inertias:
            model = scaled.model.copy()
            for change in self._started(self.inertias, setting):
                change(model)
            scaled = robot.with_model(model)
        return true_robot(scaled, payload=self.payload)

    def start_of(self, robot: MobileManipulator, placed: Array | None = None) -> Array:
        """The start of a run whose task is made for another (m, rad), shape (nq,).

        Args:
            robot: The robot.
            placed: The start that the task is made for, shape (nq,); ``robot.q_rest`` by default.
        """
        start = np.array(robot.q_rest if placed is None else placed, dtype=float)
        if robot.platform.base_joints:
            x, y, theta = pose_index(robot)
            forward = start[theta] + getattr(robot.platform, "heading", 0.0)
            start[x] -= self.start_offset * np.cos(forward)
            start[y] -= self.start_offset * np.sin(forward)
        return start

    def disturbance(self, setting: Setting) -> Torque | None:
        """The sum of the disturbances; None if there are none."""
        parts: list[Torque] = self._started(self.disturbances, setting)
        if not parts:
            return None

        def total(t: float) -> Array:
            torque = parts[0](t)
            for part in parts[1:]:
                torque = torque + part(t)
            return torque

        return total

    def make_plant(self, setting: Setting, true: MobileManipulator) -> Plant:
        """The true robot under its disturbances, its friction and its slip.

        Args:
            setting: With the nominal robot, in whose inertia relative amplitudes are measured.
            true: The true robot.
        """
        (make,) = self._started([self._plant], setting)
        plant: Plant = make(
            true,
            self.disturbance(setting),
            self._started(self.friction, setting),
            self._started(self.slip, setting),
            self._started(self.stops, setting),
        )
        return plant

    def actuation_chain(self, setting: Setting) -> ActuationChain | None:
        """The stages from the commanded torque to the one that acts; None if they are the same."""
        stages = self._started(self.actuation, setting)
        return ActuationChain(stages, setting.dt, setting.robot.nz) if stages else None

    def measurement(self, setting: Setting, true: MobileManipulator | None = None) -> Measurement:
        """The measurement that the controller is given, of the true robot; by default the nominal."""
        estimator = self._source(AccelerationSource, self.acceleration)
        (estimate,) = self._started([estimator], setting)
        encoders = None
        if true is not None and true.motors is not true.platform:  # other wheels
            encoders = Encoders(setting.robot, true, setting.dt)
        return Measurement(estimate, self._started(self.sensors, setting), encoders)

    def _started(self, sources: Sequence[Source], setting: Setting) -> list[Any]:
        try:
            return started(sources, setting)
        except SpecError as error:
            raise SpecError(f"scenario {self.name!r}: {error}") from error


def _given(scenario: Scenario) -> dict[str, Any]:
    """The fields that a scenario gives, for one that begins with it."""
    own = scenario.model_fields_set - {"name", "description", "extends"}
    return scenario.model_dump(mode="json", include=own)


def list_scenarios() -> list[str]:
    """The names that :func:`mobman.simulate` takes as ``scenario``, sorted.

    >>> import mobman as mm
    >>> "heavier" in mm.list_scenarios()
    True
    """
    return sorted(_files())


_loading: ContextVar[tuple[Path, ...]] = ContextVar("_loading", default=())


def load_scenario(name_or_path: str | os.PathLike[str]) -> Scenario:
    """A scenario by name, or from a TOML file.

    >>> import mobman as mm
    >>> mm.load_scenario("heavier")
    Scenario('heavier', mass_factor=1.3, payload=1.0)

    Args:
        name_or_path: One of :func:`list_scenarios`, or a path, which ends in ``.toml`` or has a
            separator.

    Raises:
        UnknownNameError: If there is no such name.
        SpecError: If the file is not valid.
    """
    path = named_file("scenario", name_or_path, _files())
    content = read_toml(path, "scenario file")
    where = path.resolve()
    outer = _loading.get()
    if where in outer:
        circle = " -> ".join(some.name for some in (*outer[outer.index(where) :], where))
        raise SpecError(f"{path}: field 'extends' comes back to the file itself: {circle}")
    token = _loading.set((*outer, where))
    try:
        return validate(Scenario, _with_paths(content, path.parent), str(path))
    finally:
        _loading.reset(token)


def _with_paths(content: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The content with the files that it extends found from its own folder."""
    names = content.get("extends")
    if not isinstance(names, list):
        return content
    files = [
        str(folder / name)
        if isinstance(name, str) and name not in _files() and name.endswith(".toml")
        else name
        for name in names
    ]
    return {**content, "extends": files}


def _files() -> dict[str, Path]:
    folder = Path(__file__).parent / "scenarios"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}
