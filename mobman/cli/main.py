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

from mobman.cli import names
from mobman.cli.bench import bench
from mobman.cli.export import export
from mobman.cli.output import echo, level
from mobman.cli.robots import robots
from mobman.cli.run import rerun, run
from mobman.cli.view import view
from mobman.errors import MobmanError, SpecError
from mobman.version import __version__

_LONGEST = 4000  # characters of a message
_MOST_FAULTS = 40
_LINE = re.compile(r"line \d+: ")
_COMPLETE = "_MOBMAN_COMPLETE"
"""Variable by which shells ask for completion: ``bash_source``, ``zsh_source``, ``fish_source``."""


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, "--version", prog_name="mobman", message="%(prog)s %(version)s")
def mobman() -> None:
    """Control of non-holonomic mobile manipulators: robots, runs and benchmarks."""


mobman.add_command(robots)
mobman.add_command(run)
mobman.add_command(rerun)
mobman.add_command(bench)
mobman.add_command(export)
mobman.add_command(view)
for _command in names.COMMANDS:
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
        _fail(f"{error.format_message()} (see {command} --help)", error.exit_code)
    except click.ClickException as error:
        _fail(error.format_message(), error.exit_code)
    except MobmanError as error:
        _fail(_by_lines(error), error.exit_status)
    except (KeyboardInterrupt, click.Abort):
        _fail("interrupted", 130)
    except BrokenPipeError:
        # `mobman ... | head`: the reader has what it wanted
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:
        _fail(str(error), 1)
    except BaseException as error:  # a plugin may raise anything, also SystemExit
        if level(context) > 0 or os.environ.get("MOBMAN_DEBUG"):
            traceback.print_exc()
        _fail(f"internal error: {type(error).__name__}: {error} (-v prints the traceback)", 1)


def _complete(instruction: str) -> int:
    """Print a shell's script for completion, or what it is to offer; give the exit status."""
    shell, _, what = instruction.partition("_")
    if shell not in ("bash", "zsh", "fish") or what not in ("source", "complete"):
        raise click.UsageError(
            f"{_COMPLETE} is {instruction!r}; allowed: bash_source, zsh_source, fish_source"
        )
    return shell_complete(mobman, {}, "mobman", _COMPLETE, instruction)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    if level() >= 0:
        echo(f"mobman: warning: {' '.join(str(message).split())}", err=True)


def _by_lines(error: MobmanError) -> str | list[str]:
    """The message; in several lines, where it is of faults on lines of a file."""
    faults = error.faults if isinstance(error, SpecError) else ()
    if not isinstance(error, SpecError) or len(faults) < 2 or not any(map(_LINE.match, faults)):
        return str(error)
    more = [f"and {len(faults) - _MOST_FAULTS} more"] if len(faults) > _MOST_FAULTS else []
    return [f"{error.heading}: {len(faults)} faults", *faults[:_MOST_FAULTS], *more]


def _fail(message: str | list[str], status: int) -> None:
    first, *others = [message] if isinstance(message, str) else message
    echo(f"mobman: {_in_one_line(first)}", err=True)
    for other in others:
        echo(f"  {_in_one_line(other)}", err=True)
    sys.exit(status)


def _in_one_line(message: str) -> str:
    text = " ".join(message.split())
    if len(text) > _LONGEST:
        text = f"{text[:_LONGEST]}... ({len(text)} characters)"
    return text
