"""Small suites to try the machinery on."""

from __future__ import annotations

from pathlib import Path

SMALL = """
schema = 1
name = "small"
duration = {duration}
seeds = [0, 1]

[controllers.pseudo-inverse]
law = "pseudo-inverse"

[controllers.damped]
law = "damped-least-squares"
gains = {{ mu = 0.02 }}

[[groups]]
robots = ["youbot"]
tasks = ["circle"]
scenarios = ["nominal", "disturbed"]
"""


def small_suite(folder: Path, duration: float = 0.02) -> Path:
    """A suite of 8 short runs, as a file."""
    path = folder / "small.toml"
    path.write_text(SMALL.format(duration=duration))
    return path
