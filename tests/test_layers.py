"""What import-linter's contracts, in pyproject.toml, do not say of mobman's layers."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import mobman

PACKAGE = Path(mobman.__file__).parent
ROOT = PACKAGE.parent
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
LAYERS = SETTINGS["tool"]["importlinter"]["contracts"][0]["layers"]


def _linted(folder):
    command = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    done = subprocess.run(
        [sys.executable, "-c", command, "--no-logo", "--no-cache"],
        cwd=folder,
        env={"PYTHONPATH": str(folder), "PATH": ""},
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stdout


def test_every_package_is_in_a_layer():
    packages = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    named = {name for layer in LAYERS for name in layer.split(" | ")}
    modules = {name for name in named if (PACKAGE / f"{name}.py").is_file()}
    assert packages == named - modules


def test_no_module_imports_the_facade():
    """mobman/__init__.py offers what all layers have: importing it from one would be a circle."""
    facade = re.compile(r"^\s*(import mobman$|import mobman as|from mobman import)", re.MULTILINE)
    sources = {
        path: path.read_text(encoding="utf-8")
        for path in PACKAGE.rglob("*.py")
        if "data" not in path.parts and path.name not in ("__init__.py", "__main__.py")
    }
    assert len(sources) > 100
    assert [str(path) for path, text in sources.items() if facade.search(_code(text))] == []


def _code(text):
    """Without examples in docstrings."""
    return re.sub(r'"""[\s\S]*?"""', "", text)


def test_contracts_see_an_import_upward_and_one_in_a_circle(tmp_path):
    """In a copy; also those of type checkers and those within functions."""
    shutil.copytree(PACKAGE, tmp_path / "mobman", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    status, text = _linted(tmp_path)
    assert status == 0, text
    for module, line in {
        "robots/spec.py": "def f():\n    import mobman.simulation.record\n",
        "model/dynamics.py": "if False:\n    import mobman.model.mobile_manipulator\n",
    }.items():
        path = tmp_path / "mobman" / module
        before = path.read_text(encoding="utf-8")
        path.write_text(f"{before}\n{line}", encoding="utf-8")
        status, text = _linted(tmp_path)
        assert status == 1
        assert "broken" in text.lower()
        path.write_text(before, encoding="utf-8")


def test_no_class_has_the_name_of_another():
    found: dict[str, list[str]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        for name in re.findall(r"^class (\w+)", path.read_text(encoding="utf-8"), re.MULTILINE):
            found.setdefault(name, []).append(str(path.relative_to(PACKAGE)))
    assert {name: paths for name, paths in found.items() if len(paths) > 1} == {}
