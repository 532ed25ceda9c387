"""Draw the pictures of README and docs: from the results of the suite `paper`, and of robots and runs.

python docs/pictures.py results/paper docs/images

With ``--quick``, runs are short, of a small robot, and views small: to try it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mobman as mm
from mobman.benchmark.store import Store
from mobman.viewer.view import View, make_scene

LABELS = {
    "tsm": "#0072B2",
    "tsm-simplified": "#56B4E9",
    "tsm-inverse-actuation": "#009E73",
    "pseudo-inverse": "#D55E00",
    "damped-least-squares": "#E69F00",
    "extended-jacobian": "#CC79A7",
}


def error_picture(store: Store, robot: str, scenarios: tuple[str, ...], path: Path) -> None:
    """|e^e| of the controllers in some scenarios, side by side."""
    figure = Figure(figsize=(9.6, 3.6), dpi=160, layout="constrained")
    axes = figure.subplots(1, len(scenarios), sharey=True)
    for axis, scenario in zip(np.atleast_1d(axes), scenarios, strict=True):
        for run in store.runs:
            if (run.robot, run.scenario["name"]) == (robot, scenario) and run.label in LABELS:
                record = store.record(run)
                error = np.linalg.norm(record.task_error, axis=1)
                dashed = run.label == "tsm-inverse-actuation"  # it lies on tsm inside the unit ball
                axis.semilogy(
                    record.t,
                    np.maximum(error, 1e-12),
                    color=LABELS[run.label],
                    linestyle=(0, (5, 5)) if dashed else "-",
                    linewidth=1.5,
                    label=run.label,
                )
        axis.set_title(f"{robot}, {scenario}", fontsize=10)
        axis.set_xlabel("t (s)")
        axis.grid(alpha=0.25)
        axis.set_ylim(1e-12, 20.0)
        axis.margins(x=0.0)
        axis.spines[["top", "right"]].set_visible(False)
    np.atleast_1d(axes)[0].set_ylabel("|e$^e$| (m)")
    handles, labels = np.atleast_1d(axes)[0].get_legend_handles_labels()
    order = [labels.index(label) for label in LABELS if label in labels]
    figure.legend(
        [handles[i] for i in order],
        [labels[i] for i in order],
        loc="outside right center",
        frameon=False,
        fontsize=9,
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


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
    parser.add_argument(
        "--quick", action="store_true", help="short runs of a small robot, small views"
    )
    options = parser.parse_args()
    try:
        store, folder = Store(options.results), options.folder
        error_picture(store, "youbot", ("nominal", "heavier"), folder / "paper-youbot.png")
        error_picture(store, "tiago_no_hand", ("nominal", "heavier"), folder / "paper-tiago.png")
        views(folder, options.quick)
    except mm.MobmanError as error:
        sys.exit(f"pictures.py: {error}")


if __name__ == "__main__":
    main()
