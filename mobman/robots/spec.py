"""The description of a robot, a TOML file (or a dictionary) alongside a URDF; and the folders of such
files: mobman's own, and the user's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import platformdirs
from pydantic import (
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from mobman.files import resource_folder
from mobman.toml_model import Strict, read_toml, validate

NAME = r"[A-Za-z0-9][A-Za-z0-9_.-]*"
"""Names of robots."""
DRIVEN = 1e-9
"""Weight of what grows with the way that is driven: after a million radians (or metres) it pulls as a
fiftieth of a radian of the arm does at the default weight."""
Point = tuple[float, float, float]


class UrdfSource(Strict):
    """A URDF's place, and those of its joints that do not move."""

    path: str
    """File: relative to the TOML, or to the package's ``robots`` folder where one is named."""
    package: Literal["example-robot-data"] | None = None
    """Installed data package that holds the file."""
    sha256: str | None = Field(None, pattern=r"^[0-9a-f]{64}$", exclude=True)
    """Hash of the file that the description was written for; there is a warning if it differs."""
    packages: list[str] = []
    """Folders, relative to the TOML, that hold packages NAME of ``package://NAME/...``; the folders
    above the URDF are looked in as well."""
    up: Literal["x", "y", "z", "-x", "-y", "-z"] = "z"
    """Axis of the root link that points up."""
    lock: list[str] = []
    """Joints held at their rest position: names, or patterns such as ``"hand_*"``."""

    @model_serializer(mode="wrap")
    def _without_the_usual(self, plain: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Descriptions, and with them the identity of runs, stay what they were without the field."""
        fields: dict[str, Any] = plain(self)
        if fields.get("up") == "z":
            del fields["up"]
        return fields


class Mount(UrdfSource):
    """A URDF mounted on the platform: an arm, usually."""

    prefix: str = Field("", pattern=r"^[A-Za-z0-9_.-]*$")
    """Put before the name of every link and joint of that URDF."""
    parent: str
    """Link that carries it: of the platform, or of what was mounted before."""
    xyz: Point = (0.0, 0.0, 0.0)
    """Position of its root link in the parent's frame (m)."""
    rpy: Point = (0.0, 0.0, 0.0)
    """Its orientation there: roll, pitch and yaw, as in a URDF (rad)."""


class PlatformSource(Strict):
    """The platform's type; the other fields are the type's own and are checked by it."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    type: str

    @property
    def parameters(self) -> dict[str, Any]:
        """The type's own fields."""
        return dict(self.__pydantic_extra__ or {})


class ArmSource(Strict):
    """The arm: every joint that is neither the platform's nor locked belongs to it."""

    tip: str
    """URDF link (frame) whose origin is the end-effector."""


class Coupling(Strict):
    """Soft coupling between two coordinates: adds w/2 (dq_joint - ratio dq_to)^2 to F, with dq the
    deviation from rest; an off-diagonal part of K_F.

    What moves the tip at once needs none. The steering angle of a car does not, and so the diagonal
    criterion would hold it at rest for ever.
    """

    joint: str
    """Coordinate that follows."""
    to: str
    """Coordinate that it follows."""
    ratio: float
    """dq_joint wanted for one of dq_to."""
    weight: float = Field(gt=0)
    """w."""


class CriterionSource(Strict):
    """Weights of the posture criterion (12): K_F, which is diagonal but for the couplings."""

    platform: float = Field(DRIVEN, gt=0)
    """Weight of the platform's position (1/m^2)."""
    heading: float | None = Field(None, gt=0)
    """Weight of the platform's heading (1/rad^2): ``platform`` where that alone is given, by
    :func:`mobman.model.metric.heading_weight` where neither is."""
    default: float = Field(0.05, gt=0)
    """Weight of all other coordinates."""
    wheels: float | None = Field(DRIVEN, gt=0)
    """Weight of the platform's wheels (1/rad^2). None, in older records, is that of the others, the
    paper's choice: the angles outweigh the arm after some metres."""
    weights: dict[str, float] = {}
    """Weights of single coordinates, by joint name."""
    couplings: list[Coupling] = []
    """Coordinates that are to follow others."""

    @model_validator(mode="before")
    @classmethod
    def _platforms_heading(cls, given: Any) -> Any:
        """``platform`` was the weight of the heading, too."""
        if isinstance(given, Mapping) and "platform" in given and "heading" not in given:
            return {**given, "heading": given["platform"]}
        return given


class RobotSpec(Strict):
    """A robot: what a file ``robots/NAME.toml`` says."""

    schema_version: Literal[1] = Field(alias="schema")
    name: str = Field(pattern=f"^{NAME}$")
    description: str = ""
    source: str = ""
    license: str = ""
    tags: list[str] = []
    urdf: UrdfSource | None = None
    """The robot's URDF, or the platform's where arms are mounted on it; absent where ``platform.body``
    describes the platform by its numbers."""
    mount: list[Mount] = []
    """Arms and other parts mounted on the platform, in this order."""
    platform: PlatformSource
    arm: ArmSource
    rest: dict[str, float] = {}
    """q_rest by joint name (m, rad); joints not named rest at 0, locked ones are locked there."""
    criterion: CriterionSource = CriterionSource()
    folder: Path = Field(Path(), exclude=True)
    """Folder that a relative URDF path starts from; the TOML's own."""
    file: Path | None = Field(None, exclude=True)
    """The TOML that it was read from."""

    @property
    def parts(self) -> list[UrdfSource]:
        """Its URDFs: the platform's, if there is one, then those of the mounts."""
        return [*([] if self.urdf is None else [self.urdf]), *self.mount]

    @property
    def code(self) -> str:
        """The Python class that its platform names, ``"file.py:Class"``; empty if it names none."""
        given = self.platform.parameters.get("definition")
        return str(given) if self.platform.type == "custom" else ""

    @property
    def where(self) -> str:
        """Its name in messages."""
        return f"robot {self.name!r}" + (f" ({self.file})" if self.file is not None else "")


def read_spec(path: Path) -> RobotSpec:
    """The robot that a TOML file describes; SpecError if it cannot be read or a field is wrong."""
    return spec_of(read_toml(path, "robot file"), path)


def spec_of(content: Mapping[str, Any], path: Path) -> RobotSpec:
    """The robot of a TOML file's content, which need not be there; SpecError if a field is wrong."""
    places = {"folder": path.resolve().parent, "file": path}
    return validate(RobotSpec, {**content, **places}, str(path))


def own_robots() -> dict[str, Path]:
    """The robots that come with mobman: their files by name."""
    return {path.stem: path for path in sorted(resource_folder("robots").glob("*.toml"))}


def user_robots_folder() -> Path:
    """The folder of robots that the user added, in the user's data directory; it need not exist."""
    return platformdirs.user_data_path("mobman", appauthor=False) / "robots"


def made_folder() -> Path:
    """The folder of URDFs that were made from something else, in the user's data directory."""
    return platformdirs.user_data_path("mobman", appauthor=False) / "made"
