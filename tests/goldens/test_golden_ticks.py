"""Ticks of every law on every robot at stored states, fed in open loop."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.golden_access import smallest_argument
from support.goldens import a_last_place_away, differences, plain, read, relative_difference, write
from support.swept import swept

import mobman as mm

FILE = "ticks.h5"
TICKS, DT = 6, 0.01
TOLERANCE = 1e-9
SMALLEST = 1e-6
"""Below it, rounding of the argument of a fractional power shows in the torque."""

# Options of the laws, on a few robots, in addition to every law with its defaults.
VARIANTS = {
    "tsm, explicit": ("tsm", {"discretization": "explicit", "a": 0.2, "A": 0.1}),
    "tsm, boundary layer": ("tsm", {"boundary_layer": 0.05, "a": 0.2, "A": 0.1}),
    "tsm, gains": (
        "tsm",
        {
            "lambda_0": 1.2,
            "lambda_1": 9.0,
            "lambda_2": 5.0,
            "Lambda_0": 8.0,
            "Lambda_1": 5.0,
            "alpha_1": 5 / 7,
            "c": 1.5,
            "c_0": 0.7,
            "C": 1.3,
            "C_0": 0.8,
            "c_F": 0.5,
            "w_1": 1.1,
            "w_2": 0.02,
            "w_3": 2.0,
            "w_3k": 1.7,
            "w_4": 8.0,
            "w_4k": 2.5,
            "w_5": 11.0,
            "w_6": 0.3,
            "w_7": 5.0,
            "w_8": 0.02,
            "w_9": 7.0,
            "beta_0": 0.1,
            "beta_1": 0.2,
            "a": 0.3,
            "A": 0.2,
            "metric_scale": 0.8,
        },
    ),
    "tsm-simplified, explicit": ("tsm-simplified", {"discretization": "explicit"}),
    "tsm-inverse-actuation, gains": (
        "tsm-inverse-actuation",
        {"metric_scale": 1.2, "A": 0.01, "a": 0.05, "boundary_layer": 0.01},
    ),
    "pseudo-inverse, gains": ("pseudo-inverse", {"K_p": 16.0, "K_v": 7.0, "k_0": 9.0, "k_d": 2.0}),
    "damped-least-squares, gains": ("damped-least-squares", {"mu": 0.2, "K_p": 16.0}),
    "extended-jacobian, gains": ("extended-jacobian", {"K_p": 16.0, "K_v": 7.0, "c_F": 0.5}),
}
VARIED = ("youbot", "tiago_no_hand", "ridgeback_panda")


def of_stored(robot: str) -> list[str]:
    """Labels stored of a robot: laws, and for some robots their variants."""
    return [key for key in read(FILE)[robot] if key != "states"]


def made(label: str):
    """The law of a label."""
    name, gains = VARIANTS.get(label, (label, {}))
    if name.startswith("tsm"):
        gains = {"metric_scale": 1.0} | gains  # the paper's, whatever the default is
    return mm.make_controller(name, **gains)


def measured(robot: mm.MobileManipulator, label: str, states: dict) -> dict:
    """Torques and signals of a law at each of the states, and its settings."""
    law, rows = made(label), {"torque": []}
    law.reset(robot, mm.make_task("circle", robot), DT)
    for t, q, z, z_dot in zip(states["t"], states["q"], states["z"], states["z_dot"], strict=True):
        rows["torque"].append(np.array(law.step(float(t), q, z, z_dot)))
        for name, value in getattr(law, "signals", dict)().items():
            rows.setdefault(name.replace("/", " "), []).append(np.array(value))
    found = {name: np.array(values) for name, values in rows.items()}
    settings = dict(law.settings())
    if settings.get("K_F") == robot.criterion_weights.tolist():
        settings["K_F"] = None  # as it is stored: the robot's own
    return {**found, "settings": json.dumps(plain(settings), sort_keys=True)}


def deviations(found: dict, stored: dict):
    """List the deviations, each row relative to its own largest entry."""
    found, stored = dict(found), dict(stored)
    now, then = json.loads(found.pop("settings")), json.loads(stored.pop("settings"))
    # gains that came later are not stored; with their defaults they change no tick
    now = {name: value for name, value in now.items() if name in then}
    yield from differences(now, then, TOLERANCE, where="settings")
    yield from differences(found, stored, TOLERANCE, by_row=True)


@pytest.mark.parametrize("name", swept(read(FILE)))
def test_ticks_of_every_law_are_those_stored(name):
    robot, stored = mm.load_robot(name), read(FILE)[name]
    problems = [
        f"{label}: {problem}"
        for label in of_stored(name)
        for problem in deviations(measured(robot, label, stored["states"]), stored[label])
    ]
    assert not problems, "\n".join(problems)


@pytest.mark.parametrize("gain", ["K_p", "K_v"])
def test_a_gain_that_is_a_millionth_off_is_noticed(gain):
    stored = read(FILE)["youbot"]
    value = json.loads(stored["extended-jacobian"]["settings"])[gain]
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(VARIANTS, "off", ("extended-jacobian", {gain: value * (1 + 1e-6)}))
        found = measured(mm.load_robot("youbot"), "off", stored["states"])
    names = {
        problem.partition(":")[0] for problem in deviations(found, stored["extended-jacobian"])
    }
    assert names == {f"settings/{gain}", "torque"}


# Making the file ----------------------------------------------------------------------------------


def _states(robot, random) -> dict:
    lower = np.maximum(robot.model.lowerPositionLimit, -np.pi)
    upper = np.minimum(robot.model.upperPositionLimit, np.pi)
    q = np.clip(robot.q_rest + random.uniform(-0.15, 0.15, robot.nq), lower, upper)
    z, z_dot = 0.3 * random.standard_normal(robot.nz), random.standard_normal(robot.nz)
    rows = []
    for tick in range(TICKS):
        rows.append((0.4 + DT * tick, q, z, z_dot))
        q = q + DT * robot.velocity_map(q) @ z + 1e-4 * random.standard_normal(robot.nq)
        z = z + DT * z_dot + 1e-3 * random.standard_normal(robot.nz)
        z_dot = z_dot + 0.1 * random.standard_normal(robot.nz)
    return {
        name: np.array(values)
        for name, values in zip(("t", "q", "z", "z_dot"), zip(*rows, strict=True), strict=True)
    }


def _rejection(robot, labels, states) -> str:
    """Reason to reject states: fractional powers near 0, or outputs that amplify rounding."""
    task = mm.make_task("circle", robot)
    for label in labels:
        law = made(label)
        if label.startswith("tsm"):
            law.reset(robot, task, DT)
            for row in zip(*(states[key] for key in ("t", "q", "z", "z_dot")), strict=True):
                if (least := smallest_argument(law, (float(row[0]), *row[1:]))) < SMALLEST:
                    return f"{label}: an argument of {least:.1e}"
        generator = np.random.default_rng(0)
        once = measured(robot, label, states)
        for _ in range(2):
            moved = {k: a_last_place_away(v, generator) for k, v in states.items() if k != "t"}
            other = measured(robot, label, {"t": states["t"], **moved})
            for name, values in once.items():
                if name == "settings":
                    continue
                share = relative_difference(other[name], values, by_row=True)
                if not share < TOLERANCE / 10:
                    return f"{label}: {name} moves by {share:.0e} with the last place of the states"
    return ""


def make(report=print) -> None:
    """Store states of every robot, and what every law does there."""
    content = {}
    for name in mm.list_robots():
        robot = mm.load_robot(name)
        labels = [*mm.list_controllers(), *(VARIANTS if name in VARIED else ())]
        for seed in range(100):
            states = _states(robot, np.random.default_rng(seed))
            if not (reason := _rejection(robot, labels, states)):
                break
            report(f"{name}, seed {seed}: {reason}")
        else:
            raise SystemExit(f"no usable states of {name}")
        content[name] = {
            "states": states,
            **{label: measured(robot, label, states) for label in labels},
        }
    write(FILE, content)
