"""Results of a suite as one table, a row a run."""

from __future__ import annotations

import os
from typing import Any

import pandas as pd

from mobman.benchmark.store import Store
from mobman.errors import RecordError


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
