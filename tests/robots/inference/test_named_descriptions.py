"""Names of the package robot_descriptions, without it, without a network, and with what it has."""

from __future__ import annotations

import importlib.util
import sys

import pytest
from made_urdf import differential

from mobman.errors import UnknownNameError, UsageError
from mobman.robots.incoming.incoming import incoming

PACKAGE = "robot_descriptions"


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of that name with three robots."""
    folder = tmp_path / "site" / PACKAGE
    folder.mkdir(parents=True)
    urdf = differential().arm(tip="tool0").write(tmp_path / "cart.urdf")
    names = ("cart_description", "far_description", "odd_description")
    (folder / "__init__.py").write_text(f"DESCRIPTIONS = dict.fromkeys({names})")
    (folder / "cart_description.py").write_text(f"URDF_PATH = {str(urdf)!r}")
    (folder / "far_description.py").write_text("raise OSError('Could not resolve host: there')")
    (folder / "odd_description.py").write_text("PACKAGE_PATH = '/'")
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    for name in [name for name in sys.modules if name.split(".")[0] == PACKAGE]:
        monkeypatch.delitem(sys.modules, name)
    yield urdf
    for name in [name for name in sys.modules if name.split(".")[0] == PACKAGE]:
        del sys.modules[name]


@pytest.mark.usefixtures("package")
@pytest.mark.parametrize(
    ("name", "kind", "words"),
    [
        ("far_description", UsageError, r"cannot fetch 'far_description': Could not resolve host"),
        ("far_description", UsageError, r"it needs git and a network the first time"),
        ("odd_description", UsageError, r"neither a URDF nor an MJCF file"),
        ("cat_description", UnknownNameError, r"'cat_description'.*cart_description"),
    ],
)
def test_a_robot_that_cannot_be_fetched_is_said(name, kind, words):
    with pytest.raises(kind, match=words) as error:
        incoming(name)
    assert "\n" not in str(error.value)


def test_a_robot_that_is_there_is_taken(package):
    assert incoming("cart_description").file.path == package


@pytest.mark.skipif(importlib.util.find_spec(PACKAGE) is not None, reason="it is installed")
def test_without_the_package_its_extra_is_named():
    with pytest.raises(UsageError, match=r"pip install 'mobman\[descriptions\]'"):
        incoming("cart_description")
