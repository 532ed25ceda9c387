"""Scenarios: in what the plant and its sensors differ from what the controller supposes."""

from __future__ import annotations

import os
from contextvars import ContextVar
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError, field_validator, model_validator

from mobman.arrays import Array
from mobman.errors import MobmanError, SpecError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.accelerometer import AccelerationSource, Accelerometer
from mobman.simulation.actuation.actuation import Motors, actuations
from mobman.simulation.actuation.chain import ActuationChain
from mobman.simulation.differentiators.differentiator import differentiators
from mobman.simulation.disturbances.disturbance import Torque, disturbances
from mobman.simulation.friction.friction import frictions
from mobman.simulation.inertias.inertia import inertias
from mobman.simulation.measurement import Measurement
from mobman.simulation.pieces import Source, streams
from mobman.simulation.plant import Plant, true_robot
from mobman.simulation.sensors.sensor import sensors
from mobman.simulation.slip.slip import slips
from mobman.toml_model import Strict, describe, named_file, read_toml, validate


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
    """Something between the commanded torque and the one that acts."""

    group, what, kinds = "actuation", "actuation", actuations


class SensorSource(Source):
    """An error of the measurements."""

    group, what, kinds = "sensors", "sensor", sensors


class SlipSource(Source):
    """A slip of the platform."""

    group, what, kinds = "slip", "slip", slips


def _acceleration(value: Any) -> Any:
    """A way to know z' by name, if it needs no parameters, or as a table."""
    if isinstance(value, AccelerationSource):
        return value
    fields = {"type": value} if isinstance(value, str) else value
    names = differentiators.names()
    if not isinstance(fields, dict) or fields.get("type") not in names:
        choices = ", ".join(map(repr, names))
        raise ValueError(f"must be one of {choices}, or a table with such a 'type'")
    parameters = {name: given for name, given in fields.items() if name != "type"}
    kind: Any = differentiators.get(fields["type"])
    validate(kind, parameters, f"acceleration {fields['type']!r}")
    source = AccelerationSource(**fields)
    return source if source.__pydantic_extra__ else source.type


Number = Annotated[float, Field(strict=True)]
S = TypeVar("S", bound=Source)


class Scenario(Strict):
    """A scenario: what a file ``mobman/simulation/scenarios/NAME.toml`` says."""

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
    inertias: list[InertiaSource] = []
    """More of the kind, one after the other, before the payload."""
    friction: list[FrictionSource] = []
    """On the motors' axes; they add up."""
    disturbances: list[DisturbanceSource] = []
    """Torques added to the motors'; D = -B d in (17)."""
    actuation: list[ActuationSource] = []
    """From the commanded torque to the one that acts, in the order of the signal."""
    sensors: list[SensorSource] = []
    """Errors of q, z and z', in the order in which they happen."""
    acceleration: Annotated[str | AccelerationSource, BeforeValidator(_acceleration)] = "exact"
    """How z' is known: ``"exact"``, ``"backward-difference"``, or a table with a type."""
    slip: list[SlipSource] = []
    """Velocities of the platform's pose beside that of rolling; they add up."""

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
            return content  # told of the field, together with whatever else is wrong
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

    # What a run is made of ---------------------------------------------------------------------

    def true_robot(
        self, robot: MobileManipulator, random: np.random.Generator
    ) -> MobileManipulator:
        """The robot with the true inertias; the same object if nothing changes.

        Args:
            robot: The nominal robot.
            random: The run's generator.

        Raises:
            SpecError: If a piece does not fit the robot.
        """
        scaled = true_robot(robot, self.mass_factor, self.inertia_factor)
        if self.inertias:
            model = scaled.model.copy()
            for source, own in self._with_streams(self.inertias, random):
                self._fitting(source, "change", model, robot, own)
            scaled = robot.with_model(model)
        return true_robot(scaled, payload=self.payload)

    def disturbance(self, inertia: Array, random: np.random.Generator) -> Torque | None:
        """The sum of the disturbances for one run; None if there are none.

        Args:
            inertia: What each motor's axis feels at rest (kg m^2, kg), shape (nz,).
            random: The run's generator.

        Raises:
            SpecError: If a disturbance does not fit the robot.
        """
        parts: list[Torque] = [
            self._fitting(source, "start", inertia, own)
            for source, own in self._with_streams(self.disturbances, random)
        ]
        if not parts:
            return None

        def total(t: float) -> Array:
            torque = parts[0](t)
            for part in parts[1:]:
                torque = torque + part(t)
            return torque

        return total

    def plant(
        self, robot: MobileManipulator, true: MobileManipulator, random: np.random.Generator
    ) -> Plant:
        """The true robot under its disturbances, its friction and its slip.

        Args:
            robot: The nominal robot, in whose inertia relative amplitudes are measured.
            true: The true one.
            random: The run's generator.

        Raises:
            SpecError: If a piece does not fit the robot.
        """
        if not (self.disturbances or self.friction or self.slip):
            return Plant(true)
        inertia = robot.motor_inertia(robot.q_rest)
        plant = Plant(true, self.disturbance(inertia, random))
        for friction, own in self._with_streams(self.friction, random):
            plant.resist(partial(self._fitting, friction, "start", inertia, own))
        for slip, own in self._with_streams(self.slip, random):
            plant.slide(partial(self._fitting, slip, "start", own))
        return plant

    def actuation_chain(
        self, robot: MobileManipulator, dt: float, random: np.random.Generator
    ) -> ActuationChain | None:
        """From the commanded torque to the one that acts; None if they are the same.

        Args:
            robot: The nominal robot.
            dt: Sampling period (s).
            random: The run's generator.

        Raises:
            SpecError: If a piece does not fit the robot.
        """
        if not self.actuation:
            return None
        motors = Motors.of(robot)
        stages = [
            self._fitting(source, "start", motors, dt, own)
            for source, own in self._with_streams(self.actuation, random)
        ]
        active = [stage for stage in stages if stage is not None]
        return ActuationChain(active, dt, robot.nz) if active else None

    def measurement(
        self, robot: MobileManipulator, dt: float, random: np.random.Generator
    ) -> Measurement:
        """What the controller is given.

        Args:
            robot: The nominal robot.
            dt: Sampling period (s).
            random: The run's generator.

        Raises:
            SpecError: If a piece does not fit the robot.
        """
        try:
            accelerometer = Accelerometer(self.acceleration, dt, robot.velocity_names)
        except SpecError as error:
            raise SpecError(f"scenario {self.name!r}: acceleration: {error}") from error
        found = [
            self._fitting(source, "start", robot, dt, own)
            for source, own in self._with_streams(self.sensors, random)
        ]
        return Measurement(accelerometer, [sensor for sensor in found if sensor is not None])

    def _with_streams(
        self, sources: list[S], random: np.random.Generator
    ) -> list[tuple[S, np.random.Generator]]:
        return list(zip(sources, streams(sources, random), strict=True))

    def _fitting(self, source: Source, method: str, *arguments: Any) -> Any:
        """What a piece's method gives.

        Raises:
            SpecError: If it does not fit the robot; the message names the scenario and the piece.
        """
        try:
            return getattr(source.resolved(), method)(*arguments)
        except SpecError as error:
            where = f"{source.what} {source.type!r}"
            raise SpecError(f"scenario {self.name!r}: {where}: {error}") from error


def _given(scenario: Scenario) -> dict[str, Any]:
    """What a scenario says, for one that begins with it."""
    own = scenario.model_fields_set - {"name", "description", "extends"}
    return scenario.model_dump(mode="json", include=own)


def list_scenarios() -> list[str]:
    """The names that :func:`mobman.simulate` takes as ``scenario``, sorted."""
    return sorted(_files())


_loading: ContextVar[tuple[Path, ...]] = ContextVar("_loading", default=())


def load_scenario(name_or_path: str | os.PathLike[str]) -> Scenario:
    """A scenario by name, or from a TOML file.

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
