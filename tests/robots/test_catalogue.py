"""Which robots there are, and every way to name one."""

from __future__ import annotations

from importlib.metadata import EntryPoint

import numpy as np
import pytest
from support.variants import ROBOTS, description, toml, youbot_urdf

import mobman as mm
from mobman.errors import UnknownNameError, UsageError
from mobman.robots import catalogue
from mobman.robots.spec import RobotSpec


@pytest.fixture(autouse=True)
def forget_registered_robots(monkeypatch):
    """What a test registers does not last longer than the test."""
    monkeypatch.setattr(catalogue, "_registered", {})
    monkeypatch.setattr(catalogue, "_loaded", {})


def test_own_robots_are_listed():
    assert {"youbot", "tiago", "tiago_no_hand", "tiago_dual"} <= set(mm.list_robots())
    assert mm.list_robots() == sorted(mm.list_robots())


def test_every_listed_robot_loads_under_its_name(robot):
    assert robot.name == robot.spec.name
    assert robot.name in mm.list_robots()
    assert robot.spec.description
    assert robot.spec.license
    assert robot.n > 0


def test_name_and_file_give_the_same_robot(youbot):
    by_file = mm.load_robot(ROBOTS / "youbot.toml")
    by_text = mm.load_robot(str(ROBOTS / "youbot.toml"))
    for other in (by_file, by_text):
        assert other.spec == youbot.spec
        assert np.array_equal(other.q_rest, youbot.q_rest)


def test_description_may_be_a_dictionary_or_a_spec(youbot):
    by_dictionary = mm.load_robot(description())
    by_spec = mm.load_robot(youbot.spec)
    assert by_dictionary.joint_names == by_spec.joint_names == youbot.joint_names


@pytest.mark.parametrize("wrong", ["yuobot", "youbott", "YouBot"])
def test_misspelt_robot_is_answered_with_the_nearest_name(wrong):
    with pytest.raises(UnknownNameError, match=f"unknown robot '{wrong}'.*did you mean 'youbot'"):
        mm.load_robot(wrong)


def test_unknown_robot_is_answered_with_all_names():
    with pytest.raises(UnknownNameError) as caught:
        mm.load_robot("zzz")
    assert "did you mean" not in str(caught.value)
    assert all(name in str(caught.value) for name in mm.list_robots())
    assert caught.value.exit_status == 2
    assert isinstance(caught.value, UsageError)
    assert isinstance(caught.value, mm.MobmanError)


def test_registered_dictionary_is_known_by_its_name():
    assert mm.register_robot(description(name="wheel-rates", platform__alpha="wheel-rates")) == (
        "wheel-rates"
    )
    assert "wheel-rates" in mm.list_robots()
    robot = mm.load_robot("wheel-rates")
    assert np.isclose(robot.platform.kappa, 1.0)


def test_registered_file_finds_the_urdf_beside_it(tmp_path, monkeypatch):
    (tmp_path / "mine.urdf").write_text(youbot_urdf(), encoding="utf-8")
    file = tmp_path / "mine.toml"
    file.write_text(toml(description(name="mine", urdf__path="mine.urdf")), encoding="utf-8")
    assert mm.register_robot(file) == "mine"
    monkeypatch.chdir("/")
    assert mm.load_robot("mine").urdf.path == (tmp_path / "mine.urdf").resolve()


def test_relative_path_of_a_registered_dictionary_starts_where_it_was_registered(
    tmp_path, monkeypatch
):
    (tmp_path / "mine.urdf").write_text(youbot_urdf(), encoding="utf-8")
    content = description(name="mine", urdf__path="mine.urdf", folder=None)
    monkeypatch.chdir(tmp_path)
    mm.register_robot(content)
    monkeypatch.chdir("/")
    assert mm.load_robot("mine").nz == 5


def test_registered_robot_takes_the_place_of_an_own_one():
    mm.register_robot(description(description="another one"))
    assert mm.load_robot("youbot").spec.description == "another one"


def _entry_points(monkeypatch, **targets):
    points = [EntryPoint(name, target, "mobman.robots") for name, target in targets.items()]
    monkeypatch.setattr(catalogue, "entry_points", lambda group: points)


def spec_of_another_package():
    """What an installed package's entry point may be."""
    return RobotSpec.model_validate(description(name="elsewhere"))


def test_robot_of_another_package(monkeypatch):
    _entry_points(monkeypatch, elsewhere=f"{__name__}:spec_of_another_package")
    assert "elsewhere" in mm.list_robots()
    assert catalogue.origin_of("elsewhere") == __name__.partition(".")[0]
    assert mm.load_robot("elsewhere").nz == 5


def test_robot_of_another_package_has_the_name_that_it_is_listed_by(monkeypatch):
    _entry_points(monkeypatch, another=f"{__name__}:spec_of_another_package")
    assert mm.load_robot("another").name == "another"


def test_robot_of_another_package_is_loaded_when_asked_for_and_once(monkeypatch):
    calls = []
    own = {**description(), "name": "elsewhere"}
    monkeypatch.setitem(globals(), "spec_of_another_package", lambda: calls.append(1) or own)
    _entry_points(monkeypatch, elsewhere=f"{__name__}:spec_of_another_package")
    mm.list_robots()
    assert calls == []
    for _ in range(3):
        mm.load_robot("elsewhere")
    assert calls == [1]


def test_robots_of_the_user_are_listed_and_found(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    folder = catalogue.user_robots_folder()
    assert "mine" not in mm.list_robots()
    folder.mkdir(parents=True)
    (folder / "mine.urdf").write_text(youbot_urdf(), encoding="utf-8")
    content = description(name="other", urdf__path="mine.urdf")
    (folder / "mine.toml").write_text(toml(content), encoding="utf-8")
    assert "mine" in mm.list_robots()
    assert catalogue.origin_of("mine") == "user"
    assert mm.load_robot("mine").name == "mine"


def test_broken_package_is_left_out_with_a_warning(monkeypatch):
    _entry_points(monkeypatch, broken="no_such_package:robot")
    with (
        pytest.warns(UserWarning, match="'broken' of no_such_package:robot is left out"),
        pytest.raises(UnknownNameError) as caught,
    ):
        mm.load_robot("broken")
    assert "did you mean 'broken'" not in str(caught.value)
    assert "broken" not in mm.list_robots()
    with pytest.raises(UnknownNameError):  # and no second warning
        mm.load_robot("broken")
    assert mm.load_robot("youbot").nz == 5


def leave():
    """What an entry point may do when it is called."""
    raise SystemExit(3)


def stop():
    raise KeyboardInterrupt


def test_package_that_ends_the_process_is_left_out_with_a_warning(monkeypatch):
    _entry_points(monkeypatch, leaves=f"{__name__}:leave", stops=f"{__name__}:stop")
    with (
        pytest.warns(UserWarning, match=r"'leaves' of .* is left out: SystemExit\(3\)"),
        pytest.raises(UnknownNameError),
    ):
        mm.load_robot("leaves")
    assert "leaves" not in mm.list_robots()
    with pytest.raises(KeyboardInterrupt):
        mm.load_robot("stops")
