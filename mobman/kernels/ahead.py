"""``python -m mobman.kernels.ahead``: compile every kernel now, for all later processes."""

from __future__ import annotations

import contextlib
import importlib
import sys
from pathlib import Path

from mobman.kernels.cache import kernel_files, kernel_folder, unsafe


def compiled_ahead() -> bool:
    """True if that has been done on this machine for this version."""
    return (kernel_folder() / "complete").exists()


def compile_ahead(backwards: bool = False) -> None:
    """Compile every kernel of the project that is not compiled yet; none if numba is switched off.

    Args:
        backwards: From the last to the first, to help a process that goes the other way.
    """
    from mobman.kernels.calling import address_of, runner
    from mobman.kernels.kernel import KERNELS

    package = Path(__file__).parents[1]
    for file in kernel_files():
        parts = file.relative_to(package).with_suffix("").parts
        importlib.import_module(".".join(("mobman", *parts)))
    own = [function for function in KERNELS if function.__module__.startswith("mobman.")]
    for function in own[::-1] if backwards else own:
        address_of(function)
    if own:
        runner()
        with contextlib.suppress(OSError):  # nothing was kept: there is a warning already
            if not unsafe():
                (kernel_folder() / "complete").touch()


if __name__ == "__main__":
    if not compiled_ahead():
        compile_ahead(backwards="--backwards" in sys.argv)
