"""Search spaces: declared for every law of mobman, by others where the law is, or in the suite."""

from __future__ import annotations

import pytest
from support.tuning import KnownOptimum, tuned_suite

from mobman.benchmark.suite_tables import SearchRange
from mobman.benchmark.tuning.tuning_set import candidates, law_space
from mobman.controllers.protocol import controllers, list_controllers, make_controller
from mobman.errors import SpecError, UnknownNameError

OWN = [
    name for name in list_controllers() if controllers.get(name).__module__.startswith("mobman.")
]


@pytest.mark.parametrize("law", OWN)
def test_every_law_of_mobman_has_one_with_its_defaults_inside(law):
    space = law_space(law)
    assert space
    defaults = make_controller(law).settings()
    for name, own in space.items():
        assert defaults[name] in own, name
        for end in (own.low, own.high):  # the ends are allowed, each by itself
            make_controller(law, **{name: end})


def test_laws_with_the_same_gains_have_the_same_space():
    assert law_space("tsm") == law_space("tsm-simplified") == law_space("tsm-inverse-actuation")


def test_declared_where_the_law_is():
    assert law_space("known-optimum") == {
        "x": SearchRange(low=1.0, high=1000.0, log=True),
        "y": SearchRange(low=0.0, high=1.0),
    }


def test_the_suites_own_takes_the_place_of_the_laws():
    spaces = {"one": {"y": {"low": 0.2, "high": 0.3}}}
    suite = tuned_suite(tuning={"spaces": spaces})
    found = candidates(suite).spaces
    assert list(found["one"]) == ["y"]
    assert list(found["two"]) == ["x", "y"]


def test_a_law_without_one_is_left_out_and_told():
    suite = tuned_suite(
        controllers={"one": {"law": "known-optimum"}, "own": {"law": "without-space"}}
    )
    found = candidates(suite)
    assert list(found.spaces) == ["one"]
    assert "[tuning.spaces.own]" in found.left_out["own"]
    with pytest.raises(SpecError, match="cannot tune 'own' has no search space"):
        candidates(suite, ["own"])


def test_a_grid_is_left_out():
    entry = {"law": "known-optimum", "grid": {"x": [1.0, 2.0]}}
    found = candidates(tuned_suite(controllers={"one": {"law": "known-optimum"}, "all": entry}))
    assert "several controllers" in found.left_out["all"]


@pytest.mark.parametrize(
    ("space", "told"),
    [
        ({"x": {"low": 2.0, "high": 2.0}}, "must be below"),
        ({"x": {"low": 0.0, "high": 2.0, "log": True}}, "above 0 where log = true"),
        ({"x": {"low": 1.0}}, "'tuning.spaces.one.x.high' is missing"),
        ({"z": {"low": 1.0, "high": 2.0}}, "unknown gain of 'known-optimum' 'z'"),
        ({}, "has no gain"),
    ],
)
def test_wrong_ones_are_refused(space, told):
    with pytest.raises(SpecError, match=told):
        candidates(tuned_suite(tuning={"spaces": {"one": space}}))


def test_wrong_one_of_a_law_names_the_law(monkeypatch):
    monkeypatch.setattr(KnownOptimum, "search_space", {"x": {"low": 3, "high": 2}})
    with pytest.raises(SpecError, match=r"search_space of the controller 'known-optimum'.*'x'"):
        law_space("known-optimum")


def test_unknown_labels_are_answered_with_the_nearest():
    with pytest.raises(UnknownNameError, match="did you mean 'one'"):
        candidates(tuned_suite(), ["onee"])
    with pytest.raises(UnknownNameError, match="did you mean 'two'"):
        candidates(tuned_suite(tuning={"spaces": {"twoo": {"x": {"low": 1.0, "high": 2.0}}}}))


def test_values_are_rounded_and_stay_inside():
    own = SearchRange(low=0.12345, high=0.98765)
    assert own.rounded(0.123449) == 0.12345
    assert own.rounded(0.987649) == 0.9876
    assert own.rounded(0.55555555) == 0.5556
    assert "auto" not in own
    assert True not in SearchRange(low=0.0, high=2.0)
