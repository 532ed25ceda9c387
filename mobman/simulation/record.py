"""Records: the samples of a run, its metrics, and everything needed to repeat it."""

from __future__ import annotations

import errno
import hashlib
import io
import json
import os
from dataclasses import dataclass, field, fields
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from mobman.arrays import Array
from mobman.display import Displayed, Shown
from mobman.errors import MobmanError, RecordError, UsageError
from mobman.files import as_path, write_whole
from mobman.isolation import Crash, helper
from mobman.provenance import machine
from mobman.simulation.record_file import APPLIED, DICTIONARIES, OPTIONAL, file_content

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_ALLOWED = "allowed: a record that mobman wrote"
# Processor time and memory that reading a record may take: a hundred times the usual.
_SECONDS, _SECONDS_PER_MB = 2.0, 0.5
_MEGABYTES, _MEGABYTES_PER_MB = 256.0, 100.0


@dataclass(kw_only=True)
class RecordSummary:
    """A record without its samples."""

    status: str
    """``"ok"``, ``"diverged"``, or ``"singular"``: a matrix that the law inverts had lost its rank
    before the state ran away, see ``singularity``."""
    message: str
    """For a run that is not ok: when it ended, and why."""
    robot: str
    controller: str
    task: str
    scenario: str
    seed: int
    metrics: dict[str, float]
    """By name; see docs/metrics.md. NaN where a metric has no meaning, inf where it was not reached."""
    spec: dict[str, Any]
    """Description of the run, see :class:`mobman.simulation.run_spec.RunSpec`."""
    settings: dict[str, Any]
    """The controller's gains in force, with the numbers that "auto" became."""
    versions: dict[str, str]
    """Versions of mobman and of the libraries whose numbers are in here."""
    created: str
    """Time of the run, ISO 8601, UTC."""
    machine: dict[str, str] = field(default_factory=machine)
    """Processor, architecture and system that the run was made on."""
    singularity: dict[str, Any] = field(default_factory=dict)
    """Singularity that ended a run: ``matrix`` (J, J_e, j, M or B), ``time`` (s) from which its least
    singular value ``sigma_min`` was below ``bound``, the ``joint`` of the arm nearest to its limits, and
    how far inside these it was, ``margin`` (rad, m; negative: beyond). What is not known is left out."""
    state_sha256: str = ""
    """SHA-256, hexadecimal, of t, q, z and torque at every tick, in this order, as little-endian
    doubles by rows: equal where two runs are, to the last bit. A decimated record has that of all."""

    @property
    def ok(self) -> bool:
        """True if the run went to its end."""
        return self.status == "ok"


@dataclass(repr=False, kw_only=True)
class Record(Displayed, RecordSummary):
    """A run: its samples, its metrics and everything needed to repeat it.

    Samples are at the ticks t_0 = 0 ... t_N; N_s of them, all of them unless a file was decimated. A
    run that diverged ends at its last finite sample.

    >>> import mobman as mm
    >>> record = mm.simulate("youbot", "pseudo-inverse", "paper", duration=0.05)
    >>> record.q.shape, record.status
    ((51, 8), 'ok')
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
    """Position of the tip, f_e (m), shape (N_s, min(m, 3))."""
    tip_desired: Array
    """That desired, p_d (m), shape (N_s, min(m, 3))."""
    task_error: Array
    """e^e = f_e - p_d, shape (N_s, m): position (m); from column 3 on e_o, of length 2 sin(angle/2),
    three of a pose, two of a pointing task (:mod:`mobman.model.orientation`)."""
    auxiliary_error: Array
    """e^a = f_a of (11), in axes carried along the motion, shape (N_s, nz - m)."""
    compute_time: Array
    """Time that the controller took for each tick (s), shape (N_s,)."""
    signals: dict[str, Array]
    """Signals of the controller by place in the file: ``"sliding/s"``, ..."""
    urdf_sha256: str
    """Hash of the robot's URDF file."""
    joint_names: list[str]
    """Names of the entries of q."""
    velocity_names: list[str]
    """Names of the entries of z, and of the motors."""
    decimation: int = 1
    """Ticks from one sample to the next."""
    urdf: dict[str, bytes] = field(default_factory=dict, repr=False)
    """The robot's URDF files, without their meshes: by ``"0/NAME"``, ``"1/NAME"``, ... in the order of
    its description; ``"plant/0/NAME"``, ... of a plant that is another robot."""
    tip_orientation: Array | None = None
    """Orientation of the tip, unit quaternion (w, x, y, z), shape (N_s, 4), or in a pointing task the
    axis that points, shape (N_s, 3), in world axes; None for tasks of position."""
    tip_desired_orientation: Array | None = None
    """The same that is desired."""

    def __post_init__(self) -> None:
        if not self.state_sha256:
            digest = hashlib.sha256()
            for values in (self.t, self.q, self.z, self.torque):
                digest.update(np.ascontiguousarray(values, dtype="<f8").data)
            self.state_sha256 = digest.hexdigest()

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
            UsageError: If ``every`` or ``compression`` is no such number, or the path no file's name.
        """
        content = self.to_bytes(every=every, compression=compression)
        file = as_path("path", path)
        if not file.name:
            raise UsageError(f"{str(file)!r} is not the name of a file")
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(file, content)
        except OSError as error:
            reason = error.strerror or str(error)
            if error.errno in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT):
                reason += f" ({len(content) / 1e6:.3g} MB are needed)"
            raise RecordError(f"cannot write the record {file}: {reason}") from error
        return file

    def to_bytes(self, *, every: int = 1, compression: int = 4) -> bytes:
        """The content of the file that :meth:`save` writes, with its UsageError."""
        return file_content(vars(self), every=every, compression=compression)

    def to_xarray(self) -> xr.DataTree:
        """Make a tree of the samples, as ``xarray.open_datatree`` opens the record's file.

        >>> import mobman as mm
        >>> tree = mm.simulate("youbot", "pseudo-inverse", "paper", duration=0.05).to_xarray()
        >>> tree["error/task"].sel(axis="z", t=0.02).dims
        ()

        Returns:
            In memory: ``q``, ``z`` and ``torque`` at the root, groups ``tip``, ``error``, ``sliding``
            (with a law that has such signals), ``metrics`` (attributes) and ``urdf``. Coordinates: t
            (s) and names of joints, motors and axes; every variable has ``units`` and ``description``.
        """
        import xarray as xr

        content = io.BytesIO(self.to_bytes(compression=0))
        with xr.open_datatree(content, engine="h5netcdf") as tree:
            return tree.load()

    def to_pandas(self) -> pd.DataFrame:
        """Make a frame of the samples, a row a tick.

        >>> import mobman as mm
        >>> frame = mm.simulate("youbot", "pseudo-inverse", "paper", duration=0.05).to_pandas()
        >>> frame.filter(like="tip/position/").columns.tolist()
        ['tip/position/x', 'tip/position/y', 'tip/position/z']

        Returns:
            Index ``t`` (s). Columns are named by the place in the file and the component:
            ``"q/base_x"``, ``"torque/alpha_1"``, ``"error/task/z"``, ``"sliding/s/0"``,
            ``"compute_time"``; ``attrs["places"]`` has the place and the unit of each.
        """
        import pandas as pd

        columns: dict[str, Any] = {}
        places: dict[str, tuple[str, str]] = {}
        for group in self.to_xarray().subtree:
            for name, values in group.data_vars.items():
                place = f"{group.path}/{name}".lstrip("/")
                if values.dims[:1] != ("t",):
                    continue
                for index in np.ndindex(values.shape[1:]):
                    axes = zip(values.dims[1:], index, strict=True)
                    parts = [str(values[axis].values[i]) for axis, i in axes]
                    column = "/".join([place, *parts])
                    columns[column] = values.values[:, *index]
                    places[column] = place, str(values.attrs.get("units", ""))
        frame = pd.DataFrame(columns, index=pd.Index(self.t, name="t"))
        frame.attrs["places"] = places
        return frame

    def plot(self, path: str | os.PathLike[str] | None = None) -> Any:
        """Draw errors, sliding variables, the largest shares of the robot's limits, and torques; of a
        monitored run what the theorems need, too.

        >>> import mobman as mm
        >>> record = mm.simulate("youbot", "pseudo-inverse", "paper", duration=0.05)
        >>> record.plot("run.svg").name
        'run.svg'

        Args:
            path: A file, whose suffix says in which form: ``.html`` (a page with values under the
                pointer and zoom, which needs no network), ``.svg``, ``.pdf`` or ``.png``.

        Returns:
            The file's path; without one a chart of Altair, which notebooks show.

        Raises:
            UsageError: If the suffix is another.
            MobmanError: If the file cannot be written.
        """
        from mobman.figures import charts, files  # these take a second to import
        from mobman.simulation.monitors import ratios_of

        title = f"{self.controller} on {self.robot}, {self.task}, {self.scenario}"
        title += "" if self.ok else f": {self.status}"
        norms = {"|eᵉ|  (m)": self.task_error[:, :3]}
        if self.tip_orientation is not None:
            norms["|eₒ|  (rad)"] = self.task_error[:, 3:]
        norms["|eᵃ|"] = self.auxiliary_error
        there = [name for name in "sS" if f"sliding/{name}" in self.signals]
        norms |= {f"|{name}|": self.signals[f"sliding/{name}"] for name in there}
        specs = charts.run_charts(
            *(self.t, norms, self.torque, self.velocity_names),
            law=self.controller,
            title=title,
            ended=not self.ok,
            ratios={"share of the limit": self._shares_of_limits(), **ratios_of(self.signals)},
        )
        if path is None:
            return files.displayed(specs)
        return files.save(as_path("path", path), specs, title)

    def _shares_of_limits(self) -> dict[str, Array]:
        """The largest share of a limit at each sample, shape (N_s,), by the kind of limit; 1 is at the
        limit. Kinds of which the robot has none are left out, all of them if it cannot be built."""
        from mobman.simulation.parts import robot_of
        from mobman.simulation.run_spec import RunSpec

        try:
            limits = robot_of(RunSpec.of_record(self.spec).description, self.urdf).limits
        except MobmanError:
            return {}
        with np.errstate(invalid="ignore"):  # inf - inf
            middle, half = (0.5 * (limits.upper + sign * limits.lower) for sign in (1.0, -1.0))
        torque = self.signals.get(APPLIED, self.torque)
        found = {}
        for kind, values, limit in (
            ("position", self.q - middle, half),
            ("velocity", self.z, limits.velocity),
            ("torque", torque, limits.torque),
        ):
            stated = np.isfinite(limit) & (limit > 0.0)
            if stated.any():
                found[kind] = (np.abs(values[:, stated]) / limit[stated]).max(axis=1)
        return found

    def _shown(self) -> Shown:
        error = self.metrics.get("task_error_final", np.nan)
        run = f"{self.robot} · {self.task} · {self.scenario} · {self.controller}"
        end = f"|e_e| {error:.3g} m" if self.ok else self.message
        line = f"Record({run}: {self.status}, {self.t[-1]:g} s, {end})"
        names = ("robot", "task", "scenario", "controller", "seed", "status", "message", "created")
        facts = {name: getattr(self, name) for name in names}
        return Shown(line, {**facts, "samples": len(self.t), **self.metrics})


def load_record(path: str | os.PathLike[str]) -> Record:
    """The record in an HDF5 file.

    >>> import mobman as mm
    >>> path = mm.simulate("youbot", "pseudo-inverse", "paper", duration=0.05).save("run.h5")
    >>> mm.load_record(path).t[-1].round(6).item()
    0.05

    Args:
        path: A file that :meth:`mobman.Record.save`, ``mobman run -o`` or a suite wrote; one of unknown
            origin runs no code.

    Raises:
        RecordError: If there is no such file, or it is not a record that this version reads.
    """
    content = _read(as_path("path", path), whole=True)
    for name in (*DICTIONARIES, *OPTIONAL):
        content[name] = json.loads(content.pop(f"{name}_json"))
    return Record(**content.pop("fields"), **content)


def read_summary(path: Path) -> RecordSummary:
    """The summary of a record; records with equal dictionaries share them, but for ``spec``, which is
    each run's own.

    Raises:
        RecordError: As for :func:`mobman.load_record`.
    """
    head = _read(path, whole=False)
    for name in (*DICTIONARIES, *OPTIONAL):
        text = head[f"{name}_json"]
        head[name] = json.loads(text) if name == "spec" else _shared(text)
    return RecordSummary(**{kept.name: head[kept.name] for kept in fields(RecordSummary)})


def _read(path: Path, whole: bool) -> dict[str, Any]:
    """The answer of :func:`mobman.simulation.record_reader.read`, which may crash or hang."""
    try:
        if not path.is_file():
            what = "it is a folder" if path.is_dir() else "it is no file"
            raise RecordError(f"there is no record {path}" + (f": {what}" if path.exists() else ""))
        with path.open("rb") as stream:
            start = stream.read(len(_SIGNATURE))
        if start != _SIGNATURE:
            reason = (
                f"it starts with {start!r}, not with HDF5's signature" if start else "it is empty"
            )
            raise RecordError(f"{path} is not a readable HDF5 file: {reason}; {_ALLOWED}")
        size = path.stat().st_size / 1e6
        answer: dict[str, Any] = helper.call(
            "mobman.simulation.record_reader:read",
            os.path.abspath(path),
            str(path),
            whole,
            seconds=_SECONDS + _SECONDS_PER_MB * size,
            megabytes=_MEGABYTES + _MEGABYTES_PER_MB * size,
        )
        return answer
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        why = getattr(error, "strerror", None) or error
        raise RecordError(f"cannot read the record {path}: {why}") from error
    except Crash as error:
        raise RecordError(
            f"{path} is not a readable HDF5 file: it is damaged ({error}); {_ALLOWED}"
        ) from error


@lru_cache(maxsize=512)
def _shared(text: str) -> Any:
    """A dictionary that is not to be changed; of thousands of records, few differ in theirs."""
    return MappingProxyType(json.loads(text))
