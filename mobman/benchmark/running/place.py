"""Where runs are done: what the loop over them needs to know of it."""

from __future__ import annotations

import pickle
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from types import TracebackType
from typing import Any, Self

from mobman.benchmark.running.job import Job, Result
from mobman.benchmark.running.parcel import Parcel


class Place(ABC):
    """Workers that jobs are given to; a context, at whose end none is left behind."""

    blames_exactly = True
    """Whether work whose worker died is the only work that the worker had."""

    @abstractmethod
    def slots(self) -> int:
        """How many runs can be in progress now; 0 if there is nobody to do them.

        Raises:
            MobmanError: If the place is lost.
        """

    @abstractmethod
    def submit(self, job: Job) -> Future[Result]:
        """Have a job done.

        Raises:
            BrokenExecutor: If nothing more can be done here; see :meth:`renew`.
        """

    @abstractmethod
    def loss(self, error: BaseException) -> str | None:
        """In words, how the worker that had a job was lost; None if the error is another."""

    def renew(self, error: BaseException) -> None:
        """Go on after the place broke as a whole.

        Raises:
            MobmanError: If there is no way to.
        """
        raise error

    def dumps(self) -> Callable[[Any], bytes]:
        """What pickles things for the workers."""
        return pickle.dumps

    def prepare(self, parcels: Sequence[Parcel]) -> None:
        """Is told what will be sent.

        Raises:
            MobmanError: If the workers cannot use it.
        """
        return

    @property
    def waits_for(self) -> str:
        """What is missing while there are no slots."""
        return "there are no workers"

    @abstractmethod
    def __enter__(self) -> Self: ...

    @abstractmethod
    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...
