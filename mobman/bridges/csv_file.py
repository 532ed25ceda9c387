"""CSV: the samples of a record as one table."""

from __future__ import annotations

from mobman.simulation.record import Record


def csv_content(record: Record) -> bytes:
    """The content of a file with a row a sample, and columns as :meth:`mobman.Record.to_pandas` names
    them, with units: ``t [s]``, ``torque/alpha_1 [N m or N]``. Numbers come back to the last bit."""
    frame = record.to_pandas()
    units = {name: f"{name} [{unit}]" for name, (_, unit) in frame.attrs["places"].items()}
    text = frame.rename(columns=units).to_csv(index_label="t [s]", lineterminator="\n")
    return bytes(text.encode())
