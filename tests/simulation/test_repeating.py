"""Runs repeated from their files alone, to the last bit; or refused, saying which part is not there."""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
from dataclasses import dataclass

import h5py
import numpy as np
import pinocchio as pin
import pytest
from support.platforms import on
from support.runs import Still, Torque
from support.settings import true_robot
from support.variants import ROBOTS, description, toml, youbot_urdf

import mobman as mm
from mobman import provenance
from mobman.controllers.protocol import controllers
from mobman.errors import RecordError, UsageError
from mobman.robots import catalogue
from mobman.simulation.parts import NotPlainError, from_plain
from mobman.simulation.rerun import Own, repeat, verify
from mobman.tasks.circle import Circle
from mobman.tasks.task import tasks

SHORT = {"duration": 0.05}


def _saved(folder, *arguments, every=1, **options):
    record = mm.simulate(*arguments, **{**SHORT, **options})
    return record.save(folder / "run.h5", every=every)


def _identical(path):
    found = verify(path)
    assert found.tolerance == 0.0
    assert not found.machine
    assert not found.versions
    assert found.identical, found.differences
    assert found.equal
    names = [item.name for item in found.compared]
    assert {"state_sha256", "t", "q", "z", "torque", "error/auxiliary", "status"} <= set(names)
    assert not any("compute_time" in name for name in names)
    assert any(name.startswith("metrics/task_error") for name in names)
    return found


def _refused(path) -> str:
    with pytest.raises(RecordError) as caught:
        repeat(path)
    message = str(caught.value)
    assert message.startswith(f"{path} cannot be repeated: ")
    assert "\n" not in message
    return message


@pytest.mark.parametrize(
    ("name", "law", "scenario"),
    [
        ("youbot", "tsm", "disturbed"),
        ("husky_ur5", "tsm", "heavier"),
        ("husky_ur5", "extended-jacobian", "disturbed"),
        ("fixed_panda", "tsm-inverse-actuation", "disturbed"),
        ("fixed_panda", "damped-least-squares", "nominal"),
        ("tiago_dual", "tsm-simplified", "lighter"),
        ("ridgeback_panda", "pseudo-inverse", "disturbed"),
    ],
)
def test_repetition_is_identical(name, law, scenario, tmp_path):
    _identical(_saved(tmp_path, name, law, "circle", scenario=scenario, seed=3, every=7))


def test_repetition_is_a_whole_record(tmp_path):
    record = mm.simulate("youbot", "tsm", "paper", scenario="disturbed", seed=9, **SHORT)
    again = repeat(record.save(tmp_path / "run.h5", every=10))
    assert again.state_sha256 == record.state_sha256
    assert again.spec == record.spec
    assert again.urdf == record.urdf
    assert again.decimation == 1
    assert len(again.t) == len(record.t)
    # and can be repeated itself
    _identical(again.save(tmp_path / "again.h5"))


def test_composed_robot(tmp_path):
    """A platform by its numbers with an arm mounted on it: the arm's file alone."""
    path = _saved(tmp_path, mm.load_robot(on("differential")), "tsm", "circle")
    assert list(mm.load_record(path).urdf) == ["0/ur5_robot.urdf"]
    _identical(path)


def test_robot_whose_files_were_deleted(tmp_path):
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "mine.urdf").write_text(youbot_urdf(), encoding="utf-8")
    content = description("youbot", name="mine", urdf__path="mine.urdf")
    (folder / "mine.toml").write_text(toml(content), encoding="utf-8")
    path = _saved(tmp_path, folder / "mine.toml", "tsm", "circle")
    shutil.rmtree(folder)
    assert _identical(path).note == ""


def test_urdf_is_what_the_robot_was_made_of(tmp_path):
    """Not what is in its file later."""
    (tmp_path / "mine.urdf").write_text(youbot_urdf(), encoding="utf-8")
    robot = mm.load_robot({**description("youbot", urdf__path="mine.urdf"), "folder": tmp_path})
    (tmp_path / "mine.urdf").unlink()
    path = _saved(tmp_path, robot, "pseudo-inverse", "circle")
    assert mm.load_record(path).urdf == {"0/mine.urdf": youbot_urdf().encode()}
    _identical(path)


def test_robot_that_is_registered_with_another_urdf_now(tmp_path, monkeypatch):
    monkeypatch.setattr(catalogue, "_registered", {})
    (tmp_path / "mine.urdf").write_text(youbot_urdf(), encoding="utf-8")
    mm.register_robot(
        {**description("youbot", name="mine", urdf__path="mine.urdf"), "folder": tmp_path}
    )
    path = _saved(tmp_path, "mine", "pseudo-inverse", "circle")
    assert _identical(path).note == ""
    (tmp_path / "mine.urdf").write_text(youbot_urdf() + "<!-- -->", encoding="utf-8")
    found = _identical(path)
    assert "is not the run's any more; the one in the record was used" in found.note
    assert "mine.urdf" in found.note


@pytest.mark.parametrize("name", ["tsm", "extended-jacobian", "pseudo-inverse"])
def test_gains_in_force(tmp_path, youbot, name):
    """With the numbers that "auto" and the robot's K_F became: later defaults change no old run."""
    given = {"a": "auto", "A": 0.3, "alpha_1": "5/7", "c": 2} if name == "tsm" else {"K_p": 20.0}
    path = _saved(tmp_path, youbot, mm.make_controller(name, **given), "circle")
    record = mm.load_record(path)
    gains = record.spec["gains"]
    assert gains == record.settings
    assert gains["K_F"] == youbot.criterion_weights.tolist()
    if name == "tsm":
        assert gains["alpha_1"] == "5/7"
        assert 0.0 < gains["a"] < 1.0
    _identical(path)


def test_own_start_and_sampling(tmp_path, youbot):
    q0 = youbot.q_rest + 0.1
    _identical(_saved(tmp_path, youbot, "tsm", "circle", q0=q0, dt=2.5e-3, every=3))


def test_task_with_its_own_parameters(tmp_path):
    task = Circle(centre=(0.3, 0.1 + 0.2, np.float64(0.35)), radius=1 / 3, rate=-0.7, name="mine")
    path = _saved(tmp_path, "youbot", "tsm", task)
    assert mm.load_record(path).task == "mine"
    _identical(path)


@pytest.mark.parametrize("plant", ["heavier", mm.load_scenario("lighter")], ids=["name", "object"])
def test_plant_that_is_a_scenario(tmp_path, plant):
    _identical(_saved(tmp_path, "youbot", "tsm", "circle", plant=plant, scenario="disturbed"))


def test_plant_that_is_a_robot(tmp_path, youbot):
    """With inertias of its own, on which the scenario's changes come."""
    plant = true_robot(youbot, 1.1, 1.3, payload=0.2)
    path = _saved(tmp_path, youbot, "tsm", "circle", plant=plant, scenario="heavier")
    assert len(mm.load_record(path).spec["plant_inertias"]) == youbot.model.njoints - 1
    _identical(path)


def test_plant_that_is_a_robot_of_another_urdf(tmp_path, youbot):
    text = youbot_urdf().replace('value="', 'value="1', 1)
    assert text != youbot_urdf()
    (tmp_path / "other.urdf").write_text(text, encoding="utf-8")
    plant = mm.load_robot({**description(urdf__path="other.urdf"), "folder": tmp_path})
    path = _saved(tmp_path, youbot, "pseudo-inverse", "circle", plant=plant)
    (tmp_path / "other.urdf").unlink()
    assert list(mm.load_record(path).urdf) == ["0/youbot.urdf", "plant/0/other.urdf"]
    _identical(path)


@pytest.mark.parametrize("role", ["robot", "plant"])
def test_robot_that_was_changed_in_python(tmp_path, youbot, role):
    """What its description does not say; inertias of a plant are in the file, lengths are not."""
    model = youbot.model.copy()
    if role == "robot":
        model.inertias[8] = pin.Inertia(9.0, model.inertias[8].lever, model.inertias[8].inertia)
    else:
        placement = model.jointPlacements[8].copy()
        placement.translation = placement.translation * 1.5
        model.jointPlacements[8] = placement
    changed = youbot.with_model(model)
    robots = (changed, None) if role == "robot" else (youbot, changed)
    path = _saved(tmp_path, robots[0], "pseudo-inverse", "circle", plant=robots[1])
    assert f"its {role} has other inertias or dimensions" in _refused(path)


class Damping:
    """A law of the user's own, without gains."""

    name = "damping"

    def reset(self, robot, task, dt):
        self.robot = robot

    def step(self, t, q, z, z_dot):
        return -z


class Stiffness(Damping):
    """One with gains."""

    name = "stiffness"

    @dataclass(frozen=True)
    class Gains:
        k: float = 1.0
        shape: tuple[float, ...] = (1.0, 2.0)

    def __init__(self, gains):
        self.gains = gains

    def step(self, t, q, z, z_dot):
        return -self.gains.k * z + self.gains.shape[0]


class Runaway(Damping):
    """One that drives the robot faster and faster."""

    name = "runaway"

    def step(self, t, q, z, z_dot):
        return 1.0 + z


class Line:
    """A task of the user's own, no dataclass."""

    def __init__(self, robot, q0, speed=0.1):
        self.start, self.speed = robot.tip_pose(q0).translation.copy(), speed

    def desired(self, t):
        v = np.array([self.speed, 0.0, 0.0])
        return self.start + v * t, v, 0 * v, 0 * v


@pytest.fixture
def registered(monkeypatch):
    """Laws and tasks of the user's own, for one test."""
    controllers.loaded(), tasks.loaded()
    for registry in (controllers, tasks):
        monkeypatch.setattr(registry, "_items", dict(registry.loaded()))
    controllers.register("damping", Damping)
    controllers.register("stiff", Stiffness)
    controllers.register("runaway", Runaway)
    tasks.register("line-of-mine", Line)


@pytest.mark.parametrize("law", ["damping", "stiff"])
def test_own_law_by_name(registered, tmp_path, law):
    _identical(_saved(tmp_path, "youbot", law, "circle"))


def test_own_law_with_gains(registered, tmp_path):
    path = _saved(tmp_path, "youbot", Stiffness(Stiffness.Gains(k=0.3)), "circle")
    assert mm.load_record(path).spec["law"] == "stiff"
    _identical(path)


def test_law_that_is_not_registered_here(registered, tmp_path):
    path = _saved(tmp_path, "youbot", "damping", "circle")
    del controllers._items["damping"]
    refusal = _refused(path)
    assert "its controller cannot be made: unknown controller 'damping'" in refusal
    assert "--controller FILE.py:NAME" in refusal


def test_class_that_is_given_gets_the_gains_of_the_record(tmp_path):
    path = _saved(tmp_path, "youbot", Stiffness(Stiffness.Gains(k=0.3)), "circle")
    assert "the class Stiffness, which is not registered" in _refused(path)
    assert verify(path, own=Own(controller=Stiffness), tolerance=0.0).identical


def test_class_that_is_given_without_gains_in_the_record(tmp_path):
    path = _saved(tmp_path, "youbot", Stiffness(Stiffness.Gains(1.0, (1.0, object()))), "circle")
    with pytest.raises(mm.MobmanError, match="does not have its gains; give a function"):
        repeat(path, own=Own(controller=Stiffness))


def test_task_that_is_given_with_other_fields(tmp_path):
    def smaller(robot, q0):
        return mm.make_task("circle", robot, q0, radius=0.2)

    def same(robot, q0):
        return mm.make_task("circle", robot, q0, radius=0.3)

    task = mm.make_task("circle", "youbot", radius=0.3)
    path = _saved(tmp_path, "youbot", "pseudo-inverse", task)
    with pytest.raises(mm.MobmanError, match=r"centre = .*0\.2,.* that of the run .*0\.3,"):
        repeat(path, own=Own(make_task=smaller))
    assert verify(path, own=Own(make_task=same), tolerance=0.0).identical


def test_object_of_a_class_that_is_not_registered(tmp_path):
    path = _saved(tmp_path, "youbot", Torque(lambda t: np.zeros(5)), "circle")
    assert "its controller is an object of the class Torque, which is not registered" in _refused(
        path
    )


def test_subclass_of_a_law_is_another_law(tmp_path):
    law = mm.make_controller("tsm")
    other = type("Other", (type(law),), {})(law.gains)
    assert "an object of the class Other" in _refused(_saved(tmp_path, "youbot", other, "circle"))


def test_law_whose_gains_are_no_numbers(registered, tmp_path):
    path = _saved(tmp_path, "youbot", Stiffness(Stiffness.Gains(1.0, (1.0, object()))), "circle")
    assert "the gains of its controller, a Stiffness, are more than numbers" in _refused(path)


def test_own_task_by_name(registered, tmp_path):
    path = _saved(tmp_path, "youbot", "tsm", "line-of-mine")
    _identical(path)
    del tasks._items["line-of-mine"]
    assert "its task cannot be made: unknown task 'line-of-mine'" in _refused(path)


@pytest.mark.parametrize(
    ("task", "former"),
    [
        ("circle", "mobman.tasks.trajectories.circle:Circle"),
        ("line", "mobman.tasks.paths.point_to_point:PointToPoint"),
        ("kinematic-singularity", "mobman.tasks.trajectories.kinematic_singularity:ToTheBoundary"),
    ],
)
def test_task_by_the_name_that_its_class_had(tmp_path, task, former):
    """Records of older versions can be repeated."""
    path = _saved(tmp_path, "youbot", "pseudo-inverse", task)
    with h5py.File(path, "a") as file:
        spec = json.loads(file.attrs["spec_json"])
        assert spec["task_object"]["class"] != former
        spec["task_object"]["class"] = former
        file.attrs["spec_json"] = json.dumps(spec)
    _identical(path)


def test_task_that_is_an_object(tmp_path):
    path = _saved(tmp_path, "youbot", "tsm", Still([0.5, 0.0, 0.3]))
    assert "its task is an object that the file does not hold: Still is" in _refused(path)


@dataclass
class Holding:
    """A task with something in it."""

    held: object

    def desired(self, t):
        return np.array([0.5, 0.0, 0.3]), np.zeros(3), np.zeros(3), np.zeros(3)


@pytest.mark.parametrize(
    "held",
    [{"a": [1, (2.5, None)]}, np.eye(2), np.array([1, 2], np.uint8), math.nan, np.int64(3)],
    ids=str,
)
def test_task_that_holds_plain_values(registered, tmp_path, held):
    tasks.register("holding-of-mine", lambda robot, q0: Holding(0))
    _identical(_saved(tmp_path, "youbot", "pseudo-inverse", Holding(held), duration=0.01))


@pytest.mark.parametrize(
    ("held", "words"),
    [
        ({1: 2}, "a dictionary whose keys are more than text"),
        ({(1, 2): 3}, "a dictionary whose keys are more than text"),
        ({1, 2}, "set is no dataclass, and nothing else that a file can hold"),
        (np.array([1j]), "ndarray is no dataclass, and nothing else"),
        (np.longdouble(1), "longdouble is no dataclass"),
        (Circle((0.0, 0.0, 0.0), 1.0, 1.0), None),
    ],
    ids=str,
)
def test_task_that_holds_more_than_plain_values(registered, tmp_path, held, words):
    tasks.register("holding-of-mine", lambda robot, q0: Holding(0))
    path = _saved(tmp_path, "youbot", "pseudo-inverse", Holding(held), duration=0.01)
    if words is None:
        _identical(path)
    else:
        assert f"its task is an object that the file does not hold: {words}" in _refused(path)


_CIRCLE = "mobman.tasks.circle:"


@pytest.mark.parametrize(
    ("plain", "words"),
    [
        ({"class": f"{_CIRCLE}Square", "fields": {}}, r"there is no class .*Square' here"),
        (
            {"class": f"{_CIRCLE}np.pi", "fields": {}},
            r"'mobman\.tasks\.circle:np\.pi' is not a dataclass",
        ),
        (
            {"class": "mobman.tasks.singular:PointToPoint", "fields": {}},
            r"'mobman\.tasks\.singular:PointToPoint' is a class of mobman\.tasks\.paths",
        ),
        ({"class": f"{_CIRCLE}Circle", "fields": {}}, "Circle refuses its own fields: .*missing 3"),
        ({"array": [1], "dtype": "O"}, "'O' is no type of numbers"),
    ],
    ids=str,
)
def test_plain_values_that_nothing_is_made_of(plain, words):
    with pytest.raises(NotPlainError, match=words):
        from_plain(plain, "")


class Unsaid(Damping):
    """One whose gains are said by its class only."""

    Gains = Stiffness.Gains


def test_own_parts_that_are_none_are_no_fault_of_the_file(registered, tmp_path):
    controllers.register("unsaid", Unsaid)
    path = _saved(tmp_path, "youbot", Unsaid(), "circle")
    assert "its controller, a Unsaid, does not say its gains" in _refused(path)
    assert repeat(path, own=Own(controller=Unsaid())).ok
    for own, words in (
        ({"robot": "youbot"}, "robot = 'youbot'"),
        ({"make_task": 5}, "make_task = 5"),
    ):
        with pytest.raises(UsageError, match=rf"{words}: must be a"):
            repeat(path, own=Own(**own))
    for tolerance in (-1.0, math.nan, "0"):
        with pytest.raises(UsageError, match=r"tolerance = .*: must be a number from 0 on"):
            verify(path, tolerance=tolerance)


def test_everything_that_is_not_there_is_told_at_once(tmp_path):
    path = _saved(tmp_path, "youbot", Torque(lambda t: np.zeros(5)), Still([0.5, 0.0, 0.3]))
    assert "Torque" in _refused(path)
    assert "Still" in _refused(path)


def test_platform_in_python(tmp_path, monkeypatch):
    """Code is not in a record, and is not taken from wherever one happens to be."""
    monkeypatch.setattr(catalogue, "_registered", {})
    monkeypatch.chdir(tmp_path)
    path = _saved(tmp_path, "youbot", "pseudo-inverse", "circle")
    with h5py.File(path, "a") as file:
        spec = json.loads(file.attrs["spec_json"])
        spec["robot"] |= {
            "name": "own",
            "platform": {"type": "custom", "definition": "mine.py:Mine"},
        }
        file.attrs["spec_json"] = json.dumps(spec)
    (tmp_path / "mine.py").write_text("raise SystemExit('run')\n", encoding="utf-8")
    assert "its platform is Python code, 'mine.py:Mine', which the file does not hold" in _refused(
        path
    )


def test_class_in_a_file_is_not_imported_for_it(tmp_path):
    path = _saved(tmp_path, "youbot", "pseudo-inverse", "circle")
    with h5py.File(path, "a") as file:
        spec = json.loads(file.attrs["spec_json"])
        spec["task_object"] = {"class": "antigravity:Fly", "fields": {}}
        file.attrs["spec_json"] = json.dumps(spec)
    assert "'antigravity:Fly' is no class of mobman or of a registered package" in _refused(path)


@pytest.mark.parametrize(
    "part", ["robot", "law", "task_object", "q0", "not_repeatable", "at_start"]
)
def test_spec_that_is_not_whole(tmp_path, part):
    path = _saved(tmp_path, "youbot", "pseudo-inverse", "circle")
    with h5py.File(path, "a") as file:
        spec = json.loads(file.attrs["spec_json"])
        del spec[part]
        file.attrs["spec_json"] = json.dumps(spec)
    assert "not whole" in _refused(path)


def test_urdf_that_is_missing(tmp_path):
    path = _saved(tmp_path, "youbot", "pseudo-inverse", "circle")
    with h5py.File(path, "a") as file:
        del file["urdf"]
    assert "URDFs are not all in the file" in _refused(path)


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    record = mm.simulate("youbot", "tsm", "paper", scenario="disturbed", seed=2, **SHORT)
    return record.save(tmp_path_factory.mktemp("good") / "run.h5", every=5)


@pytest.mark.parametrize(
    ("place", "index", "column"),
    [("q", (4, 6), "y_2"), ("torque", (0, 1), "alpha_2"), ("sliding/S", (10, 2), "component 2")],
)
def test_changed_sample_is_found(good, tmp_path, place, index, column):
    path = shutil.copy(good, tmp_path / "run.h5")
    with h5py.File(path, "a") as file:
        before = file[place][index]
        file[place][index] = np.nextafter(before, np.inf)
    found = verify(path)
    assert not found.equal
    (item,) = found.differences
    assert item.name == place
    assert 0.0 < item.difference < 1e-10
    assert f"at t = {index[0] * 5e-3:g} s" in item.where
    assert column in item.where
    # within a tolerance it is the same run
    assert verify(path, tolerance=1e-9).equal
    assert not verify(path, tolerance=1e-9).identical


def test_other_changes_are_found(good, tmp_path):
    for change, name in (
        (lambda file: file["metrics"].attrs.modify("torque_peak", 1.0), "metrics/torque_peak"),
        (lambda file: file["metrics"].attrs.create("made_up", 1.0), "metrics/made_up"),
        (lambda file: file.attrs.modify("state_sha256", "0" * 64), "state_sha256"),
        (lambda file: file.attrs.modify("status", "diverged"), "status"),
        (lambda file: file.attrs.modify("task", "other"), "task"),
        (lambda file: file["t"].__setitem__(3, 0.5), "t"),
    ):
        path = shutil.copy(good, tmp_path / "run.h5")
        with h5py.File(path, "a") as file:
            change(file)
        assert [item.name for item in verify(path).differences] == [name]


def test_run_with_samples_missing_at_the_end(good, tmp_path):
    path = tmp_path / "run.h5"
    record = mm.load_record(good)
    arrays = {
        field.name: getattr(record, field.name)[:-2]
        for field in dataclasses.fields(record)
        if isinstance(getattr(record, field.name), np.ndarray)
    }
    signals = {name: values[:-2] for name, values in record.signals.items()}
    dataclasses.replace(record, signals=signals, **arrays).save(path)
    (item,) = verify(path).differences
    assert item.name == "t at the end"
    assert item.difference == pytest.approx(0.01)
    assert "0.04 s in the file, 0.05 s now" in item.where


def test_controllers_time_does_not_matter(good, tmp_path):
    path = shutil.copy(good, tmp_path / "run.h5")
    with h5py.File(path, "a") as file:
        file["compute_time"][:] = 7.0
        file["metrics"].attrs["compute_time_median"] = 7.0
    assert verify(path).identical


def test_on_another_processor_within_a_tolerance(good, monkeypatch):
    other = {**provenance.machine(), "processor": "Abacus 3000"}
    record = mm.load_record(good)
    path = dataclasses.replace(record, machine=other).save(good.with_name("elsewhere.h5"))
    found = verify(path)
    assert found.tolerance > 0.0
    assert found.equal
    assert found.machine == {"processor": ("Abacus 3000", provenance.machine()["processor"])}
    assert verify(path, tolerance=0.0).identical
    far = dataclasses.replace(record, machine=other, z=record.z + 0.01)
    differing = verify(far.save(good.with_name("far.h5"))).differences
    assert [item.name for item in differing] == ["z"]


def test_with_other_versions_within_a_tolerance(good):
    record = mm.load_record(good)
    for name, matters in (("numpy", True), ("h5py", False)):
        changed = dataclasses.replace(record, versions={**record.versions, name: "0.1"})
        found = verify(changed.save(good.with_name("versions.h5")))
        assert (found.tolerance > 0.0) is matters
        assert (name in found.versions) is matters
        assert found.equal


def test_run_that_diverged(registered, tmp_path):
    """Bit for bit here; elsewhere only its first half is judged."""
    record = mm.simulate("youbot", "runaway", "circle", duration=1.0)
    assert record.status == "diverged"
    assert len(record.t) > 20
    _identical(record.save(tmp_path / "run.h5", every=3))
    q = record.q.copy()
    q[-1] += 10.0
    elsewhere = {"q": q, "machine": {**record.machine, "processor": "Abacus 3000"}}
    path = dataclasses.replace(record, **elsewhere).save(tmp_path / "late.h5")
    assert verify(path).equal
    assert not verify(path, tolerance=0.0).equal
    q[1] += 10.0
    path = dataclasses.replace(record, **elsewhere).save(tmp_path / "early.h5")
    assert [item.name for item in verify(path).differences] == ["q"]


def test_meshes_are_not_needed(tmp_path):
    """Those of the registered robots are in packages, which the file does not name."""
    for name in ("tiago", "lekiwi_so101"):
        assert (ROBOTS / f"{name}.toml").is_file()
        path = _saved(tmp_path, name, "pseudo-inverse", "circle", duration=0.01)
        assert "mesh" in "".join(text.decode() for text in mm.load_record(path).urdf.values())
        _identical(path)
