"""Tables of docs/uncertain.md: what wrong dimensions and motors cost, and when a law holds with them.

python benchmarks/uncertain.py error [LAW ...] [--robots ROBOT ...] [--shares SHARE ...] [--tip modelled]
python benchmarks/uncertain.py condition [ROBOT ...] [--shares SHARE ...]
python benchmarks/uncertain.py margin [LAMBDA_2 ...] [--lambda_1 LAMBDA_1]
python benchmarks/uncertain.py zero [DEGREES ...]
python benchmarks/uncertain.py motors [FACTOR ...] [--scales SCALE ...]
python benchmarks/uncertain.py singular [LAW ...]
"""

from __future__ import annotations

import argparse
import math
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numba import njit

import mobman as mm
from mobman.arrays import Array
from mobman.controllers.task_errors import TaskSpace
from mobman.files import resource_folder
from mobman.model.criterion import Posture
from mobman.model.metric import base_metric
from mobman.simulation.pieces import Setting

LAWS = (
    *("tsm", "tsm-null-space", "super-twisting", "time-delay", "computed-torque-integral"),
    *("disturbance-observer", "extended-jacobian", "pseudo-inverse"),
)
ROBOTS = ("youbot", "tiago_no_hand", "husky_ur5", "ridgeback_panda", "hunter_ur10", "fixed_panda")
SHARES = (0.01, 0.03, 0.1)
TABLES = ("error", "condition", "margin", "zero", "motors", "singular")


def wrong(share: float, tip: str = "measured") -> mm.Scenario:
    """Links, tool, wheel radius and track off by up to a share, at random."""
    fields = mm.load_scenario("uncertain-kinematics").model_dump(mode="json")
    for piece in fields["kinematics"]:
        piece |= {name: share for name in piece if name.endswith("spread")}
    return mm.Scenario(**{**fields, "name": "wrong", "tip": tip})


def error(robot: str, law: mm.Controller | str, scenario: mm.Scenario, duration: float) -> str:
    """Largest |e^e| of the last fifth of the default circle (m), or how the run ended."""
    record = mm.simulate(robot, law, "circle", duration=duration, scenario=scenario)
    if not record.ok:
        return f"{record.status} at {record.t[-1]:.2g} s"
    late = record.task_error[record.t >= 0.8 * duration, :3]
    return f"{np.linalg.norm(late, axis=1).max():.1e}"


def condition(robot: mm.MobileManipulator, share: float, seeds: int = 10) -> tuple[Array, Array]:
    """Largest |Delta|, Delta = (J_e - Jh_e) X_e, of ``tsm`` and of ``tsm-null-space``: by seed along the
    default circle that the nominal robot follows, shape (seeds,) each."""
    record = mm.simulate(robot, "tsm", "circle", duration=10.0)
    task = mm.make_task("circle", robot)
    own, omega = TaskSpace(robot, task, Posture.of(robot)), base_metric(robot)
    found = np.zeros((2, seeds))
    for seed in range(seeds):
        setting = Setting(robot, 1e-3, np.random.default_rng(seed))
        true = TaskSpace(wrong(share).true_robot(setting), task)
        for q in record.q[::200]:
            for space in (own, true):
                space.at(0.0, q, np.zeros(robot.nz))
            weighted = omega[:, None] * own.J[:3].T
            inverses = np.linalg.inv(own.J)[:, :3], weighted @ np.linalg.inv(own.J[:3] @ weighted)
            for i, X in enumerate(inverses):
                size = np.linalg.norm((true.J - own.J[:3]) @ X, 2)
                found[i, seed] = max(found[i, seed], size)
    return found[0], found[1]


@njit
def sliding_motion(
    lambda_1: float, lambda_2: float, turn: Array, e: Array, duration: float, dt: float
) -> float:
    """The largest |e_i| of the last fifth of e'' = T n, with n by (31) on s = 0 and lambda_0 = 1."""
    e, rate, n = e.copy(), np.zeros_like(e), np.zeros_like(e)
    ticks, largest = int(duration / dt), 0.0
    for tick in range(ticks):
        for i in range(len(e)):
            bracket = math.copysign(abs(rate[i]) ** (9 / 7), rate[i]) + e[i]
            g = math.copysign(abs(n[i]) ** 0.6, n[i])
            g += lambda_1**0.6 * math.copysign(abs(bracket) ** (1 / 3), bracket)
            n[i] -= dt * lambda_2 * g
        rate += dt * (turn @ n)
        e += dt * rate
        size = np.abs(e).max()
        if not size < 1e6:
            return np.inf
        if tick > 0.8 * ticks:
            largest = max(largest, size)
    return largest


def margin(lambda_1: float, lambda_2: float) -> float:
    """The largest angle by which a J that is turned in a plane may be wrong (rad), by bisection: the law
    converges with (31) on s = 0."""
    low, high = 0.0, 0.5 * math.pi
    while high - low > 2e-3:
        middle = 0.5 * (low + high)
        c, s = math.cos(middle), math.sin(middle)
        turn = np.array([[c, -s], [s, c]])
        if sliding_motion(lambda_1, lambda_2, turn, np.array([1.0, 0.3]), 40.0, 5e-4) < 1e-3:
            low = middle
        else:
            high = middle
    return low


def diverging(lambda_1: float, lambda_2: float, size: float, seeds: int = 300) -> int:
    """How many of so many random Delta of a norm the law does not converge with."""
    random, found = np.random.default_rng(0), 0
    for _ in range(seeds):
        wrong = random.standard_normal((3, 3))
        turn = np.eye(3) + size / np.linalg.norm(wrong, 2) * wrong
        e = np.array([1.0, 0.3, -0.5])
        found += not sliding_motion(lambda_1, lambda_2, turn, e, 40.0, 5e-4) < 1e-3
    return found


def cranked(dead: float | None = None) -> mm.MobileManipulator:
    """The youBot's arm and body on a base whose turning motor has no lever at the heading ``dead``."""
    folder = resource_folder("robots")
    fields = tomllib.loads((folder / "youbot.toml").read_text(encoding="utf-8"))
    options = {} if dead is None else {"dead": dead}
    crank = f"{Path(__file__).with_name('crank.py')}:Crank"
    fields["platform"] = {"type": "custom", "definition": crank, "options": options}
    fields["urdf"]["lock"] = ["phi_1", "phi_2"]
    return mm.load_robot({**fields, "name": "cranked", "folder": folder})


def passage(law: str, scenario: str, time: float, duration: float = 10.0) -> str:
    """Cost of passing the heading that the robot without a dead one has at ``time``: largest |e^e| in
    the 0.4 s about it and at the end, each with that of the free robot, and the motor's peak (N m)."""
    free = mm.simulate(cranked(), law, "circle", duration=duration, scenario=scenario)
    heading = free.joint_names.index("base_theta")
    robot = cranked(float(free.q[np.searchsorted(free.t, time), heading]))
    record = mm.simulate(robot, law, "circle", duration=duration, scenario=scenario)
    if not record.ok:
        return f"{record.status} at {record.t[-1]:.2g} s"
    near = np.abs(record.t - time) <= 0.2
    sizes = [
        np.linalg.norm(run.task_error[part, :3], axis=1).max()
        for part in (near, record.t >= 0.8 * duration)
        for run in (record, free)
    ]
    peak = np.abs(record.torque[:, 1]).max()
    return "{:.1e} ({:.1e}), {:.1e} ({:.1e}), {:.2g}".format(*sizes, peak)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("table", choices=TABLES)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--robots", nargs="+", default=ROBOTS)
    parser.add_argument("--shares", nargs="+", type=float, default=SHARES)
    parser.add_argument("--scales", nargs="+", type=float, default=(1.0, 0.5))
    parser.add_argument("--tip", choices=("modelled", "measured"), default="measured")
    parser.add_argument("--lambda_1", type=float, default=11.0)
    parser.add_argument("--duration", type=float, default=10.0)
    given = parser.parse_args(arguments)
    if given.table == "error":
        for robot in given.robots:
            for law in given.names or LAWS:
                found = [
                    error(robot, law, wrong(share, given.tip), given.duration)
                    for share in given.shares
                ]
                print(f"| `{robot}` | `{law}` | {' | '.join(found)} |", flush=True)
    elif given.table == "condition":
        for name in given.names or ROBOTS:
            for share in given.shares:
                sizes = condition(mm.load_robot(name), share)
                found = " | ".join(f"{np.median(one):.2f}, {one.max():.2f}" for one in sizes)
                print(f"| `{name}` | {share:g} | {found} |", flush=True)
    elif given.table == "margin":
        for lambda_2 in map(float, given.names or (6, 12, 24, 48)):
            angle = margin(given.lambda_1, lambda_2)
            size = 2.0 * math.sin(0.5 * angle)
            found = diverging(given.lambda_1, lambda_2, size)
            cells = f"{lambda_2:g} | {math.degrees(angle):.0f}° | {size:.2f} | {found} of 300"
            print(f"| {given.lambda_1:g} | {cells} |", flush=True)
    elif given.table == "zero":
        for degrees in map(float, given.names or (15, 25, 40)):
            piece = {"type": "zeros", "links": "panda_joint1", "offset": math.radians(degrees)}
            scenario = mm.Scenario(name="zero", kinematics=[piece], tip="measured")
            found = [
                error("fixed_panda", mm.make_controller("tsm", lambda_2=gain), scenario, 8.0)
                for gain in (6.0, 24.0)
            ]
            print(f"| {degrees:g}° | {' | '.join(found)} |", flush=True)
    elif given.table == "singular":
        for law in given.names or ("tsm", "tsm-inverse-actuation"):
            for scenario in ("nominal", "heavier"):
                found = " | ".join(passage(law, scenario, time) for time in (0.5, 1.0, 3.0))
                print(f"| `{law}` | `{scenario}` | {found} |", flush=True)
    else:
        for factor in map(float, given.names or (0.25, 0.5, 1.5, 1.9, 2.1, 3.5, 4.5)):
            scenario = mm.Scenario(name="motors", actuation=[{"type": "gain", "factor": factor}])
            found = [
                error(robot, mm.make_controller("tsm", metric_scale=scale), scenario, 8.0)
                for robot in given.robots
                for scale in given.scales
            ]
            print(f"| {factor:g} | {' | '.join(found)} |", flush=True)


if __name__ == "__main__":
    main()
