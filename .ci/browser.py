"""Install a browser for pictures, films and the viewer's tests, if there is none: ``make browser``.

With ``--dry-run``, print the commands and run none of them.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys

from mobman.viewer.page import BrowserError, BrowserMissingError, browser

Commands = list[list[str]]


def ways(root: bool, apt: str | None) -> list[Commands]:
    """Ways to install a browser, the preferred one first; each is a sequence of commands.

    Args:
        root: Whether this user may install system packages.
        apt: The program apt-get; None if there is none.
    """
    playwright = [sys.executable, "-m", "playwright", "install"]
    if root and apt is not None:
        # Ubuntu has no such package; playwright then installs the libraries of its own browser
        system = [[apt, "update", "-qq"], [apt, "install", "-y", "-qq", "chromium"]]
        return [system, [[*playwright, "--with-deps", "chromium"]]]
    return [[[*playwright, "chromium"]]]


def found() -> str | None:
    """The version of the browser that is there; None if there is none.

    Raises:
        BrowserError: If there is one that does not start.
    """
    try:
        with browser() as running:
            return f"{running.browser_type.name} {running.version}"
    except BrowserMissingError:
        return None


def main(arguments: list[str]) -> int:
    """Install a browser unless there is one; the exit status."""
    try:
        if (version := found()) is not None:
            print(f"browser: {version} is installed")
            return 0
        environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
        for commands in ways(os.geteuid() == 0, shutil.which("apt-get")):
            print(
                "browser: " + " && ".join(shlex.join(command) for command in commands), flush=True
            )
            if "--dry-run" in arguments:
                return 0
            if all(
                subprocess.run(command, env=environment, stdin=subprocess.DEVNULL).returncode == 0
                for command in commands
            ):
                break
        version = found()
    except BrowserError as error:
        print(f"browser: {error}", file=sys.stderr)
        return 1
    if version is None:
        print("browser: none could be installed", file=sys.stderr)
        return 1
    print(f"browser: {version} is installed")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
