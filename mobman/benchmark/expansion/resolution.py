"""From runs by their names to runs by what the names stand for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from mobman.benchmark.expansion.entries import Entries
from mobman.benchmark.expansion.places import Place
from mobman.benchmark.expansion.problems import Problems
from mobman.controllers.protocol import controllers, make_controller
from mobman.model.build import load_robot
from mobman.model.platforms.platform import platforms
from mobman.robots.catalogue import find_spec
from mobman.simulation.run_spec import RunSpec, fingerprint, foreign_code_sha256
from mobman.simulation.scenario import Scenario
from mobman.tasks.task import make_task, task_parameters, tasks

if TYPE_CHECKING:
    from mobman.benchmark.suite import Suite


class Resolution:
    """What the names in places stand for; each thing that several runs share is made once.

    Args:
        suite: The suite.
        entries: What it defines itself.
        places: Its runs by their names.
        problems: Where it is noted what cannot be made.
    """

    def __init__(
        self, suite: Suite, entries: Entries, places: Sequence[Place], problems: Problems
    ) -> None:
        self._suite, self._entries = suite, entries
        attempt = problems.attempt
        self._robots: dict[str, Any] = {
            name: attempt(f"robot {name!r}", _fingerprint_of, name)
            for name in dict.fromkeys(place.robot for place in places)
        }
        self._scenarios: dict[str, Any] = {
            name: attempt(f"scenario {name!r}", entries.scenario, name)
            for name in dict.fromkeys(place.scenario for place in places)
        }
        self._laws: dict[tuple[str, str], Any] = {
            key: attempt(_told(place), self._gains_and_settings, place)
            for key, place in {place.controller_key: place for place in places}.items()
        }
        self._tasks: dict[tuple[str, str], Any] = {
            key: attempt(f"task {key[1]!r} for robot {key[0]!r}", self._parameters, *key)
            for key in dict.fromkeys((place.robot, place.task) for place in places)
            if self._robots[key[0]] is not None
        }
        self._codes: dict[tuple[str, str, str, str], str] = {}

    def run(self, place: Place) -> RunSpec:
        """The run at a place, if no problem was noted."""
        gains, settings = self._laws[place.controller_key]
        law = self._entries.law_of(place.label)
        task, given = self._entries.task_of(place.task)
        return RunSpec(
            label=place.label,
            robot=place.robot,
            robot_sha256=self._robots[place.robot],
            law=law,
            gains=gains,
            settings=settings,
            task=place.task,
            task_name=task,
            task_given=given,
            task_parameters=self._tasks[place.robot, place.task],
            scenario=self._scenarios[place.scenario],
            family=self._entries.family_of(place.scenario),
            seed=place.seed,
            duration=place.duration,
            dt=place.dt,
            record_period=self._suite.record_period,
            compression=self._suite.compression,
            code_sha256=self._code(place, law, task),
        )

    def _gains_and_settings(self, place: Place) -> tuple[dict[str, Any], dict[str, Any]]:
        """Gains as given, and all of them."""
        gains = {**self._entries.controllers.fields[place.label], **place.gains}
        controller = make_controller(self._entries.law_of(place.label), **gains)
        settings: dict[str, Any] = getattr(controller, "settings", dict)()
        return gains, settings

    def _code(self, place: Place, law: str, task: str) -> str:
        key = (law, task, place.robot, place.scenario)
        if key not in self._codes:
            pieces = Scenario.model_validate(self._scenarios[place.scenario]).types()
            platform = platforms.get(find_spec(place.robot).platform.type)
            self._codes[key] = foreign_code_sha256(
                [controllers.get(law), tasks.get(task), platform, *pieces]
            )
        return self._codes[key]

    def _parameters(self, robot: str, task: str) -> dict[str, Any]:
        name, given = self._entries.task_of(task)
        return task_parameters(make_task(name, load_robot(robot), **given))


def _fingerprint_of(robot: str) -> str:
    return fingerprint(find_spec(robot))


def _told(place: Place) -> str:
    own = f" in {place.where}" if place.gains else ""
    return f"controller {place.label!r}{own}"
