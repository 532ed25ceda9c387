"""Compile the kernels that most tests need: ``python -m support.kernels``, in the folder tests.

``make test`` does so while it checks style and types, which takes as long.
"""

from __future__ import annotations

import mobman as mm
from support.swept import ONE_OF_EACH


def compile_kernels() -> None:
    """Run every law on one robot, and one law on a robot of each platform type, for a tick."""
    for robot in ONE_OF_EACH:
        for law in mm.list_controllers() if robot == "youbot" else ["tsm"]:
            mm.simulate(robot, law, "circle", duration=1e-3, scenario="realistic")


if __name__ == "__main__":
    compile_kernels()
