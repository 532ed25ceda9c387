"""What a run leaves behind."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.simulation.provenance import machine

OWN_PLACES = {
    "t",
    "q",
    "z",
    "torque",
    "tip",
    "error",
    "compute_time",
    "metrics",
    "joint",
    "velocity",
    "axis",
    "urdf",
}
"""First parts of the places in a record's file that a controller's signals cannot have."""


@dataclass
class Record:
    """A run: its samples, its metrics and everything needed to repeat it.

    Samples are at the ticks t_0 = 0 ... t_N; N_s of them, all of them unless a file was decimated. A
    run that diverged ends at its last finite sample.
    """

    t: Array
    """Time (s), shape (N_s,)."""
    q: Array
    """True configuration (m, rad), shape (N_s, nq)."""
    z: Array
    """True reduced velocity, shape (N_s, nz)."""
    torque: Array
    """Commanded v, held from each tick to the next (N m, N), shape (N_s, nz); where an actuation lies
    between, the signal ``"torque_applied"`` is what acts."""
    tip_position: Array
    """Task coordinates of the tip, f_e (m), shape (N_s, m)."""
    tip_desired: Array
    """p_d (m), shape (N_s, m)."""
    task_error: Array
    """e^e = f_e - p_d (m), shape (N_s, m)."""
    auxiliary_error: Array
    """e^a = f_a of (11), in axes carried along the motion, shape (N_s, nz - m)."""
    compute_time: Array
    """Time that the controller took for each tick (s), shape (N_s,)."""
    signals: dict[str, Array]
    """What the controller reports of itself, by its place in the file: ``"sliding/s"``, ..."""
    metrics: dict[str, float]
    """By name; see docs/metrics.md. NaN where a metric has no meaning, inf where it was not reached."""
    status: str
    """``"ok"``, ``"diverged"`` or ``"singular"``."""
    message: str
    """For a run that is not ok: when it ended, and why."""
    robot: str
    controller: str
    task: str
    scenario: str
    seed: int
    spec: dict[str, Any]
    """The run as it was asked for."""
    settings: dict[str, Any]
    """The controller's gains in force, with the numbers that "auto" became."""
    versions: dict[str, str]
    """Of mobman and of the libraries whose numbers are in here."""
    urdf_sha256: str
    """Of the robot's URDF file."""
    created: str
    """When, ISO 8601, UTC."""
    joint_names: list[str]
    """Of q."""
    velocity_names: list[str]
    """Of z and of the motors."""
    decimation: int = field(default=1)
    """Ticks from one sample to the next."""
    urdf: dict[str, bytes] = field(default_factory=dict, repr=False)
    """The robot's URDF files, without their meshes: by ``"0/NAME"``, ``"1/NAME"``, ... in the order of
    its description; ``"plant/0/NAME"``, ... of a plant that is another robot."""
    machine: dict[str, str] = field(default_factory=machine)
    """Processor, architecture and system that the run was made on."""
    state_sha256: str = ""
    """SHA-256, hexadecimal, of t, q, z and torque at every tick, in this order, as little-endian
    doubles by rows: equal where two runs are, to the last bit. A decimated record has that of all."""

    def __post_init__(self) -> None:
        if not self.state_sha256:
            self.state_sha256 = state_sha256(self.t, self.q, self.z, self.torque)

    @property
    def ok(self) -> bool:
        """Whether the run went to its end."""
        return self.status == "ok"

    def save(self, path: str | os.PathLike[str], *, every: int = 1, compression: int = 4) -> Path:
        """Write the record to an HDF5 file: whole, or not at all.

        Args:
            path: The file; one that is there is replaced.
            every: Keep every so many-th sample, and the last; metrics stay those of all samples.
            compression: From 0, none, to 9; every number comes back to the last bit.

        Returns:
            The file's path.

        Raises:
            RecordError: If it cannot be written.
            UsageError: If ``every`` or ``compression`` is no such number.
        """
        from mobman.simulation.record_file import write_record

        return write_record(self, Path(path), every=every, compression=compression)

    def to_bytes(self, *, every: int = 1, compression: int = 4) -> bytes:
        """The content of the file that :meth:`save` writes.

        Raises:
            UsageError: If ``every`` or ``compression`` is no such number.
        """
        from mobman.simulation.record_file import record_bytes

        return record_bytes(self, every=every, compression=compression)


def state_sha256(*samples: Array) -> str:
    """Hash of samples as :attr:`Record.state_sha256` has it."""
    digest = hashlib.sha256()
    for values in samples:
        digest.update(np.ascontiguousarray(values, dtype="<f8").data)
    return digest.hexdigest()


def load_record(path: str | os.PathLike[str]) -> Record:
    """The record in an HDF5 file.

    Raises:
        RecordError: If there is no such file, or it is not a record that this version reads.
    """
    from mobman.simulation.record_file import read_record

    return read_record(Path(path))
