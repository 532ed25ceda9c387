"""``python -m mobman``, and the command ``mobman``."""

from __future__ import annotations

import os
import signal
from types import FrameType


def main() -> None:
    """Run the command line and exit."""
    # Loading it takes a third of a second, in which Ctrl-C must not end in a traceback of imports.
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.SIG_IGN:  # as in the background of a script
        signal.signal(signal.SIGINT, _leave)
    from mobman.cli.main import main as run

    signal.signal(signal.SIGINT, before)
    run()


def _leave(number: int, frame: FrameType | None) -> None:
    os.write(2, b"mobman: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    main()
