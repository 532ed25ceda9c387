"""Draw the pictures of README and docs: from the results of the suite `paper`, and of robots and runs.

python docs/pictures.py results/paper docs/images --fair results/claims/fair

With ``--fair``, the leaderboards of the suite ``fair`` are drawn, too. With ``--quick``, runs are short,
of a small robot, and views small: to try it.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import mobman as mm
from mobman.benchmark.report.charts import leaderboard_figure, looks_for
from mobman.benchmark.report.data import read_results
from mobman.benchmark.report.standings import board_of
from mobman.benchmark.store import Store
from mobman.figures.charts import Curve, thin, time_chart
from mobman.figures.files import beside, drawn
from mobman.figures.looks import LAWS, looks_of
from mobman.files import write_all
from mobman.viewer.view import View, make_scene


def error_picture(store: Store, robot: str, scenarios: tuple[str, ...], path: Path) -> None:
    """|e^e| of the controllers in some scenarios, side by side."""
    charts = []
    for scenario in scenarios:
        curves = {}
        for run in store.runs:
            if (run.robot, run.scenario["name"]) == (robot, scenario) and run.label in LAWS:
                record = store.record(run)
                error = np.linalg.norm(record.task_error, axis=1)
                curves[run.label] = Curve(run.label, *thin(record.t, np.asarray(error)))
        chart = time_chart(
            list(curves.values()),
            looks_of({label: label for label in LAWS if label in curves}),
            title=f"Task error, {robot}, {scenario}",
            axis="|eᵉ|  (m)",
            duration=max(curve.t[-1] for curve in curves.values()),
            limits=(1e-12, 20.0),
            heading=f"{robot}, {scenario}",
        )
        charts.append(chart)
    write_all({path: drawn(beside(charts, across=True), "png")})


def leaderboard_picture(store: Store, path: Path) -> None:
    """The leaderboards of a suite's scenarios, side by side."""
    results = read_results(store)
    charts = []
    for scenario in dict.fromkeys(row["scenario"] for row in results.rows):
        rows = [row for row in results.rows if row["scenario"] == scenario]
        board = board_of(replace(results, rows=rows))
        chart = leaderboard_figure(board, looks_for(results)).charts[0]
        charts.append(chart | {"title": scenario})
    write_all({path: drawn(beside(charts, across=True), "png")})


def views(folder: Path, quick: bool = False) -> None:
    """Robots and runs as `mobman view` shows them; this needs the extras `view` and `film`."""
    size = (160, 90) if quick else (1280, 720)
    long, short = (0.1, 0.1) if quick else (12.0, 10.0)  # s
    tiago, husky = ("youbot", "youbot") if quick else ("tiago_no_hand", "husky_ur5")
    View(make_scene("youbot")).save(folder / "view-youbot.png", size=size)
    circle = mm.simulate(tiago, "tsm", "circle", duration=long)
    View(make_scene(circle)).save(folder / "view-tiago.png", size=size, time=9.0)
    composed = mm.simulate(husky, "tsm", "circle", duration=long)
    View(make_scene(composed)).save(folder / "view-husky.png", size=size, time=6.0)
    heavier = [
        mm.simulate("youbot", law, "paper", duration=short, scenario="heavier")
        for law in ("tsm", "pseudo-inverse")
    ]
    comparison = View(make_scene(heavier))
    comparison.save(folder / "view-comparison.png", size=size, time=8.6)


def main() -> None:
    """Draw everything."""
    parser = argparse.ArgumentParser(description="Draw the pictures of README and docs.")
    parser.add_argument("results", type=Path, help="folder of the suite's results")
    parser.add_argument("folder", type=Path, help="folder of the pictures")
    parser.add_argument("--fair", type=Path, help="folder of the results of the suite fair")
    parser.add_argument(
        "--quick", action="store_true", help="short runs of a small robot, small views"
    )
    options = parser.parse_args()
    try:
        store, folder = Store(options.results), options.folder
        error_picture(store, "youbot", ("nominal", "heavier"), folder / "paper-youbot.png")
        error_picture(store, "tiago_no_hand", ("nominal", "heavier"), folder / "paper-tiago.png")
        if options.fair is not None:
            leaderboard_picture(Store(options.fair), folder / "fair.png")
        views(folder, options.quick)
    except mm.MobmanError as error:
        sys.exit(f"pictures.py: {error}")


if __name__ == "__main__":
    main()
