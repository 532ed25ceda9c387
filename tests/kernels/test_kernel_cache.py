"""Machine code that is kept between processes: found again, and done without where it must be."""

from __future__ import annotations

import ast
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import mobman
from mobman.kernels.cache import kernel_files

PACKAGE = Path(mobman.__file__).parent

# The helper that compiles all other kernels meanwhile is none of these tests' business: one core.
TINY = """
from __future__ import annotations
import os
os.cpu_count = lambda: 1
import numpy as np
from mobman.arrays import Vector
from mobman.kernels.kernel import kernel
from mobman.kernels.program import call, program

@kernel
def double(x: Vector) -> None:
    for i in range(x.shape[0]):
        x[i] *= {factor}

x = np.arange(3.0)
program([call(double, x)])()
print(x.tolist())
"""


class Tiny:
    """A program of one small kernel, run in processes of its own."""

    def __init__(self, folder: Path, cache: Path) -> None:
        self.file, self.cache = folder / "tiny.py", cache
        self.write("2.0")

    def write(self, factor: str) -> None:
        self.file.write_text(TINY.format(factor=factor), encoding="utf-8")

    def run(self, expected: str = "[0.0, 2.0, 4.0]") -> str:
        """What it has to say apart from its result."""
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(self.cache)}
        environment.pop("NUMBA_DISABLE_JIT", None)
        done = subprocess.run(
            [sys.executable, self.file],
            capture_output=True,
            text=True,
            env=environment,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr
        assert done.stdout == f"{expected}\n"
        return done.stderr

    def kept(self) -> list[Path]:
        """The files with this kernel's machine code, and the index of them."""
        return sorted(self.cache.rglob("tiny.double*"))


@pytest.fixture
def tiny(tmp_path):
    return Tiny(tmp_path, tmp_path / "cache")


@pytest.fixture(scope="module")
def run_once(tmp_path_factory):
    """A program that was run, so that its machine code is kept."""
    folder = tmp_path_factory.mktemp("tiny")
    tiny = Tiny(folder, folder / "cache")
    tiny.run()
    return tiny


@pytest.fixture
def compiled(tiny, run_once):
    """The same program, and a copy of what was kept of it."""
    shutil.copytree(run_once.cache, tiny.cache)
    assert tiny.kept()
    return tiny


def test_first_process_says_that_it_compiles_and_the_second_does_not_compile(tiny):
    first = tiny.run()
    assert first.count("mobman: compiling its kernels for this machine") == 1
    assert first.count("\n") == 1
    assert str(tiny.cache) in first
    kept = tiny.kept()
    assert {file.suffix for file in kept} == {".nbi", ".nbc"}
    times = [file.stat().st_mtime_ns for file in kept]
    assert tiny.run() == ""
    assert tiny.kept() == kept
    assert [file.stat().st_mtime_ns for file in kept] == times


def test_changed_kernel_is_compiled_anew(compiled):
    assert compiled.run() == ""
    compiled.write("3.0")
    assert "compiling" in compiled.run("[0.0, 3.0, 6.0]")
    assert compiled.run("[0.0, 3.0, 6.0]") == ""


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("content", [b"no machine code", None], ids=["other", "half"])
def test_file_that_cannot_be_read_counts_as_missing(compiled, suffix, content):
    for file in compiled.kept():
        if file.suffix == suffix:
            whole = file.read_bytes()
            file.write_bytes(whole[: len(whole) // 2] if content is None else content)
    assert compiled.run().count("\n") == 1  # the announcement
    assert compiled.run() == ""


def test_missing_machine_code_is_compiled_anew(compiled):
    for file in compiled.kept():
        if file.suffix == ".nbc":
            file.unlink()
    assert "compiling" in compiled.run()
    assert compiled.run() == ""


@pytest.mark.parametrize("obstacle", ["a file is in its way", "read-only"])
def test_folder_that_cannot_be_written_costs_one_warning(tmp_path, obstacle):
    above = tmp_path / "above"
    if obstacle == "read-only":
        above.mkdir(mode=0o500)
        if os.access(above, os.W_OK):
            pytest.skip("this user may write everywhere")
    else:
        above.write_text("")
    tiny = Tiny(tmp_path, above / "cache")
    for _ in range(2):
        said = tiny.run()
        assert said.count("mobman: compiling its kernels") == 1
        assert said.count("cannot be kept in") == 1
        assert said.count("Warning") == 1
        assert "Set NUMBA_CACHE_DIR to a folder that can be written" in said
        assert "Traceback" not in said


posix = pytest.mark.skipif(os.name != "posix", reason="permissions are those of POSIX")


def refused(tiny, *words):
    """Machine code is neither loaded nor kept, and one warning says why."""
    before = {path: path.read_bytes() for path in tiny.cache.rglob("*") if path.is_file()}
    said = tiny.run()
    assert said.count("mobman: compiling its kernels") == 1
    assert said.count("Warning") == 1
    for word in ("cannot be kept in", "NUMBA_CACHE_DIR", *words):
        assert word in said
    after = {path: path.read_bytes() for path in tiny.cache.rglob("*") if path.is_file()}
    assert after == before


@posix
@pytest.mark.parametrize("mode", [0o777, 0o1777])
def test_folder_that_others_may_write_to_is_not_used(compiled, mode):
    folder = compiled.kept()[0].parent
    folder.chmod(mode)
    refused(compiled, f"other users may write to {folder}: chmod go-w {folder}")
    folder.chmod(0o755)
    assert compiled.run() == ""


@posix
def test_folder_that_the_users_own_group_may_write_to(compiled):
    """As a umask of 002 makes it."""
    folder = compiled.kept()[0].parent
    folder.chmod(0o775)
    assert compiled.run() == ""
    if os.getuid() == 0:  # only root may give it to another group
        os.chown(folder, -1, 65534)
        refused(compiled, f"other users may write to {folder}")


@posix
def test_folder_above_it_that_others_may_write_to(compiled):
    compiled.cache.chmod(0o777)
    refused(compiled, f"other users may write to {compiled.cache}: chmod go-w {compiled.cache}")
    compiled.cache.chmod(0o1777)  # as /tmp: others may add to it, and replace nothing
    assert compiled.run() == ""


@posix
def test_file_that_others_may_write_to(compiled):
    file = compiled.kept()[0]
    file.chmod(0o666)
    assert compiled.run() == ""  # nobody else reaches it
    file.parent.chmod(0o755)
    refused(compiled, f"other users may write to {file}")


@posix
def test_link_to_a_folder_that_others_may_write_to(compiled, tmp_path):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    compiled.cache.rename(shared / "cache")
    compiled.cache.symlink_to(shared / "cache")
    refused(compiled, f"other users may write to {shared}")


@posix
@pytest.mark.skipif(os.name != "posix" or os.getuid() != 0, reason="only root may give files away")
@pytest.mark.parametrize("what", ["cache", "folder", "file"])
def test_what_belongs_to_another_user_is_not_used(compiled, what):
    file = compiled.kept()[0]
    path = {"cache": compiled.cache, "folder": file.parent, "file": file}[what]
    os.chown(path, 65534, -1)
    refused(compiled, f"{path} belongs to another user, 65534")


@posix
def test_machine_code_of_others_is_not_even_unpickled(compiled, tmp_path):
    """What is unpickled runs."""
    seen = tmp_path / "seen"
    for file in compiled.kept():
        file.write_bytes(pickle.dumps(Touches(str(seen))))
    compiled.kept()[0].parent.chmod(0o777)
    refused(compiled, "other users may write to")
    assert not seen.exists()


class Touches:
    """Leaves a file where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (self.path, "w"))


@posix
def test_folders_that_are_made_are_for_this_user_alone(tiny):
    mask = os.umask(0)
    try:
        tiny.run()
    finally:
        os.umask(mask)
    folder = tiny.kept()[0].parent
    for path in (folder, folder.parent, tiny.cache):
        assert path.stat().st_mode & 0o777 == 0o700
    assert tiny.run() == ""


def test_every_file_with_a_kernel_is_known():
    """However it is decorated."""
    found = kernel_files()
    for file in PACKAGE.rglob("*.py"):
        functions = [
            node
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
            if isinstance(node, ast.FunctionDef)
        ]
        if any("kernel" in map(ast.unparse, function.decorator_list) for function in functions):
            assert file in found
    assert len(found) > 10


@pytest.mark.parametrize("file", ["dense.py", "calling.py", "kernel.py"])
def test_folder_is_named_after_all_that_decides_the_machine_code(file, tmp_path):
    """Equations, the calling convention and the compiler's options."""
    names = []
    for change in ("", "# changed"):
        copy = shutil.copytree(PACKAGE, tmp_path / f"with{change}" / "mobman")
        path = copy / "kernels" / file
        path.write_text(path.read_text(encoding="utf-8") + change, encoding="utf-8")
        code = (
            f"import sys; sys.path.insert(0, {str(copy.parent)!r}); import mobman.kernels.cache as c; "
            f"assert c.__file__.startswith({str(copy)!r}); print(c.kernel_folder().name)"
        )
        done = subprocess.run(
            [sys.executable, "-I", "-c", code], capture_output=True, text=True, check=True
        )
        names.append(done.stdout)
    assert names[0] != names[1]
