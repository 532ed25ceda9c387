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
from support.forked import Forks, forks_of

import mobman
from mobman import compiled as kernels
from mobman.compiled import kernel_files

PACKAGE = Path(mobman.__file__).parent

TINY = """
import numpy as np
from mobman.compiled import bind, kernel

@kernel
def double(x):
    for i in range(x.shape[0]):
        x[i] *= {factor}

x = np.arange(3.0)
bind(double, x)()
print(x.tolist())
"""


@pytest.fixture(scope="module")
def forks():
    """Python with numba, which has compiled something, and without any kernel of mobman's."""
    with forks_of(
        "mobman.compiled", prepare="import numba\nnumba.njit('f8(f8)')(lambda x: x)"
    ) as forks:
        yield forks


class Tiny:
    """A script with one small kernel, run in processes of its own."""

    def __init__(self, forks: Forks, folder: Path, cache: Path, written: bool = False) -> None:
        self.forks, self.file, self.cache = forks, folder / "tiny.py", cache
        if not written:
            self.write("2.0")

    @property
    def folder(self) -> Path:
        """The folder of this version of the kernels."""
        (folder,) = (self.cache / "mobman").iterdir()
        return folder

    def write(self, factor: str) -> None:
        self.file.write_text(TINY.format(factor=factor), encoding="utf-8")

    def run(self, expected: str = "[0.0, 2.0, 4.0]") -> str:
        """What it has to say apart from its result."""
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(self.cache)}
        done = self.forks.run(self.file, env=environment)
        assert done.returncode == 0, done.stderr
        assert done.stdout == f"{expected}\n"
        return done.stderr

    def kept(self) -> list[Path]:
        """The files with this kernel's machine code, and the index of them."""
        return sorted(self.cache.rglob("tiny.double*"))


@pytest.fixture
def tiny(forks, tmp_path):
    return Tiny(forks, tmp_path, tmp_path / "cache")


@pytest.fixture(scope="module")
def run_once(forks, tmp_path_factory):
    """A script that was run, so that its machine code is kept."""
    folder = tmp_path_factory.mktemp("tiny")
    tiny = Tiny(forks, folder, folder / "cache")
    tiny.run()
    return tiny


@pytest.fixture
def compiled(tmp_path, run_once):
    """The same script, and a copy of what was kept of it."""
    copy = Tiny(run_once.forks, run_once.file.parent, tmp_path / "cache", written=True)
    shutil.copytree(run_once.cache, copy.cache)
    assert copy.kept()
    return copy


def test_first_process_says_that_it_compiles_and_the_second_does_not_compile(tiny):
    first = tiny.run()
    assert first.count("mobman: compiling its kernels for this machine; once") == 1
    assert first.count("\n") == 1
    assert str(tiny.cache) in first
    kept = tiny.kept()
    assert {file.suffix for file in kept} == {".nbi", ".nbc"}
    times = [file.stat().st_mtime_ns for file in kept]
    assert tiny.run() == ""
    assert tiny.kept() == kept
    assert [file.stat().st_mtime_ns for file in kept] == times


def test_changed_kernel_is_compiled_anew(tiny):
    tiny.run()
    tiny.write("3.0")
    assert tiny.run("[0.0, 3.0, 6.0]") == ""
    before = {file: file.stat().st_mtime_ns for file in tiny.kept()}
    assert tiny.run("[0.0, 3.0, 6.0]") == ""
    assert {file: file.stat().st_mtime_ns for file in tiny.kept()} == before


@pytest.mark.parametrize(
    ("suffix", "content"),
    [
        pytest.param(".nbi", b"no machine code", id="index, other"),
        pytest.param(".nbc", None, id="code, half"),
        pytest.param(".nbc", b"no machine code", id="code, other", marks=pytest.mark.slow),
        pytest.param(".nbi", None, id="index, half", marks=pytest.mark.slow),
    ],
)
def test_file_that_cannot_be_read_counts_as_missing(compiled, suffix, content):
    for file in compiled.kept():
        if file.suffix == suffix:
            whole = file.read_bytes()
            file.write_bytes(whole[: len(whole) // 2] if content is None else content)
    assert compiled.run() == ""
    assert compiled.kept()
    assert compiled.run() == ""


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_missing_machine_code_is_compiled_anew(compiled, suffix):
    for file in compiled.kept():
        if file.suffix == suffix:
            file.unlink()
    assert ("compiling" in compiled.run()) == (suffix == ".nbi")
    assert len(compiled.kept()) == 2


@pytest.mark.parametrize("obstacle", ["a file is in its way", "read-only"])
def test_folder_that_cannot_be_written_costs_one_warning(forks, tmp_path, obstacle):
    above = tmp_path / "above"
    if obstacle == "read-only":
        above.mkdir(mode=0o500)
        if os.access(above, os.W_OK):
            pytest.skip("this user may write everywhere")
    else:
        above.write_text("")
    tiny = Tiny(forks, tmp_path, above / "cache")
    for _ in range(2):  # the second finds nothing that the first has left
        said = tiny.run()
        assert said.count("mobman: compiling its kernels") == 1
        assert said.count("cannot be kept in") == 1
        assert said.count("Warning") == 1
        assert "Set NUMBA_CACHE_DIR to a folder that can be written" in said
        assert "Traceback" not in said


@pytest.mark.parametrize(("kept", "said"), [((), "once, it takes"), (("dot",), "not used before")])
def test_kernels_that_come_later_are_not_said_to_take_as_long(kept, said, monkeypatch, capsys):
    monkeypatch.setattr(kernels, "_kept", lambda: frozenset(kept))
    monkeypatch.setattr(kernels, "unsafe", lambda: "")
    kernels._say_that_it_takes_time.__wrapped__()
    assert said in capsys.readouterr().err


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
@pytest.mark.parametrize("mode", [0o777, pytest.param(0o1777, marks=pytest.mark.slow)])
def test_folder_that_others_may_write_to_is_not_used(compiled, mode):
    folder = compiled.folder
    folder.chmod(mode)
    refused(compiled, f"other users may write to {folder}: chmod go-w {folder}")
    folder.chmod(0o755)
    assert compiled.run() == ""


@posix
def test_folder_that_the_users_own_group_may_write_to(compiled):
    """As a umask of 002 makes it."""
    folder = compiled.folder
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
    compiled.folder.chmod(0o755)
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
@pytest.mark.parametrize(
    "what", [*(pytest.param(name, marks=pytest.mark.slow) for name in ("cache", "folder")), "file"]
)
def test_what_belongs_to_another_user_is_not_used(compiled, what):
    file = compiled.kept()[0]
    path = {"cache": compiled.cache, "folder": compiled.folder, "file": file}[what]
    os.chown(path, 65534, -1)
    refused(compiled, f"{path} belongs to another user, 65534")


@posix
def test_machine_code_of_others_is_not_even_unpickled(compiled, tmp_path):
    """What is unpickled runs."""
    seen = tmp_path / "seen"
    for file in compiled.kept():
        file.write_bytes(pickle.dumps(Touches(str(seen))))
    compiled.folder.chmod(0o777)
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
    folder = tiny.folder
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


def _copy(folder, file="", old="", new=""):
    """A copy of the package, with a change in one of its files."""
    copy = shutil.copytree(PACKAGE, folder / "mobman", ignore=shutil.ignore_patterns("*.pyc"))
    if file:
        text = (copy / file).read_text(encoding="utf-8")
        assert old in text
        (copy / file).write_text(text.replace(old, new, 1), encoding="utf-8")
    return folder


def _run(folder, code, **environment):
    """What code prints that imports a copy of the package."""
    code = f"import sys; sys.path.insert(0, {str(folder)!r}); import mobman\n{code}"
    code += f"\nassert mobman.__file__.startswith({str(folder)!r})"
    done = subprocess.run(
        [sys.executable, "-I", "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, **environment},
    )
    return done.stdout


@pytest.mark.parametrize("file", ["linalg.py", pytest.param("compiled.py", marks=pytest.mark.slow)])
def test_folder_is_named_after_all_that_decides_the_machine_code(file, tmp_path):
    """Equations and the compiler's options."""
    code = "from mobman.compiled import kernel_folder; print(kernel_folder().name)"
    names = [
        _run(_copy(tmp_path / "as it is"), code),
        _run(_copy(tmp_path / "changed", file, '"""', '"""Changed. '), code),
    ]
    assert names[0] != names[1]


# Of a kernel that calls kernels of another file: what it computes, and how much was compiled for it.
CALLER = """
import numpy as np
from mobman.compiled import bind
from mobman.controllers.task_errors import tip_rates
J_f, rate, C = np.array([[1.0, 2.0]]), np.zeros((1, 2)), np.eye(2)
J, J_dot_z = np.zeros((1, 2)), np.zeros(1)
bind(tip_rates, J_f, rate, C, np.ones(2), np.array([1.0, 2.0]), J, J_dot_z)()
print(J_dot_z.tolist(), sum(tip_rates.stats.cache_misses.values()))
"""


def test_an_edited_kernel_does_not_live_on_in_its_callers(tmp_path):
    cache = str(tmp_path / "cache")
    before = _copy(tmp_path / "before")
    assert _run(before, CALLER, NUMBA_CACHE_DIR=cache) == "[5.0] 1\n"
    assert _run(before, CALLER, NUMBA_CACHE_DIR=cache) == "[5.0] 0\n"
    changed = "total += a[i] * b[i] + 10.0"  # of the dot product
    after = _copy(tmp_path / "after", "linalg.py", "total += a[i] * b[i]", changed)
    assert _run(after, CALLER, NUMBA_CACHE_DIR=cache) == "[45.0] 1\n"


USER = """
from mobman.compiled import kernel
from mobman.linalg import dot
{imports}

@kernel
def one(x):
    return {value}
print(one.stats.cache_path is not None)
"""


@pytest.mark.parametrize(
    ("imports", "value", "kept"),
    [("", "dot(x, x)", True), ("from other import two", "two(x)", False)],
    ids=["mobman's", "another file's"],
)
def test_kernel_that_calls_another_file_of_the_users_is_not_kept(imports, value, kept, tmp_path):
    """Since numba would not see that file change."""
    other = "from mobman.compiled import kernel\n\n@kernel\ndef two(x):\n    return x[0]\n"
    (tmp_path / "other.py").write_text(other)
    (tmp_path / "user.py").write_text(USER.format(imports=imports, value=value))
    done = subprocess.run(
        [sys.executable, tmp_path / "user.py"], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"{kept}\n"


MISSES = """
import mobman as mm
import gc
record = mm.simulate("youbot", "tsm", "circle", duration=0.004)
kernels = [one for one in gc.get_objects() if type(one).__name__ == "CPUDispatcher"]
print(len(kernels) > 30, sum(sum(one.stats.cache_misses.values()) for one in kernels))
"""


def test_second_process_compiles_nothing():
    """If the first does not either, it is the second: others have run before these tests."""
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", MISSES], capture_output=True, text=True, check=True
        )
        if done.stdout == "True 0\n":
            break
    assert done.stdout == "True 0\n"
