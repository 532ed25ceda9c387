"""Tables of docs/ground.md: how hard ground approaches the ideal plant, and the least friction on which
a law holds.

    python benchmarks/ground.py convergence [ROBOT ...]
    python benchmarks/ground.py survey [LAW ...] [--robot ROBOT]
    python benchmarks/ground.py friction [LAW ...] [--robot ROBOT] [--scenarios SCENARIO ...]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

import mobman as mm

HOLDS = 1e-3
"""m: a law holds where the tip's error stays below it in the steady part of a run."""
SMOOTH = "pseudo-inverse"
"""Law of the comparison with the ideal plant: it uses no z', and is smooth."""
LAWS = ("tsm", "tsm-null-space", "time-delay", "extended-jacobian", "computed-torque-integral")
COMPARED = ("tsm", "tsm-null-space", "computed-torque-integral", "time-delay", "extended-jacobian")
SURVEYED = (
    *("nominal", "heavier", "wrong-motors", "uncertain-kinematics", "contact", "noisy"),
    *("real-limits", "delayed", "realistic"),
)
_GROUNDS = ((1e-3, 1e-3, 5e-4), (1e-4, 1e-4, 2.5e-4), (1e-5, 1e-5, 1e-4), (1e-6, 1e-6, 5e-5))
_LARGEST, _RATIO = 2.0, 1.05  # of the bisection: where it begins, and how near it comes


def on_ground(scenario: str = "contact", **plant: float) -> mm.Scenario:
    """The scenario ``contact`` with other fields of its plant, and the inertias of another one."""
    fields = mm.load_scenario("contact").model_dump(mode="json")
    if scenario != "contact":
        other = mm.load_scenario(scenario)
        fields |= {"mass_factor": other.mass_factor, "payload": other.payload}
    return mm.Scenario(**{**fields, "name": "ground", "plant": {**fields["plant"], **plant}})


def distance_to_ideal(
    robot: str, deflection: float, creep: float, step: float, duration: float = 2.0
) -> tuple[float, float]:
    """How far the tip and the platform are from where they are on the ideal plant, at most (m)."""
    scenario = on_ground(deflection=deflection, creep=creep, step=step)
    found, ideal = (
        mm.simulate(robot, SMOOTH, "circle", duration=duration, scenario=one)
        for one in (scenario, "nominal")
    )
    if not found.ok:
        return float("inf"), float("inf")
    base = [found.joint_names.index(name) for name in ("base_x", "base_y")]
    return (
        float(np.linalg.norm(found.tip_position - ideal.tip_position, axis=1).max()),
        float(np.linalg.norm((found.q - ideal.q)[:, base], axis=1).max()),
    )


def holds(robot: str, law: str, scenario: mm.Scenario, duration: float) -> bool:
    """True if a law holds in a run."""
    record = mm.simulate(robot, law, "circle", duration=duration, scenario=scenario)
    return bool(record.ok and record.metrics["task_error_max"] < HOLDS)


def least_friction(
    robot: str, law: str, scenario: str = "contact", duration: float = 10.0
) -> float:
    """The least coefficient of friction on which a law holds, by bisection of its logarithm; inf if it
    holds on none."""
    high, low = _LARGEST, 0.01
    if not holds(robot, law, on_ground(scenario, friction=high), duration):
        return float("inf")
    while high / low > _RATIO:
        middle = float(np.sqrt(high * low))
        if holds(robot, law, on_ground(scenario, friction=middle), duration):
            high = middle
        else:
            low = middle
    return high


def late_error(robot: str, law: str, scenario: str, duration: float = 8.0) -> str:
    """Largest |e^e| of the last fifth of the default circle (m), or how the run ended."""
    record = mm.simulate(robot, law, "circle", duration=duration, scenario=scenario)
    if not record.ok:
        return f"{record.status} at {record.t[-1]:.2g} s"
    late = record.task_error[record.t >= 0.8 * duration, :3]
    return f"{np.linalg.norm(late, axis=1).max():.1e}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", choices=("convergence", "friction", "survey"))
    parser.add_argument("names", nargs="*", help="robots, or laws")
    parser.add_argument("--robot", default="tiago_no_hand")
    parser.add_argument("--scenarios", nargs="+", default=("contact", "heavier"))
    given: Any = parser.parse_args(arguments)
    if given.table == "convergence":
        for robot in given.names or [given.robot]:
            for ground in _GROUNDS:
                tip, base = distance_to_ideal(robot, *ground)
                print(f"| `{robot}` | {ground[0]:g} | {tip:.1e} | {base:.1e} |", flush=True)
        return
    if given.table == "survey":
        for scenario in SURVEYED:
            found = [late_error(given.robot, law, scenario) for law in given.names or COMPARED]
            print(f"| `{scenario}` | {' | '.join(found)} |", flush=True)
        return
    for law in given.names or LAWS:
        found = [least_friction(given.robot, law, scenario) for scenario in given.scenarios]
        texts = ("never" if np.isinf(friction) else f"{friction:.2f}" for friction in found)
        print(f"| `{law}` | {' | '.join(texts)} |", flush=True)


if __name__ == "__main__":
    main()
