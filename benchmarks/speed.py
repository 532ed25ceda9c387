"""How fast mobman is, measured: ``python benchmarks/speed.py`` from the repository's root.

Writes ``speed.json`` (all numbers), ``speed.md`` (tables, and which targets are met) and
``speed.svg`` to the output folder, and compares the ratios with ``benchmarks/speed_baseline.json``.
Exit status 0: no ratio is worse than the baseline allows; 1: one is; 2: invalid usage. ``--quick``
makes every measurement once, on runs so short that what is measured is mostly their start: it
shows that all of them work, its numbers say nothing, and it compares nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

ROBOTS = ("youbot", "tiago_no_hand", "tiago_dual")
LONG_RUNS = ("youbot", "tiago_no_hand")
"""Robots, of those measured, that are run for a minute."""
BASELINE = Path(__file__).parent / "speed_baseline.json"
DOCS = Path(__file__).parents[1] / "docs"

_THREADS = ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM", "NUMEXPR")


def main(arguments: list[str] | None = None) -> int:
    """Measure, write, compare; the exit status."""
    options = _options(arguments)
    # before numpy is loaded, hence also before anything that loads it
    os.environ.update({f"{library}_NUM_THREADS": "1" for library in _THREADS})
    from measure.baseline import as_table, compare, read_baseline, write_baseline
    from measure.page import numbers_into, page
    from measure.plot import draw

    from mobman.errors import MobmanError

    try:
        result = measure(options)
    except MobmanError as error:
        print(f"speed.py: {error}", file=sys.stderr)
        return 2
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "speed.json").write_text(json.dumps(result, indent=1) + "\n")
    (options.output / "speed.md").write_text(page(result), encoding="utf-8")
    draw(result, options.output / "speed.svg")
    print(f"wrote {options.output / 'speed.md'}, speed.json, speed.svg")
    if options.update_baseline:
        write_baseline(BASELINE, result)
        # the committed ratios and the numbers in the docs are of one measurement
        draw(result, DOCS / "images" / "speed.svg")
        document = DOCS / "speed.md"
        text = document.read_text(encoding="utf-8")
        written = numbers_into(text, result, "images/speed.svg")
        document.write_text(written, encoding="utf-8")
        print(f"wrote {BASELINE} and {document}")
        return 0
    if options.quick:
        print("numbers of --quick say nothing: its runs are too short, and nothing was compared")
        return 0
    baseline = read_baseline(BASELINE)
    if baseline is None:
        print(f"no {BASELINE.name} to compare with; --update-baseline makes one")
        return 0
    comparisons = compare(result, baseline)
    print(as_table(comparisons))
    return int(any(one.failed for one in comparisons))


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """All numbers, as ``speed.json`` holds them."""
    from measure.cases import case_of
    from measure.closed_loop import measure_robot, real_time
    from measure.growth import with_joints, with_period, with_workers
    from measure.imports import import_times
    from measure.long_run import long_runs
    from measure.machine import processor, versions

    import mobman as mm

    quick = options.quick
    robots = {name: mm.load_robot(name) for name in options.robots}
    rounds, batch = (1, 0.01) if quick else (15, 0.1)
    result: dict[str, Any] = {
        "command": " ".join(["python benchmarks/speed.py", *options.arguments]),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": processor(),
        "versions": versions(),
        "quick": quick,
        "rounds": rounds,
        "robots": {},
        "growth": {},
        "long_runs": {},
    }
    _say("imports")
    result["imports"] = import_times(1 if quick else 7)
    for name, robot in robots.items():
        _say(f"{name}: a tick and what it is compared with")
        result["robots"][name] = measure_robot(robot, rounds, batch, ticks=100 if quick else 2000)
        for key, note in result["robots"][name]["notes"].items():
            _say(f"{name}: {key}: {note}")
    _say("growth with the arm")
    result["growth"]["joints"] = with_joints(rounds, 0.5 * batch)
    _say("growth with the sampling period")
    result["growth"]["dt"] = with_period(1 if quick else 7, 0.1 if quick else 1.0)
    _say("growth with the number of workers")
    result["growth"]["workers"] = with_workers(
        2 if quick else 12, 0.1 if quick else 2.0, most=1 if quick else None
    )
    _say("real time")
    result["real_time"] = real_time(
        mm.load_robot("youbot"), 1 if quick else 3, 1.0 if quick else 10.0
    )
    for name in LONG_RUNS:
        if name in robots:
            _say(f"{name}: a long run")
            case = case_of(robots[name])
            task = str(getattr(case.task, "name", ""))
            result["long_runs"][name] = long_runs(name, case.gains, task, 0.05 if quick else 1.0)
    return result


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Measure how fast mobman is.")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("results/speed"), help="folder for the results"
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="every measurement once, on short runs: some ten seconds a robot",
    )
    parser.add_argument(
        "--update-baseline", action="store_true", help=f"keep the ratios in {BASELINE.name}"
    )
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), metavar="NAME")
    options = parser.parse_args(arguments)
    if options.quick and options.update_baseline:
        parser.error("--update-baseline keeps a full measurement; leave out --quick")
    options.arguments = sys.argv[1:] if arguments is None else arguments
    return options


def _say(what: str) -> None:
    print(what, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
