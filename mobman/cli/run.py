"""``mobman run``: one closed loop; ``mobman rerun``: a run again from its record, and comparison."""

from __future__ import annotations

import json
import math
import os
import shlex
import threading
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mobman.cli.names import complete
from mobman.cli.output import (
    FILE,
    FORCE,
    PORT,
    check_new,
    console,
    echo,
    level,
    number,
    print_json,
    reports,
    table,
)
from mobman.cli.progress import progress_bar
from mobman.errors import FOREIGN_ERRORS, MobmanError, RecordError

if TYPE_CHECKING:
    from mobman.model.mobile_manipulator import MobileManipulator
    from mobman.simulation.record import Record
    from mobman.simulation.rerun import Own, Verification
    from mobman.viewer.view import LiveRun, View

_PATIENCE = 15.0  # s that a run waits for the browser
_TOLD = 5
_SUFFIXES = (".h5", ".hdf5")
_SUMMARY = ("tracking", "redundancy", "effort", "limits", "ground", "timing")
"""Sections of metrics in the lines that are printed of a run."""


def _values(
    context: click.Context, parameter: click.Parameter, texts: tuple[str, ...]
) -> dict[str, Any]:
    """NAME=VALUE texts as a dictionary; values are JSON, or else text."""
    values: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise click.BadParameter(f"{text!r} is not NAME=VALUE", param_hint=parameter.opts[0])
        if name in values:
            raise click.BadParameter(f"{name} is given twice", param_hint=parameter.opts[0])
        try:
            values[name] = json.loads(value)
        except json.JSONDecodeError:
            values[name] = value
    return values


def _speed(context: click.Context, parameter: click.Parameter, text: str | None) -> float | None:
    """Simulated seconds a second; inf for as fast as it goes."""
    if text is None:
        return None
    try:
        speed = math.inf if text == "max" else float(text)
    except ValueError:
        speed = math.nan
    if not speed > 0.0 or (math.isinf(speed) and text != "max"):
        raise click.BadParameter(
            f"{text!r} is neither a positive number nor max", param_hint=parameter.opts[0]
        )
    return speed


_PAIRS: dict[str, Any] = {"multiple": True, "metavar": "NAME=VALUE", "callback": _values}
_SHOWN: dict[str, Any] = {"show_default": True}


@click.command()
@click.argument("robot", **complete("robots"))
@click.option(
    "--controller",
    default="tsm",
    **_SHOWN,
    **complete("controllers"),
    help="Control law, or FILE.py:NAME of one.",
)
@click.option(
    "--task",
    default="circle",
    **_SHOWN,
    **complete("tasks"),
    help="Task of the tip, or FILE.py:NAME.",
)
@click.option(
    "--task-option", **_PAIRS, help="A parameter of the task, such as radius=0.3; repeatable."
)
@click.option("--duration", type=float, default=10.0, **_SHOWN, help="s.")
@click.option("--dt", type=float, default=1e-3, **_SHOWN, help="Sampling period, s.")
@click.option(
    "--scenario",
    default="nominal",
    **_SHOWN,
    **complete("scenarios"),
    help="Scenario, or its TOML file.",
)
@click.option(
    "--seed",
    type=click.IntRange(0, 2**63 - 1),
    default=0,
    **_SHOWN,
    help="Random seed of the scenario.",
)
@click.option(
    "--gain",
    **_PAIRS,
    help="A gain of the controller, such as a=0.2 or discretization=explicit; repeatable.",
)
@click.option(
    "--monitor",
    is_flag=True,
    help="Record what the theorems suppose and conclude of a sliding law, and tell what fails first.",
)
@click.option("-o", "--output", type=FILE, help="HDF5 file for the record (.h5).")
@FORCE
@click.option("--all", "everything", is_flag=True, help="Print every metric, with its meaning.")
@reports
@click.option(
    "--live", is_flag=True, help="Show it in the browser while it runs, and then until Ctrl-C."
)
@click.option(
    "--live-speed",
    metavar="X|max",
    callback=_speed,
    help="Simulated seconds a second, or as fast as it goes; means --live.  [default: 1]",
)
@click.option("--no-browser", is_flag=True, help="With --live: print the address, open no browser.")
@click.option("--port", type=PORT, help="With --live: port to serve on.")
def run(
    robot: str,
    controller: str,
    task: str,
    task_option: dict[str, Any],
    duration: float,
    dt: float,
    scenario: str,
    seed: int,
    gain: dict[str, Any],
    monitor: bool,
    output: Path | None,
    force: bool,
    everything: bool,
    as_json: bool,
    live: bool,
    live_speed: float | None,
    no_browser: bool,
    port: int | None,
) -> None:
    """Simulate ROBOT (a name or a TOML file) under a controller and print what came of it.

    Exit status 1 if the run diverged or met a singularity; its record is written all the same.
    """
    from mobman.controllers.protocol import controllers, make_controller
    from mobman.model.build import load_robot
    from mobman.simulation.scenario import load_scenario
    from mobman.simulation.simulate import seconds, simulate
    from mobman.tasks.task import check_parameters, make_task, tasks

    if output is not None:
        check_new(output, suffixes=_SUFFIXES, force=force)
        _check_writable(output)
    for name, known, option in (
        (controller, controllers, "--controller"),
        (task, tasks, "--task"),
    ):
        if ".py:" in name:
            known.register(name, _code(name, option))
    model = load_robot(robot)
    law = make_controller(controller, **gain)
    options = check_parameters(task, task_option)
    aim = make_task(task, model, **options)
    resolved = load_scenario(scenario)
    settings: dict[str, Any] = {"duration": duration, "dt": dt, "scenario": resolved, "seed": seed}
    with ExitStack() as closing:
        watched: LiveRun | None = None
        if live or live_speed is not None:
            from mobman.viewer.view import LiveRun, View

            watched = LiveRun(
                model,
                task,
                task_options=options,
                duration=seconds("duration", duration),
                speed={None: 1.0, math.inf: None}.get(live_speed, live_speed),
                controller=controller,
                scenario=resolved.name,
                seed=seed,
            )
            shown = View(watched.scene, port=port, frames=watched.frames)
            _open(watched, closing.enter_context(shown), no_browser)
            settings |= {"observe": watched.observe, "observe_every": watched.every}
        title = f"{model.name} · {task} · {resolved.name} · {controller}"
        with progress_bar(title) as progress:
            record = simulate(model, law, aim, progress=progress, monitor=monitor, **settings)
        saved = None if output is None else record.save(output)
        tell(record, model, saved, as_json=as_json, everything=everything)
        if watched is not None:
            # the page gets the whole run and stays until Ctrl-C: the way to end it, not a failure
            try:
                watched.finish(record)
                threading.Event().wait()
            except KeyboardInterrupt:
                echo(err=True)
    if not _went_well(record):
        raise click.exceptions.Exit(1)


def _check_writable(path: Path) -> None:
    """Refuse what cannot be written before the simulation, not after it."""
    folder = next((parent for parent in path.absolute().parents if parent.exists()), None)
    if folder is None or not folder.is_dir() or not os.access(folder, os.W_OK):
        raise RecordError(f"cannot write the record {path}: {folder} is no folder to write in")


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


def tell(
    record: Record,
    robot: MobileManipulator,
    path: Path | None,
    *,
    as_json: bool = False,
    everything: bool = False,
) -> None:
    """Print a run: a line a section of metrics, or every metric, and where it broke limits; or all that
    is known of it as JSON."""
    from mobman.simulation.limits import limit_remarks, unlimited_motors
    from mobman.simulation.metrics import list_metrics
    from mobman.simulation.monitors import first_failure

    if as_json:
        keys = ("status", "message", "metrics", "settings", "spec", "versions")
        content = {key: getattr(record, key) for key in keys}
        print_json({**content, "file": None if path is None else str(path)})
        return
    out = console()
    shown = record.settings if level() > 0 else ("a", "A")
    bounds = {key: record.settings[key] for key in shown if key in record.settings}
    in_force = ", ".join(
        f"{key} = {value:.4g}" if isinstance(value, float) else f"{key} = {value}"
        for key, value in bounds.items()
    )
    name = f"{record.robot} · {record.task} · {record.scenario} · {record.controller}"
    rest = f" {record.status}"
    out.print(out.render_str(name, style="bold"), rest + (f"  ({in_force})" if in_force else ""))
    known = [metric for metric in list_metrics() if metric.name in record.metrics]
    if everything or level() > 0:
        listing = table("metric", "value", "unit", "what it is", right={"value"})
        for metric in known:
            value = number(record.metrics[metric.name], metric.unit)
            listing.add_row(metric.name, value, metric.unit, metric.description)
    else:
        listing = table()
        for section in _SUMMARY:
            parts = [
                f"{metric.short}: {_with_unit(record.metrics[metric.name], metric.unit)}"
                for metric in known
                if metric.section == section and metric.short
            ]
            if parts:
                listing.add_row(f"  {section}", "; ".join(parts))
    out.print(listing)
    if record.spec.get("monitor"):
        out.print(f"theorems: {first_failure(record.t, record.signals)}", soft_wrap=True)
    if free := unlimited_motors(record):
        out.print(f"no torque limit is known of {', '.join(free)}", soft_wrap=True)
    for remark in limit_remarks(record, robot):
        out.print(f"beyond its limits: {remark}", soft_wrap=True)
    if record.ok and record.metrics["success"] == 0.0:
        errors = f"|e^e| is {number(record.metrics['task_error_final'])} m"
        angle = record.metrics.get("orientation_error_final", math.nan)
        if not math.isnan(angle):
            errors += f" and the orientation is {number(angle)} rad off"
        out.print(f"no success: it went to its end, but {errors} there", soft_wrap=True)
        cut = record.metrics.get("saturation_share", 0.0)
        if cut > 0.0 and record.settings.get("saturation") == "none":
            out.print(
                f"torques were cut in {100 * cut:.0f} % of the ticks, which {record.controller} does "
                "not know of: --gain saturation=hedge",
                soft_wrap=True,
            )
    if path is not None:
        out.print(f"record: {path}", soft_wrap=True)
        out.print(f"next: mobman view {shlex.quote(str(path))}", soft_wrap=True)


def _with_unit(value: float, unit: str) -> str:
    text = number(value, unit)
    return f"{text} {unit}" if math.isfinite(value) and unit != "1" else text


def _went_well(record: Record) -> bool:
    if not record.ok:
        echo(f"mobman: the run ended as {record.status} {record.message}", err=True)
    return record.ok


# rerun -------------------------------------------------------------------------------------------------


@click.command()
@click.argument(
    "files", nargs=-1, required=True, metavar="FILE...", type=click.Path(path_type=Path)
)
@click.option(
    "--verify",
    "verifies",
    is_flag=True,
    help="Compare with what is in the file: bit for bit, or within a tolerance on another processor "
    "or with other versions.",
)
@click.option(
    "--tolerance",
    type=float,
    metavar="X",
    help="With --verify: largest difference, over the larger of 1 and the largest value, 100 times as "
    "much in torques and signals; 0 for bit for bit.  [default: 0, or 1e-4 on another processor or with "
    "other versions]",
)
@click.option(
    "-o", "--output", type=FILE, help="HDF5 file for the new record (.h5), at every tick."
)
@FORCE
@click.option(
    "--robot",
    metavar="FILE",
    help="Robot (a TOML file or a name) to use instead of the record's, for a platform that is Python "
    "code.",
)
@click.option(
    "--controller",
    metavar="FILE.py:NAME",
    help="Python code of a law that is not registered: called without arguments, gives the controller.",
)
@click.option(
    "--task",
    metavar="FILE.py:NAME",
    help="Python code of a task that is not registered: called with the robot and q0, gives the task.",
)
@reports
def rerun(
    files: tuple[Path, ...],
    verifies: bool,
    tolerance: float | None,
    output: Path | None,
    force: bool,
    robot: str | None,
    controller: str | None,
    task: str | None,
    as_json: bool,
) -> None:
    """Repeat the run of each record FILE from the file alone.

    No code is taken from the file. What is Python code, and not registered, is named by --robot,
    --controller and --task.

    Exit status 1 if a run cannot be repeated, if it diverged or met a singularity, or, with --verify, if
    the repetition differs from the file.
    """
    from mobman.simulation.parts import robot_of
    from mobman.simulation.rerun import repeat, verify

    if output is not None and len(files) > 1:
        raise click.UsageError(f"-o is for one record; {len(files)} files are given")
    if tolerance is not None and not verifies:
        raise click.UsageError("--tolerance goes with --verify")
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance >= 0.0):
        raise click.BadParameter(f"{tolerance} is not a number from 0 on", param_hint="--tolerance")
    if output is not None:
        check_new(output, suffixes=_SUFFIXES, force=force)
    own, told, failed = _own(robot, controller, task), [], False
    for file in files:
        try:
            with progress_bar(str(file)) as progress:
                if verifies:
                    found = verify(file, tolerance=tolerance, own=own, progress=progress)
                record = found.record if verifies else repeat(file, own=own, progress=progress)
            saved = None if output is None else record.save(output)
            if not verifies:
                robot_run = own.robot or robot_of(record.spec["robot"], record.urdf)
                tell(record, robot_run, saved, as_json=as_json)
                failed |= not _went_well(record)
                continue
            failed |= not found.equal
            if as_json:
                told.append(_as_json(file, found, saved))
            else:
                _print(file, found, saved)
        except MobmanError as error:
            if len(files) == 1:
                raise
            echo(f"mobman: {' '.join(str(error).split())}", err=True)
            failed = True
    if verifies and as_json:
        print_json(told)
    if failed:
        raise click.exceptions.Exit(1)


def _own(robot: str | None, controller: str | None, task: str | None) -> Own:
    """Parts that the user names instead of the record's."""
    from mobman.model.build import load_robot
    from mobman.simulation.rerun import Own

    law = None if controller is None else _code(controller, "--controller")
    if law is not None:
        try:
            law = law()
        except FOREIGN_ERRORS as error:
            raise click.BadParameter(
                f"calling {controller} failed: {error!r}", param_hint="--controller"
            ) from error
    return Own(
        robot=None if robot is None else load_robot(robot),
        controller=law,
        make_task=None if task is None else _code(task, "--task"),
    )


def _code(name: str, option: str) -> Any:
    from mobman.model.platforms.custom import load_code

    if ":" not in name:
        raise click.BadParameter(f"{name!r} is not FILE.py:NAME", param_hint=option)
    return load_code(name, Path.cwd(), f"{option} {name}")


def _print(file: Path, found: Verification, saved: Path | None) -> None:
    metrics = sum(item.name.startswith("metrics/") for item in found.compared)
    what = f"{len(found.compared)} compared, {metrics} of them metrics"
    how = "bit for bit" if found.tolerance == 0.0 else f"with a tolerance of {found.tolerance:g}"
    verdict = f"differs in {len(found.differences)} ({what}, {how})"
    if found.equal:
        verdict = f"equal within a tolerance of {found.tolerance:g} ({what})"
    if found.identical:
        verdict = f"identical, bit for bit ({what})"
    echo(f"{file}: {verdict}")
    changed = {**found.machine, **found.versions}
    for name, (was, now) in changed.items():
        echo(f"  other {name}: {was or 'unknown'} then, {now or 'unknown'} now")
    if changed and found.tolerance > 0.0:
        echo("  these round in other ways, so the comparison is within a tolerance")
    if found.note:
        echo(f"  {found.note}")
    for item in found.differences[:_TOLD]:
        by = "" if math.isnan(item.difference) else f" by {item.difference:.3g}"
        echo(f"  {item.name} differs{by}: {item.where}")
    if len(found.differences) > _TOLD:
        echo(f"  and {len(found.differences) - _TOLD} more (see --json)")
    if saved is not None:
        echo(f"record: {saved}")


def _as_json(file: Path, found: Verification, saved: Path | None) -> dict[str, Any]:
    return {
        "file": str(file),
        "equal": found.equal,
        "identical": found.identical,
        "tolerance": found.tolerance,
        "machine": {name: {"then": w, "now": n} for name, (w, n) in found.machine.items()},
        "versions": {name: {"then": w, "now": n} for name, (w, n) in found.versions.items()},
        "note": found.note,
        "compared": [asdict(item) for item in found.compared],
        "record": None if saved is None else str(saved),
    }
