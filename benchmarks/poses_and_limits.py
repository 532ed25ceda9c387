"""Tables of the docs over all robots: poses, limits of motors and joints, and what makes a car steer.

python benchmarks/poses_and_limits.py pose [ROBOT ...]
python benchmarks/poses_and_limits.py far [ROBOT ...]
python benchmarks/poses_and_limits.py limits [ROBOT ...]
python benchmarks/poses_and_limits.py within [ROBOT ...]
python benchmarks/poses_and_limits.py steer
"""

from __future__ import annotations

import argparse
import math
import tomllib
from collections.abc import Iterator, Sequence

import numpy as np

import mobman as mm
from mobman.files import resource_folder
from mobman.simulation.limits import limit_remarks

FAR = mm.Scenario(name="far", start_offset=1.5, actuation=[{"type": "saturation", "factor": 1.0}])
"""1.5 m farther from the path, with the URDF's limits of torque."""

STEERED = (
    *(("hunter_ur10", "weight", value, 60.0) for value in (1e-12, 1e-3, 2e-2)),
    *(("ranger_xarm7", "ratio", value, 30.0) for value in (1.0, 2.6, 5.0)),
)
"""Robots, the field of their couplings that is changed, its value, and the length of the run (s)."""


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


def within(robot: mm.MobileManipulator) -> Iterator[str]:
    """Of the laws that know the limits, 25 s: error at the end (m), largest ratio to a limit of torque
    or velocity, and how far a joint went beyond its range (rad or m)."""
    for law in ("whole-body-qp", "mpc"):
        record = mm.simulate(robot, law, "circle", duration=25.0)
        ratio = max(record.metrics[f"{name}_limit_ratio"] for name in ("torque", "velocity"))
        yield f"{np.linalg.norm(record.task_error[-1, :3]):.1e}" if record.ok else _end(record)
        yield f"{ratio:.2f}"
        yield f"{record.metrics['position_limit_excess']:.1e}"


def steered(name: str, field: str, value: float, duration: float) -> list[str]:
    """Error at the end (m), how far the platform has turned by then (rad), and the peak torque (N m)."""
    folder = resource_folder("robots")
    fields = tomllib.loads((folder / f"{name}.toml").read_text(encoding="utf-8"))
    for coupling in fields["criterion"]["couplings"]:
        coupling[field] = value
    robot = mm.load_robot({**fields, "folder": folder})
    record = mm.simulate(robot, "tsm", "circle", duration=duration)
    error = np.linalg.norm(record.task_error[-1, :3])
    heading = record.q[:, record.joint_names.index("base_theta")]
    return [
        f"{value:g}",
        f"{error:.1e}" if record.ok else _end(record),
        f"{heading[-1] - heading[0]:.2f}",
        f"{record.metrics['torque_peak']:.1e}",
    ]


def _end(record: mm.Record) -> str:
    return f"{record.status} at {record.t[-1]:.2g} s"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("table", choices=("pose", "far", "limits", "within", "steer"))
    parser.add_argument("robots", nargs="*")
    given = parser.parse_args(arguments)
    for case in STEERED if given.table == "steer" else ():
        print(f"| `{case[0]}` | `{case[1]}` | {' | '.join(steered(*case))} |", flush=True)
    for name in () if given.table == "steer" else given.robots or mm.list_robots():
        robot = mm.load_robot(name)
        if given.table == "pose":
            cells = [str(robot.nz), *pose(robot)]
        elif given.table == "within":
            cells = list(within(robot))
        else:
            cells = hedged(robot, FAR if given.table == "far" else "real-limits")
        print(f"| `{name}` | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
