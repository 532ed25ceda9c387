"""Scenarios: in what the plant and its sensors differ from what the controller supposes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, ValidationError, model_validator

from mobman.arrays import Array
from mobman.errors import SpecError
from mobman.simulation.disturbances.disturbance import Disturbance, Torque, disturbances
from mobman.toml_model import Strict, describe, named_file, read_toml, validate


class DisturbanceSource(Strict):
    """A disturbance's type; the other fields are the type's own and are checked by it."""

    model_config = ConfigDict(extra="allow", frozen=True)

    type: str

    @model_validator(mode="after")
    def _valid(self) -> Self:
        self.resolved()  # told when it is read, not when it is used
        return self

    def resolved(self) -> Disturbance:
        """The disturbance itself.

        Raises:
            UnknownNameError: If its type is unknown.
            SpecError: If one of its fields is wrong.
        """
        kind: Any = disturbances.get(self.type)
        fields = dict(self.__pydantic_extra__ or {})
        found: Disturbance = validate(kind, fields, f"disturbance {self.type!r}")
        return found


class Scenario(Strict):
    """A scenario: what a file ``mobman/simulation/scenarios/NAME.toml`` says."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    description: str = ""
    mass_factor: float = Field(1.0, gt=0)
    """True mass of every link over the nominal one."""
    inertia_factor: float | None = Field(None, gt=0)
    """True rotational inertia of every link over the nominal one; the mass factor by default."""
    payload: float = Field(0.0, ge=0)
    """Point mass at the tip that the controller does not know (kg)."""
    disturbances: list[DisturbanceSource] = []
    """Torques added to the motors'; D = -B d in (17)."""
    acceleration: Literal["exact", "backward-difference"] = "exact"
    """How z' is measured: the true one under the torque held until now, or (z_k - z_(k-1))/dt."""

    def __init__(self, **fields: Any) -> None:
        try:
            super().__init__(**fields)
        except ValidationError as error:
            what = f"scenario {fields.get('name', '')!r}"
            raise SpecError(f"{what}: {describe(Scenario, error)}") from error

    def disturbance(self, inertia: Array, random: np.random.Generator) -> Torque | None:
        """The sum of the disturbances for one run; None if there are none.

        Args:
            inertia: What each motor's axis feels at rest (kg m^2, kg), shape (nz,).
            random: Where all randomness comes from.

        Raises:
            SpecError: If a disturbance does not fit the robot.
        """
        parts: list[Torque] = []
        # one generator for each, so that adding one does not change the others
        for source, own in zip(
            self.disturbances, random.spawn(len(self.disturbances)), strict=True
        ):
            try:
                parts.append(source.resolved().start(inertia, own))
            except SpecError as error:
                raise SpecError(f"scenario {self.name!r}: {error}") from error
        if not parts:
            return None

        def total(t: float) -> Array:
            torque = parts[0](t)
            for part in parts[1:]:
                torque = torque + part(t)
            return torque

        return total


def list_scenarios() -> list[str]:
    """The names that :func:`mobman.simulate` takes as ``scenario``, sorted."""
    return sorted(_files())


def load_scenario(name_or_path: str | os.PathLike[str]) -> Scenario:
    """A scenario by name, or from a TOML file.

    Raises:
        UnknownNameError: If there is no such name.
        SpecError: If the file is not valid.
    """
    path = named_file("scenario", name_or_path, _files())
    return validate(Scenario, read_toml(path, "scenario file"), str(path))


def _files() -> dict[str, Path]:
    folder = Path(__file__).parent / "scenarios"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}
