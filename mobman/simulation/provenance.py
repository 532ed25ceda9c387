"""What made a result: versions of everything whose numbers are in it."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from mobman.version import __version__

_LIBRARIES = ("pin", "example-robot-data", "numpy", "scipy", "numba", "h5py")


def versions() -> dict[str, str]:
    """Versions of mobman, Python and the libraries that compute."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    found = {"mobman": __version__, "python": platform.python_version()}
    for library in _LIBRARIES:
        try:
            found[library] = version(library)
        except PackageNotFoundError:  # Pinocchio from conda or ROS has another name there
            found[library] = "unknown"
    return found
