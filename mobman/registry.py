"""Named things that are found by looking: one new file registers itself, nothing else changes."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import warnings
from importlib.metadata import entry_points
from typing import Generic, TypeVar

from mobman.errors import FOREIGN_ERRORS, UnknownNameError

T = TypeVar("T")


class Registry(Generic[T]):
    """Names to things of one kind.

    The modules of ``package`` are imported at the first look-up and register what they define;
    installed packages add theirs by entry points of ``group``, loaded only when asked for.

    Threads may look up at once, also for the first time: each imports what it needs, for which Python
    has a lock for every module, and none waits for anything else.

    Args:
        kind: What the things are called in messages, for instance ``"controller"``.
        package: Package whose modules register themselves when imported.
        group: Entry-point group of third-party packages.
    """

    def __init__(self, kind: str, package: str, group: str | None = None) -> None:
        self.kind = kind
        self._package = package
        self._group = group
        self._items: dict[str, T] = {}
        self._discovered = False

    def register(self, name: str, item: T) -> T:
        """Add ``item`` under ``name``, replacing what had the name."""
        if not self._imports():
            self._discover()  # or what it finds would replace the item later
        self._items[name] = item
        return item

    def names(self) -> list[str]:
        """All names, sorted; third-party ones without loading their packages."""
        self._discover()
        return sorted({*self._items, *self._plugins()})

    def loaded(self) -> dict[str, T]:
        """The things of this process by name: third-party ones only if they were asked for."""
        self._discover()
        return dict(self._items)

    def get(self, name: str) -> T:
        """The thing of that name.

        Raises:
            UnknownNameError: If there is none; the message gives the nearest names.
        """
        self._import_namesake(name)
        if name in self._items:
            return self._items[name]
        self._discover()
        if name not in self._items and name in (plugins := self._plugins()):
            try:
                self._items[name] = plugins[name].load()
            except FOREIGN_ERRORS as error:  # another package's fault must not take mobman down
                warnings.warn(
                    f"{self.kind} {name!r} of {plugins[name].value} is left out: {error!r}",
                    stacklevel=2,
                )
        if name not in self._items:
            # a broken package's name is no choice
            raise UnknownNameError(self.kind, str(name), set(self.names()) - {name})
        return self._items[name]

    def _plugins(self) -> dict:  # type: ignore[type-arg]
        if self._group is None:
            return {}
        return {point.name: point for point in entry_points(group=self._group)}

    def _import_namesake(self, name: str) -> None:
        """Import the module that is called as the thing, if there is one: most often the right one."""
        module = str(name).replace("-", "_")
        if self._discovered or not module.isidentifier():
            return
        try:
            importlib.import_module(f"{self._package}.{module}")
        except ModuleNotFoundError as error:
            if error.name != f"{self._package}.{module}":
                raise

    def _imports(self) -> bool:
        """Whether this thread is importing a module of the package.

        To import the others on the way would let two threads wait for each other's.
        """
        frame = inspect.currentframe()
        while frame is not None:
            name = str(frame.f_globals.get("__name__"))
            if frame.f_code.co_name == "<module>" and name.startswith(self._package + "."):
                return True
            frame = frame.f_back
        return False

    def _discover(self) -> None:
        if self._discovered:
            return
        package = importlib.import_module(self._package)
        for module in pkgutil.iter_modules(package.__path__, self._package + "."):
            importlib.import_module(module.name)
        # not before: another thread would take some of them for all
        self._discovered = True
