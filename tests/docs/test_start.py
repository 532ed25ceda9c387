"""docs/start.md: its commands, as they stand there, in an empty folder."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

PAGE = (Path(__file__).parents[2] / "docs" / "start.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^\$ mobman (.*)$", PAGE, re.MULTILINE)


def test_commands_run_and_the_page_is_there(tmp_path):
    assert len(COMMANDS) >= 3
    for command in COMMANDS:
        words = shlex.split(command)
        done = subprocess.run(
            [sys.executable, "-m", "mobman", *words],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, (command, done.stderr)
        for word in words:
            if word.endswith((".h5", ".html")):
                assert (tmp_path / word).is_file(), command
    assert (tmp_path / "runs.html").stat().st_size > 100_000
