"""Imports run downward, from the command line to the robots' data, and never in a circle."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import mobman

PACKAGE = Path(mobman.__file__).parent
LAYERS = [
    {"cli"},
    {"viewer", "benchmark", "checks"},
    {"simulation"},
    {"controllers"},
    {"tasks"},
    {"model"},
    {"robots", "kernels"},
]
RANK = {name: len(LAYERS) - i for i, layer in enumerate(LAYERS) for name in layer}
# What all layers stand on: errors, registry, arrays, ...
COMMON = 0

MODULES = {
    ".".join(("mobman", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
        ".__init__"
    ): path
    for path in PACKAGE.rglob("*.py")
}


def _rank(module: str) -> int:
    parts = module.split(".")
    if module in ("mobman", "mobman.__main__"):  # the façade and the command
        return len(LAYERS) + 1
    return RANK.get(parts[1], COMMON)


def _for_types_only(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)


def _imports(tree: ast.AST, *, at_import_only: bool) -> set[str]:
    """Modules of mobman that a module imports, not counting those for type checkers."""
    found: set[str] = set()
    for node in ast.iter_child_nodes(tree):
        if _for_types_only(node):
            continue
        if at_import_only and isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            continue
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in MODULES else str(node.module))
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        else:
            found |= _imports(node, at_import_only=at_import_only)
    return {name for name in found if name.split(".")[0] == "mobman"}


def _imports_of(module: str, *, at_import_only: bool = False) -> set[str]:
    tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
    return _imports(tree, at_import_only=at_import_only) - {module}


def test_every_package_is_a_layer():
    packages = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").is_file()}
    assert packages <= set(RANK)
    assert {"robots", "model", "tasks", "controllers", "simulation"} <= packages


@pytest.mark.parametrize("module", sorted(MODULES))
def test_module_imports_no_layer_above_its_own(module):
    for imported in _imports_of(module):
        assert imported in MODULES, f"{module} imports {imported}, which is not there"
        # mobman/__init__.py offers what all layers have: importing it from one would be a circle
        assert imported != "mobman", f"{module} imports the façade"
        assert _rank(imported) <= _rank(module), f"{module} imports {imported}"
        siblings = _rank(imported) == _rank(module) and _rank(module) in RANK.values()
        if siblings:
            assert imported.split(".")[1] == module.split(".")[1], f"{module} imports {imported}"


def test_no_module_imports_itself_in_a_circle():
    graph = {module: _imports_of(module, at_import_only=True) for module in MODULES}
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join((*path[path.index(module) :], module))
        if module not in done:
            for imported in sorted(graph.get(module, ())):
                visit(imported, (*path, module))
            done.add(module)

    for module in sorted(graph):
        visit(module, ())


def test_the_check_sees_an_upward_import(tmp_path):
    """So that a test of this kind cannot pass by looking at nothing."""
    source = (
        "from typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n    from mobman.cli.main import main\n"
        "from mobman.errors import UsageError\n"
        "def f():\n    from mobman.simulation.record import Record\n"
    )
    tree = ast.parse(source)
    assert _imports(tree, at_import_only=False) == {"mobman.errors", "mobman.simulation.record"}
    assert _imports(tree, at_import_only=True) == {"mobman.errors"}
    assert _rank("mobman.simulation.record") > _rank("mobman.model.build") > _rank("mobman.errors")
