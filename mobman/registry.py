"""Named things that are found by looking: one new file registers itself, nothing else changes."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
import warnings
from collections.abc import Callable
from functools import lru_cache
from importlib import metadata
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, Generic, TypeVar, overload

from mobman.errors import FOREIGN_ERRORS, UnknownNameError, UsageError

T = TypeVar("T")
D = TypeVar("D")


def entry_points(group: str) -> tuple[EntryPoint, ...]:
    """Find a group's entry points, once until a folder of ``sys.path`` changes: to read those of all
    packages takes some ten milliseconds."""
    return _entry_points(group, tuple((folder, _changed(folder)) for folder in sys.path))


@lru_cache(maxsize=32)
def _entry_points(group: str, folders: tuple[tuple[str, int], ...]) -> tuple[EntryPoint, ...]:
    return tuple(metadata.entry_points(group=group))


def _changed(folder: str) -> int:
    try:
        return Path(folder).stat().st_mtime_ns
    except OSError:
        return 0


def made_by(thing: Callable[..., Any], problem: str, *arguments: Any, **named: Any) -> Any:
    """Call what a user registered; UsageError, which begins with ``problem``, if it is not callable or
    does not take these arguments."""
    try:
        inspect.signature(thing).bind(*arguments, **named)
    except TypeError as error:
        raise UsageError(f"{problem}: {error}") from error
    except ValueError:  # some callables of other languages have no signature
        pass
    return thing(*arguments, **named)


class Registry(Generic[T]):
    """Names to things of one kind.

    The modules of ``package`` are imported at the first look-up and register what they define;
    installed packages add theirs by entry points of ``group``, loaded only when asked for. What is
    registered from elsewhere comes before both.

    Threads may look up and register at once: registering imports nothing, and Python has a lock for
    every module that a look-up imports.

    Args:
        kind: What the things are called in messages, for instance ``"controller"``.
        package: Package whose modules register themselves when imported.
        group: Entry-point group of third-party packages.
    """

    def __init__(self, kind: str, package: str, group: str | None = None) -> None:
        self.kind = kind
        self._package = package
        self._group = group
        self._own: dict[str, T] = {}  # of the package's modules
        self._items: dict[str, T] = {}  # registered from elsewhere
        self._broken: set[str] = set()  # other packages' that could not be loaded
        self._discovered = False

    @overload
    def register(self, name: str, *, module: str | None = None) -> Callable[[D], D]: ...
    @overload
    def register(self, name: str, item: T, *, module: str | None = None) -> T: ...
    def register(self, name: str, item: Any = None, *, module: str | None = None) -> Any:
        """Add ``item`` under ``name``, replacing what had the name; without it, return a decorator that
        adds what it decorates. ``module`` defines the thing, by default that of the caller."""
        module = module or str(sys._getframe(1).f_globals.get("__name__"))
        # a later import of the package's modules must not replace what others have registered
        table = self._own if module.startswith(f"{self._package}.") else self._items

        def add(thing: Any) -> Any:
            table[name] = thing
            return thing

        return add if item is None else add(item)

    def names(self) -> list[str]:
        """All names, sorted; third-party ones without loading their packages."""
        return sorted({*self.loaded(), *self._plugins()})

    def every(self) -> dict[str, T]:
        """All things by name; third-party ones that cannot be loaded are left out with one warning."""
        found = {}
        for name in self.names():
            if name not in self._broken:
                try:
                    found[name] = self.get(name)
                except UnknownNameError:
                    self._broken.add(name)
        return found

    def loaded(self) -> dict[str, T]:
        """The things of this process by name: third-party ones only if they were asked for."""
        self._discover()
        return {**self._own, **self._items}

    def own(self) -> dict[str, T]:
        """The things that come with mobman, by name."""
        self._discover()
        return dict(self._own)

    def get(self, name: str) -> T:
        """The thing of that name; UnknownNameError, with the nearest names, if there is none."""
        name = name if isinstance(name, str) else repr(name)
        if name not in self._items and name not in self._own:
            self._discover()
        if name not in self._items and name in self._own:
            return self._own[name]
        if name not in self._items and name in (plugins := self._plugins()):
            try:
                loaded = plugins[name].load()
                # what the package's own code registered is the thing: a decorator may give another
                self._items.setdefault(name, loaded)
            except FOREIGN_ERRORS as error:  # another package's fault must not take mobman down
                source = plugins[name].value
                message = f"{self.kind} {name!r} of {source} is left out: {error!r}"
                warnings.warn(message, stacklevel=2)
        if name not in self._items:
            # a broken package's name is no choice
            raise UnknownNameError(self.kind, str(name), set(self.names()) - {name})
        return self._items[name]

    def _plugins(self) -> dict[str, EntryPoint]:
        if self._group is None:
            return {}
        return {point.name: point for point in entry_points(group=self._group)}

    def _discover(self) -> None:
        if self._discovered:
            return
        package = importlib.import_module(self._package)
        for module in pkgutil.iter_modules(package.__path__, self._package + "."):
            importlib.import_module(module.name)
        # not before: another thread would take some of them for all
        self._discovered = True
