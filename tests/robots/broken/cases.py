"""What a case of the corpus is, and where the cases are kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from good_robot import GoodRobot


@dataclass(frozen=True)
class Case:
    """One way to break the good robot.

    Attributes:
        break_it: What breaks it.
        words: What the message must name: the file, the element or field, what was found, what is
            allowed.
        added: The same where the URDF itself is what a robot is made of, if that says something else:
            there xacro and MJCF are read, while the URDF that a description names must be one.
    """

    break_it: Callable[[GoodRobot], None]
    words: tuple[str, ...]
    added: tuple[str, ...] = ()

    def words_of(self, command: str) -> tuple[str, ...]:
        """What the message of a sub-command must name."""
        return self.added if command == "add" and self.added else self.words


class Corpus(dict[str, Case]):
    """Cases by the names of the functions that make them."""

    def case(
        self, *words: str, added: tuple[str, ...] = ()
    ) -> Callable[[Callable[[GoodRobot], None]], Callable[[GoodRobot], None]]:
        """Add the decorated function as a case whose message has these words."""

        def add(function: Callable[[GoodRobot], None]) -> Callable[[GoodRobot], None]:
            assert function.__name__ not in self
            self[function.__name__] = Case(function, words, added)
            return function

        return add


urdfs = Corpus()
"""The URDF is wrong."""
descriptions = Corpus()
"""The description (TOML) is wrong, or does not fit its URDF."""
meshes = Corpus()
"""The meshes are wrong, which only shows when the robot is to be seen."""
