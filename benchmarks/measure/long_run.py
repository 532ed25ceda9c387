"""A minute of a robot's life: how evenly its ticks go, and what memory the run takes.

Each run has a process of its own (this file as a script), so that nothing else is in its memory.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

SHORT, LONG = 20.0, 60.0
"""Simulated durations (s) between which growth is looked for."""

_DT = 1e-3  # s
_RESOLUTION = 1e6  # bytes: a process takes memory from the system in pieces; less is not told


def long_runs(robot: str, gains: dict[str, float], task: str, scale: float = 1.0) -> dict[str, Any]:
    """A short and a long run of ``tsm`` at 1 kHz.

    Args:
        robot: Its name.
        gains: Of the controller.
        task: Its name.
        scale: Factor of both durations.

    Returns:
        Of the long run: ``median``, ``p99`` and ``max`` of the controller's step (s),
        ``p99_over_median``; ``p99_over_median_by_second``, the median of what single seconds of it
        have, where a machine whose pace changes does not show; ``machine_p99_over_median``, the same of
        as many bare Pinocchio calls as take the same time: what the machine does to anything;
        ``preemptions``, how often the system
        took the core away, which the tick it hits pays for; ``record`` (bytes), ``beyond_record``
        (bytes of the peak, above what the process had before and the record itself), ``seconds``
        that it took. Of both: ``growth_per_tick``, bytes by which the peak beyond the record grows,
        ``kept_growth_per_tick``, the same of what is left when the run is done, and ``resolution``,
        below which they mean none.
    """
    short, long = (_in_a_process(robot, gains, task, scale * d) for d in (SHORT, LONG))
    grown = long["beyond_record"] - short["beyond_record"]
    kept = long["kept_beyond_record"] - short["kept_beyond_record"]
    ticks = long["ticks"] - short["ticks"]
    return {
        **long,
        "growth_per_tick": grown / ticks,
        "kept_growth_per_tick": kept / ticks,
        "resolution": _RESOLUTION / ticks,
    }


def _in_a_process(
    robot: str, gains: dict[str, float], task: str, duration: float
) -> dict[str, Any]:
    arguments = json.dumps({"robot": robot, "gains": gains, "task": task, "duration": duration})
    done = subprocess.run(
        [sys.executable, str(Path(__file__).resolve()), arguments],
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def _run(robot: str, gains: dict[str, float], task: str, duration: float) -> dict[str, Any]:
    """One run, in this process."""
    import resource
    from time import perf_counter

    import numpy as np

    import mobman as mm

    loaded = mm.load_robot(robot)
    controller = mm.make_controller("tsm", **gains)
    mm.simulate(loaded, controller, task, duration=0.1)  # first calls compile
    gc.collect()
    _trim()
    _forget_peak()
    before = _memory("VmRSS")
    preempted = resource.getrusage(resource.RUSAGE_SELF).ru_nivcsw
    started = perf_counter()
    record = mm.simulate(loaded, controller, task, duration=duration, dt=_DT)
    seconds = perf_counter() - started
    preempted = resource.getrusage(resource.RUSAGE_SELF).ru_nivcsw - preempted
    peak = _memory("VmHWM")
    gc.collect()
    _trim()
    after = _memory("VmRSS")
    if not record.ok:
        raise RuntimeError(f"the run is {record.status} {record.message}")
    arrays = [value for value in vars(record).values() if isinstance(value, np.ndarray)]
    size = sum(array.nbytes for array in [*arrays, *record.signals.values()])
    median, p99 = np.percentile(record.compute_time, (50, 99))
    seconds_of_it = record.compute_time[:-1].reshape(-1, round(1.0 / _DT))
    each_median, each_p99 = np.percentile(seconds_of_it, (50, 99), axis=1)
    return {
        "duration": duration,
        "ticks": len(record.t) - 1,
        "seconds": seconds,
        "median": float(median),
        "p99": float(p99),
        "max": float(record.compute_time.max()),
        "p99_over_median": float(p99 / median),
        "p99_over_median_by_second": float(np.median(each_p99 / each_median)),
        "machine_p99_over_median": _machine_tail(loaded, float(median), len(record.t)),
        "preemptions": preempted,
        "record": size,
        "beyond_record": peak - before - size,
        "kept_beyond_record": after - before - size,
    }


def _machine_tail(robot: Any, seconds: float, samples: int) -> float:
    """p99 over median of something that does the same each time and takes so long."""
    from time import perf_counter

    import numpy as np
    from peers.bare_pinocchio import make_bare_controller

    bare = make_bare_controller(robot)
    for _ in range(1000):
        bare()
    started = perf_counter()
    for _ in range(1000):
        bare()
    repeats = max(1, round(seconds / (perf_counter() - started) * 1000))
    times = np.empty(samples)
    for i in range(samples):
        started = perf_counter()
        for _ in range(repeats):
            bare()
        times[i] = perf_counter() - started
    median, p99 = np.percentile(times, (50, 99))
    return float(p99 / median)


def _memory(field: str) -> int:
    """Bytes of a field of /proc/self/status; of the whole process's peak where there is none."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        import resource

        unit = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(f"{field}:"))


def _trim() -> None:
    """Give back what the allocator keeps for later, which is no memory of the run's."""
    with contextlib.suppress(OSError, AttributeError):  # not glibc: it then counts
        ctypes.CDLL(None).malloc_trim(0)


def _forget_peak() -> None:
    """Let VmHWM start anew from what is in use now."""
    with contextlib.suppress(OSError):  # not Linux: the peak then includes that of loading
        Path("/proc/self/clear_refs").write_text("5")


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    print(json.dumps(_run(**json.loads(sys.argv[1]))))
