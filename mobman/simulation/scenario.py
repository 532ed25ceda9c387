"""Scenarios: differences of the plant and its sensors from what the controller supposes."""

from __future__ import annotations

import os
from collections import Counter
from contextvars import ContextVar
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import (
    BeforeValidator,
    Field,
    PlainSerializer,
    SerializerFunctionWrapHandler,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_serializer,
    model_validator,
)

from mobman.arrays import Array
from mobman.display import Displayed, Shown, line_of
from mobman.errors import MobmanError, SpecError, UnknownNameError, UsageError
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.actuation import ActuationChain, actuations
from mobman.simulation.differences import add_to_tip, inertias, kinematics
from mobman.simulation.disturbances import Torque, disturbances, frictions, stops
from mobman.simulation.pieces import Piece, Setting, Types
from mobman.simulation.plant import Plant, plants, slips
from mobman.simulation.sensors import Measure, encoders, estimators, pose_index, sensors
from mobman.toml_model import Strict, describe, named_file, read_toml, validate

GROUPS: dict[str, tuple[str, Types]] = {
    "kinematics": ("kinematics", kinematics),
    "inertias": ("inertia", inertias),
    "friction": ("friction", frictions),
    "disturbances": ("disturbance", disturbances),
    "actuation": ("actuation", actuations),
    "sensors": ("sensor", sensors),
    "slip": ("slip", slips),
    "stops": ("stop", stops),
    "acceleration": ("acceleration", estimators),
    "plant": ("plant", plants),
}
"""The fields of a scenario that hold pieces: what messages call one of them, and the types."""
MOST_PIECES = 100
"""Pieces of one kind in a scenario."""
Number = Annotated[float, Field(strict=True)]


def _read(given: Any, info: ValidationInfo) -> Any:
    if isinstance(given, Piece) and not given.type:
        raise ValueError("must be a table with a 'type'")
    return _piece_of(str(info.field_name), given) if isinstance(given, dict) else given


def _stored(piece: Piece) -> dict[str, Any]:
    """All fields of a piece, with its type: those left out too, so that a stored scenario says all."""
    return {"type": piece.type, **piece.model_dump(mode="json", exclude_none=True)}


OnePiece = Annotated[Piece, BeforeValidator(_read), PlainSerializer(_stored)]
"""A table with a ``type``, and the type's own fields."""
Pieces = Annotated[list[OnePiece], Field(max_length=MOST_PIECES)]


def _piece_of(group: str, table: dict[str, Any]) -> Piece:
    """The piece of a table, of its type's class; ValueError if its type is missing or unknown, or one of
    its fields is wrong."""
    (what, types), name = GROUPS[group], str(table.get("type", ""))
    if not name:
        listing = ", ".join(map(repr, types.names()))
        raise ValueError(f"field 'type' is missing; allowed: one of {listing}")
    fields = {field: value for field, value in table.items() if field != "type"}
    return validate(types.get(name), fields, f"{what} {name!r}").of_type(name)


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
    kinematics: Pieces = []
    """Wrong dimensions: J, and N of the platform; one after the other."""
    tip: Literal["modelled", "measured"] = "modelled"
    """A law's knowledge of its tip: its model at the measured q and z, or the true tip's position and
    velocity; its Jacobian is the model's in either case."""
    inertias: Pieces = []
    """More of the kind, one after the other, before the payload."""
    friction: Pieces = []
    """On the motors' axes; they add up."""
    disturbances: Pieces = []
    """Torques added to the motors'; D = -B d in (17)."""
    actuation: Pieces = []
    """From the commanded torque to the one that acts, in the order of the signal."""
    sensors: Pieces = []
    """Errors of q, z and z', in the order in which they happen."""
    acceleration: str | OnePiece = "exact"
    """Estimator of z': ``"exact"``, ``"backward-difference"``, or a table with a type."""
    slip: Pieces = []
    """Velocities of the platform's pose in addition to that of rolling; they add up."""
    stops: Pieces = []
    """Forces that keep joints from leaving their limits; they add up."""
    plant: str | OnePiece = "ideal"
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

    @field_validator("acceleration", "plant", mode="before")
    @classmethod
    def _single(cls, value: Any, info: ValidationInfo) -> Piece | str:
        """A piece by the name of its type, if it needs no parameters, or as a table."""
        if isinstance(value, Piece):
            return value
        table = {"type": value} if isinstance(value, str) else value
        names = GROUPS[str(info.field_name)][1].names()
        if not isinstance(table, dict) or table.get("type") not in names:
            choices = ", ".join(map(repr, names))
            raise ValueError(f"must be one of {choices}, or a table with such a 'type'")
        piece = _piece_of(str(info.field_name), table)
        return piece if piece.model_dump(exclude_none=True) else piece.type

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

    def pieces(self, group: str) -> list[Piece]:
        """The pieces in one of :data:`GROUPS`."""
        own = getattr(self, group)
        if isinstance(own, list):
            return own
        return [_piece_of(group, {"type": own}) if isinstance(own, str) else own]

    def types(self) -> list[type[Piece]]:
        """The types of its pieces."""
        return [type(piece) for group in GROUPS for piece in self.pieces(group)]

    # Parts of a run. Each takes its setting, and raises SpecError if a piece does not fit the robot.

    def _started(self, group: str, setting: Setting) -> list[Any]:
        """The effects of the pieces of a group, without those that do nothing."""
        counts: Counter[str] = Counter()
        found = []
        for piece in self.pieces(group):
            own = setting.of_piece(f"{group}/{piece.type}", counts[piece.type])
            counts[piece.type] += 1
            try:
                found.append(piece.start(own))
            except SpecError as error:
                where = f"scenario {self.name!r}: {GROUPS[group][0]} {piece.type!r}"
                raise SpecError(f"{where}: {error}") from error
        return [effect for effect in found if effect is not None]

    def true_robot(self, setting: Setting) -> MobileManipulator:
        """The setting's robot with the true dimensions and inertias; the same object if nothing
        changes."""
        robot, mass = setting.robot, self.mass_factor
        for remake in self._started("kinematics", setting):
            robot = remake(robot)
        turning = mass if self.inertia_factor is None else self.inertia_factor
        changes = self._started("inertias", setting)
        if mass == turning == 1.0 and not changes and not self.payload:
            return robot
        model = robot.model.copy()
        for i in range(1, model.njoints):
            link = model.inertias[i]
            model.inertias[i] = pin.Inertia(link.mass * mass, link.lever, link.inertia * turning)
        for change in changes:
            change(model)
        if self.payload:
            add_to_tip(model, robot, pin.Inertia(self.payload, np.zeros(3), np.zeros((3, 3))))
        return robot.with_model(model)

    def start_of(self, robot: MobileManipulator, placed: Array | None = None) -> Array:
        """The start of a run whose task is made for another, ``robot.q_rest`` by default (m, rad),
        shapes (nq,)."""
        start = np.array(robot.q_rest if placed is None else placed, dtype=float)
        if robot.platform.base_joints:
            x, y, theta = pose_index(robot)
            forward = start[theta] + getattr(robot.platform, "heading", 0.0)
            start[x] -= self.start_offset * np.cos(forward)
            start[y] -= self.start_offset * np.sin(forward)
        return start

    def disturbance(self, setting: Setting) -> Torque | None:
        """The sum of the disturbances; None if there are none."""
        parts: list[Torque] = self._started("disturbances", setting)
        return (lambda t: sum((part(t) for part in parts[1:]), parts[0](t))) if parts else None

    def make_plant(self, setting: Setting, true: MobileManipulator) -> Plant:
        """The true robot under its disturbances, its friction and its slip; relative amplitudes are
        measured in the inertia of the nominal robot, which the setting has."""
        (make,) = self._started("plant", setting)
        parts = (self._started(group, setting) for group in ("friction", "slip", "stops"))
        plant: Plant = make(true, self.disturbance(setting), *parts)
        return plant

    def actuation_chain(self, setting: Setting) -> ActuationChain | None:
        """The stages from the commanded torque to the one that acts; None if they are the same."""
        stages = self._started("actuation", setting)
        return ActuationChain(stages, setting.dt, setting.robot.nz) if stages else None

    def measurement(self, setting: Setting, true: MobileManipulator | None = None) -> Measure:
        """The measurement that the controller is given, of the true robot; by default the nominal."""
        true = setting.robot if true is None else true
        (estimate,), errors = (
            self._started("acceleration", setting),
            self._started("sensors", setting),
        )
        other_wheels = true.motors is not true.platform
        tell = encoders(setting.robot, true, setting.dt) if other_wheels else None
        if tell is None and not errors:
            return lambda q, z, z_dot: (q.copy(), own := z.copy(), estimate(own, z_dot))

        def measure(q: Array, z: Array, z_dot: Array) -> tuple[Array, Array, Array]:
            if tell is not None:
                z, z_dot = tell(q, z, z_dot)
            q_now, z_now = q.copy(), z.copy()
            for sensor in errors:
                sensor.state(q_now, z_now)
            acceleration = estimate(z_now, z_dot)
            for sensor in errors:
                sensor.acceleration(acceleration)
            return q_now, z_now, acceleration

        return measure


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
    if isinstance(names := content.get("extends"), list):  # files are found from its own folder
        given = [isinstance(n, str) and n not in _files() and n.endswith(".toml") for n in names]
        folder = path.parent
        content["extends"] = [
            str(folder / n) if file else n for n, file in zip(names, given, strict=True)
        ]
    token = _loading.set((*outer, where))
    try:
        return validate(Scenario, content, str(path))
    finally:
        _loading.reset(token)


@cache
def nominal() -> Scenario:
    """The scenario of runs for which none is named."""
    return load_scenario("nominal")


def _files() -> dict[str, Path]:
    folder = Path(__file__).parent / "scenarios"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


GivenPlant = MobileManipulator | Scenario | str | os.PathLike[str] | None


def true_plant(setting: Setting, plant: GivenPlant, scenario: Scenario) -> MobileManipulator:
    """The true robot: the setting's, or the one given to :func:`simulate`, with the masses and payload
    of the scenario, unless ``plant`` is one.

    Raises:
        UnknownNameError: If a plant is named that is not a scenario.
        UsageError: If it has other joints, or is nothing of the kind.
        SpecError: If a piece of the scenario does not fit the robot.
    """
    base, changes = setting.robot, scenario
    if isinstance(plant, MobileManipulator):
        if plant.joint_names != base.joint_names:
            raise UsageError(f"the plant {plant.name!r} has other joints than {base.name!r}")
        base = plant
    elif isinstance(plant, Scenario):
        changes = plant
    elif isinstance(plant, (str, os.PathLike)):
        text = os.fspath(plant)
        if text not in list_scenarios() and not text.endswith(".toml"):
            raise UnknownNameError("plant", text, list_scenarios())
        changes = load_scenario(text)
    elif plant is not None:
        raise UsageError(
            f"plant = {plant!r}: must be a robot, a scenario, a scenario's name or its file"
        )
    return changes.true_robot(Setting(base, setting.dt, setting.random))
