"""Robots that differ from the project's own in a field or two."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

from mobman.files import resource_folder

ROBOTS = resource_folder("robots")

ROLLING = """
import numpy as np


class Body:
    coordinates = ("base_x", "base_y", "base_theta", "phi_1", "phi_2")
    velocity_names = ("right", "left")
    root_offset = (0.0, 0.0, 0.05)
    R, W = 0.05, 0.158

    def constraint_matrix(self, x):
        c, s, R, W = np.cos(x[2]), np.sin(x[2]), self.R, self.W
        return np.array([[s, -c, 0, 0, 0], [c, s, W, -R, 0], [c, s, -W, 0, -R]])

    def velocity_map(self, x):
        c, s, h = np.cos(x[2]), np.sin(x[2]), self.R / 2
        turn = h / self.W
        return np.array([[h * c, h * c], [h * s, h * s], [turn, -turn], [1, 0], [0, 1]])
"""
"""The youBot's platform in Python, as the class ``Body``."""


def description(robot: str = "youbot", /, **changes: Any) -> dict[str, Any]:
    """A robot's TOML as a dictionary; ``platform__alpha="paper"`` changes ``[platform] alpha``.

    A value of None leaves the field out.
    """
    content = tomllib.loads((ROBOTS / f"{robot}.toml").read_text(encoding="utf-8"))
    content["folder"] = ROBOTS
    for path, value in changes.items():
        *tables, field = path.split("__")
        table = content
        for part in tables:
            table = table.setdefault(part, {})
        if value is None:
            table.pop(field)
        else:
            table[field] = copy.copy(value)
    return content


def youbot_urdf() -> str:
    """The text of the youBot's URDF."""
    return (ROBOTS / "youbot.urdf").read_text(encoding="utf-8")


def youbot_with_urdf(folder: Path, text: str, **changes: Any) -> dict[str, Any]:
    """The youBot on another URDF, written to ``folder``."""
    (folder / "changed.urdf").write_text(text, encoding="utf-8")
    return {**description(urdf__path="changed.urdf", **changes), "folder": folder}


def toml(content: dict[str, Any]) -> str:
    """A description as TOML: as much of the format as these tests need."""
    plain = {k: v for k, v in content.items() if not isinstance(v, dict) and k != "folder"}
    lines = [f"{key} = {_value(value)}" for key, value in plain.items()]
    for key, table in content.items():
        if isinstance(table, dict):
            lines += [f"[{key}]", *(f"{k} = {_value(v)}" for k, v in table.items())]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, (int, float)) else f'"{value}"'
