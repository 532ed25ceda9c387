"""Provenance of a result: versions of everything whose numbers are in it, and the machine."""

from __future__ import annotations

import hashlib
import platform
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from mobman.version import __version__

_LIBRARIES = ("pin", "example-robot-data", "numpy", "scipy", "numba", "h5py", "daqp")
COMPUTING = ("mobman", "source", "python", "pin", "numpy", "scipy", "numba")
"""Those of them that may change a run's last bits; the robots' URDFs are in the records."""


def versions() -> dict[str, str]:
    """Versions of mobman, Python and the libraries that compute; ``"source"`` is a hash of mobman's own
    Python files, which tells two states of one version from each other."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    found = {"mobman": __version__, "python": platform.python_version()}
    for library in _LIBRARIES:
        try:
            found[library] = version(library)
        except PackageNotFoundError:  # Pinocchio from conda or ROS has another name there
            found[library] = "unknown"
    own, digest = Path(__file__).parent, hashlib.sha256()
    for path in sorted(own.rglob("*.py")):
        digest.update(f"{path.relative_to(own).as_posix()}\0".encode() + path.read_bytes())
    return {**found, "source": digest.hexdigest()[:16]}


def machine() -> dict[str, str]:
    """The processor's model, the architecture, and the system with its library of mathematics: what
    the last bits of a run depend on in addition to the versions. Empty where the system does not say."""
    return dict(_machine())


@cache
def _machine() -> dict[str, str]:
    library = " ".join(platform.libc_ver()).strip() or platform.release()
    processor = platform.processor()
    with suppress(OSError):  # where there is such a file, it says more
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
        processor = next(named, processor)
    system = f"{platform.system()} ({library})"
    return {"processor": processor, "architecture": platform.machine(), "system": system}
