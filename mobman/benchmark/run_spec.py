"""One run of a suite: everything that its result depends on, and its name."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, NamedTuple

_NO_PART_OF_THE_RESULT = ("label", "gains", "task", "family", "compression")
"""What does not change the numbers: names within the suite, and gains, which ``settings`` hold."""


class Cell(NamedTuple):
    """What runs are compared in: everything but the controller and the seed."""

    robot: str
    task: str
    scenario: str
    dt: float
    duration: float


@dataclass(frozen=True)
class RunSpec:
    """One run of a suite."""

    label: str
    """The controller's label in the suite."""
    robot: str
    robot_sha256: str
    """Of the robot's description and URDF."""
    law: str
    gains: dict[str, Any]
    """As the suite gives them."""
    settings: dict[str, Any]
    """All gains, the law's defaults among them."""
    task: str
    """The task's label in the suite."""
    task_name: str
    """The registered task."""
    task_given: dict[str, Any]
    """Its parameters, as the suite gives them."""
    task_parameters: dict[str, Any]
    """All that is known of the task, for this robot."""
    scenario: dict[str, Any]
    family: str
    """The scenario's label in the suite, which several have that are made from one grid."""
    seed: int
    duration: float
    """s."""
    dt: float
    """Sampling period (s)."""
    record_period: float
    """Time from one sample in the file to the next (s)."""
    compression: int
    """Of the file, 0 to 9."""
    code_sha256: str
    """Of the source of the law and the task, where they are not mobman's own; empty if they are."""
    version: str
    """mobman's: another version may give other numbers."""

    @cached_property
    def run_id(self) -> str:
        """Hash of all that the result depends on."""
        content = {
            key: value for key, value in asdict(self).items() if key not in _NO_PART_OF_THE_RESULT
        }
        text = json.dumps(content, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def cell(self) -> Cell:
        """What it is compared in."""
        return Cell(self.robot, self.task, self.scenario["name"], self.dt, self.duration)

    @property
    def record_every(self) -> int:
        """Ticks from one sample in the file to the next."""
        return max(1, round(self.record_period / self.dt))

    def __str__(self) -> str:
        cell = self.cell
        return (
            f"{cell.robot} · {cell.task} · {cell.scenario} · {self.label} · {cell.dt:g} s · "
            f"seed {self.seed}"
        )
