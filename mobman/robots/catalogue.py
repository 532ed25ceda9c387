"""The catalogue of robots: mobman's own, those registered by the user, and other packages'."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields
from functools import lru_cache, partial
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

from mobman.errors import FOREIGN_ERRORS, SpecError, UnknownNameError, UsageError
from mobman.registry import entry_points
from mobman.robots.incoming.describe import describe
from mobman.robots.incoming.incoming import URDF_ENDINGS
from mobman.robots.infer.findings import Options, Undecided
from mobman.robots.spec import RobotSpec, own_robots, read_spec, user_robots_folder
from mobman.toml_model import validate

_GROUP = "mobman.robots"
_registered: dict[str, RobotSpec] = {}
_loaded: dict[EntryPoint, RobotSpec | None] = {}


def list_robots() -> list[str]:
    """The names that :func:`load_robot` takes, sorted; packages' robots without loading them, less those
    that could not be loaded.

    >>> import mobman as mm
    >>> "youbot" in mm.list_robots()
    True
    """
    return sorted(_known())


def origin_of(name: str) -> str:
    """The origin of a listed robot: ``"mobman"``, ``"this process"``, a package or ``"user"``."""
    return _known()[name][0]


def register_robot(spec_or_path: RobotSpec | Mapping[str, Any] | str | os.PathLike[str]) -> str:
    """Make a robot known under its name, for this process; again to replace it.

    Args:
        spec_or_path: A :class:`RobotSpec`, a dictionary of its fields, or a TOML file. It goes before
            any other robot of its name.

    >>> import mobman as mm
    >>> spec = mm.load_robot("youbot").spec
    >>> mm.register_robot(spec.model_copy(update={"name": "mine"}))
    'mine'
    >>> mm.load_robot("mine").nz
    5

    Returns:
        The robot's name.

    Raises:
        SpecError: If the description is not valid.
    """
    spec = as_spec(spec_or_path)
    _registered[spec.name] = spec
    return spec.name


def as_spec(spec_or_path: RobotSpec | Mapping[str, Any] | str | os.PathLike[str]) -> RobotSpec:
    """A description from whatever form the user has it in; a string is a file's path."""
    if isinstance(spec_or_path, RobotSpec):
        return spec_or_path
    if isinstance(spec_or_path, Mapping):
        content = {"folder": Path.cwd(), **spec_or_path}
        return validate(RobotSpec, content, f"robot {spec_or_path.get('name', '')!r}")
    if not isinstance(spec_or_path, (str, os.PathLike)):
        raise UsageError(f"{spec_or_path!r} is not a robot: expected a description or a TOML file")
    return read_spec(Path(spec_or_path))


def registered_as(described: Mapping[str, Any]) -> RobotSpec:
    """The registered robot of a description in a record, whose platform is Python code; SpecError if
    none has both the name and the description: a file of unknown origin does not get to run code."""
    name = described.get("name")
    if name in list_robots():  # it is a name alone, never a path
        spec = find_spec(str(name))
        if spec.model_dump(mode="json", by_alias=True) == described:
            return spec
    code = described["platform"].get("definition")
    raise SpecError(
        f"its platform is Python code, {code!r}, which the file does not hold; register the robot "
        f"{name!r} with the description of the run, or, to run it again, name it with --robot FILE"
    )


def find_spec(
    name_or_path: str | os.PathLike[str], made_of: str = "", /, **facts: Any
) -> RobotSpec:
    """The description of a robot by name, or of a TOML file by path.

    Anything that ends in ``.toml`` or has a path separator is a path. A URDF, a xacro file, a folder or
    an archive with one serves as well: what its TOML would say is inferred, and said in a warning.

    Of a URDF ``facts`` are what is not to be inferred, fields of :class:`Options`; messages name what it
    was ``made_of`` in its place. UnknownNameError if no robot has the name, SpecError if the description
    is not valid, UsageError if a URDF does not tell enough.
    """
    if not isinstance(name_or_path, (str, os.PathLike)):
        raise UsageError(f"{name_or_path!r} is not a robot: expected a name or a TOML file")
    text = os.fspath(name_or_path)
    if text.lower().endswith(URDF_ENDINGS) or (os.sep in text and os.path.isdir(text)):
        stamp = (0, 0)  # another one when the file has changed
        with suppress(OSError, ValueError):
            status = os.stat(text)
            stamp = (status.st_mtime_ns, status.st_size)
        place = text if "://" in text else os.path.abspath(text)  # an address is refused as one
        return _inferred(place, stamp, _options(facts), made_of)
    if facts:
        raise UsageError(f"{', '.join(facts)}: only for a URDF or a model; {text!r} is neither")
    if text.endswith(".toml") or os.sep in text or not isinstance(name_or_path, str):
        return read_spec(Path(text))
    if text in (known := _known()) and (spec := known[text][1]()) is not None:
        # by which it is found, whatever its field says
        return spec.model_copy(update={"name": text})
    # a broken package's name is no choice
    raise UnknownNameError("robot", text, set(list_robots()) - {text})


def _options(facts: Mapping[str, Any]) -> Options:
    """Facts as options; a name alone stands for a list of it."""
    allowed = {field.name: field for field in fields(Options) if field.name != "types"}
    if unknown := sorted(set(facts) - set(allowed)):
        raise UsageError(f"{unknown[0]!r} is no fact of a URDF; allowed: {', '.join(allowed)}")
    listed = {}
    for name, value in facts.items():
        if allowed[name].default == ():
            several = isinstance(value, Iterable) and not isinstance(value, str)
            listed[name] = tuple(value) if several else (value,)
    options = Options(**{**facts, **listed})
    options.check()
    return options


@lru_cache(maxsize=64)
def _inferred(path: str, stamp: tuple[int, int], options: Options, made_of: str) -> RobotSpec:
    """The description of a URDF, inferred and reported once for each state of the file."""
    try:
        robot = describe(path, options, made_of=made_of)
    except Undecided as error:
        raise UsageError(f"{error}; 'mobman robots add {path}' takes these options") from error
    facts = robot.found.summary()
    wheels = f", wheels {', '.join(facts['wheels'])}" if facts["wheels"] else ""
    radius = "" if facts["wheel_radius"] is None else f" of {facts['wheel_radius']:.4g} m"
    locked = f"{len(facts['locked'])} joints locked"
    said = (*(f"uncertain: {doubt}" for doubt in robot.found.uncertain), *robot.warnings)
    warnings.warn(
        f"{made_of or os.path.basename(path)} is taken as robot {robot.name!r}: {facts['platform']} "
        f"platform{wheels}{radius}, arm of {len(facts['arm_joints'])} joints, tip {facts['tip']}, "
        f"{'; '.join((locked, *said))}; 'mobman robots add {path}' writes it down, to be read and "
        "changed",
        stacklevel=4,
    )
    return robot.spec()


def _known() -> dict[str, tuple[str, Callable[[], RobotSpec | None]]]:
    """The origin of every robot by its name, and what gives its description; of several of one name that
    of this process, mobman's, the user's, or a package's, in this order."""
    found: dict[str, tuple[str, Callable[[], RobotSpec | None]]] = {}
    for point in entry_points(group=_GROUP):
        if _loaded.get(point, point) is not None:
            package = point.value.partition(":")[0].partition(".")[0]
            found[point.name] = package, partial(_load_plugin, point)
    users = {path.stem: path for path in user_robots_folder().glob("*.toml")}
    for origin, files in (("user", users), ("mobman", own_robots())):
        found |= {name: (origin, partial(read_spec, path)) for name, path in files.items()}
    own = {name: partial(_registered.__getitem__, name) for name in _registered}
    return found | {name: ("this process", spec) for name, spec in own.items()}


def _load_plugin(point: EntryPoint) -> RobotSpec | None:
    """The robot of a package, loaded once; None and one warning if that fails."""
    if point not in _loaded:
        try:
            found = point.load()
            _loaded[point] = as_spec(found() if callable(found) else found)
        except FOREIGN_ERRORS as error:  # another package's fault must not take mobman down
            why = f"robot {point.name!r} of {point.value} is left out: {error!r}"
            warnings.warn(why, stacklevel=3)
            _loaded[point] = None
    return _loaded[point]
