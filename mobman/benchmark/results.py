"""Results of a suite as one table, a row a run; and joining folders of results."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import pandas as pd

from mobman.benchmark.store import SCHEMA_VERSION, Store
from mobman.errors import MobmanError, RecordError, UsageError
from mobman.simulation.run_spec import RunSpec


def load_results(folder: str | os.PathLike[str]) -> pd.DataFrame:
    """The results in a folder, one row a run of the suite.

    >>> import mobman as mm
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> suite = mm.Suite.model_validate(
    ...     {
    ...         "schema": 1,
    ...         "name": "mine",
    ...         "duration": 0.05,
    ...         "controllers": {"baseline": {"law": "pseudo-inverse"}},
    ...         "groups": [{"robots": ["youbot"], "tasks": ["paper"]}],
    ...     }
    ... )
    >>> with ThreadPoolExecutor(1) as pool:
    ...     done = mm.run_suite(suite, "results/mine", executor=pool, report=False)
    >>> frame = mm.load_results("results/mine")
    >>> frame.pivot_table("task_error_final", "robot", "controller").columns.tolist()
    ['baseline']

    Args:
        folder: The folder that ``mobman bench run`` or :func:`mobman.run_suite` wrote.

    Returns:
        A frame indexed by run id. Columns: ``robot``, ``task``, ``scenario``, ``controller`` (its
        label in the suite), ``law``, ``placement`` (its number), ``seed``, ``dt`` (s), ``duration``
        (s), ``status`` (as in :class:`mobman.Record`; ``"failed"`` for a run without a result,
        ``"pending"`` for one that is not done yet), ``message``, ``file``, every metric by its name, and
        what is known of a singularity (``singular_matrix``, ``singular_time``, ..., see
        :attr:`mobman.Record.singularity`); NaN where a run has none.

    Raises:
        MobmanError: If the folder holds no results.
    """
    store, names = Store(folder), ("law", "placement", "seed", "dt", "duration")
    rows: list[dict[str, Any]] = []
    for run, found, reason in store.outcomes():
        row: dict[str, Any] = {"run_id": run.run_id, "robot": run.robot, "task": run.task}
        row |= {"scenario": run.scenario["name"], "controller": run.label}
        row |= {name: getattr(run, name) for name in names}
        if isinstance(found, RecordError):
            row |= {"status": "failed" if reason else "pending", "message": reason, "file": ""}
        else:
            row |= {"status": found.status, "message": found.message, "file": str(store.path(run))}
            row |= found.metrics
            row |= {f"singular_{name}": value for name, value in found.singularity.items()}
        rows.append(row)
    return pd.DataFrame(rows).set_index("run_id")


@dataclass(frozen=True)
class Merged:
    """Result of joining folders."""

    asked: int  # runs of the folders together
    there: int  # those whose record is in the joined folder
    copied: int
    unusable: list[str]  # records that cannot be read, and why; they were left out
    conflicts: list[str]
    """Runs that two folders have with different results; the first one's is kept."""


def merge(folders: Sequence[str | os.PathLike[str]], into: str | os.PathLike[str]) -> Merged:
    """Join folders of one suite's results, from several machines for instance, in another folder, which
    may be new, or hold results of the suite; they are left as they are.

    Raises:
        MobmanError: If a folder holds no results, or another suite's, or ``into`` cannot be written.
        UsageError: If there is no folder to join.
    """
    if isinstance(folders, str) or not folders:
        raise UsageError(f"folders = {folders!r}: must be a list of one folder or more")
    sources, target = [Store(folder) for folder in folders], Store(into)
    if target.exists:
        sources.insert(0, target)
    manifests = {source: source.manifest for source in sources}
    names = {own.suite.name: source.folder for source, own in manifests.items()}
    if len(names) > 1:
        found = ", ".join(f"{name!r} in {folder}" for name, folder in names.items())
        raise MobmanError(f"these are results of different suites: {found}")
    for source, manifest in manifests.items():
        if manifest.schema_version != SCHEMA_VERSION:
            raise MobmanError(
                f"{source.folder} holds results made by an earlier mobman (schema "
                f"{manifest.schema_version}), which are not joined with others"
            )
    runs: dict[str, RunSpec] = {}
    for run in chain.from_iterable(manifest.runs for manifest in manifests.values()):
        runs.setdefault(run.run_id, run)
    target.begin(manifests[sources[0]].suite, runs.values())
    copied, unusable, conflicts = 0, [], []
    for source in sources:
        for run in manifests[source].runs if source is not target else ():
            if not os.path.lexists(source.path(run)):
                continue
            try:
                new = source.summary(run)
            except RecordError as error:
                unusable.append(str(error))
                continue
            if not target.done(run):
                target.keep(run, source.path(run).read_bytes())
                copied += 1
            elif target.summary(run).state_sha256 != new.state_sha256:
                conflicts.append(f"{run}: {target.path(run)} and {source.path(run)} differ")
        for run_id, reason in source.failures.items() if source is not target else ():
            lost = runs.get(run_id)
            if lost is not None and not target.done(lost):
                target.fail(lost, reason)
    seconds = sum(manifest.seconds or 0.0 for manifest in manifests.values())
    workers = sum(manifest.workers or 0 for manifest in manifests.values())
    target.write(replace(target.manifest, seconds=seconds or None, workers=workers or None))
    target.finish()
    there = sum(target.done(run) for run in runs.values())
    return Merged(len(runs), there, copied, unusable, conflicts)
