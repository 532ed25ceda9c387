"""Controllers that do to a worker what a worker may suffer."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path


class _Law:
    """Torque zero; what it does else, it does at its start."""

    def reset(self, robot, task, dt):
        self.act()

    def step(self, t, q, z, z_dot):
        return 0.0 * z


class Killed(_Law):
    """A process that is out of memory is ended so."""

    def act(self):
        os.kill(os.getpid(), signal.SIGKILL)


class Leaves(_Law):
    def act(self):
        os._exit(7)


class LeavesQuietly(_Law):
    def act(self):
        os._exit(0)


class Segfaults(_Law):
    def act(self):
        ctypes.string_at(0)


class Stops(_Law):
    def act(self):
        os.kill(os.getpid(), signal.SIGSTOP)


class Swells(_Law):
    """Asks for ten gigabytes at a time, and keeps them."""

    def act(self):
        kept = []
        while True:
            kept.append(bytearray(10 << 30))


class Talks(_Law):
    def act(self):
        raise RuntimeError("many words " * 10_000)


class Loops(_Law):
    """For ever, in Python, and whatever ``Exception`` comes."""

    def act(self):
        while True:
            with contextlib.suppress(Exception):
                time.sleep(1e-3)


class Slow(_Law):
    """Takes its time at every step."""

    def act(self):
        pass

    def step(self, t, q, z, z_dot):
        time.sleep(0.02)
        return 0.0 * z


class Hangs(_Law):
    """For ever, in compiled code that never lets the interpreter go."""

    def act(self):
        ctypes.PyDLL(None).sleep(600)


class Fills(_Law):
    """Asks for more memory than there is."""

    def act(self):
        bytearray(1 << 60)


class Raises(_Law):
    def act(self):
        raise RuntimeError("a bug of its own")


class Exits(_Law):
    def act(self):
        raise SystemExit(3)


class Diverges(_Law):
    def act(self):
        pass

    def step(self, t, q, z, z_dot):
        return 0.0 * z + float("nan")


@dataclass
class Mark:
    """A file, as a gain."""

    mark: str = ""


class KilledOnce(_Law):
    """Dies where no other of its kind has died before."""

    Gains = Mark

    def __init__(self, gains):
        self.gains = gains

    def act(self):
        try:
            Path(self.gains.mark).touch(exist_ok=False)
        except FileExistsError:
            return
        os.kill(os.getpid(), signal.SIGKILL)


class Forks(_Law):
    """Its child goes on with the run, as if it were the worker; so does the worker, which notes the
    child's process."""

    Gains = Mark

    def __init__(self, gains):
        self.gains = gains

    def act(self):
        if child := os.fork():
            mark = Path(self.gains.mark)  # replaced whole: the test may read it meanwhile
            mark.with_suffix(".new").write_text(str(child))
            mark.with_suffix(".new").replace(mark)
