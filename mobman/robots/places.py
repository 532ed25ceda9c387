"""Folders of robots' files: mobman's own, and the user's."""

from __future__ import annotations

from pathlib import Path

import platformdirs

from mobman.files import resource_folder


def own_robots() -> dict[str, Path]:
    """The robots that come with mobman: their files by name."""
    return {path.stem: path for path in sorted(resource_folder("robots").glob("*.toml"))}


def user_robots_folder() -> Path:
    """The folder of robots that the user added, in the user's data directory; it need not exist."""
    return platformdirs.user_data_path("mobman", appauthor=False) / "robots"


def made_folder() -> Path:
    """The folder of URDFs that were made from something else, in the user's data directory."""
    return platformdirs.user_data_path("mobman", appauthor=False) / "made"
