"""The command line, in this process and in one of its own."""

from __future__ import annotations

import io
import runpy
import signal
import subprocess
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from unittest.mock import patch

import click

from mobman.cli.main import mobman as group
from support.golden_access import only_mobmans_own

Done = subprocess.CompletedProcess[str]


def mobman(*arguments: object) -> Done:
    """Run ``python -m mobman`` in this process, which takes a tenth of the time."""
    command = ["mobman", *map(str, arguments)]
    # as those of a process: of bytes, so that their encoding and errors are what they are there
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2))
    handler, status = signal.getsignal(signal.SIGTERM), 0
    _forget_help(group)
    try:
        with (
            only_mobmans_own(),
            patch.object(sys, "argv", command),
            warnings.catch_warnings(),
            redirect_stdout(out),
            redirect_stderr(err),
        ):
            warnings.simplefilter("default")
            warnings.simplefilter("ignore", ResourceWarning)  # of what other tests left
            try:
                runpy.run_module("mobman", run_name="__main__")
            except SystemExit as leave:
                status = int(leave.code or 0)
    finally:
        signal.signal(signal.SIGTERM, handler)
    return Done(command, status, *map(_text, (out, err)))


def mobman_process(*arguments: object, **options: object) -> Done:
    """Run it as the shell does."""
    return subprocess.run(
        [sys.executable, "-m", "mobman", *map(str, arguments)],
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        **options,
    )


def _text(stream: io.TextIOWrapper) -> str:
    stream.flush()
    return stream.buffer.getvalue().decode("utf-8")


def _forget_help(command: click.Command) -> None:
    """click keeps the help option of a command's first call, which may have been without the group."""
    command._help_option = None
    for part in getattr(command, "commands", {}).values():
        _forget_help(part)
