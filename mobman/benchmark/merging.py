"""Joining folders of results, from several machines for instance."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

from mobman.benchmark.manifest import NAME
from mobman.benchmark.store import Store
from mobman.errors import MobmanError, RecordError, UsageError
from mobman.simulation.run_spec import RunSpec


@dataclass(frozen=True)
class Merged:
    """Result of joining folders."""

    asked: int
    """Runs that the folders ask for together."""
    there: int
    """Those whose record is in the joined folder."""
    copied: int
    unusable: list[str]
    """Records that cannot be read, and why; they were left out."""
    conflicts: list[str]
    """Runs that two folders have with different results; the first one's is kept."""


def merge(folders: Sequence[str | os.PathLike[str]], into: str | os.PathLike[str]) -> Merged:
    """Join folders of one suite's results, from several machines for instance.

    Args:
        folders: What is joined; they are left as they are.
        into: The folder that gets everything; it may be new, or hold results of the suite.

    Raises:
        MobmanError: If a folder holds no results, or another suite's, or ``into`` cannot be written.
        UsageError: If there is no folder to join.
    """
    if isinstance(folders, str) or not folders:
        raise UsageError(f"folders = {folders!r}: must be a list of one folder or more")
    sources = [Store(folder) for folder in folders]
    target = Store(into)
    if (target.folder / NAME).exists():
        sources.insert(0, target)
    manifests = [source.manifest for source in sources]
    names = {
        manifest.suite.name: source for manifest, source in zip(manifests, sources, strict=True)
    }
    if len(names) > 1:
        found = ", ".join(f"{name!r} in {store.folder}" for name, store in names.items())
        raise MobmanError(f"these are results of different suites: {found}")
    runs: dict[str, RunSpec] = {}
    for manifest in manifests:
        for run in manifest.runs:
            runs.setdefault(run.run_id, run)
    target.begin(manifests[0].suite, runs.values())
    copied, unusable, conflicts = 0, [], []
    for source in sources:
        if source is target:
            continue
        for run in source.runs:
            if not os.path.lexists(source.path(run)):
                continue
            try:
                new = source.summary(run)
            except RecordError as error:
                unusable.append(str(error))
                continue
            try:
                old = target.summary(run)
            except RecordError:
                target.keep(run, source.path(run).read_bytes())
                copied += 1
                continue
            if old.state_sha256 != new.state_sha256:
                conflicts.append(f"{run}: {target.path(run)} and {source.path(run)} differ")
        for failure in source.failures:
            lost = runs.get(failure.run_id)
            if lost is not None and not target.done(lost):
                target.fail(lost, failure.reason)
    seconds = [manifest.seconds for manifest in manifests if manifest.seconds is not None]
    workers = [manifest.workers for manifest in manifests if manifest.workers is not None]
    before = target.manifest
    after = replace(before, seconds=sum(seconds) or None, workers=sum(workers) or None)
    try:
        after.write(target.folder)
    except OSError as error:
        raise MobmanError(f"cannot write to {target.folder}: {error.strerror or error}") from error
    target.rebuild_index()
    there = sum(target.done(run) for run in runs.values())
    return Merged(len(runs), there, copied, unusable, conflicts)
