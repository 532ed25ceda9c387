"""What is sent to a worker, and what comes back."""

from __future__ import annotations

import os
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, field

from mobman.benchmark.running.parcel import Parcel
from mobman.simulation.run_spec import RunSpec

_MARK = uuid.uuid4().hex


def this_process() -> tuple[str, int]:
    """What tells this process from all others, on any machine."""
    return _MARK, os.getpid()  # a fork has the same mark


@dataclass(frozen=True)
class Job:
    """A run, with what its names mean where the suite was started; a worker may not know."""

    run: RunSpec
    robot: Parcel
    law: Parcel
    task: Parcel
    time_limit: float
    """Wall time (s)."""
    origin: tuple[str, int]
    """:func:`this_process` there."""
    with_file: bool = True
    """True if the content of the record's file is sent back."""


@dataclass(frozen=True)
class Result:
    """What became of a job."""

    status: str
    """The record's, or ``"failed"`` if there is none."""
    message: str
    task_error: float
    """The record's metric task_error_max (m); NaN if there is no record."""
    content: bytes | None
    """Content of the record's file; None if there is no record, or the job is without."""
    again: bool = False
    """Whether it may well go better another time."""
    fault: str = ""
    """Cause of a failure, if known: ``"gains"`` that the law refuses, or the ``"machine"``."""
    metrics: Mapping[str, float] = field(default_factory=dict)
    """The record's."""
    end: float = 0.0
    """Time of its last sample (s)."""
    seconds: float = 0.0
    """Wall time that it took."""

    @classmethod
    def failure(cls, message: str, *, again: bool = False, fault: str = "") -> Result:
        """A result without a record."""
        return cls("failed", message, float("nan"), None, again, fault)
