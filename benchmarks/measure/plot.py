"""The measurement as a picture, ``speed.svg``: bars for each robot, and growth with the arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

_BARS = {
    "bare_tick": ("(a) bare Pinocchio", "#9aa0a6"),
    "step": ("(b) our step", "#f2a65a"),
    "tick": ("(c) our tick", "#d1495b"),
    "pink_solve": ("(d) Pink solve_ik", "#66a182"),
    "mujoco_step": ("(e) MuJoCo step", "#2e4057"),
    "plain_tick": ("(f) plain loop", "#7a5195"),
}


def draw(result: dict[str, Any], path: Path) -> None:
    """Write the picture."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    with mpl.rc_context({"svg.hashsalt": "speed", "svg.fonttype": "none", "font.size": 9}):
        figure, (bars, growth) = plt.subplots(1, 2, figsize=(10.5, 4.6), layout="constrained")
        _bars(bars, result.get("robots", {}))
        _growth(growth, result.get("growth", {}).get("joints"))
        figure.savefig(path, metadata={"Date": None})
        plt.close(figure)


def _bars(axes: Any, robots: dict[str, Any]) -> None:
    width = 0.8 / len(_BARS)
    for i, (key, (label, colour)) in enumerate(_BARS.items()):
        found = [robot["seconds"].get(key) for robot in robots.values()]
        places = [n + (i - (len(_BARS) - 1) / 2) * width for n, one in enumerate(found) if one]
        medians = np.array([1e6 * one["median"] for one in found if one])
        low = np.array([1e6 * one["low"] for one in found if one])
        high = np.array([1e6 * one["high"] for one in found if one])
        axes.bar(
            places,
            medians,
            width,
            label=label,
            color=colour,
            yerr=[medians - low, high - medians],
            error_kw={"linewidth": 0.8},
        )
    axes.set_yscale("log")
    axes.set_ylabel("time (µs)")
    axes.set_xticks(range(len(robots)), [f"{name}\nr = {r['nz']}" for name, r in robots.items()])
    axes.set_title("a tick, medians and quartiles")
    axes.legend(fontsize=8, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.13), frameon=False)
    axes.grid(axis="y", alpha=0.3)
    axes.set_axisbelow(True)


def _growth(axes: Any, joints: dict[str, Any] | None) -> None:
    axes.set_title("a controller step on chains of 3 to 40 joints")
    if joints is None:
        axes.text(0.5, 0.5, "not measured", ha="center", transform=axes.transAxes)
        return
    r = np.array(joints["nz"], dtype=float)
    labels = {"step": "controller step", "bare_controller": "bare Pinocchio", "own": "own work"}
    for (kind, label), colour in zip(
        labels.items(), ("#f2a65a", "#9aa0a6", "#d1495b"), strict=True
    ):
        median, low, high = (
            1e6 * np.array([one[key] for one in joints[kind]]) for key in ("median", "low", "high")
        )
        axes.plot(r, median, "o-", markersize=3, color=colour, label=label)
        axes.fill_between(r, low, high, color=colour, alpha=0.25, linewidth=0)
    last = 1e6 * joints["own"][-1]["median"]
    axes.plot(r, last * (r / r[-1]) ** 3, ":", color="black", linewidth=0.8, label="r³")
    axes.set_xscale("log")
    axes.set_yscale("log")
    lowest = min(one["median"] for kind in labels for one in joints[kind] if one["median"] > 0.0)
    axes.set_ylim(bottom=1e6 * lowest / 2)
    axes.set_xticks(joints["nz"], [str(n) for n in joints["nz"]])
    axes.minorticks_off()
    axes.set_xlabel("r = length of z")
    axes.set_ylabel("time (µs)")
    axes.legend(fontsize=7)
    axes.grid(alpha=0.3)
