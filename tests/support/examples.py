"""Python blocks and commands of a documentation page, in its order: each block by itself."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

from support.forked import SHORT_RUNS, Done, Forks

ROOT = Path(__file__).parents[2]
SHELL, NOT_RUN = {"bash", "console", "sh"}, {"bibtex", "text", "toml"}
"""Languages of blocks that have commands, and of those that are not run."""
_FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"# (\w+\.py)\b")

# What other tests run, or what sets a machine up: beginnings of commands.
ELSEWHERE = {
    "make": "tests/test_make_targets.py",
    "dask scheduler": "tests/benchmark/running/test_cluster.py",
    "dask worker": "tests/benchmark/running/test_cluster.py",
    **dict.fromkeys(("git clone", "pip install", "python -m pip", "python3 -m venv"), ""),
}

# bash says which commands a block has: it finds no program, and calls this in its place.
_BASH = r"""
exec 3>&1; PATH=/dev/null; cd() { :; }; source() { :; }; .() { :; }
command_not_found_handle() {
    printf '%q ' ${_MOBMAN_COMPLETE:+_MOBMAN_COMPLETE=$_MOBMAN_COMPLETE} "$@" >&3; echo >&3
}
"""


@dataclass(frozen=True)
class Block:
    """A block of a page, and the line that it begins on."""

    page: Path
    line: int
    language: str
    text: str

    @property
    def place(self) -> str:
        return f"{self.page.name}, line {self.line}"

    def commands(self) -> list[list[str]]:
        """The words of each command of a shell's block, as bash reads them; none of another block."""
        if self.language not in SHELL:
            return []
        script = re.sub(r"^\$ ", "", self.text, flags=re.MULTILINE)
        bash = subprocess.run(["bash", "-c", _BASH + script], capture_output=True, text=True)
        assert not bash.stderr, f"{self.place}: {bash.stderr}"
        return [shlex.split(line) for line in bash.stdout.splitlines()]


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page."""
    text = page.read_text(encoding="utf-8")
    found = [
        Block(page, text[: fenced.start(3)].count("\n") + 1, fenced[2], textwrap.dedent(fenced[3]))
        for fenced in _FENCE.finditer(text)
    ]
    assert len(re.findall("^ *```", text, re.MULTILINE)) == 2 * len(found), page
    return found


def run_block(block: Block, folder: Path, forks: Forks) -> None:
    """Run a Python block as a script, or each command of a shell's, in a folder.

    A script whose first line is ``# NAME.py`` is kept under that name, for others to import.
    """
    if block.language == "python":
        named = _FILE.match(block.text)
        file = folder / (named[1] if named else f"{block.page.stem}_{block.line}.py")
        # on the lines that it has in the page
        file.write_text("\n" * (block.line - 1) + block.text, encoding="utf-8")
        _check(forks.run(file, cwd=folder), block.place)
    elif block.language in SHELL:
        for words in block.commands():
            if not any(shlex.join(words).startswith(other) for other in ELSEWHERE):
                _check(_run(words, folder, forks), f"{block.place}: {shlex.join(words)}")
    else:
        assert block.language in NOT_RUN, f"{block.place}: of which language is this block?"


def _check(done: Done, place: str) -> None:
    no_browser = "need Chromium or Chrome, and there is none" in done.stderr  # it is optional
    assert done.returncode == 0 or no_browser, (
        f"{place} fails by itself:\n{done.stdout}{done.stderr}"
    )


# Commands in a shorter time ----------------------------------------------------------------------


def _run(words: list[str], folder: Path, forks: Forks) -> Done:
    environment = dict(word.split("=", 1) for word in words if word.startswith("_MOBMAN_COMPLETE="))
    program, *arguments = words[len(environment) :]
    environment |= {**os.environ, "XDG_DATA_HOME": str(folder / "home")}
    if program == "python":
        return forks.run(ROOT / arguments[0], *arguments[1:], "--seconds", "0.1", cwd=folder)
    assert program == "mobman", f"no test runs {shlex.join(words)}"
    code = "import support.examples; support.examples.main()"
    return forks.run("-c", code, *shortened(arguments), cwd=folder, env=environment)


def shortened(words: list[str]) -> list[str]:
    """A command with runs of 20 ms and small pictures, which opens no page, nor writes elsewhere."""
    words = [word.replace("/tmp/", "") for word in words]
    if words[:1] == ["run"]:
        words += ["--duration", "0.02"]
    if "--live" in words or "--live-speed" in words or words[:1] == ["view"]:
        words += ["--no-browser"]
    if words[:1] == ["view"]:
        words += ["--size", "160x90"]
    if "--time" in words:
        words[words.index("--time") + 1] = "0.01"
    return words


def prepared() -> str:
    """Code for the process that is copied: suites with names are short."""
    return (
        f"{SHORT_RUNS}\nsys.path.append({str(ROOT / 'tests')!r})\n"
        "import support.examples; support.examples.shorten_suites()"
    )


def shorten_suites() -> None:
    """Let suites with names have one robot, one task, two laws, two scenarios and runs of 20 ms."""
    from mobman.benchmark import suite as module

    load = module.load_suite

    def short(name: str) -> module.Suite:
        suite = load(name)
        if str(name).endswith(".toml"):
            return suite
        content = suite.model_dump(by_alias=True, exclude_unset=True)
        for key in ("placements", "first_placement", "seeds", "overrides"):
            content.pop(key, None)
        group = content["groups"][0]
        for key in ("duration", "placements", "seeds"):
            group.pop(key, None)
        group |= {key: group[key][:1] for key in ("robots", "tasks")}
        group["scenarios"] = group.get("scenarios", ["nominal"])[:2]
        group["controllers"] = ["tsm", "pseudo-inverse"]
        gains = group.get("gains", {})
        group["gains"] = {label: gains[label] for label in group["controllers"] if label in gains}
        content |= {"duration": 0.02, "groups": [group]}
        content["tuning"] = {"trials": 1, "duration": 0.02}
        small = module.Suite.model_validate(content)
        vars(small)["lines"] = vars(suite)["lines"]
        return small

    module.load_suite = short


def main() -> None:
    """The command line: suites run in this process, figures of reports are empty files, and what waits
    for Ctrl-C gets it at once."""
    from mobman.benchmark import backends, runner, workers
    from mobman.benchmark.tuning import tune
    from mobman.cli import run, view
    from mobman.cli.main import main as command
    from mobman.figures import files

    class Interrupted:
        def wait(self) -> None:
            raise KeyboardInterrupt

    run.threading = view.threading = SimpleNamespace(Event=Interrupted)
    runner.Local = tune.Local = lambda *_: backends.Backend(ThreadPoolExecutor(1))
    files.drawn = files.printed = lambda *_, **options: b""
    runner.Cluster = lambda _, jobs: backends.Cluster(_cluster(), jobs)
    workers.start_ahead = lambda: None
    sys.argv[0] = "mobman"
    command()


def _cluster() -> str:
    """The address of a cluster in this process."""
    from distributed import LocalCluster

    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False}
    return LocalCluster(**options, dashboard_address=None).scheduler_address
