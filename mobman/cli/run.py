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

from click import BadParameter, Context, IntRange, Parameter, UsageError, argument, command, option
from click.exceptions import Exit

from mobman.cli.options import FILE, FORCE, PATH, PORT, check_new, complete, level, reports
from mobman.cli.output import console, echo, in_lines, note, number, progress_bar, report, table
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


def _values(context: Context, parameter: Parameter, texts: tuple[str, ...]) -> dict[str, Any]:
    """NAME=VALUE texts as a dictionary; values are JSON, or else text."""
    values: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise BadParameter(f"{text!r} is not NAME=VALUE", param_hint=parameter.opts[0])
        if name in values:
            raise BadParameter(f"{name} is given twice", param_hint=parameter.opts[0])
        try:
            values[name] = json.loads(value)
        except (ValueError, RecursionError):
            values[name] = value
    return values


def _speed(text: str) -> float:
    """Simulated seconds a second; inf for as fast as it goes."""
    try:
        speed = math.inf if text == "max" else float(text)
    except ValueError:
        speed = math.nan
    if not speed > 0.0 or (math.isinf(speed) and text != "max"):
        raise BadParameter(f"{text!r} is neither a positive number nor max")
    return speed


_PAIRS: dict[str, Any] = {"multiple": True, "metavar": "NAME=VALUE", "callback": _values}
_GAIN = "A gain of the controller, such as a=0.2 or discretization=explicit; repeatable."
_MONITOR = (
    "Record what the theorems suppose and conclude of a sliding law, and tell what fails first."
)
_LIVE = "Show it in the browser while it runs, and then until Ctrl-C."
_LIVE_SPEED = "Simulated seconds a second, or as fast as it goes; means --live.  [default: 1]"
_LAWS, _TASKS = complete("controllers"), complete("tasks")


@command()
@argument("robot", **complete("robots"))
@option("--controller", default="tsm", **_LAWS, help="Control law, or FILE.py:NAME of one.")
@option("--task", default="circle", **_TASKS, help="Task of the tip, or FILE.py:NAME.")
@option("--task-option", **_PAIRS, help="A parameter of the task, such as radius=0.3; repeatable.")
@option("--duration", type=float, default=10.0, help="s.")
@option("--dt", type=float, default=1e-3, help="Sampling period, s.")
@option(
    "--scenario", default="nominal", **complete("scenarios"), help="Scenario, or its TOML file."
)
@option("--seed", type=IntRange(0, 2**63 - 1), default=0, help="Random seed of the scenario.")
@option("--gain", **_PAIRS, help=_GAIN)
@option("--monitor", is_flag=True, help=_MONITOR)
@option("-o", "--output", type=FILE, help="HDF5 file for the record (.h5).")
@FORCE
@option("--all", "everything", is_flag=True, help="Print every metric, with its meaning.")
@reports
@option("--live", is_flag=True, help=_LIVE)
@option("--live-speed", metavar="X|max", type=_speed, help=_LIVE_SPEED)
@option("--no-browser", is_flag=True, help="With --live: print the address, open no browser.")
@option("--port", type=PORT, help="With --live: port to serve on.")
def run(robot: str, controller: str, task: str, output: Path | None, **given: Any) -> None:
    """Simulate ROBOT (a name, a TOML file or a URDF) under a controller and print what came of it.

    Exit status 1 if the run diverged or met a singularity; its record is written all the same.
    """
    from mobman.controllers.protocol import controllers, make_controller
    from mobman.model.build import load_robot
    from mobman.simulation.scenario import load_scenario
    from mobman.simulation.simulate import seconds, simulate
    from mobman.tasks.task import check_parameters, make_task, tasks

    check_new(output, suffixes=_SUFFIXES, force=given["force"])
    if output is not None:
        _check_writable(output)
    if ".py:" in controller:
        controllers.register(controller, _code(controller, "--controller"))
    if ".py:" in task:
        tasks.register(task, _code(task, "--task"))
    model = load_robot(robot)
    law = make_controller(controller, **given["gain"])
    options = check_parameters(task, given["task_option"])
    aim = make_task(task, model, **options)
    scenario, speed = load_scenario(given["scenario"]), given["live_speed"]
    settings = {key: given[key] for key in ("duration", "dt", "seed", "monitor")}
    with ExitStack() as closing:
        watched: LiveRun | None = None
        if given["live"] or speed is not None:
            from mobman.viewer.view import LiveRun, View

            about = {"controller": controller, "scenario": scenario.name, "seed": given["seed"]}
            about["duration"] = seconds("duration", given["duration"])
            about["speed"] = {None: 1.0, math.inf: None}.get(speed, speed)
            watched = LiveRun(model, task, options, **about)
            shown = View(watched.scene, port=given["port"], frames=watched.frames)
            _open(watched, closing.enter_context(shown), given["no_browser"])
            settings |= {"observe": watched.observe, "observe_every": watched.every}
        title = f"{model.name} · {task} · {scenario.name} · {controller}"
        with progress_bar(title) as progress:
            record = simulate(model, law, aim, scenario=scenario, progress=progress, **settings)
        if given["task_option"]:
            record.spec["task_given"] = given["task_option"]
        saved = None if output is None else record.save(output)
        tell(record, model, saved, everything=given["everything"])
        if watched is not None:
            # the page gets the whole run and stays until Ctrl-C: the way to end it, not a failure
            try:
                watched.finish(record)
                threading.Event().wait()
            except KeyboardInterrupt:
                echo(err=True)
    if not _went_well(record):
        raise Exit(1)


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
        note("no browser could be opened; open the address in one")
    elif not watched.wait_for_page(_PATIENCE):
        note("the page is not open yet; the run begins without it")


def tell(
    record: Record,
    robot: MobileManipulator,
    path: Path | None,
    *,
    everything: bool = False,
) -> None:
    """Print a run by sections of metrics, or every metric, and where it broke limits."""
    from mobman.simulation.limits import limit_remarks, limits_in_the_way, unlimited_motors
    from mobman.simulation.metrics import list_metrics
    from mobman.simulation.monitors import first_failure

    metrics, settings = record.metrics, record.settings
    keys = ("status", "message", "metrics", "settings", "spec", "versions")
    content = {key: getattr(record, key) for key in keys}
    report({**content, "file": None if path is None else str(path)})
    out = console()
    bounds = [key for key in ("a", "A") if key in settings]
    in_force = ", ".join(
        f"{key} = {value:.4g}" if isinstance(value := settings[key], float) else f"{key} = {value}"
        for key in (settings if level() > 0 else bounds)
    )
    name = f"{record.robot} · {record.task} · {record.scenario} · {record.controller}"
    rest = f" {record.status}"
    out.print(out.render_str(name, style="bold"), rest + (f"  ({in_force})" if in_force else ""))
    known = [metric for metric in list_metrics() if metric.name in metrics]
    if everything or level() > 0:
        rows = [(m.name, number(metrics[m.name], m.unit), m.unit, m.description) for m in known]
        out.print(table("metric", "value", "unit", "what it is", rows=rows, right={"value"}))
    else:
        sections: dict[str, list[str]] = {section: [] for section in _SUMMARY}
        for metric in known:
            if metric.short and metric.section in sections:
                value = _with_unit(metrics[metric.name], metric.unit)
                sections[metric.section].append(f"{metric.short}: {value}")
        room = out.width - max(map(len, sections)) - 4
        shown = [(f"  {name}", in_lines(parts, room)) for name, parts in sections.items() if parts]
        out.print(table(rows=shown))
    lines = []
    if record.spec.get("monitor"):
        lines.append(f"theorems: {first_failure(record.t, record.signals)}")
    if free := unlimited_motors(record):
        lines.append(f"no torque limit is known of {', '.join(free)}")
    lines += [f"beyond its limits: {remark}" for remark in limit_remarks(record, robot)]
    if not (record.ok and metrics["success"]):
        lines += limits_in_the_way(record, robot)
    if record.ok and metrics["success"] == 0.0:
        errors = f"|e^e| is {number(metrics['task_error_final'])} m"
        angle = metrics.get("orientation_error_final", math.nan)
        if not math.isnan(angle):
            errors += f" and the orientation is {number(angle)} rad off"
        lines.append(f"no success: it went to its end, but {errors} there")
        cut = metrics.get("saturation_share", 0.0)
        if cut > 0.0 and settings.get("saturation") == "none":
            lines.append(
                f"torques were cut in {100 * cut:.0f} % of the ticks, which {record.controller} does "
                "not know of: --gain saturation=hedge"
            )
    if path is not None:
        lines += [f"record: {path}", f"next: mobman view {shlex.quote(str(path))}"]
    for line in lines:
        out.print(line, soft_wrap=True)


def _with_unit(value: float, unit: str) -> str:
    text = number(value, unit)
    return f"{text} {unit}" if math.isfinite(value) and unit != "1" else text


def _went_well(record: Record) -> bool:
    if not record.ok:
        note(f"the run ended as {record.status} {record.message}")
    return record.ok


# rerun -------------------------------------------------------------------------------------------------

_VERIFY = (
    "Compare with what is in the file: bit for bit, or within a tolerance on another processor or with "
    "other versions."
)
_TOLERANCE = (
    "With --verify: largest difference, over the larger of 1 and the largest value, 100 times as much "
    "in torques and signals; 0 for bit for bit.  [default: 0, or 1e-4 on another processor or with "
    "other versions]"
)
_ROBOT = (
    "Robot (a TOML file or a name) to use instead of the record's, for a platform that is Python "
    "code."
)
_LAW = (
    "Python code of a law that is not registered: a class with Gains, which gets the record's, or what "
    "gives the controller when it is called."
)
_TASK = (
    "Python code of a task that is not registered: called with the robot, q0 and the record's "
    "parameters, gives the task."
)


@command()
@argument("files", nargs=-1, required=True, metavar="FILE...", type=PATH)
@option("--verify", "verifies", is_flag=True, help=_VERIFY)
@option("--tolerance", type=float, metavar="X", help=_TOLERANCE)
@option("-o", "--output", type=FILE, help="HDF5 file for the new record (.h5), at every tick.")
@FORCE
@option("--robot", metavar="FILE", help=_ROBOT)
@option("--controller", metavar="FILE.py:NAME", help=_LAW)
@option("--task", metavar="FILE.py:NAME", help=_TASK)
@reports
def rerun(files: tuple[Path, ...], verifies: bool, output: Path | None, **given: Any) -> None:
    """Repeat the run of each record FILE from the file alone.

    No code is taken from the file. What is Python code, and not registered, is named by --robot,
    --controller and --task.

    Exit status 1 if a run cannot be repeated, if it diverged or met a singularity, or, with --verify, if
    the repetition differs from the file.
    """
    from mobman.simulation.parts import robot_of
    from mobman.simulation.rerun import repeat, verify

    tolerance, force = given.pop("tolerance"), given.pop("force")
    if output is not None and len(files) > 1:
        raise UsageError(f"-o is for one record; {len(files)} files are given")
    if tolerance is not None and not verifies:
        raise UsageError("--tolerance goes with --verify")
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance >= 0.0):
        raise BadParameter(f"{tolerance} is not a number from 0 on", param_hint="--tolerance")
    check_new(output, suffixes=_SUFFIXES, force=force)
    own, told, failed = _own(**given), [], False
    for file in files:
        try:
            with progress_bar(str(file)) as progress:
                if verifies:
                    found = verify(file, tolerance=tolerance, own=own, progress=progress)
                record = found.record if verifies else repeat(file, own=own, progress=progress)
            saved = None if output is None else record.save(output)
            if not verifies:
                robot_run = own.robot or robot_of(record.spec["robot"], record.urdf)
                tell(record, robot_run, saved)
                failed |= not _went_well(record)
                continue
            failed |= not found.equal
            told.append(_as_json(file, found, saved))
            _print(file, found, saved)
        except MobmanError as error:
            if len(files) == 1:
                raise
            note(error)
            failed = True
    if verifies:
        report(told)
    if failed:
        raise Exit(1)


def _own(robot: str | None, controller: str | None, task: str | None) -> Own:
    """Parts that the user names instead of the record's."""
    from mobman.model.build import load_robot
    from mobman.simulation.rerun import Own

    law = None if controller is None else _code(controller, "--controller")
    try:
        law = law if law is None or isinstance(law, type) else law()
    except FOREIGN_ERRORS as error:
        message = f"calling {controller} failed: {error!r}"
        raise BadParameter(message, param_hint="--controller") from error
    return Own(
        robot=None if robot is None else load_robot(robot),
        controller=law,
        make_task=None if task is None else _code(task, "--task"),
    )


def _code(name: str, option: str) -> Any:
    from mobman.model.platforms.custom import load_code

    if ":" not in name:
        raise BadParameter(f"{name!r} is not FILE.py:NAME", param_hint=option)
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
    def told(changes: dict[str, tuple[str, str]]) -> dict[str, dict[str, str]]:
        return {name: {"then": was, "now": now} for name, (was, now) in changes.items()}

    return {
        "file": str(file),
        **{key: getattr(found, key) for key in ("equal", "identical", "tolerance")},
        "machine": told(found.machine),
        "versions": told(found.versions),
        "note": found.note,
        "compared": [asdict(item) for item in found.compared],
        "record": None if saved is None else str(saved),
    }
