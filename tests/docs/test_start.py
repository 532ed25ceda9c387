"""docs/start.md: its commands and its Python block, as they stand there, in an empty folder."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

PAGE = (Path(__file__).parents[2] / "docs" / "start.md").read_text(encoding="utf-8")
(BLOCK,) = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
COMMANDS = re.findall(r"^\$ mobman (.*)$", PAGE, re.MULTILINE)


def test_commands_run_and_the_page_is_there(tmp_path):
    assert len(COMMANDS) >= 3
    steps = [["-m", "mobman", *shlex.split(command)] for command in COMMANDS]
    for step in [*steps, ["-c", BLOCK]]:
        done = subprocess.run(
            [sys.executable, *step],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, (step, done.stderr)
    named = set(re.findall(r"[\w]+\.(?:h5|html|svg)", " ".join([*COMMANDS, BLOCK])))
    assert named == {path.name for path in tmp_path.iterdir()}
    assert (tmp_path / "runs.html").stat().st_size > 100_000
