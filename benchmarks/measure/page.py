"""The measurement as a page of tables, ``speed.md``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from measure.targets import rounded_against, targets

_ROWS = {
    "bare_tick": "(a) the bare Pinocchio calls of a tick",
    "bare_controller": "(a') of them, those of the controller",
    "step": "(b) our controller step",
    "tick": "(c) our whole tick, recording and metrics included",
    "tick_alone": "(c') the same without what a run costs once",
    "pink_solve": "(d) Pink's `solve_ik`, kinematics only",
    "pink_step": "(d') Pink's whole step",
    "mujoco_step": "(e) a 1 ms MuJoCo step with wheel contacts",
    "plain_tick": "(f) the same closed loop written plainly",
}
_RATIOS = {
    "tick_over_bare": "(c)/(a)",
    "step_over_bare": "(b)/(a')",
    "step_over_pink": "(b)/(d)",
    "plain_over_tick": "(f)/(c)",
    "tick_over_mujoco": "(c)/(e)",
}
_BEGIN = "<!-- numbers, written by python benchmarks/speed.py --update-baseline -->"
_END = "<!-- end of numbers -->"
_MORE_IS_BETTER = {"plain_over_tick"}


def page(result: dict[str, Any]) -> str:
    """The whole page, Markdown."""
    parts = [
        "# Speed",
        f"Made by `{result['command']}`, {result['created']}, on {result['processor']}.\n"
        f"{', '.join(f'{name} {number}' for name, number in result['versions'].items())}; "
        "BLAS on one thread.",
        "Medians over interleaved repetitions, with their quartiles in brackets: in each of the "
        f"{result['rounds']} rounds every measurement is made once. Ratios are taken in each round.",
        "![Cost of a tick, and how it grows with the arm](speed.svg)",
        "## Targets",
        _targets(result),
        "A quick run: few rounds and short runs, so none of these verdicts is final."
        if result["quick"]
        else "",
    ]
    if robots := result.get("robots"):
        parts += ["## A tick (µs)", _times(robots), "## Ratios", _ratios(robots), _notes(robots)]
    parts += list(_growth(result.get("growth", {})))
    if runs := result.get("long_runs"):
        parts += ["## A minute at 1 kHz", _long_runs(runs)]
    if real_time := result.get("real_time"):
        parts += [
            "## Real time",
            f"youbot, runs of {real_time['simulated']:g} s at 1 kHz on one core: "
            f"{_spread(real_time['factor'], up=False)} times faster than real time.",
        ]
    if imports := result.get("imports"):
        parts += ["## Import", _imports(imports)]
    return "\n\n".join(part for part in parts if part) + "\n"


def numbers_into(document: str, result: dict[str, Any], picture: str) -> str:
    """A document with the page's tables between its two marks.

    Args:
        document: Markdown with the marks.
        result: The measurement.
        picture: Where the document finds the plot.
    """
    before, rest = document.split(_BEGIN, 1)
    _, after = rest.split(_END, 1)
    numbers = page(result).split("\n", 2)[2].replace("(speed.svg)", f"({picture})")
    numbers = numbers.replace("\n## ", "\n### ")  # a part of a page, no longer one of its own
    return f"{before}{_BEGIN}\n{numbers.strip()}\n{_END}{after}"


def _targets(result: dict[str, Any]) -> str:
    return table(
        ["target", "limit", "found", "verdict"],
        ([one.text, one.bound, one.value, one.verdict] for one in targets(result)),
        rule="---",
    )


def _times(robots: dict[str, Any]) -> str:
    """One column a robot; what a run costs once in ms."""
    head = ["", *(f"{name} (r = {robot['nz']})" for name, robot in robots.items())]
    rows = [
        [label, *(_cell(robot, "seconds", key, 1e6) for robot in robots.values())]
        for key, label in _ROWS.items()
    ]
    once = ["a run of one tick, which (c) bears a share of (ms)"]
    rows.append(
        [*once, *(_cell(robot, "seconds", "one_tick_run", 1e3) for robot in robots.values())]
    )
    ticks = ["ticks of the runs of (c) and (f)", *(str(r["ticks"]) for r in robots.values())]
    return table(head, [*rows, ticks])


def _ratios(robots: dict[str, Any]) -> str:
    return table(
        ["", *robots],
        (
            [
                label,
                *(
                    _cell(r, "ratios", key, 1.0, key not in _MORE_IS_BETTER)
                    for r in robots.values()
                ),
            ]
            for key, label in _RATIOS.items()
        ),
    )


def _notes(robots: dict[str, Any]) -> str:
    lines = [
        f"- {name}: {_ROWS[key]}: {note}"
        for name, robot in robots.items()
        for key, note in robot["notes"].items()
    ]
    return "\n".join(lines)


def _growth(growth: dict[str, Any]) -> Iterable[str]:
    if joints := growth.get("joints"):
        yield "## Growth with the arm"
        yield (
            "Chains of n joints on a differential base, r = n + 2; µs of a controller step. Own: "
            "the step without its bare Pinocchio calls."
        )
        kinds = ("step", "bare_controller", "own")
        yield table(
            ["n", "r", "controller step", "bare Pinocchio", "own"],
            (
                [str(n), str(nz), *(_spread(joints[kind][i], 1e6) for kind in kinds)]
                for i, (n, nz) in enumerate(zip(joints["joints"], joints["nz"], strict=True))
            ),
        )
        exponents = joints["exponent"]
        yield (
            f"Own work grows as r^{rounded_against(exponents['all'], True)} over all sizes, as "
            f"r^{rounded_against(exponents['larger half'], True)} over the larger half of them."
        )
    if periods := growth.get("dt"):
        yield "## Growth with the sampling period"
        yield (
            "youbot; ms of computing for a simulated second. The plant's integration step is 1 ms "
            "at most, whatever the period."
        )
        yield table(
            ["dt (ms)", "ms a simulated second"],
            (
                [f"{1e3 * dt:g}", _spread(cost, 1e3)]
                for dt, cost in zip(
                    periods["dt"], periods["seconds_per_simulated_second"], strict=True
                )
            ),
        )
    if workers := growth.get("workers"):
        yield "## Growth with the number of workers"
        yield (
            f"A suite of {workers['runs']} equal runs of youbot, {workers['duration']:g} s each at "
            "1 kHz, the start of the processes included."
        )
        columns = zip(
            workers["workers"], workers["runs_per_minute"], workers["speed_up"], strict=True
        )
        yield table(
            ["workers", "runs a minute", "speed-up"],
            (
                [str(number), rounded_against(rate, False), rounded_against(speed_up, False)]
                for number, rate, speed_up in columns
            ),
        )


def _long_runs(runs: dict[str, Any]) -> str:
    return table(
        ["", *(f"{name}, {run['duration']:g} s" for name, run in runs.items())],
        [
            ["controller step, median (µs)", *(_up(r["median"], 1e6) for r in runs.values())],
            ["p99 (µs)", *(_up(r["p99"], 1e6) for r in runs.values())],
            ["longest (µs)", *(_up(r["max"], 1e6) for r in runs.values())],
            ["p99 over median", *(_up(r["p99_over_median"]) for r in runs.values())],
            [
                "the same within single seconds, median of them",
                *(_up(r["p99_over_median_by_second"]) for r in runs.values()),
            ],
            [
                "the same of bare Pinocchio calls that take as long",
                *(_up(r["machine_p99_over_median"]) for r in runs.values()),
            ],
            [
                "core taken away by the system (times)",
                *(f"{r['preemptions']}" for r in runs.values()),
            ],
            ["record (MB)", *(_up(r["record"], 1e-6) for r in runs.values())],
            ["peak beyond it (MB)", *(_up(r["beyond_record"], 1e-6) for r in runs.values())],
            [
                "kept beyond it when it is done (MB)",
                *(_up(r["kept_beyond_record"], 1e-6) for r in runs.values()),
            ],
            ["growth of the peak (B/tick)", *(_up(r["growth_per_tick"]) for r in runs.values())],
            [
                "growth of what is kept (B/tick)",
                *(_up(r["kept_growth_per_tick"]) for r in runs.values()),
            ],
            ["resolution of both (B/tick)", *(_up(r["resolution"]) for r in runs.values())],
        ],
    )


def _imports(imports: dict[str, Any]) -> str:
    return table(
        ["", "s"],
        [
            ["import pinocchio", _spread(imports["pinocchio"])],
            ["import mobman", _spread(imports["mobman"])],
            ["beyond pinocchio", _spread(imports["difference"])],
            ["import mobman and all that a closed loop needs", _spread(imports["mobman_used"])],
            ["beyond pinocchio", _spread(imports["difference_used"])],
        ],
    )


def table(head: list[str], rows: Iterable[list[str]], rule: str = "---:") -> str:
    """A Markdown table; what follows the first column to the right, or as the rule says."""
    lines = [head, ["---", *[rule] * (len(head) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cell(robot: dict[str, Any], kind: str, key: str, scale: float, up: bool = True) -> str:
    found = robot[kind].get(key)
    return "not measured" if found is None else _spread(found, scale, up)


def _spread(spread: dict[str, float], scale: float = 1.0, up: bool = True) -> str:
    median, low, high = (
        rounded_against(scale * spread[key], up) for key in ("median", "low", "high")
    )
    return f"{median} [{low}, {high}]"


def _up(value: float, scale: float = 1.0) -> str:
    return rounded_against(scale * value, True)
