"""Python processes that start at once: copies of one that has imported the libraries before."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

Done = subprocess.CompletedProcess[str]

_SERVER = """
import importlib, json, os, runpy, signal, sys, traceback

prepare, *names = sys.argv[1:]
for name in names:
    importlib.import_module(name)
exec(prepare)

def run(words, cwd, environment, seconds):
    signal.alarm(seconds)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(cwd)
    if words[0] == "-c":
        sys.path[0], sys.argv = "", ["-c", *words[2:]]
        exec(compile(words[1], "<string>", "exec"), {"__name__": "__main__"})
    elif words[0] == "-m":
        sys.path[0], sys.argv = os.getcwd(), words[1:]
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    else:
        sys.path[0], sys.argv = os.path.dirname(os.path.abspath(words[0])), words
        runpy.run_path(words[0], run_name="__main__")

for line in sys.stdin:
    *asked, folder = json.loads(line)
    if not (child := os.fork()):
        status = 0
        for number, name in ((1, "out"), (2, "err")):
            os.dup2(os.open(os.path.join(folder, name), os.O_WRONLY | os.O_CREAT), number)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        try:
            run(*asked)
        except SystemExit as leave:
            status = leave.code or 0
            if not isinstance(status, int):
                print(status, file=sys.stderr)
                status = 1
        except BaseException:
            traceback.print_exc()
            status = 1
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(status)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


class Forks:
    """Runs what a command ``python ...`` would, in a copy of a process that has imported modules.

    What the copy does not do as that command would: read PYTHON* variables, and call what is
    registered to be called at the end of a process.

    Args:
        modules: What is imported.
        prepare: Code that is run then.
    """

    def __init__(self, *modules: str, prepare: str = "") -> None:
        self._server = subprocess.Popen(
            [sys.executable, "-c", _SERVER, prepare, *modules],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")},
        )

    def run(
        self,
        *words: object,
        cwd: str | os.PathLike[str] = ".",
        env: dict[str, str] | None = None,
        seconds: int = 600,
    ) -> Done:
        """Run a script, ``-c`` with its text or ``-m`` with its module, and the arguments.

        Args:
            words: These.
            cwd: Its working folder.
            env: Its environment, this process's by default.
            seconds: Time after which it is ended by SIGALRM.
        """
        texts, environment = [str(word) for word in words], dict(os.environ if env is None else env)
        assert self._server.stdin
        assert self._server.stdout
        with tempfile.TemporaryDirectory() as folder:
            asked = json.dumps([texts, str(Path(cwd).resolve()), environment, seconds, folder])
            print(asked, file=self._server.stdin, flush=True)
            status = int(self._server.stdout.readline())
            out, err = ((Path(folder) / name).read_text("utf-8") for name in ("out", "err"))
        return Done([sys.executable, *texts], status, out, err)

    def close(self) -> None:
        """End the process that is copied."""
        for stream in (self._server.stdin, self._server.stdout):
            assert stream
            stream.close()
        self._server.wait()


# Long runs do not compile their kernels together, as in tests/conftest.py.
SHORT_RUNS = "sys.modules['mobman.simulation.simulate']._MANY_TICKS = 10**6"


@contextlib.contextmanager
def forks_of(*modules: str, prepare: str = "") -> Iterator[Forks]:
    """Make :class:`Forks`, closed at the end."""
    forks = Forks(*modules, prepare=prepare)
    try:
        yield forks
    finally:
        forks.close()
