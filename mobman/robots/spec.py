"""The description of a robot: a TOML file (or a dictionary) beside a URDF."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, Field

from mobman.toml_model import Strict, read_toml, validate


class UrdfSource(Strict):
    """Where the URDF is, and which of its joints do not move."""

    path: str
    """File: relative to the TOML, or to the package's ``robots`` folder where one is named."""
    package: Literal["example-robot-data"] | None = None
    """Installed data package that holds the file."""
    lock: list[str] = []
    """Joints held at their rest position: names, or patterns such as ``"hand_*"``."""


class PlatformSource(Strict):
    """The platform's type; the other fields are the type's own and are checked by it."""

    model_config = ConfigDict(extra="allow", frozen=True)

    type: str

    @property
    def parameters(self) -> dict[str, Any]:
        """The type's own fields."""
        return dict(self.__pydantic_extra__ or {})


class ArmSource(Strict):
    """The arm: every joint that is neither the platform's nor locked belongs to it."""

    tip: str
    """URDF link (frame) whose origin is the end-effector."""


class CriterionSource(Strict):
    """Weights of the posture criterion (12): the diagonal of K_F."""

    platform: float = Field(0.001, gt=0)
    """Of the platform's position and heading (1/m^2, 1/rad^2)."""
    default: float = Field(0.05, gt=0)
    """Of all other coordinates, wheels included."""
    weights: dict[str, float] = {}
    """Of single coordinates, by joint name."""


class RobotSpec(Strict):
    """A robot: what a file ``robots/NAME.toml`` says."""

    schema_version: Literal[1] = Field(alias="schema")
    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    description: str = ""
    source: str = ""
    license: str = ""
    tags: list[str] = []
    urdf: UrdfSource
    platform: PlatformSource
    arm: ArmSource
    rest: dict[str, float] = {}
    """q_rest by joint name (m, rad); joints not named rest at 0, locked ones are locked there."""
    criterion: CriterionSource = CriterionSource()
    folder: Path = Field(Path(), exclude=True)
    """Folder that a relative URDF path starts from; the TOML's own."""


def read_spec(path: Path) -> RobotSpec:
    """The robot that a TOML file describes.

    Raises:
        SpecError: If the file cannot be read or a field is wrong.
    """
    content = read_toml(path, "robot file")
    content.pop("folder", None)
    return validate(RobotSpec, {**content, "folder": path.resolve().parent}, str(path))
