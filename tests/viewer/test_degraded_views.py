"""What cannot be drawn as it should be: a message, and what can be drawn."""

from __future__ import annotations

import dataclasses
import re
import shutil
import sys

import numpy as np
import pinocchio as pin
import pytest

import mobman as mm
from mobman.viewer import meshes
from mobman.viewer.meshes import Surface, hollowed
from mobman.viewer.robot import Primitive, cylinder, robot_parts
from mobman.viewer.scene import robot_of_run
from mobman.viewer.view import make_scene
from tests.support.poses import largest_difference
from tests.support.variants import youbot_urdf, youbot_with_urdf

MESH = '<visual><geometry><mesh filename="package://nowhere/{}"/></geometry></visual>'
TRIANGLE = "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
TRIANGLE += "endloop\nendfacet\nendsolid x\n"
BULKY = '<inertia ixx="3" iyy="4" izz="5"'


def _robot(folder, change):
    return mm.load_robot(youbot_with_urdf(folder, change(youbot_urdf())))


def _without_looks(text):
    return re.sub(r"<(visual|collision)\b.*?</\1>", "", text, flags=re.DOTALL)


def _in_link(text, link, content):
    return text.replace(f'<link name="{link}">', f'<link name="{link}">{content}')


def test_missing_mesh_is_told_and_the_rest_is_drawn(tmp_path, opened):
    robot = _robot(tmp_path, lambda text: _in_link(text, "arm_1", MESH.format("arm.stl")))
    file = tmp_path / "page.html"
    with pytest.warns(UserWarning, match=r"1 meshes are not drawn.*package://nowhere/arm.stl"):
        view = mm.view(robot, html=file)
    with opened(view.url) as page:
        assert largest_difference(page, robot, robot.q_rest) <= 1e-6
        assert len(page.evaluate("mobman.objects()")) == len(robot_parts(robot)[0])


def test_link_of_a_missing_mesh_shows_its_collision_geometry(tmp_path):
    def change(text):
        content = MESH.format("arm.stl") + (
            '<collision><geometry><cylinder radius="0.07" length="0.2"/></geometry></collision>'
        )
        return _in_link(_without_looks(text), "arm_1", content)

    robot = _robot(tmp_path, change)
    joint = robot.model.frames[robot.model.getFrameId("arm_1")].parentJoint
    parts, _ = robot_parts(robot)
    drawn = [part for part in parts if part.joint == joint and part.role == "visual"]
    assert [part.shape for part in drawn] == [cylinder(0.07, 0.2)]


def test_link_whose_mesh_is_missing_does_not_leave_others_floating(tmp_path):
    """The platform's joint carries other shapes, too: the collision geometry of the link alone stands
    in, and where it has none the box of its mass and inertia."""
    collision = '<collision><geometry><box size="0.4 0.3 0.1"/></geometry></collision>'
    sensor = "<visual><geometry><sphere radius='0.02'/></geometry></visual>"

    def shapes(content):
        def change(text):
            text = _in_link(_without_looks(text), "platform", MESH.format("base.stl") + content)
            fixed = (
                f'<link name="sensor">{sensor}</link><joint name="sensor_joint" type="fixed">'
                '<parent link="platform"/><child link="sensor"/></joint>'
            )
            return text.replace("</robot>", f"{fixed}</robot>")

        robot = _robot(tmp_path, change)
        parts, (warning,) = robot_parts(robot)
        assert "base.stl" in warning
        return robot, [p for p in parts if p.link == "platform" and p.role == "visual"]

    robot, (part,) = shapes(collision)
    assert part.shape == Primitive("box", (0.4, 0.3, 0.1))
    _, (part,) = shapes("")
    # all that the platform's joint carries
    inertia = robot.model.inertias[part.joint]
    box = part.placement.act(pin.Inertia.FromBox(inertia.mass, *part.shape.size))
    assert box.matrix() == pytest.approx(inertia.matrix(), abs=1e-9)


def test_plain_body_of_an_inertia_that_is_too_large_hides_nothing(tmp_path):
    def change(text):
        mesh = MESH.format("base.stl")
        text = _in_link(_without_looks(text), "platform", mesh)
        return re.sub(r'<inertia ixx="\S+" iyy="\S+" izz="\S+"', BULKY, text, count=1)

    robot = _robot(tmp_path, change)
    (part,) = [p for p in robot_parts(robot)[0] if p.link == "platform" and p.role == "visual"]
    mass = robot.model.inertias[part.joint].mass
    assert mass / np.prod(part.shape.size) == pytest.approx(300.0)
    x, y, z = np.square(part.shape.size)
    assert [y + z, x + z, x + y] == pytest.approx(
        np.array([3, 4, 5]) * (y + z) / 3
    )  # in proportion


@pytest.mark.parametrize("name", ["hsr", "stretch", "fetch", "youbot_mecanum", "turtlebot3_omx"])
def test_nothing_floats(name):
    """The boxes about all shapes at rest, 25 mm larger since wheels have wells, are joined by others."""
    robot = mm.load_robot(name)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.q_rest)
    boxes = []
    for part in robot_parts(robot)[0]:
        if part.role == "visual":
            place = data.oMi[part.joint] * part.placement
            points = part.shape.points @ place.rotation.T + place.translation
            boxes.append((points.min(axis=0) - 0.025, points.max(axis=0) + 0.025))
    found, rest = [boxes[0]], boxes[1:]
    for low, high in found:
        near = [b for b in rest if np.all(b[0] < high) and np.all(low < b[1])]
        found += near
        rest = [b for b in rest if not any(b is other for other in near)]
    assert len(boxes) > 5
    assert rest == []


def test_hollowed_box_is_closed_and_has_the_volume_that_is_left():
    """By the divergence theorem, and by points that are inside of the box but in no well."""
    random = np.random.default_rng(5)
    box = np.array([[-1.0, -0.5, 0.0], [1.0, 0.5, 0.6]])
    for _ in range(5):
        middles = random.uniform(-1.0, 1.0, (4, 3))
        reach = np.array([(-0.3, -0.2, -np.inf), (0.3, 0.2, 0.2)])
        wells = [middle + reach for middle in middles]
        surface = hollowed(box, wells)
        a, b, c = surface.vertices[surface.faces].transpose(1, 0, 2)
        volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
        assert np.cross(b - a, c - a).sum(axis=0) == pytest.approx(0.0, abs=1e-12)
        points = random.uniform(*box, (40_000, 3))
        left = ~np.any([np.all((points > w[0]) & (points < w[1]), axis=1) for w in wells], axis=0)
        assert volume == pytest.approx(1.2 * left.mean(), rel=0.02)


@pytest.mark.parametrize(
    "name",
    [
        "ranger_xarm7",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("ridgeback_panda", "lekiwi_so101")
        ),
    ],
)
def test_wheels_under_a_plain_body_can_be_seen(name):
    """The sight from outside, along the axle, to the wheel's hub meets nothing of the body."""
    robot = mm.load_robot(name)
    parts, _ = robot_parts(robot)
    (body,) = [p for p in parts if p.link == "platform" and p.role == "visual"]
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.q_rest)
    place = data.oMi[body.joint] * body.placement
    corners = body.shape.vertices[body.shape.faces]
    for wheel in robot.platform.wheels:
        at = place.actInv(data.oMi[robot.model.getJointId(wheel.joint)])
        axle = np.zeros(3)
        axle[int(np.argmax(np.abs((at.rotation @ [0.0, 1.0, 0.0])[:2])))] = 1.0
        assert not _meets(at.translation, np.sign(at.translation) * axle, corners), wheel.joint


def _meets(start, direction, corners):
    """Whether a ray meets a triangle (Moeller and Trumbore)."""
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(direction, v)
    det = np.einsum("ij,ij->i", u, p)
    safe = np.where(np.abs(det) > 1e-12, det, np.nan)
    s = start - a
    x = np.einsum("ij,ij->i", s, p) / safe
    q = np.cross(s, u)
    y, t = q @ direction / safe, np.einsum("ij,ij->i", v, q) / safe
    return bool(np.any((x >= 0.0) & (y >= 0.0) & (x + y <= 1.0) & (t > 0.0)))


def test_robot_without_any_shape_is_a_skeleton_with_wheels(tmp_path):
    robot = _robot(tmp_path, _without_looks)
    parts, warnings = robot_parts(robot)
    assert warnings == []
    carried = {part.joint for part in parts if part.role == "visual"}
    moving = set(range(1, robot.model.njoints))
    assert carried == moving - {robot.model.getJointId(name) for name in ("base_x", "base_y")}
    wheels = {robot.model.getJointId(wheel.joint): wheel.radius for wheel in robot.platform.wheels}
    for part in parts:
        if part.joint in wheels and part.role == "visual":
            assert part.shape.size[0] == 2.0 * wheels[part.joint]
    marked = [part.joint for part in parts if part.role == "mark"]
    assert sorted(set(marked)) == sorted(wheels)


@pytest.mark.parametrize("content", ["", "solid nothing\nendsolid\n", "this is no mesh"])
def test_broken_mesh_is_told(tmp_path, content):
    (tmp_path / "broken.stl").write_text(content)
    robot = _robot(
        tmp_path,
        lambda text: _in_link(
            text, "arm_1", MESH.replace("package://nowhere/", "").format("broken.stl")
        ),
    )
    _, (warning,) = robot_parts(robot)
    assert "broken.stl" in warning


def test_unknown_robot_leaves_the_paths(runs, opened, tmp_path):
    record = dataclasses.replace(runs("youbot"), urdf={})
    file = tmp_path / "page.html"
    with pytest.warns(
        UserWarning, match=r"'youbot' is not drawn, only the paths: .*not all in the"
    ):
        view = mm.view(record, html=file)
    with opened(view.url) as page:
        page.evaluate("mobman.setTime(0.5)")
        assert page.evaluate("mobman.objects()") == []
        last = page.evaluate("mobman.frameTimes().filter(t => t <= 0.5).pop()")
        expected = record.tip_position[int(np.argmin(np.abs(record.t - last)))]
        assert page.evaluate("mobman.trail()")[-1] == pytest.approx(expected, abs=1e-5)
        assert "not drawn" in page.inner_text("#info")


def test_other_urdf_is_not_taken_for_the_runs(runs):
    record = dataclasses.replace(runs("youbot"), urdf_sha256="0" * 64)
    robot, problem = robot_of_run(record)
    assert robot is None
    assert "SHA-256" in problem
    assert make_scene(record).content["runs"][0]["robot"] is None


def test_robot_that_is_not_registered_is_built_from_the_record(runs, tmp_path):
    """Its URDF need not be anywhere; its meshes are those beside the run's file."""
    mesh = MESH.replace("package://nowhere/", "").format("meshes/base.stl")
    (tmp_path / "robot").mkdir()
    own = _robot(tmp_path / "robot", lambda text: _in_link(text, "platform", mesh))
    record = mm.simulate(own, "pseudo-inverse", "circle", duration=0.02)
    shutil.rmtree(tmp_path / "robot")
    for there in (False, True):
        if there:
            (tmp_path / "meshes").mkdir()
            (tmp_path / "meshes" / "base.stl").write_text(TRIANGLE)
        robot, problem = robot_of_run(record, tmp_path)
        assert problem == ""
        assert robot.name == own.name
        assert (robot_parts(robot)[1] == []) == there


def test_meshes_are_read_without_the_libraries_of_the_extra(monkeypatch):
    robot = mm.load_robot("tiago_no_hand")
    full, _ = robot_parts(robot)
    monkeypatch.setitem(sys.modules, "fast_simplification", None)
    monkeypatch.setattr(meshes, "installed", lambda library: False)
    plain, warnings = robot_parts(robot)
    assert warnings == []

    def triangles(parts):
        return sum(len(part.shape.faces) for part in parts if isinstance(part.shape, Surface))

    assert len(plain) == len(full)
    assert triangles(full) < 0.6 * triangles(plain)


def test_reduced_meshes_keep_their_size():
    for part in robot_parts(mm.load_robot("tiago_no_hand"))[0]:
        if isinstance(part.shape, Surface):
            assert np.all(np.isfinite(part.shape.vertices))
    angle = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    ring = np.array([[np.cos(a), np.sin(a), h] for h in np.linspace(0, 1, 20) for a in angle])
    faces = [
        corner
        for h in range(19)
        for i in range(200)
        for a, b in [(200 * h + i, 200 * h + (i + 1) % 200)]
        for corner in ([a, b, a + 200], [b, b + 200, a + 200])
    ]
    small = meshes.reduced(Surface(ring, np.array(faces), colour=(1.0, 0.0, 0.0, 1.0)), 500)
    assert 300 <= len(small.faces) <= 520
    bounds = np.array([small.vertices.min(axis=0), small.vertices.max(axis=0)])
    assert bounds == pytest.approx(np.array([[-1, -1, 0], [1, 1, 1]]), abs=0.02)
    assert small.colour == (1.0, 0.0, 0.0, 1.0)


def _ring(sides):
    """The side of a cylinder about z, of radius 1, as an OBJ file."""
    angles = 2.0 * np.pi * np.arange(sides) / sides
    corners = [(np.cos(a), np.sin(a), h) for h in (0.0, 1.0) for a in angles]
    lines = ["v {:.9f} {:.9f} {:.9f}".format(*corner) for corner in corners]
    for i in range(1, sides + 1):
        j = i % sides + 1
        lines += [f"f {i} {j} {i + sides}", f"f {j} {j + sides} {i + sides}"]
    return "\n".join(lines)


@pytest.mark.parametrize(("sides", "smooth"), [(36, True), (6, False)])
def test_edges_are_seen_and_curves_are_smooth(tmp_path, opened, sides, smooth):
    """Normals point away from the axis, or are their triangle's where edges are of 60 degrees."""
    (tmp_path / "ring.obj").write_text(_ring(sides), encoding="ascii")
    mesh = MESH.replace("package://nowhere/", "").format("ring.obj")
    robot = _robot(tmp_path, lambda text: _in_link(text, "arm_1", mesh))
    with opened(mm.view(robot, html=tmp_path / "page.html").url) as page:
        position, normal = page.evaluate(
            """["position", "normal"].map(name => Array.from(mobman.app.runs[0].robot.layers.visual
                .find(mesh => mesh.userData.role === "visual" && mesh.geometry.type === "BufferGeometry")
                .geometry.attributes[name].array))"""
        )
    position, normal = (np.reshape(values, (-1, 3, 3)) for values in (position, normal))
    outward = np.sum(normal[..., :2] * position[..., :2], axis=2)
    if smooth:
        assert outward.min() > np.cos(np.radians(3.0))
    else:
        assert outward == pytest.approx(np.cos(np.radians(30.0)), abs=1e-6)
    assert np.linalg.norm(normal, axis=2) == pytest.approx(1.0, abs=1e-6)
