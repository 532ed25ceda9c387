"""What is wrong with a suite, all of it at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from mobman.errors import MobmanError, SpecError

T = TypeVar("T")


class Problems:
    """Collects faults, each once and in the order in which they are met."""

    def __init__(self) -> None:
        self._found: dict[str, None] = {}

    def note(self, problem: str) -> None:
        """Add one, with its place in the suite."""
        self._found[problem] = None

    def attempt(
        self, where: str, function: Callable[..., T], /, *arguments: Any, **options: Any
    ) -> T | None:
        """What a function returns; None, with its error noted, if it raises one of mobman's.

        Args:
            where: The place in the suite, which the note begins with.
            function: The function.
            *arguments: Its arguments.
            **options: The same.
        """
        try:
            return function(*arguments, **options)
        except MobmanError as error:
            told = str(error)
            self.note(told if told.startswith(f"{where}:") else f"{where}: {told}")
            return None

    def require_none(self, suite: str) -> None:
        """
        Args:
            suite: The suite's name.

        Raises:
            SpecError: With all that was noted, if anything was.
        """
        if self._found:
            raise SpecError(f"suite {suite!r}: " + "; ".join(self._found))
