"""The generated pages: the API from docstrings, the command line from click, files from their models."""

from __future__ import annotations

import ast
import importlib
import inspect
import json
import re
import tempfile
import textwrap
import types
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import h5py
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

import mobman as mm
from mobman.benchmark.suite import Suite
from mobman.robots.spec import RobotSpec
from mobman.simulation.scenario import GROUPS as GROUPS_OF_PIECES
from mobman.simulation.scenario import Scenario
from mobman.toml_model import Strict

GROUPS = {
    "robots": ("Robots", ("robots", "model")),
    "laws": ("Laws and tasks", ("controllers", "tasks")),
    "runs": ("Runs and scenarios", ("simulation",)),
    "suites": ("Suites and their results", ("benchmark",)),
    "others": ("Viewer and errors", ("viewer", "errors")),
}
"""Page, heading and packages of the public names."""
EXTENSIONS = {
    "A law's gains": ("mobman.controllers.gains.gain", "mobman.controllers.gains.as_settings"),
    "What a fast law is made of": (
        "mobman.compiled.kernel",
        "mobman.compiled.bind",
        "mobman.controllers.task_errors.TaskSpace",
        "mobman.controllers.baselines.ResolvedAcceleration",
    ),
    "Tasks": ("mobman.tasks.task.parameter", "mobman.tasks.task.tasks"),
    "Platforms": ("mobman.model.platforms.platform.Platform",),
    "Criteria": ("mobman.model.criterion.Criterion", "mobman.model.criterion.Term"),
    "Pieces of scenarios": (
        "mobman.simulation.pieces.Piece",
        "mobman.simulation.pieces.Setting",
    ),
    "Metrics": ("mobman.simulation.metrics.metric", "mobman.simulation.metrics.Run"),
    "Checks of robots": ("mobman.checks.checks.check", "mobman.checks.checks.Subject"),
    "Learned policies": ("mobman.bridges.policy.PolicyController",),
    "Registries": ("mobman.registry.Registry",),
}
"""What own laws, tasks and the like build on."""


def write_reference(folder: Path) -> None:
    """Write the generated pages into a folder of the site's sources."""
    folder.mkdir()
    made = {f"api_{page}.rst": _api(page) for page in GROUPS}
    made["api_extending.rst"] = _extending()
    made["command_line.rst"] = COMMANDS
    made["robot_file.md"] = _robot_file()
    made["suite_file.md"] = _suite_file()
    made["scenario_file.md"] = _scenario_file()
    made["record_file.md"] = _record_file()
    for name, text in made.items():
        (folder / name).write_text(text, encoding="utf-8")


def _api(page: str) -> str:
    heading, packages = GROUPS[page]
    names = [
        name
        for name in mm.__all__
        if name != "__version__" and getattr(mm, name).__module__.split(".")[1] in packages
    ]
    text = _heading(heading) + "Public names, as ``import mobman as mm`` offers them.\n\n"
    return text + "".join(_automatic(f"mobman.{name}") for name in names)


def _extending() -> str:
    text = _heading("For your own additions") + (
        "What own laws, tasks, platforms and the like are made from; "
        ":doc:`how to add each thing </contributing>` says where they go.\n\n"
    )
    for heading, names in EXTENSIONS.items():
        text += _heading(heading, "-") + "".join(map(_automatic, names))
    return text


def _automatic(name: str) -> str:
    """The directive for an object by its full name."""
    module, _, last = name.rpartition(".")
    thing = getattr(importlib.import_module(module), last)
    if inspect.isclass(thing):
        return f".. autoclass:: {name}\n   :members:\n   :inherited-members: BaseModel\n\n"
    kind = "function" if inspect.isroutine(thing) else "data"
    return f".. auto{kind}:: {name}\n\n"


def _heading(text: str, mark: str = "=") -> str:
    return f"{text}\n{mark * len(text)}\n\n"


COMMANDS = (
    _heading("Commands")
    + """Every command with its options; :doc:`command line </command_line>` says what is common to them.

.. click:: mobman.cli.main:mobman
   :prog: mobman
   :nested: full
"""
)


# Files ----------------------------------------------------------------------------------------


def _robot_file() -> str:
    return (
        "# Robot file\n\nThe fields of a robot's TOML file, from the model that reads it. "
        "[Robots](../robots.md) shows one; the fields of each type of platform are in "
        "[Platforms](../platforms.md).\n\n" + "".join(_tables(RobotSpec, "The file"))
    )


def _suite_file() -> str:
    return (
        "# Suite file\n\nThe fields of a suite's TOML file, from the model that reads it. "
        "[Suites](../suites.md) shows one.\n\n" + "".join(_tables(Suite, "The file"))
    )


def _scenario_file() -> str:
    text = (
        "# Scenario file and its pieces\n\nThe fields of a scenario, from the model that reads "
        "it, and those of each type of piece. [Scenarios](../scenarios.md) explains them.\n\n"
    )
    text += _table(Scenario, "The file")
    for name, (_, kinds) in GROUPS_OF_PIECES.items():
        text += f"## {name}\n\n"
        for kind, piece in sorted(kinds.own().items()):
            text += _table(piece, f"`{kind}`", level=3)
    return text


def _record_file() -> str:
    record = mm.simulate(
        "youbot",
        mm.make_controller("tsm", a=0.2, A=0.2),
        "paper",
        duration=0.005,
        monitor=True,
    )
    text = (
        "# Record of a run\n\nThe HDF5 file of a run, as a run of `tsm` with monitors leaves it; "
        "[results](../results.md) says how to read it, and what each attribute means.\n\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        record.save(path)
        with h5py.File(path) as file:
            text += _rows(
                "Attributes",
                ("attribute", "example"),
                [(f"`{name}`", f"`{_short(value)}`") for name, value in file.attrs.items()],
            )
            found: list[tuple[str, ...]] = []
            file.visititems(lambda name, item: found.append(_dataset(name, item)))
            text += _rows(
                "Datasets",
                ("dataset", "type", "along", "units", "content"),
                [r for r in found if r],
            )
            text += _rows(
                "Metrics",
                ("attribute of `metrics`", "example"),
                [(f"`{name}`", f"{value:.4g}") for name, value in file["metrics"].attrs.items()],
            )
    return text


def _dataset(name: str, item: h5py.Dataset | h5py.Group) -> tuple[str, ...]:
    if not isinstance(item, h5py.Dataset) or name.startswith("urdf/"):
        return ()
    along = [next(iter(dimension.values())).name[1:] for dimension in item.dims if len(dimension)]
    described = (str(item.attrs.get(key, "")) for key in ("units", "description"))
    kind = "text" if h5py.check_string_dtype(item.dtype) else str(item.dtype)
    return (f"`{name}`", kind, ", ".join(f"`{a}`" for a in along), *map(_cell, described))


def _short(value: Any) -> str:
    text = str(value)
    return _cell(text if len(text) <= 60 else text[:57] + "...")


def _tables(model: type[BaseModel], heading: str) -> Iterator[str]:
    """Tables of a model and of those that its fields hold, each once, outermost first."""
    waiting, done = [(model, heading)], set()
    while waiting:
        model, heading = waiting.pop(0)
        if model in done:
            continue
        done.add(model)
        yield _table(model, heading)
        for name, field in model.model_fields.items():
            place = name if heading == "The file" else f"{heading.strip('`')}.{name}"
            waiting += [(inner, f"`{place}`") for inner in _models(field.annotation)]


def _table(model: type[BaseModel], heading: str, level: int = 2) -> str:
    rows = []
    for name, field in model.model_fields.items():
        if field.exclude:
            continue
        required = field.is_required()
        default = "required" if required else f"`{_default(field)}`"
        allowed = "".join(f", {_cell(str(limit))}" for limit in _limits(field))
        rows.append(
            (
                f"`{field.alias or name}`",
                f"{_cell(_type(field.annotation))}{allowed}",
                default,
                _meaning(model, name),
            )
        )
    said = _markdown(model.__doc__ or "").partition("\n\n")[0].replace("\n", " ")
    if not rows:
        return f"{'#' * level} {heading}\n\n{said}\n\n"
    return _rows(heading, ("field", "type", "default", "meaning"), rows, said, level)


def _rows(
    heading: str,
    headings: tuple[str, ...],
    rows: list[tuple[str, ...]],
    said: str = "",
    level: int = 2,
) -> str:
    lines = [headings, ("---",) * len(headings), *rows]
    table = "".join("| " + " | ".join(line) + " |\n" for line in lines)
    return f"{'#' * level} {heading}\n\n{said}\n\n{table}\n"


def _models(annotation: Any) -> list[Any]:
    """The models that a type holds."""
    if isinstance(annotation, type) and issubclass(annotation, Strict):
        return [annotation]
    return [found for inner in get_args(annotation) for found in _models(inner)]


def _type(annotation: Any) -> str:
    """A type as a reader of TOML would call it."""
    inner = get_args(annotation)
    origin = get_origin(annotation)
    if origin in (Union, types.UnionType):
        return " or ".join(_type(kind) for kind in inner if kind is not type(None))
    if origin is Annotated:
        return _type(inner[0])
    if origin is Literal:
        return ", ".join(json.dumps(value) for value in inner)
    if origin in (list, tuple):
        number = f"{len(inner)} " if origin is tuple and Ellipsis not in inner else ""
        return f"list of {number}{_type(inner[0])}"
    if origin is dict:
        return f"table of {_type(inner[1])}"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "table"
    names = {str: "text", float: "number", int: "integer", bool: "boolean", Any: "any"}
    return names.get(annotation) or getattr(annotation, "__name__", str(annotation))


def _limits(field: FieldInfo) -> Iterator[str]:
    signs = {
        "gt": "> ",
        "ge": "≥ ",
        "lt": "< ",
        "le": "≤ ",
        "min_length": "length ≥ ",
        "max_length": "length ≤ ",
    }
    for limit in field.metadata:
        for name, sign in signs.items():
            if (value := getattr(limit, name, None)) is not None:
                yield f"{sign} {value:g}"


def _default(field: FieldInfo) -> str:
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined or value is None:
        return "none"
    if isinstance(value, BaseModel):
        return "{}" if not value.model_fields_set else value.model_dump_json()
    return json.dumps(value, ensure_ascii=False)


def _meaning(model: type[BaseModel], name: str) -> str:
    """The docstring of a field, of the class that declares it."""
    for owner in model.__mro__:
        if name in vars(owner).get("__annotations__", {}):
            return _cell(_markdown(_field_docstrings(owner).get(name, "")))
    return ""


@cache
def _field_docstrings(model: type[BaseModel]) -> dict[str, str]:
    """The strings that follow the fields of a class in its source."""
    body = ast.parse(textwrap.dedent(inspect.getsource(model))).body[0].body
    return {
        field.target.id: said.value.value
        for field, said in pairwise(body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(said, ast.Expr)
        and isinstance(said.value, ast.Constant)
    }


def _markdown(docstring: str) -> str:
    text = re.sub(r":(?:func|class|meth|mod|attr|data):`~?([^`]+)`", r"`\1`", docstring)
    text = re.sub(r":math:`([^`]+)`", r"$\1$", text)
    return re.sub(r"``(.+?)``", r"`\1`", text).split("\n>>> ")[0].strip()


def _cell(text: str) -> str:
    """Text for a cell of a table."""
    return re.sub(r"\s+", " ", text).replace("|", r"\|")
