"""Numbers far beyond those of any robot: refused in words, or a run that says how it ended."""

from __future__ import annotations

import contextlib
import dataclasses
import warnings

import numpy as np
import pytest
from support.swept import swept
from support.variants import description

import mobman as mm
from mobman.arrays import LARGEST, SMALLEST, beyond_sizes
from mobman.controllers.protocol import controllers
from mobman.errors import GainError, MobmanError, SpecError, UsageError
from mobman.simulation.scenario import Scenario
from mobman.tasks.task import check_parameters, parameters_of

FAR = [5e-324, 1e-160, 1e160, 1e300, 1.7e308]
SIZES = r"must be 0, or of a size from 1e-30 to 1e\+15"
ALLOWED = [SMALLEST, LARGEST, -LARGEST]
# one of each family: points, circles, harmonics, turns of the tip, and what is searched for
SOME_TASKS = ("line", "circle", "lissajous", "pose-circle", "kinematic-singularity")


@pytest.fixture(autouse=True)
def no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def settles(make) -> None:
    """It is refused with an error of mobman's, or runs to a status."""
    with contextlib.suppress(MobmanError):
        assert make().status in ("ok", "diverged", "singular")


def run(law="tsm", task="circle", robot="youbot", **options):
    return mm.simulate(robot, law, task, duration=0.005, **options)


@pytest.mark.parametrize("value", FAR)
@pytest.mark.parametrize("law", mm.list_controllers())
def test_gains_are_refused(law, value):
    for field in dataclasses.fields(controllers.get(law).Gains):
        with pytest.raises(GainError, match=rf"^{field.name} = "):
            mm.make_controller(law, **{field.name: value})


def test_gain_that_no_float_holds():
    for name in ("K_F", "a", "alpha_1"):
        with pytest.raises(GainError, match=rf"^{name} = "):
            mm.make_controller("tsm", **{name: 10**400})
    with pytest.raises(GainError, match=rf"^K_F = \[.*\]: {SIZES}"):
        mm.make_controller("tsm", K_F=[1.0] * 7 + [1e300])


@pytest.mark.parametrize("value", ALLOWED)
@pytest.mark.parametrize(
    "law", swept(["tsm", "damped-least-squares", "extended-jacobian"], always=["tsm"])
)
def test_gains_of_the_least_and_largest_size_run(law, value):
    for field in dataclasses.fields(controllers.get(law).Gains):
        settles(lambda name=field.name: run(mm.make_controller(law, **{name: value})))


@pytest.mark.parametrize("value", [*FAR, 10**400])
def test_tasks_parameters_are_refused(value):
    for name in ("radius", "rate", "gap"):
        with pytest.raises(UsageError, match=rf"parameter '{name}' .* is .*"):
            check_parameters("circle", {name: value})
    with pytest.raises(UsageError, match="parameter 'amplitudes'"):
        check_parameters("lissajous", {"amplitudes": [0.1, 0.1, value]})


@pytest.mark.parametrize("value", [SMALLEST, LARGEST])
@pytest.mark.parametrize("task", swept(mm.list_tasks(), always=SOME_TASKS))
def test_tasks_of_the_least_and_largest_size_run(task, value, youbot):
    for item in parameters_of(task):
        for given in (value, [value] * 3):
            settles(
                lambda name=item.name, given=given: run(
                    task=mm.make_task(task, youbot, **{name: given}), robot=youbot
                )
            )


PIECES = [
    {"payload": None},
    {"mass_factor": None},
    {"inertia_factor": None},
    {"inertias": [{"type": "payload", "mass": 1.0, "offset": [0.0, 0.0, None]}]},
    {"friction": [{"type": "coulomb", "torque": None}]},
    {"friction": [{"type": "coulomb", "torque": 1.0, "velocity": None}]},
    {"disturbances": [{"type": "growing", "torque": None, "time": 1e-3, "power": 9.0}]},
    {"disturbances": [{"type": "growing", "torque": 1.0, "time": 1e-3, "power": None}]},
    {"disturbances": [{"type": "sinusoid", "torque": 1.0, "frequency": None}]},
    {"actuation": [{"type": "delay", "delay": None}]},
    {"actuation": [{"type": "rate-limit", "torque": 1.0, "rise_time": None}]},
    {"sensors": [{"type": "noise", "velocity": None}]},
    {"sensors": [{"type": "quantisation", "resolution": None, "velocity": "difference"}]},
    {"slip": [{"type": "lateral", "velocity": None}]},
    {"acceleration": {"type": "robust-differentiator", "lipschitz": None}},
    {"acceleration": {"type": "filtered-difference", "cutoff": None}},
]


def filled(content, value):
    if isinstance(content, dict):
        return {name: filled(item, value) for name, item in content.items()}
    if isinstance(content, list):
        return [filled(item, value) for item in content]
    return value if content is None else content


@pytest.mark.parametrize("piece", PIECES, ids=lambda piece: str(piece).replace(" ", ""))
def test_scenarios(piece):
    for value in [*FAR, -1e300]:
        with pytest.raises(SpecError, match=r"is .*: "):
            Scenario(name="far", **filled(piece, value))
    for value in ALLOWED:
        settles(lambda value=value: run(scenario=Scenario(name="far", **filled(piece, value))))


@pytest.mark.parametrize("field", ["platform", "default", "wheels"])
def test_criterion_of_a_robot(field):
    for value in FAR:
        with pytest.raises(SpecError, match=rf"field 'criterion\.{field}' is .*: {SIZES}"):
            mm.load_robot(description(**{f"criterion__{field}": value}))
    for value in ALLOWED:
        changed = description(**{f"criterion__{field}": value})
        settles(lambda changed=changed: run(robot=mm.load_robot(changed)))


@pytest.mark.parametrize("field", ["criterion__weights", "rest"])
def test_values_by_joint(field):
    for value in FAR:
        with pytest.raises(SpecError, match=rf"field '{field.replace('__', '.')}.* is .*: {SIZES}"):
            mm.load_robot(description(**{field: {"y_1": value}}))


def test_wheel_radius():
    for value in FAR:
        with pytest.raises(SpecError, match=rf"'wheel_radius' is .*: {SIZES}"):
            mm.load_robot(description(platform__wheel_radius=value))


def test_law_whose_torque_overflows_gives_a_record_without_a_warning(youbot):
    class Huge:
        def reset(self, robot, task, dt):
            self.n = 0

        def step(self, t, q, z, z_dot):
            self.n += 1
            return np.full(5, 1e200 if self.n > 2 else 0.0)

    record = run(Huge(), robot=youbot)
    assert record.status == "diverged"
    assert np.isinf(record.metrics["task_error_max"])


def test_sizes():
    assert not any(map(beyond_sizes, [0.0, -0.0, 1, 2**63, True, "1e300", None, 1e-30, -1e15]))
    assert all(map(beyond_sizes, [1e16, -1e-31, np.inf, [0.0, 1e16], {"a": (1e-40,)}]))
    assert beyond_sizes(np.array([[1.0, 1e300]]))
    assert beyond_sizes(np.array(1e300))
