"""``mobman run``: one closed loop."""

from __future__ import annotations

import json
import math
import os
import threading
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.table import Table

from mobman.cli.output import console, echo, number, print_json, progress_bar
from mobman.errors import RecordError

if TYPE_CHECKING:
    from mobman.simulation.record import Record
    from mobman.viewer.live import LiveRun
    from mobman.viewer.view import View

_PATIENCE = 15.0
"""How long a run waits for the browser (s)."""


@click.command()
@click.argument("robot")
@click.option("--controller", default="tsm", show_default=True, help="Control law.")
@click.option("--task", default="circle", show_default=True, help="Task of the tip.")
@click.option(
    "--task-option",
    "task_options",
    multiple=True,
    metavar="NAME=VALUE",
    help="A parameter of the task, such as radius=0.3; repeatable.",
)
@click.option("--duration", type=float, default=10.0, show_default=True, help="s.")
@click.option("--dt", type=float, default=1e-3, show_default=True, help="Sampling period, s.")
@click.option(
    "--scenario", default="nominal", show_default=True, help="Scenario, or its TOML file."
)
@click.option(
    "--seed",
    type=click.IntRange(0, 2**63 - 1),
    default=0,
    show_default=True,
    help="Of the scenario's randomness.",
)
@click.option(
    "--gain",
    "gains",
    multiple=True,
    metavar="NAME=VALUE",
    help="A gain of the controller, such as a=0.2 or discretization=explicit; repeatable.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    help="HDF5 file for the record.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option(
    "--live", is_flag=True, help="Show it in the browser while it runs, and then until Ctrl-C."
)
@click.option(
    "--live-speed",
    metavar="X|max",
    help="Simulated seconds a second, or as fast as it goes; means --live.  [default: 1]",
)
@click.option("--no-browser", is_flag=True, help="With --live: print the address, open no browser.")
@click.option("--port", type=click.IntRange(0, 65535), help="With --live: port to serve on.")
def run(
    robot: str,
    controller: str,
    task: str,
    task_options: tuple[str, ...],
    duration: float,
    dt: float,
    scenario: str,
    seed: int,
    gains: tuple[str, ...],
    output: Path | None,
    as_json: bool,
    live: bool,
    live_speed: str | None,
    no_browser: bool,
    port: int | None,
) -> None:
    """Simulate ROBOT (a name or a TOML file) under a controller and print its metrics.

    Exit status 1 if the run diverged or met a singularity; its record is written all the same.
    """
    from mobman.controllers.protocol import make_controller
    from mobman.model.build import load_robot
    from mobman.simulation.scenario import load_scenario
    from mobman.simulation.simulate import simulate
    from mobman.tasks.task import check_parameters, make_task

    speed = _speed(live_speed)
    live = live or live_speed is not None
    model = load_robot(robot)
    law = make_controller(controller, **_values(gains, "--gain"))
    options = check_parameters(task, _values(task_options, "--task-option"))
    aim = make_task(task, model, **options)
    resolved = load_scenario(scenario)
    if output is not None:
        _check_writable(output)
    with ExitStack() as closing:
        watched: LiveRun | None = None
        looking: dict[str, Any] = {}
        if live:
            from mobman.simulation.simulate import seconds
            from mobman.viewer.live import LiveRun
            from mobman.viewer.view import View

            watched = LiveRun(
                model,
                task,
                task_options=options,
                duration=seconds("duration", duration),
                speed=speed,
                controller=controller,
                scenario=resolved.name,
                seed=seed,
            )
            shown = View(watched.scene, port=port, frames=watched.frames)
            _open(watched, closing.enter_context(shown), no_browser)
            looking = {"observe": watched.observe, "observe_every": watched.every}
        title = f"{model.name} · {task} · {resolved.name} · {controller}"
        with progress_bar(title) as progress:
            record = simulate(
                model,
                law,
                aim,
                duration=duration,
                dt=dt,
                scenario=resolved,
                seed=seed,
                progress=progress,
                **looking,
            )
        path = None if output is None else record.save(output)
        tell(record, path, as_json=as_json)
        if watched is not None:
            _stay(watched, record)
    if not record.ok:
        echo(f"mobman: the run ended as {record.status} {record.message}", err=True)
        raise click.exceptions.Exit(1)


def _open(watched: LiveRun, shown: View, no_browser: bool) -> None:
    """Show the page, and let it come up before the run begins."""
    # not with what is printed of the run, which may be JSON
    echo(f"live: {shown.url}  (Ctrl-C ends it)", err=True)
    if no_browser:
        return
    if not shown.open():
        echo("mobman: no browser could be opened; open the address in one", err=True)
    elif not watched.wait_for_page(_PATIENCE):
        echo("mobman: the page is not open yet; the run begins without it", err=True)


def _stay(watched: LiveRun, record: Record) -> None:
    """Give the page the whole run, and keep it until Ctrl-C: the way to end it, not a failure."""
    try:
        watched.finish(record)
        threading.Event().wait()
    except KeyboardInterrupt:
        echo(err=True)


def tell(record: Record, path: Path | None, *, as_json: bool) -> None:
    """Print a run: its metrics as a table, or all that is known of it as JSON."""
    if not as_json:
        _print(record, path)
        return
    print_json(
        {
            "status": record.status,
            "message": record.message,
            "metrics": record.metrics,
            "settings": record.settings,
            "spec": record.spec,
            "versions": record.versions,
            "file": None if path is None else str(path),
        }
    )


def _print(record: Any, path: Path | None) -> None:
    from mobman.simulation.metrics import list_metrics

    out = console()
    bounds = {key: record.settings[key] for key in ("a", "A") if key in record.settings}
    in_force = ", ".join(f"{key} = {value:.4g}" for key, value in bounds.items())
    name = f"{record.robot} · {record.task} · {record.scenario} · {record.controller}"
    rest = f" {record.status}" + (f"  (in force: {in_force})" if in_force else "")
    out.print(out.render_str(name, style="bold"), rest)
    table = Table(box=None, pad_edge=False)
    table.add_column("metric")
    table.add_column("value", justify="right")
    table.add_column("unit")
    table.add_column("what it is")
    for metric in list_metrics():
        if metric.name in record.metrics:
            value = number(record.metrics[metric.name], metric.unit)
            table.add_row(metric.name, value, metric.unit, metric.description)
    out.print(table)
    if path is not None:
        out.print(f"record: {path}", soft_wrap=True)


def _values(texts: tuple[str, ...], option: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for text in texts:
        name, value = _value(text, option)
        if name in values:
            raise click.BadParameter(f"{name} is given twice", param_hint=option)
        values[name] = value
    return values


def _check_writable(path: Path) -> None:
    """Before the simulation, not after it."""
    folder = next((parent for parent in path.absolute().parents if parent.exists()), None)
    if folder is None or not folder.is_dir() or not os.access(folder, os.W_OK):
        raise RecordError(f"cannot write the record {path}: {folder} is no folder to write in")


def _speed(text: str | None) -> float | None:
    """Simulated seconds a second; None for as fast as it goes."""
    if text == "max":
        return None
    try:
        speed = 1.0 if text is None else float(text)
    except ValueError:
        speed = math.nan
    if not (math.isfinite(speed) and speed > 0.0):
        raise click.BadParameter(
            f"{text!r} is neither a positive number nor max", param_hint="--live-speed"
        )
    return speed


def _value(text: str, option: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise click.BadParameter(f"{text!r} is not NAME=VALUE", param_hint=option)
    try:
        return name, json.loads(value)
    except json.JSONDecodeError:
        return name, value
