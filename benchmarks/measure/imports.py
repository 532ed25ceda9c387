"""How long ``import mobman`` takes, beside ``import pinocchio`` without which it could not be.

mobman loads its parts when they are first used; so a second number is the import with everything
loaded that a closed loop needs.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import asdict
from tempfile import TemporaryDirectory
from typing import Any

from measure.rounds import Measure, Spread, interleaved

_CODE = """
from time import perf_counter
started = perf_counter()
{imports}
print(perf_counter() - started)
"""
_IMPORTS = {
    "pinocchio": "import pinocchio",
    "mobman": "import mobman",
    "mobman_used": "import mobman; mobman.load_robot, mobman.make_controller, mobman.simulate",
}


def import_times(rounds: int) -> dict[str, Any]:
    """Seconds of each import in a fresh interpreter, and by how much ours are longer in each round.

    Returns:
        Medians and quartiles of ``pinocchio``, ``mobman`` (the bare import), ``mobman_used`` (with
        all that a closed loop needs), ``difference`` and ``difference_used``.
    """
    with TemporaryDirectory() as bytecode:
        # compiled once, as installed packages are; the round that warms up does it, or a single one
        environment = {**os.environ, "PYTHONPYCACHEPREFIX": bytecode}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        measures = {name: _import(code, environment) for name, code in _IMPORTS.items()}
        taken = interleaved(measures, rounds, warm_up=rounds > 1)
    taken["difference"] = taken["mobman"] - taken["pinocchio"]
    taken["difference_used"] = taken["mobman_used"] - taken["pinocchio"]
    return {name: asdict(Spread.of(values)) for name, values in taken.items()}


def _import(imports: str, environment: dict[str, str]) -> Measure:
    def measure() -> float:
        done = subprocess.run(
            # -P: what is installed, not what happens to lie in the working directory
            [sys.executable, "-P", "-c", _CODE.format(imports=imports)],
            env=environment,
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        )
        return float(done.stdout)

    return measure
