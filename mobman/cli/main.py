"""The entry point: sub-commands, and errors as one or two plain lines.

Exit status: 0 done; 1 the command failed; 2 invalid usage; 130 interrupted.
"""

from __future__ import annotations

import io
import os
import re
import signal
import sys
import traceback
import warnings

import click
from click.shell_completion import shell_complete

from mobman.cli.bench import bench
from mobman.cli.names import COMMANDS
from mobman.cli.options import level
from mobman.cli.output import echo, note
from mobman.cli.robots import robots
from mobman.cli.run import rerun, run
from mobman.cli.view import export, view
from mobman.errors import MobmanError, SpecError, told_of_foreign
from mobman.version import __version__

_LONGEST = 4000  # characters of a message
_MOST_FAULTS = 40
_LINE = re.compile(r"line \d+: ")
_COMPLETE = "_MOBMAN_COMPLETE"
"""Variable by which shells ask for completion: ``bash_source``, ``zsh_source``, ``fish_source``."""
_SETTINGS = {"help_option_names": ["-h", "--help"], "max_content_width": 100, "show_default": True}


@click.group(context_settings=_SETTINGS)
@click.version_option(__version__, "--version", prog_name="mobman", message="%(prog)s %(version)s")
def mobman() -> None:
    """Control of non-holonomic mobile manipulators: robots, runs and benchmarks."""


for _command in (robots, run, rerun, bench, export, view, *COMMANDS):
    mobman.add_command(_command)


def main() -> None:
    """Run the command line and exit."""
    # Asked to stop, it stops as after Ctrl-C: workers are ended and what was done is kept.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    warnings.showwarning = _show_warning
    for stream in (sys.stdout, sys.stderr):  # a terminal need not have every character
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    context = None
    try:
        if instruction := os.environ.get(_COMPLETE):
            raise click.exceptions.Exit(_complete(instruction))
        # not mobman.main(): that turns a closed pipe into exit status 1
        with mobman.make_context("mobman", sys.argv[1:]) as context:
            mobman.invoke(context)
        if sys.stdout is not None:
            sys.stdout.flush()  # so that a closed pipe is met here
    except click.exceptions.Exit as leave:
        sys.exit(leave.exit_code)
    except click.exceptions.NoArgsIsHelpError as error:
        echo(error.ctx.get_help() if error.ctx else "", err=True)
        sys.exit(error.exit_code)
    except click.UsageError as error:
        command = error.ctx.command_path if error.ctx else "mobman"
        _fail(error.exit_code, f"{error.format_message()} (see {command} --help)")
    except click.ClickException as error:
        _fail(error.exit_code, error.format_message())
    except MobmanError as error:
        _fail(error.exit_status, *_by_lines(error))
    except (KeyboardInterrupt, click.Abort):
        _fail(130, "interrupted")
    except BrokenPipeError:
        # `mobman ... | head`: the reader has what it wanted
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:
        _fail(1, str(error))
    except BaseException as error:  # a plugin may raise anything, also SystemExit
        if level(context) > 0 or os.environ.get("MOBMAN_DEBUG"):
            traceback.print_exc()
        internal = f"internal error: {type(error).__name__}: {error}"
        _fail(1, f"{told_of_foreign(error) or internal} (-v prints the traceback)")


def _complete(instruction: str) -> int:
    """Print a shell's script for completion, or what it is to offer; give the exit status."""
    if not re.fullmatch("(bash|zsh|fish)_(source|complete)", instruction):
        raise click.UsageError(
            f"{_COMPLETE} is {instruction!r}; allowed: bash_source, zsh_source, fish_source"
        )
    return shell_complete(mobman, {}, "mobman", _COMPLETE, instruction)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    if level() >= 0:
        note(f"warning: {message}")


def _by_lines(error: MobmanError) -> list[str]:
    """The message; in several lines, where it is of faults on lines of a file."""
    faults = error.faults if isinstance(error, SpecError) else ()
    if not isinstance(error, SpecError) or len(faults) < 2 or not any(map(_LINE.match, faults)):
        return [str(error)]
    more = [f"and {len(faults) - _MOST_FAULTS} more"] if len(faults) > _MOST_FAULTS else []
    return [f"{error.heading}: {len(faults)} faults", *faults[:_MOST_FAULTS], *more]


def _fail(status: int, *lines: str) -> None:
    for head, line in zip(["mobman: ", *["  "] * (len(lines) - 1)], lines, strict=True):
        text = " ".join(line.split())
        if len(text) > _LONGEST:
            text = f"{text[:_LONGEST]}... ({len(text)} characters)"
        echo(head + text, err=True)
    sys.exit(status)
