"""``mobman.view``: robots and runs in the browser, in a notebook, as a page, a picture or a film."""

from __future__ import annotations

import contextlib
import html as html_text
import json
import math
import os
import sys
import threading
import warnings
import webbrowser
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from numbers import Real
from pathlib import Path
from time import perf_counter, sleep
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.controllers.task_errors import TaskSpace
from mobman.errors import UsageError
from mobman.files import as_path, write_all
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.model.platforms.custom import without_code
from mobman.robots.catalogue import list_robots
from mobman.robots.spec import RobotSpec
from mobman.simulation.record import Record, load_record
from mobman.tasks.task import make_task
from mobman.viewer import scene as scenes
from mobman.viewer.page import LOOPBACK, PageServer, document, save_film, save_picture

Viewable = Record | MobileManipulator | RobotSpec | Mapping[str, Any] | str | os.PathLike[str]
"""A run or its file, or a robot in any form that :func:`mobman.load_robot` takes."""

_SHOWN = (Record, MobileManipulator, RobotSpec, Mapping, str, os.PathLike)
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HEIGHT = 620  # pixels, in a notebook
_RATED = 1.0  # Time over which the rate of a live run is taken (s)
_BEHIND = 0.1  # Delay behind the clock that a live run makes up for (s); a longer one is kept


class View(contextlib.AbstractContextManager["View"]):
    """A scene to look at: by an address, in a notebook, or in a file.

    The server is started when its address is first asked for. It lives in this process and ends with
    it, or with :meth:`close`; a view is a context manager that closes itself.

    Args:
        scene: The scene that it shows.
        serving: ``host``, ``port`` and ``frames`` of the :class:`~mobman.viewer.page.PageServer`.
    """

    def __init__(self, scene: scenes.Scene, **serving: Any) -> None:
        self.scene, self._serving = scene, serving
        self._server: PageServer | None = None
        self._file: Path | None = None
        self._closed = False

    @property
    def url(self) -> str:
        """The address for a browser: of the file that it was written to, or this process's server;
        UsageError if the view is closed, or the port is taken."""
        if self._file is not None:
            return self._file.resolve().as_uri()
        if self._closed:
            raise UsageError("this view is closed; make a new one")
        if self._server is None:
            self._server = PageServer(self.html(), **self._serving)
        return self._server.url

    def html(self) -> str:
        """The page, whole: it opens without a network."""
        return document(self.scene.title, self.scene.content)

    def save(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write it to a file: whole, or not at all; return the file's path.

        Args:
            path: ``.html`` for the page, ``.png`` for a picture, ``.gif`` or ``.mp4`` for a film.
            options: For a picture ``time`` (s; the end of the longest run by default), ``size`` (width
                and height, pixels), ``scale`` (pixels of the file for each of these: letters and lines
                grow with it) and ``transparent`` (robots, lines, labels and shadows alone, on nothing).
                For a film ``fps`` (frames a second; 30, and 20 for a GIF, by default), ``size``,
                ``speed`` (seconds of the run a second) and ``progress`` (told the share done, 0 to 1).

        Raises:
            UsageError: If the file's kind is another, an option cannot be, or nothing moves in a film.
            BrowserError: If there is no browser for a picture.
            MobmanError: If the file cannot be written, or a film's encoder is missing.
        """
        file = as_path("path", path)
        kind = file.suffix.lower()
        if kind in (".html", ".htm"):
            if options:
                raise UsageError(f"{file}: a page has no option {', '.join(options)}")
            write_all({file: self.html().encode()})
            return file
        if kind not in (".png", ".gif", ".mp4"):
            raise UsageError(f"{file}: allowed: a file .html, .png, .gif or .mp4")
        save: Any = save_picture if kind == ".png" else save_film
        if unknown := [name for name in options if name not in save.__kwdefaults__]:
            what = "picture" if kind == ".png" else "film"
            raise UsageError(f"{file}: a {what} has no option {', '.join(unknown)}")
        save(self.scene, file, **options)
        return file

    def open(self) -> bool:
        """Open it in the user's browser; return whether there was one to open."""
        known = ("BROWSER", "DISPLAY", "WAYLAND_DISPLAY")
        # without a screen a text browser would take the terminal
        screen = sys.platform in ("win32", "darwin") or any(map(os.environ.get, known))
        try:
            return screen and webbrowser.open(self.url)
        except webbrowser.Error:
            return False

    def close(self) -> None:
        """Stop the server; again without effect."""
        self._closed = True
        if self._server is not None:
            self._server.close()
            self._server = None

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"View({self.scene.title!r})"

    def _repr_html_(self) -> str:
        page, title = map(html_text.escape, (self.html(), self.scene.title))
        style = f"width: 100%; height: {_HEIGHT}px; border: 0"
        return f'<iframe srcdoc="{page}" style="{style}" title="{title}"></iframe>'


def view(
    what: Viewable | Iterable[Viewable],
    *,
    html: str | os.PathLike[str] | None = None,
    open_browser: bool | None = None,
    host: str = LOOPBACK,
    port: int | None = None,
    layout: scenes.Layout = "overlay",
    time: float | None = None,
    camera: str | Sequence[float] | None = None,
) -> View:
    """Show a robot, a run, or several runs together.

    >>> import mobman as mm
    >>> record = mm.simulate("youbot", "pseudo-inverse", "paper", duration=0.05)
    >>> page = mm.view(record, html="run.html")

    Args:
        what: A robot (an object, a name, a TOML file or a description), a run (a record or its HDF5
            file), or several runs.
        html: A file to write the page to, instead of serving it.
        open_browser: True to open the user's browser; the default unless this is a notebook, where
            the view shows itself, or a file was written.
        host: Address to listen on; this machine alone by default.
        port: Port to listen on; a free one by default.
        layout: scenes.Layout of several runs: ``"overlay"`` or ``"side-by-side"``.
        time: Time that a replay opens at (s); by default its beginning, or the end of a run that failed.
        camera: Direction to look from, in the world's axes: ``"front"``, ``"back"``, ``"left"``,
            ``"side"``, ``"top"``, ``"iso"``, or three numbers.

    Returns:
        The view: keep it as long as the page is to be served.

    Raises:
        UsageError: If there is nothing to show, or an argument cannot be.
        SpecError: If a robot's description is not valid.
        RecordError: If a record cannot be read.
    """
    scene = make_scene(what, layout=layout, time=time, camera=camera)
    shown, notebook = View(scene, host=host, port=port), _in_notebook()
    if html is not None:
        shown._file = shown.save(html)
    elif port is not None or not notebook:
        _ = shown.url  # so that a port that is taken is met here
    if open_browser or (open_browser is None and html is None and not notebook):
        shown.open()
    return shown


def make_scene(
    what: Viewable | Iterable[Viewable],
    *,
    layout: scenes.Layout = "overlay",
    time: float | None = None,
    camera: str | Sequence[float] | None = None,
) -> scenes.Scene:
    """Make the scene that :func:`view` shows, as plain data; it warns and raises as that."""
    scenes.check_view(time, layout)
    single = isinstance(what, _SHOWN)
    if not single and not isinstance(what, Iterable):
        raise UsageError(f"{what!r} cannot be shown: give a robot, a run, or several runs")
    things: list[Any] = [what] if single else list(what)  # type: ignore[arg-type]
    if not things:
        raise UsageError("there is nothing to show: give a robot, a run, or several runs")
    for thing in things:
        if not isinstance(thing, _SHOWN):
            raise UsageError(f"{thing!r} cannot be shown: give a robot, a run, or several runs")
    found = [_run(thing) for thing in things]
    runs = [run for run in found if run is not None]
    robots = [thing for thing, run in zip(things, found, strict=True) if run is None]
    if runs and robots:
        raise UsageError(f"{robots[0]!r} is a robot, the others are runs: show one or the other")
    if len(robots) > 1:
        raise UsageError("one robot at a time can be shown; several runs can")
    if robots:
        scene = scenes.scene_of_robot(_robot(robots[0]), camera=camera)
    else:
        scene = scenes.scene_of_runs(runs, layout=layout, time=time, camera=camera)
    for warning in scene.warnings:
        warnings.warn(warning, stacklevel=3)
    return scene


def _robot(what: Any) -> MobileManipulator:
    """A robot by name or description; of a file, whose origin is unknown, no code is run."""
    if isinstance(what, MobileManipulator):
        return what
    named = isinstance(what, (RobotSpec, Mapping)) or os.fspath(what) in list_robots()
    with contextlib.nullcontext() if named else without_code():
        return load_robot(what)


def _run(thing: Any) -> scenes.ShownRun | None:
    """The run that something is or that its file holds; None if it is none."""
    if isinstance(thing, Record):
        return scenes.ShownRun(thing, thing.controller)
    if not isinstance(thing, (str, os.PathLike)):
        return None
    path, begins_so = Path(thing), False
    with contextlib.suppress(OSError, ValueError), path.open("rb") as file:
        begins_so = file.read(len(_HDF5)) == _HDF5
    if not begins_so and path.suffix.lower() not in (".h5", ".hdf5", ".hdf"):
        return None
    return scenes.ShownRun(load_record(path), path.stem, path.resolve().parent)


class LiveRun:
    """Shows a run that is being simulated, without a part in it: ``scene`` is the page's as it begins,
    ``every`` the simulated time from one look at it to the next (s).

    It is given copies of the state, and computes from them with a robot (at rest where the run begins)
    and a task of its own, since it does so in another thread than the simulation. ``speed`` is the
    largest, in simulated seconds a second, None for as fast as it goes; ``about`` has names of the
    ``controller`` and the ``scenario``, and the ``seed``. UsageError if the speed or the duration (s) is
    not a positive number.
    """

    def __init__(
        self,
        robot: MobileManipulator,
        task: str,
        options: Mapping[str, Any] = MappingProxyType({}),
        *,
        duration: float,
        speed: float | None = 1.0,
        **about: Any,
    ) -> None:
        for name, value in (("speed", speed), ("duration", duration)):
            if value is not None and not (
                isinstance(value, Real) and math.isfinite(value) and value > 0.0
            ):
                raise UsageError(f"{name} = {value!r}: must be a positive number")
        self.every = max(1.0 / scenes.FRAMES_PER_SECOND, duration / scenes.MOST_FRAMES)
        self._speed = speed
        self._began: float | None = None
        self._robot = load_robot(robot.spec)
        self._task = make_task(task, self._robot, **options)
        self._about: dict[str, Any] = {"controller": "", "scenario": "", "seed": 0, **about}
        self._about |= {"robot": robot.name, "task": task, "status": "ok", "message": ""}
        self._space = TaskSpace(self._robot, self._task)
        self._samples: list[tuple[float, Array, Array, Array]] = []
        self._taken: list[float] = []  # when each was, by the clock (s)
        self._asked = threading.Event()
        self._whole: str | None = None
        times = [*np.arange(0.0, duration, self.every), duration]
        still = np.zeros(self._robot.nz)
        rest = self._states([(t, self._robot.q_rest, still, still) for t in times])
        self.scene = scenes.scene_of_runs([scenes.ShownRun(rest, "", robot=self._robot)], live=True)
        self.scene.content["live_speed"] = speed

    def observe(self, t: float, q: Array, z: Array, torque: Array) -> None:
        """Take a state; returns when it is time to go on."""
        self._samples.append((t, q.copy(), z.copy(), torque.copy()))
        self._taken.append(perf_counter())
        if self._speed is None:
            return
        now, due = perf_counter(), t / self._speed
        if self._began is None or now - self._began - due > _BEHIND:
            self._began = now - due
        sleep(max(0.0, self._began + due - now))

    def finish(self, record: Record) -> None:
        """Give the page all of the run, which has ended."""
        run = scenes.ShownRun(record, record.controller, robot=self._robot)
        content = scenes.scene_of_runs([run]).content
        told = {name: content["runs"][0][name] for name in ("motion", "info")}
        told |= {"ended": True, "error_decades": content["error_decades"]}
        self._whole = json.dumps(told)

    def wait_for_page(self, seconds: float) -> bool:
        """Wait until a page asks for frames; return whether one did in time."""
        return self._asked.wait(seconds)

    def frames(self, after: float) -> str:
        """The news for a page that has the frames up to a time (s), as JSON."""
        self._asked.set()
        if self._whole is not None:
            return self._whole
        samples = self._samples[:]
        later = samples[bisect_right(samples, after, key=lambda sample: sample[0]) :]
        if not later:
            return "{}"
        moved = scenes.motion(self._states(later), self._robot)
        return json.dumps({"motion": moved.described(), "rate": self._rate(len(samples))})

    def _rate(self, count: int) -> float | None:
        """Simulated seconds a second over the last second of the clock; None if it has just begun."""
        now, last = self._taken[count - 1], count - 1
        first = min(bisect_left(self._taken, now - _RATED, hi=last), last - 1)
        if first < 0 or not (passed := now - self._taken[first]) > 0.0:
            return None
        return (self._samples[last][0] - self._samples[first][0]) / passed

    def _states(self, samples: list[tuple[float, Array, Array, Array]]) -> SimpleNamespace:
        """States that a scene shows of a record, at some samples."""
        arrays = map(np.array, zip(*samples, strict=True))
        parts = dict(zip(("t", "q", "z", "torque"), arrays, strict=True))
        space, seen = self._space, []
        for at, *state, _ in samples:
            space.at(at, *state)
            desired = self._task.desired(float(at))[0]
            seen.append((space.f[:3].copy(), desired, space.f - space.p_d[0]))
        tip, desired, error = map(np.array, zip(*seen, strict=True))
        m = tip.shape[1]
        return SimpleNamespace(
            **parts,
            tip_position=tip,
            tip_desired=desired[:, :m],
            tip_desired_orientation=desired[:, m:] if desired.shape[1] > m else None,
            task_error=error,
            joint_names=self._robot.joint_names,
            **self._about,
        )


def _in_notebook() -> bool:
    """Tell whether this is a kernel of Jupyter, which shows what has ``_repr_html_``."""
    shell = sys.modules.get("IPython")
    running = None if shell is None else shell.get_ipython()
    return running is not None and "IPKernelApp" in getattr(running, "config", {})
