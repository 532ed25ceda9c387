"""Files of xacro, expanded to a URDF by the package xacro, in a process of its own.

The language evaluates expressions of Python. The package refuses names that begin with ``__``; here all
attributes of the interpreter (frames, code, classes) are refused as well, there is no environment, and
time and memory are limited. Files that a xacro file includes are read wherever they lie.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import re
import types
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mobman.errors import MobmanError, SpecError, UsageError
from mobman.isolation import helper
from mobman.robots.urdf.meshes import package_folders
from mobman.robots.urdf.read import MEGABYTES, UrdfFile, macros

_SECONDS, _HELPER_MEGABYTES = 30.0, 500.0
_FORBIDDEN = re.compile(r"_.*|(gi|cr|ag|tb|f|co|func)_.*|mro|format|format_map")
"""Names of attributes that lead from a value to the interpreter."""
_BANNER = re.compile(r"<!--\s*(=+|\|.*?\|)\s*-->\s*", re.DOTALL)


def is_xacro(robot: ET.Element) -> bool:
    """True if a ``<robot>`` element has to be expanded."""
    return any(True for _ in macros(robot))


def expanded(
    content: bytes, path: Path, packages: Sequence[Path], arguments: Mapping[str, str]
) -> tuple[str, list[str]]:
    """The URDF of a xacro file, and what was run for it.

    Args:
        content: The file's content.
        path: Where it is, or would be: includes are looked for from there.
        packages: Folders that hold packages, see :class:`UrdfFile`.
        arguments: Values of its arguments.

    Raises:
        UsageError: If the package xacro is not installed.
        SpecError: If the file cannot be expanded.
    """
    if importlib.util.find_spec("xacro") is None:
        raise UsageError(
            f"{path} is written in xacro, which makes a URDF of it; install the package xacro: pip "
            f"install 'mobman[xacro]', or run xacro yourself: xacro {path.name} > robot.urdf"
        )
    folders = [str(folder) for folder in packages]
    if not path.is_file() or path.read_bytes() != content:  # of a pipe: its place is not its own
        raise SpecError("xacro cannot be read from a pipe, since it includes files; name the file")
    try:
        text, included = helper.call(
            f"{__name__}:expand",
            str(path),
            dict(arguments),
            folders,
            seconds=_SECONDS,
            megabytes=_HELPER_MEGABYTES,
        )
    except MobmanError as error:
        raise SpecError(f"{path} cannot be expanded by xacro: {error}") from error
    files = f", with {len(included)} files that it includes" if included else ""
    return text, [f"expanded by xacro, which evaluates the expressions of {path.name}{files}"]


def expand(path: str, arguments: dict[str, str], folders: list[str]) -> list[Any]:
    """Do the work of :func:`expanded` in this process."""
    xacro: Any = importlib.import_module("xacro")
    substitution: Any = importlib.import_module("xacro.substitution_args")
    urdf = UrdfFile(Path(path), (*map(Path, folders), *Path(path).parents))

    def find(name: str) -> str:
        found = package_folders(name, urdf)
        if not found:
            raise MobmanError(
                f"$(find {name}): there is no package {name!r}; name the folder that holds it by "
                "--package-path"
            )
        return str(found[0])

    def guarded(expression: str, known: dict[str, Any], own: Any = None) -> Any:
        code = compile(expression.strip(), "<expression>", "eval")
        _refuse_inner(code, expression)
        known.update(__builtins__={})
        return eval(code, known, own)  # no name of it leads out of its values

    def evaluated(expression: str, context: dict[str, Any]) -> str:
        values = {
            name: substitution.convert_value(value, "auto")
            for name, value in context.get("arg", {}).items()
        }
        known = {k: v for k, v in substitution._eval_dict.items() if k != "__builtins__"}
        known |= {
            "arg": values.__getitem__,
            "find": find,
            "dirname": lambda: str(Path(path).parent),
        }
        known |= {kind.__name__: kind for kind in (list, dict, map, str, float, int)}
        return str(guarded(expression, {**known, **values}))

    before = dict(os.environ)
    kept = xacro.safe_eval, substitution._eval, substitution._eval_find
    try:
        os.environ.clear()
        xacro.safe_eval, substitution._eval, substitution._eval_find = guarded, evaluated, find
        xacro.all_includes.clear()
        document = xacro.process_file(path, mappings=dict(arguments), verbosity=0)
        text = _BANNER.sub("", document.toprettyxml(indent="  "))
    except MobmanError:
        raise
    except RecursionError:
        raise MobmanError("its macros or properties call each other without end") from None
    except Exception as error:  # the package raises what its parser, yaml and expressions raise
        shown = " ".join(str(error).split()) or type(error).__name__
        raise MobmanError(shown) from None
    finally:
        os.environ.update(before)
        xacro.safe_eval, substitution._eval, substitution._eval_find = kept
    if len(text) > MEGABYTES * 1e6:
        raise MobmanError(f"it makes a URDF of {len(text) / 1e6:.3g} MB; allowed: {MEGABYTES:g} MB")
    return [text, sorted({str(name) for name in xacro.all_includes})]


def _refuse_inner(code: types.CodeType, expression: str) -> None:
    """
    Raises:
        MobmanError: If an expression uses a name that leads to the interpreter.
    """
    if wrong := [name for name in code.co_names if _FORBIDDEN.fullmatch(name)]:
        raise MobmanError(f"the expression {expression[:80]!r} uses {wrong[0]!r}, which is refused")
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            _refuse_inner(constant, expression)
