"""What runs are called in a comparison: by what tells them apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from mobman.simulation.record import Record


def labels(records: Sequence[Record], names: Sequence[str]) -> list[str]:
    """A label for each run.

    Args:
        records: The runs.
        names: What to call those that are alike in everything, such as their files' names.
    """
    if len(records) == 1:
        return [records[0].controller]
    fields = [
        [record.robot for record in records],
        [record.controller for record in records],
        [record.task for record in records],
        [record.scenario for record in records],
        [f"seed {record.seed}" for record in records],
    ]
    telling = [field for field in fields if len(set(field)) > 1]
    found = [" · ".join(parts) for parts in zip(*telling, strict=True)] or [
        record.controller for record in records
    ]
    often = Counter(found)
    return [
        f"{label} · {name}" if often[label] > 1 else label
        for label, name in zip(found, names, strict=True)
    ]
