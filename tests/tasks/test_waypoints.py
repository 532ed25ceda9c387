"""Paths through the points of files: their rates, their ends, what records and suites keep, and files
that are not as they should be."""

from __future__ import annotations

import math

import h5py
import numpy as np
import pinocchio as pin
import pytest
from support.differences import derivative, relative
from support.suites import suite_of

import mobman as mm
from mobman.benchmark.work import jobs_of
from mobman.errors import MobmanError, UsageError
from mobman.simulation.rerun import verify
from mobman.tasks.waypoints import PoseSpline, Spline, _fastest

HEADER = "t,x,y,z,qw,qx,qy,qz"
POINT = "0,0,0,0,1,0,0,0"


def _random(seed, *, poses, count=7):
    """Columns of random points at uneven times."""
    random = np.random.default_rng(seed)
    t = np.cumsum([0.3, *random.uniform(0.8, 1.6, count - 1)])
    columns = [t[:, None], np.cumsum(random.uniform(-0.2, 0.2, (count, 3)), axis=0)]
    if poses:
        turns = np.cumsum(random.uniform(-0.5, 0.5, (count, 3)), axis=0)
        xyzw = np.array([pin.Quaternion(pin.exp3(turn)).coeffs() for turn in turns])
        columns.append(xyzw[:, [3, 0, 1, 2]] * random.choice([-1.0, 1.0], (count, 1)))
    return np.hstack(columns)


def _written(folder, values, name="points.csv", header=HEADER):
    path = folder / name
    names = header.split(",")[: values.shape[1]]
    if path.suffix == ".csv":
        np.savetxt(path, values, delimiter=",", header=",".join(names), fmt="%.17g")
        return path
    with h5py.File(path, "w") as file:
        file["points"] = values
        file["points"].attrs["columns"] = names
    return path


def _rotation(quaternion):
    return pin.Quaternion(*quaternion).toRotationMatrix()


@pytest.mark.parametrize("poses", [False, True], ids=["position", "pose"])
@pytest.mark.parametrize("name", ["waypoints", "path"])
def test_rates(name, poses, tmp_path, youbot):
    """p_d' to p_d''' are the derivatives, across points, too; Omega_d is the angular velocity."""
    made = mm.make_task(
        name,
        youbot,
        file=_written(tmp_path, _random(len(name), poses=poses)),
        **({"travel": 9.0} if name == "path" else {}),
    )
    start, end = made.span
    times = [*np.random.default_rng(1).uniform(start + 0.1, end - 0.1, 12)]
    h, bound = (4e-3, 1e-6)
    if name == "path":
        # the fifth derivative jumps at points: differences have to be smaller there
        h, bound = (1e-3, 1e-5)
    else:
        times += made.knots[1:-1]
    for t in times:
        now = made.desired(t)
        p_dot = derivative(lambda s, t=t: made.desired(t + s)[0], h)
        assert relative(now[1][:3], p_dot[:3]) < 1e-8
        if poses:
            assert abs(np.linalg.norm(now[0][3:]) - 1.0) < 1e-14
            turning = derivative(lambda s, t=t: _rotation(made.desired(t + s)[0][3:]), h)
            omega = pin.unSkew(turning @ _rotation(now[0][3:]).T)
            assert relative(now[1][3:], omega) < 1e-8
        for order in (1, 2):
            rate = derivative(lambda s, t=t, k=order: made.desired(t + s)[k], h)
            assert relative(now[order + 1], rate) < bound


@pytest.mark.parametrize("suffix", ["csv", "h5"])
def test_points_are_passed_at_their_times_from_rest_to_rest(suffix, tmp_path, youbot):
    values = _random(4, poses=True)
    made = mm.make_task("waypoints", youbot, file=_written(tmp_path, values, f"points.{suffix}"))
    for t, *pose in values:
        p_d = made.desired(t)[0]
        assert np.allclose(p_d[:3], pose[:3], atol=1e-12)
        assert np.allclose(_rotation(p_d[3:]), _rotation(pose[3:]), atol=1e-12)
    for inside, beyond in ((values[0, 0] + 1e-7, 0.0), (values[-1, 0] - 1e-7, 100.0)):
        assert not np.any(made.desired(beyond)[1:])
        for rate in made.desired(inside)[1:]:  # C^3 where the motion begins and ends
            assert np.abs(rate).max() < 1e-4


def test_two_points_are_joined_by_the_polynomial_of_a_line(tmp_path, youbot):
    """Septic splines of two points at rest are 35 x^4 - 84 x^5 + 70 x^6 - 20 x^7."""
    values = np.array([[0.0, 0.1, 0.2, 0.3], [2.0, 0.5, 0.2, 0.1]])
    file = _written(tmp_path, values)
    for made in (
        mm.make_task("waypoints", youbot, file=file),
        mm.make_task("path", youbot, file=file, travel=2.0),
    ):
        for t in (0.3, 1.0, 1.7):
            x = t / 2.0
            share = 35 * x**4 - 84 * x**5 + 70 * x**6 - 20 * x**7
            expected = values[0, 1:] + share * (values[1] - values[0])[1:]
            assert np.allclose(made.desired(t)[0], expected, atol=1e-13)


def test_path_runs_along_a_circle_and_stops(tmp_path, youbot):
    angles = np.linspace(0.0, 2.0 * math.pi, 41)
    values = np.stack([0.3 * np.cos(angles), 0.3 * np.sin(angles), 0.0 * angles], axis=1)
    file = _written(tmp_path, values, header="x,y,z")
    made = mm.make_task("path", youbot, file=file)
    times = np.linspace(*made.span, 200)
    radii = [np.linalg.norm(made.desired(t)[0][:2]) for t in times]
    assert np.abs(np.array(radii) - 0.3).max() < 1e-4
    speeds = [np.linalg.norm(made.desired(t)[1]) for t in times]
    assert 0.45 < max(speeds) < 0.51
    for t in made.span:
        assert not np.any(made.desired(t)[1:])


def test_start_is_ahead_left_and_up_of_the_tip(tmp_path, tiago):
    q0 = tiago.q_rest.copy()
    q0[tiago.joint_names.index("base_theta")] = 0.5 * math.pi
    turn = [math.cos(0.25), math.sin(0.25), 0.0, 0.0]  # about the direction ahead: world y
    values = np.array([[0.0, 0, 0, 0, 1, 0, 0, 0], [3.0, 0.2, 0.1, 0.05, *turn]])
    file = _written(tmp_path, values)
    made = mm.make_task("waypoints", tiago, q0, file=file, frame="start")
    tip = tiago.tip_pose(q0)
    first, last = made.desired(0.0)[0], made.desired(3.0)[0]
    assert np.allclose(first[:3], tip.translation, atol=1e-14)
    assert np.allclose(_rotation(first[3:]), tip.rotation, atol=1e-14)
    assert np.allclose(last[:3], tip.translation + np.array([-0.1, 0.2, 0.05]), atol=1e-14)
    expected = pin.exp3(np.array([0.0, 0.5, 0.0])) @ tip.rotation
    assert np.allclose(_rotation(last[3:]), expected, atol=1e-14)


def test_bounds_of_the_tips_speed_are_bounds(robot):
    """No z within the velocity limits moves the tip faster, in any posture."""
    speed, turning = _fastest(robot)
    random, limits = np.random.default_rng(1), robot.limits
    most = np.where(np.isfinite(limits.velocity), limits.velocity, 1.0)
    for _ in range(50):
        q = robot.q_rest.copy()
        low, high = limits.lower[robot.arm_index], limits.upper[robot.arm_index]
        inside = np.isfinite(low) & np.isfinite(high)
        low, high = np.where(inside, low, -3.0), np.where(inside, high, 3.0)
        q[robot.arm_index] = random.uniform(low, high)
        z = most * random.choice([-1.0, 1.0], robot.nz)
        q = robot.consistent(q)
        q_dot = robot.velocity_map(q) @ z
        q_dot /= max(1.0, np.max(np.abs(q_dot) / limits.joint_velocity))
        rates = robot.tip_jacobian(q) @ q_dot
        assert np.linalg.norm(rates[:3]) <= speed * (1.0 + 1e-9)
        assert np.linalg.norm(rates[3:]) <= turning * (1.0 + 1e-9)


def test_waypoints_are_followed_and_repeated_without_their_file(tmp_path):
    values = np.array([[0.0, 0, 0, 0], [1.5, 0.05, 0.05, 0.0], [3.0, 0.1, 0.0, 0.02]])
    file = _written(tmp_path, values)
    task = mm.make_task("waypoints", "tiago_no_hand", file=file, frame="start")
    record = mm.simulate("tiago_no_hand", "tsm", task, duration=3.1)
    file.unlink()
    assert record.ok
    moving = (record.t > 2.0) & (record.t < 3.0)  # after what the law's start costs
    assert np.abs(record.task_error[moving]).max() < 1e-6
    assert np.abs(record.task_error[-1]).max() < 1e-6
    found = verify(record.save(tmp_path / "run.h5"))
    assert found.tolerance == 0.0


def test_runs_of_a_suite_depend_on_the_content_of_a_file_not_on_its_path(tmp_path):
    def run(file):
        groups = [{"robots": ["youbot"], "tasks": ["mine"]}]
        given = {"task": "waypoints", "parameters": {"file": str(file)}}
        (found,) = suite_of(["pseudo-inverse"], groups=groups, tasks={"mine": given}).runs()
        return found

    values = _random(5, poses=False)
    first = run(_written(tmp_path, values))
    assert run(_written(tmp_path, values, "same.h5")).run_id == first.run_id
    values[3, 2] += 1e-3
    assert run(_written(tmp_path, values)).run_id != first.run_id
    for file in tmp_path.iterdir():
        file.unlink()
    (job,) = jobs_of([first], 60.0)  # as a worker elsewhere makes it, which has no such file
    made = mm.make_task(first.task_name, "youbot", **job.run.task_given)
    assert made.points[0] == pytest.approx(_random(5, poses=False)[0, 1:])


BROKEN = {
    "no points": (HEADER, "number of points: found 0; allowed: 2 to 1000"),
    "one point": (f"{HEADER}\n{POINT}", "number of points: found 1; allowed: 2 to 1000"),
    "no header": (f"{POINT}\n{POINT}", "line 1, the header: column '0' is unknown"),
    "unknown column": ("t,x,y,w\n0,0,0,0", "line 1, the header: column 'w' is unknown in t,x,y,w; a"),
    "twice": ("t,x,y,z,x\n0,0,0,0,0", "line 1, the header: a column is there twice"),
    "missing column": ("t,x,y\n0,0,0\n1,0,0", "line 1, the header: no column z in t,x,y; allowed"),
    "half a quaternion": ("t,x,y,z,qw\n0,0,0,0,1", "line 1, the header: no column qx, qy, qz in"),
    "short line": ("t,x,y,z\n0,0,0,0\n1,0,0", "line 3: it has 3 entries; needed: 4"),
    "text": ("t,x,y,z\n0,0,here,0\n1,0,0,0", "line 2, column 'y': found 'here'; allowed: a finite"),
    "nan": ("t,x,y,z\n0,0,0,0\n# a\n1,nan,0,0", "line 4, column 'x': found 'nan'; allowed: a finite"),
    "huge": ("t,x,y,z\n0,0,0,0\n1,1e300,0,0", "line 3, column 'x': found 1e+300; allowed: 0, or of"),
    "times": ("t,x,y,z\n0,0,0,0\n2,1,0,0\n2,0,0,0", "line 4, column 't': found 2 s; allowed: later"),
    "before 0": ("t,x,y,z\n-1,0,0,0\n2,1,0,0", "line 2, column 't': found -1 s; allowed: from 0"),
    "no unit": (f"{HEADER}\n{POINT}\n1,0,0,0,1,1,0,0", "of length 1.41421; allowed: length 1"),
    "half a turn": (f"{HEADER}\n{POINT}\n1,0,0,0,0,1,0,0", "turns by 180 degrees; allowed: 170"),
    "no times": ("x,y,z\n0,0,0\n1,0,0", "its points have no column t; needed: t"),
    "too fast": ("t,x,y,z\n0,0,0,0\n0.1,9,0,0", r"would move at 196.9 m/s at t = 0.05 s; allowed for"),
    "turns too fast": (f"{HEADER}\n{POINT}\n0.1,0,0,0,0,0.8,0,0.6", "turns by 180 degrees; allow"),
    "too many": ("x,y,z\n" + "0,0,0\n" * 1001, "line 1002: more than 1000 points; allowed: 2 to"),
    "too large": ("x,y,z\n" + "#" * 1_100_000, "has 1.1 MB; allowed: 1 MB"),
    "empty": ("", "is empty"),
    "other text": (b"x,y,z\n\xff\xfe\n", "is neither HDF5 nor text in UTF-8"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files_are_refused_by_place(case, tmp_path, youbot):
    content, message = BROKEN[case]
    path = tmp_path / "points.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(UsageError) as caught:
        mm.make_task("waypoints", youbot, file=path)
    text = str(caught.value)
    assert message in text
    assert "\n" not in text
    assert len(text) < 600


def _link(file, values):
    file["points"] = h5py.ExternalLink("other.h5", "/points")


def _outside(file, values):
    names = [("/etc/hostname", 0, values.nbytes)]
    file.create_dataset("points", shape=values.shape, dtype="f8", external=names)


def _virtual(file, values):
    layout = h5py.VirtualLayout(values.shape, "f8")
    layout[:] = h5py.VirtualSource("other.h5", "points", values.shape)
    file.create_virtual_dataset("points", layout)


def _wide(file, values):
    file.create_dataset("points", shape=(10**9, 8), dtype="f8", chunks=(1000, 8))


def _texts(file, values):
    file["points"] = np.full(values.shape, b"a")


def _nan(file, values):
    file["points"] = values * np.nan


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (_link, "points is an external link to 'other.h5':'/points'; needed: the data itself"),
        (_outside, "the values of points are in another file, '/etc/hostname'; needed: the data"),
        (_virtual, "points is a virtual dataset, a view of other files; needed: the data itself"),
        (_wide, "points has shape (1000000000, 8); allowed: 2 to 1000 rows"),
        (_texts, "points has entries of type |S1; allowed: numbers"),
        (_nan, "row 0, column 't': found nan; allowed: 0, or of a size"),
        (lambda file, values: None, "points is missing"),
    ],
)
def test_hdf5_holds_its_points_itself(make, message, tmp_path, youbot):
    values = _random(6, poses=True)
    _written(tmp_path, values, "other.h5")
    path = tmp_path / "points.h5"
    with h5py.File(path, "w") as file:
        make(file, values)
        if isinstance(file.get("points", getlink=True), h5py.HardLink):
            file["points"].attrs["columns"] = HEADER.split(",")
    with pytest.raises(UsageError) as caught:
        mm.make_task("waypoints", youbot, file=path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


def test_damaged_hdf5_is_told(tmp_path, youbot):
    path = _written(tmp_path, _random(6, poses=True), "points.h5")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(UsageError, match=r"points\.h5 is not a readable HDF5 file"):
        mm.make_task("waypoints", youbot, file=path)
    path.write_bytes(b"x,y,z\n0,0,0\n1,0,0\n")
    with pytest.raises(UsageError, match=r"it starts with b'x,y,z\\n0,', not with HDF5's"):
        mm.make_task("waypoints", youbot, file=path)


def _columns(x, **others):
    return {"x": x, "y": [0.0, 0.0], "z": [0.5, 0.5], **others}


@pytest.mark.parametrize(
    ("file", "words"),
    [
        *((file, "") for file in (3, "missing.csv", ".", {"x": [0.0, 1.0]}, {"x": "ab"}, {"y": 1})),
        ({1: [0, 1]}, "column '1' is unknown in 1; allowed: x,y,z"),
        (_columns([0.0, True]), "column 'x': must be a list of numbers"),
        (_columns([0, 10**400]), "column 'x': must be a list of numbers"),
        (
            _columns(np.zeros((2, 2))),
            r"is {'x': array\(\[\[0., .*column 'x': must be a list of numbers",
        ),
        (_columns([0.0]), "column 'y': must be a list of numbers, as many as the other columns"),
    ],
)
def test_what_is_no_file_is_refused(file, words, youbot):
    with pytest.raises(UsageError, match=rf"task 'path': parameter 'file'.*{words}"):
        mm.make_task("path", youbot, file=file)


def test_columns_may_be_arrays(youbot):
    made = mm.make_task("path", youbot, file=_columns(np.array([0.4, 0.5]), y=[np.float64(0), 0]))
    assert made == mm.make_task("path", youbot, file=_columns([0.4, 0.5]))


def test_quaternions_seen_from_the_start_follow_each_other(youbot):
    """Of the two signs of one orientation, that nearer to the one before."""
    angles = np.array([0.0, 1.2, 2.4])
    turns = {"qw": np.cos(angles), "qx": np.sin(angles), "qy": [0.0] * 3, "qz": [0.0] * 3}
    file = {"x": [0.0, 0.1, 0.2], "y": [0.0] * 3, "z": [0.0] * 3, **turns}
    first, second, third = np.array(mm.make_task("path", youbot, file=file, frame="start").points)
    assert first[3:] @ second[3:] == pytest.approx(np.cos(1.2))
    assert second[3:] @ third[3:] == pytest.approx(np.cos(1.2))


def test_many_points_are_shown_by_their_number(youbot):
    count = 1000
    file = {"t": [float(i) for i in range(count)], **{axis: [0.1] * count for axis in "xyz"}}
    made = mm.make_task("waypoints", youbot, file=file)
    assert repr(made) == "Spline('waypoints')"
    assert "1000" in made._repr_html_()


def test_path_of_points_that_are_alike_is_refused(tmp_path, youbot):
    path = tmp_path / "points.csv"
    path.write_text("x,y,z\n0,0,0\n1,0,0\n1,0,0\n")
    with pytest.raises(UsageError, match="points 1 and 2 are alike"):
        mm.make_task("path", youbot, file=path)


def test_fields_of_records_are_checked():
    """A record of unknown origin makes these classes."""
    three = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0))
    for points, knots, travel in (
        (three, (0.0, 1.0), 0.0),
        (three, (0.0, 1.0, 1.0), 0.0),
        (three, (0.0, 1.0, math.nan), 0.0),
        (three, (0.0, 1.0, 2.0), -1.0),
        (((0.0, 0.0), (1.0, 0.0)), (0.0, 1.0), 0.0),
    ):
        with pytest.raises(MobmanError):
            Spline(points, knots, travel)
    poses = tuple((*point, 1.0, 0.0, 0.0, 0.1) for point in three)
    with pytest.raises(MobmanError, match="must have length 1"):
        PoseSpline(poses, (0.0, 1.0, 2.0))


@pytest.mark.parametrize("small", [1e-2, 1e-4, 1e-6, 1e-9])
def test_uneven_times_are_refused_or_passed_exactly(small, youbot):
    """A spline that rounding errors have spoilt is not taken for one through the points."""
    times, x = [0.0, 1.0, 1.0 + small, 2.0, 3.0], [0.0, 0.1, 0.1, 0.2, 0.0]
    file = {"t": times, "x": x, "y": x, "z": x}
    try:
        made = mm.make_task("waypoints", youbot, file=file)
    except UsageError as error:
        refused = str(error)
        passed = 0.0
    else:
        refused = "the spline does not pass its points"
        passed = max(np.abs(made.desired(t)[0] - p).max() for t, p in zip(times, x, strict=True))
    assert "the spline does not pass its points" in refused or "m/s" in refused
    assert passed < 1e-8
