"""The identity of a run: all that its result depends on, wherever that is, and nothing else."""

from __future__ import annotations

import importlib.util
import sys

import pytest
from support.suites import suite_of
from support.variants import ROLLING, description, toml, youbot_urdf

import mobman as mm
from mobman.benchmark.work import jobs_of, robot_of
from mobman.errors import MobmanError, RecordError, SpecError
from mobman.provenance import versions
from mobman.simulation.disturbances import frictions
from mobman.simulation.run_spec import RunSpec


@pytest.fixture
def folder(tmp_path):
    """A robot of one's own: its description, its URDF, and its platform in Python."""
    made = tmp_path / "robots"
    made.mkdir()
    (made / "own.py").write_text(ROLLING)
    (made / "own.urdf").write_text(youbot_urdf())
    platform = {"type": "custom", "definition": "own.py:Body"}
    content = description(name="own", urdf__path="own.urdf") | {"platform": platform}
    (made / "own.toml").write_text(toml(content))
    return made


def run_of(folder, **fields):
    groups = [{"robots": [str(folder / "own.toml")], "tasks": ["circle"]}]
    (run,) = suite_of(["pseudo-inverse"], groups=groups, **fields).runs()
    return run


@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("own.py", "0.158", "0.159"),
        ("own.urdf", 'mass value="', 'mass value="1'),
        ("own.toml", 'name = "own"', 'name = "other"'),
    ],
)
def test_what_the_robot_is_made_of_is_part_of_it(folder, name, before, after):
    first, path = run_of(folder).run_id, folder / name
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after))
    assert run_of(folder).run_id != first
    path.write_text(text)
    assert run_of(folder).run_id == first


def test_where_the_robot_is_does_not_matter(folder):
    first = run_of(folder)
    elsewhere = folder.rename(folder.with_name("elsewhere"))
    second = run_of(elsewhere)
    assert second.robot != first.robot
    assert second.run_id == first.run_id


def test_one_robot_at_two_places_is_told(folder):
    (folder.parent / "copy").mkdir()
    for path in folder.iterdir():
        (folder.parent / "copy" / path.name).write_bytes(path.read_bytes())
    robots = [str(place / "own.toml") for place in (folder, folder.parent / "copy")]
    suite = suite_of(["pseudo-inverse"], groups=[{"robots": robots, "tasks": ["circle"]}])
    with pytest.raises(SpecError, match=r"robots '.*' and '.*' are the same run"):
        suite.runs()


def test_code_that_is_edited_meanwhile_is_not_run(folder):
    groups = [{"robots": [str(folder / "own.toml")], "tasks": ["circle"]}]
    (job,) = jobs_of(suite_of(["pseudo-inverse"], groups=groups).runs(), 60.0)
    (folder / "own.py").write_text(ROLLING.replace("0.158", "0.159"))
    with pytest.raises(MobmanError, match="or its platform's code is not"):
        robot_of(job)


def test_code_in_a_package_is_part_of_it_and_not_imported_to_see(folder, monkeypatch):
    package = folder / "packages" / "wheeled_things"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "body.py").write_text(ROLLING)
    monkeypatch.syspath_prepend(folder / "packages")
    toml_file = folder / "own.toml"
    toml_file.write_text(toml_file.read_text().replace("own.py:", "wheeled_things.body:"))
    run = run_of(folder)
    for name in [name for name in sys.modules if name.startswith("wheeled_things")]:
        monkeypatch.delitem(sys.modules, name)
    (package / "body.py").write_text(ROLLING.replace("0.158", "0.159"))
    from mobman.robots.catalogue import find_spec
    from mobman.simulation.run_spec import fingerprint

    assert fingerprint(find_spec(run.robot)) != run.robot_sha256
    assert "wheeled_things" not in sys.modules


def test_own_piece_of_a_scenario_is_part_of_it(tmp_path, monkeypatch):
    path = tmp_path / "pieces_of_mine.py"
    path.write_text(
        "from mobman.simulation.disturbances import frictions\n"
        "from mobman.simulation.pieces import Piece\n\n\n"
        "class Sticky(Piece):\n    pass\n\n\n"
        'frictions.register("sticky", Sticky)\n'
    )
    frictions.loaded()
    monkeypatch.setattr(frictions, "_items", dict(frictions._items))
    spec = importlib.util.spec_from_file_location("pieces_of_mine", path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "pieces_of_mine", module)
    spec.loader.exec_module(module)
    scenarios = {"mine": {"friction": [{"type": "sticky"}]}}
    group = {"robots": ["youbot"], "tasks": ["circle"], "scenarios": ["mine", "nominal"]}
    suite = suite_of(["pseudo-inverse"], scenarios=scenarios, groups=[group])
    mine, nominal = suite.runs()
    path.write_text(path.read_text() + "# edited\n")
    again, same = suite.runs()
    assert mine.code_sha256
    assert again.run_id != mine.run_id
    assert same.run_id == nominal.run_id
    assert not nominal.code_sha256


def test_record_keeps_the_run(youbot, tmp_path):
    record = mm.simulate(youbot, "tsm", "circle", duration=0.01, plant="heavier", seed=3)
    path = record.save(tmp_path / "run.h5")
    run = RunSpec.of_record(mm.load_record(path).spec)
    assert (run.robot, run.law, run.task_name, run.seed) == ("youbot", "tsm", "circle", 3)
    assert run.as_recorded() == record.spec
    for name, value in (("seed", -1), ("dt", "fast"), ("q0", [[0.0]]), ("robot", None)):
        with pytest.raises(RecordError, match="is not whole") as caught:
            RunSpec.of_record({**record.spec, name: value})
        assert "\n" not in str(caught.value)


def test_records_name_the_source_that_made_them(youbot):
    record = mm.simulate(youbot, "tsm", "circle", duration=0.01)
    assert len(record.versions["source"]) == 16
    assert record.versions == versions()
