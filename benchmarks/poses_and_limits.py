"""Tables of the docs over all robots: poses, and control at the limits of motors and joints.

python benchmarks/poses_and_limits.py pose [ROBOT ...]
python benchmarks/poses_and_limits.py far [ROBOT ...]
python benchmarks/poses_and_limits.py limits [ROBOT ...]
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence

import numpy as np

import mobman as mm
from mobman.simulation.limits import limit_remarks

FAR = mm.Scenario(name="far", start_offset=1.5, actuation=[{"type": "saturation", "factor": 1.0}])
"""1.5 m farther from the path, with the URDF's limits of torque."""


def pose(robot: mm.MobileManipulator) -> list[str]:
    """|e^e| (m) and the angle (rad) that remain on ``pose-circle``, a cell an orientation."""
    cells = []
    for orientation in ("hold", "turn", "wobble"):
        try:
            task = mm.make_task("pose-circle", robot, orientation=orientation)
            record = mm.simulate(robot, "tsm", task, duration=10.0)
        except mm.MobmanError as error:
            return [str(error)]
        found = record.metrics["task_error_max"], record.metrics["orientation_error_max"]
        cells.append("{:.1e}, {:.1e}".format(*found) if record.ok else _end(record))
    return cells


def hedged(robot: mm.MobileManipulator, scenario: mm.Scenario | str) -> list[str]:
    """|e^e| at the end (m), share of ticks at a limit, largest torque over its limit, what is beyond."""
    law = mm.make_controller("tsm", saturation="hedge")
    record = mm.simulate(robot, law, "circle", duration=10.0, scenario=scenario)
    error = record.task_error[-1, :3]
    ratio = record.metrics.get("torque_limit_ratio", math.nan)
    return [
        f"{np.linalg.norm(error):.1e}" if record.ok else _end(record),
        f"{100 * record.metrics['saturation_share']:.1f} %",
        f"{ratio:.2f}",
        "; ".join(limit_remarks(record, robot)) or "–",
    ]


def _end(record: mm.Record) -> str:
    return f"{record.status} at {record.t[-1]:.2g} s"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("table", choices=("pose", "far", "limits"))
    parser.add_argument("robots", nargs="*")
    given = parser.parse_args(arguments)
    for name in given.robots or mm.list_robots():
        robot = mm.load_robot(name)
        if given.table == "pose":
            cells = [str(robot.nz), *pose(robot)]
        else:
            cells = hedged(robot, FAR if given.table == "far" else "real-limits")
        print(f"| `{name}` | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
