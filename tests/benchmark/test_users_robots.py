"""A user's robots, which a pattern of a suite means: none of them stops the others."""

from __future__ import annotations

import pytest
from support.variants import ROLLING, description, toml, youbot_urdf

from mobman.benchmark import expand
from mobman.benchmark.suite_tables import SuiteTables
from mobman.errors import SpecError
from mobman.model.platforms.custom import without_code
from mobman.toml_model import validate

BROKEN = {"raises": "raise RuntimeError('no licence')", "ends": "raise SystemExit(3)"}


@pytest.fixture
def suite(tmp_path, monkeypatch):
    """A suite of the robots that begin with ``users_``, and the folder with three of them."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.setattr(expand, "_said", set())
    folder = tmp_path / "mobman/robots"
    folder.mkdir(parents=True)
    (folder / "own.urdf").write_text(youbot_urdf())
    for name, code in {"sound": ROLLING, **BROKEN}.items():
        (folder / f"{name}.py").write_text(code)
        platform = {"type": "custom", "definition": f"{name}.py:Body"}
        content = description(name=f"users_{name}", urdf__path="own.urdf") | {"platform": platform}
        (folder / f"users_{name}.toml").write_text(toml(content))

    def of(*robots):
        groups = [{"robots": list(robots), "tasks": ["circle"]}]
        content = {"schema": 1, "name": "all", "duration": 1.0, "groups": groups}
        controllers = {"pi": {"law": "pseudo-inverse"}}
        return validate(SuiteTables, content | {"controllers": controllers}, "all")

    return of


def test_code_that_fails_leaves_its_robot_out(suite):
    with pytest.warns(UserWarning, match="left out of the suite") as said:
        runs = expand.runs_of(suite("users_*", "youbot"))
    assert [run.robot for run in runs] == ["users_sound", "youbot"]
    assert sorted(str(one.message).split("'")[1] for one in said) == ["users_ends", "users_raises"]


def test_what_only_looks_runs_no_code_and_says_so_once(suite):
    def counts():
        for robots in (("users_*", "youbot"), ("users_s*", "youbot")):
            with without_code():
                yield len(expand.runs_of(suite(*robots)))
            yield expand.number_of_runs(suite(*robots))

    with pytest.warns(UserWarning, match="only looked at") as said:
        assert list(counts()) == [1, 1, 1, 1]
    assert len(said) == 3


def test_a_robot_that_is_named_stops_its_suite(suite):
    with pytest.raises(SpecError, match="no licence"):
        expand.runs_of(suite("users_raises", "youbot"))
