"""Tables of docs/ground.md: how hard ground approaches the ideal plant, and what holds on it.

python benchmarks/ground.py convergence [ROBOT ...]
python benchmarks/ground.py survey [LAW ...] [--robot ROBOT]
python benchmarks/ground.py holds [ROBOT ...]
python benchmarks/ground.py start [ROBOT ...]
python benchmarks/ground.py asked [ROBOT ...]
python benchmarks/ground.py friction [LAW ...] [--robot ROBOT] [--scenarios SCENARIO ...]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

import mobman as mm
from mobman.simulation.contact import MuJoCo
from mobman.simulation.mjcf import feet_of
from mobman.simulation.traction import traction

HOLDS = 1e-3
"""m: a law holds where the tip's error stays below it in the steady part of a run."""
SMOOTH = "pseudo-inverse"
"""Law of the comparison with the ideal plant: it uses no z', and is smooth."""
LAWS = ("tsm", "tsm-null-space", "time-delay", "extended-jacobian", "computed-torque-integral")
COMPARED = ("tsm", "tsm-null-space", "computed-torque-integral", "time-delay", "extended-jacobian")
STARTED = ("tiago_no_hand", "youbot", "husky_ur5", "ranger_xarm7")
ASKED = ("hsr", "ranger_xarm7", "stretch", "turtlebot3_omx")
FRICTION = 0.8  # of `contact`
SURVEYED = (
    *("nominal", "heavier", "wrong-motors", "uncertain-kinematics", "contact", "noisy"),
    *("real-limits", "delayed", "realistic"),
)
TABLES = ("convergence", "friction", "survey", "holds", "start", "asked")
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
    return late(mm.simulate(robot, law, "circle", duration=duration, scenario=scenario), duration)


def late(record: mm.Record, duration: float) -> str:
    """Largest |e^e| of the last fifth (m), or how the run ended."""
    if not record.ok:
        return f"{record.status} at {record.t[-1]:.2g} s"
    size = np.linalg.norm(record.task_error[record.t >= 0.8 * duration, :3], axis=1).max()
    return f"{size:.1e}"


def held(robot: str) -> list[str]:
    """Error of ``tsm``, its slip (m/s) and true error of the tip (m); error of ``tsm-null-space``."""
    found, other = (
        mm.simulate(robot, law, "circle", duration=10.0, scenario="contact")
        for law in ("tsm", "tsm-null-space")
    )
    metrics = (found.metrics.get(name, np.nan) for name in ("slip_max", "true_error_max"))
    cells = (f"{value:.1e}" if np.isfinite(value) else "–" for value in metrics)
    return [late(found, 10.0), *cells, late(other, 10.0)]


def started(robot: str) -> list[str]:
    """From 4 m behind: the cap on acceleration (m/s^2), error without caps and with, friction used."""
    cap = traction(mm.load_robot(robot), MuJoCo(friction=0.8)).a_max()
    scenario = mm.load_scenario("contact").model_copy(update={"start_offset": 4.0})
    free, capped = (
        mm.simulate(
            robot, mm.make_controller("tsm", **caps), "circle", duration=16.0, scenario=scenario
        )
        for caps in ({}, {"v_max": 1.0, "a_max": cap})
    )
    used = f"{capped.metrics['grip_used']:.2f}"
    return [f"{cap:.1f}", late(free, 16.0), late(capped, 16.0), used]


def grip_asked(robot: mm.MobileManipulator, record: mm.Record) -> np.ndarray:
    """Friction over load that a run on the ideal plant needs of the wheel that needs most, a number a
    tick; inf from where the ground would have to pull.

    By Newton and Euler on the whole robot, without MuJoCo: momentum tells force and moment, springs as
    stiff as the feet the loads, and of all frictions with that force and moment those are taken whose
    sum of squares is least.
    """
    model, data = robot.model, robot.model.createData()
    pose, level = robot.platform_index[:3], robot.q_rest.copy()
    level[pose] = 0.0
    feet = feet_of(robot)
    pin.forwardKinematics(model, data, level)
    places = [data.oMi[model.getJointId(foot.joint)].act(foot.centre)[:2] for foot in feet]
    plane = np.column_stack([np.ones(len(feet)), places])
    stiffness = np.array([1.0 if foot.friction else MuJoCo().supports for foot in feet])
    rough = np.array([foot.friction for foot in feet])
    middle = plane[rough, 1:].mean(axis=0)
    arms = plane[rough, 1:] - middle
    across = np.column_stack([-arms[:, 1], arms[:, 0]]) / np.sum(arms**2)
    found = []
    for q, z, z_dot in zip(
        record.q, record.z, np.diff(record.z, axis=0) / np.diff(record.t)[:, None], strict=False
    ):
        C = robot.velocity_map(q)
        q_ddot = C @ z_dot + robot.velocity_map_rate(q, z) @ z
        pin.computeCentroidalMomentumTimeVariation(model, data, q, C @ z, q_ddot)
        turn = np.array(pin.rpy.rpyToMatrix(0.0, 0.0, q[pose[2]])).T  # to the platform's axes
        centre = turn @ (data.com[0] - [*q[pose[:2]], 0.0])
        force = turn @ (data.dhg.linear - pin.computeTotalMass(model) * model.gravity.linear)
        moment = turn @ data.dhg.angular + np.cross(centre, force)  # about the platform's origin
        load, wanted = np.zeros(len(feet)), np.array([force[2], -moment[1], moment[0]])
        on = np.ones(len(feet), dtype=bool)
        while on.sum() > 2:
            K = plane[on].T * stiffness[on]
            load[on] = stiffness[on] * (plane[on] @ np.linalg.solve(K @ plane[on], wanted))
            if (load[on] > 0.0).all():
                break
            on, load = on & (load > 0.0), np.zeros(len(feet))
        yaw = moment[2] - middle[0] * force[1] + middle[1] * force[0]
        friction = np.linalg.norm(force[:2] / rough.sum() + yaw * across, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            found.append(np.max(friction / load[rough]))
    return np.array(found)


def asked(robot: str, law: str) -> list[str]:
    """Friction over load that the ideal plant's motion needs at most, and when it is first above that
    of the ground (s); when a wheel on the ground first has no more, and the end there."""
    ideal, ground = (
        mm.simulate(robot, law, "circle", duration=10.0, scenario=scenario)
        for scenario in ("nominal", "contact")
    )
    found = grip_asked(mm.load_robot(robot), ideal)
    signals = ground.signals
    used = signals["contact/friction"] > (1.0 - 1e-6) * FRICTION * signals["contact/normal"]
    return [
        f"{found.max():.2f}",
        _first(ideal.t, found > FRICTION),
        _first(ground.t, used.any(axis=1)),
        late(ground, 10.0),
    ]


def _first(t: np.ndarray, true: np.ndarray) -> str:
    return f"{t[np.argmax(true)]:.2f}" if true.any() else "–"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", choices=TABLES)
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
    if given.table in ("holds", "start"):
        row = held if given.table == "holds" else started
        for robot in given.names or (mm.list_robots() if row is held else STARTED):
            print(f"| `{robot}` | {' | '.join(row(robot))} |", flush=True)
        return
    if given.table == "asked":
        for robot in given.names or ASKED:
            for law in ("tsm", "tsm-null-space"):
                print(f"| `{robot}` | `{law}` | {' | '.join(asked(robot, law))} |", flush=True)
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
