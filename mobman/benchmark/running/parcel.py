"""Things that many runs need, sent with each of them at little cost."""

from __future__ import annotations

import hashlib
import pickle
from collections import OrderedDict
from collections.abc import Callable
from threading import Lock
from typing import Any

from mobman.errors import MobmanError

_KEPT = 256  # opened parcels in a process; laws and tasks are small
_opened: OrderedDict[str, Any] = OrderedDict()
_lock = Lock()


class Parcel:
    """A thing that is pickled once, however often it is sent, and unpickled once in each process.

    Args:
        name: What it is, for messages: ``"law 'tsm'"``.
        thing: The thing.
        dumps: What pickles it.
    """

    def __init__(self, name: str, thing: Any, dumps: Callable[[Any], bytes] = pickle.dumps) -> None:
        self.name = name
        self._thing = thing
        self._dumps = dumps
        self._packed: bytes | None = None

    def pack(self) -> bytes:
        """The thing, pickled.

        Raises:
            MobmanError: If it cannot be.
        """
        if self._packed is None:
            try:
                self._packed = self._dumps(self._thing)
            except Exception as error:  # whatever the thing's own methods raise, too
                raise MobmanError(
                    f"{self.name} cannot be sent to another process ({_short(error)}); define it at "
                    "the top level of a module"
                ) from error
        return self._packed

    def pack_anew(self) -> None:
        """Forget how it was pickled, since the means have changed."""
        self._packed = None

    def open(self) -> Any:
        """The thing.

        Raises:
            MobmanError: If this process lacks what it is made of.
        """
        return self._thing

    def __reduce__(self) -> tuple[Any, ...]:
        packed = self.pack()
        return _Received, (self.name, hashlib.sha256(packed).hexdigest(), packed)


class _Received(Parcel):
    """A parcel in the process that it was sent to."""

    def __init__(self, name: str, key: str, packed: bytes) -> None:
        self.name = name
        self._key = key
        self._packed = packed

    def open(self) -> Any:
        with _lock:
            if self._key in _opened:
                _opened.move_to_end(self._key)
                return _opened[self._key]
        assert self._packed is not None
        try:
            thing = pickle.loads(self._packed)
        except Exception as error:  # what unpickling runs may raise anything
            raise MobmanError(
                f"{self.name} cannot be had on the worker ({_short(error)}); install there what "
                "defines it"
            ) from error
        with _lock:
            _opened[self._key] = thing
            if len(_opened) > _KEPT:
                _opened.popitem(last=False)
        return thing

    def __reduce__(self) -> tuple[Any, ...]:
        return _Received, (self.name, self._key, self._packed)


def _short(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
