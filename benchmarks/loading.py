"""How long a robot takes to load, after the imports: ``python benchmarks/loading.py [ROBOT...]``.

Each robot in processes of its own, so that nothing is in a cache but the operating system's.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys

_ALONE = """
import sys, time
import pinocchio
import mobman as mm
mm.load_robot, mm.simulate  # imports what a program imports
before = time.perf_counter()
mm.load_robot(sys.argv[1])
print(time.perf_counter() - before)
"""


def loading_times(robot: str, repeats: int) -> list[float]:
    """Times of the first ``load_robot`` of a process (s)."""
    times = []
    for _ in range(repeats):
        done = subprocess.run(
            [sys.executable, "-c", _ALONE, robot], capture_output=True, text=True, check=True
        )
        times.append(float(done.stdout))
    return times


def main() -> None:
    """Measure and print."""
    import mobman as mm

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", metavar="ROBOT", default=mm.list_robots())
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    print(f"{'robot':<18}{'median (ms)':>12}{'least':>8}{'most':>8}")
    for robot in given.robots:
        times = [1e3 * time for time in loading_times(robot, given.repeats)]
        print(f"{robot:<18}{statistics.median(times):>12.1f}{min(times):>8.1f}{max(times):>8.1f}")


if __name__ == "__main__":
    main()
