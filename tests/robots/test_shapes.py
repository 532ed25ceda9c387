"""The shapes of a URDF's links, against vertices that are computed without them."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mobman as mm
from mobman.robots.urdf.meshes import MeshReader
from mobman.robots.urdf.shapes import bounds, extents, placement, read_shapes

XYZ, RPY = np.array([0.3, -0.2, 0.5]), np.array([0.4, -1.1, 2.3])
TURN = Rotation.from_euler("xyz", RPY).as_matrix()
TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 3.0]])
ROUND = np.linspace(0.0, 2.0 * math.pi, 2000, endpoint=False)


def text(values):
    return " ".join(repr(float(value)) for value in values)


def origin(xyz=XYZ, rpy=RPY):
    return f'<origin xyz="{text(xyz)}" rpy="{text(rpy)}"/>'


def read(geometry, place="", use="collision", vertices={}.get):
    """The only shape of a link."""
    link = f'<link name="a"><{use}>{place}<geometry>{geometry}</geometry></{use}></link>'
    (shape,) = read_shapes(
        ET.fromstring(link), use, lambda mesh: vertices(mesh.get("filename").strip())
    )
    return shape


def directions():
    random = np.random.default_rng(5).standard_normal((50, 3))
    return np.vstack([np.eye(3), -np.eye(3), random])


def agree(shape, vertices, error=1e-12):
    """Whether a shape reaches as far as its vertices do, in all directions."""
    for direction in directions():
        farthest = float(np.max(vertices @ direction))
        assert shape.reach(direction) == pytest.approx(farthest, abs=error)


def disc(radius, height):
    column = np.full(len(ROUND), height)
    return np.column_stack([radius * np.cos(ROUND), radius * np.sin(ROUND), column])


def test_box():
    corners = np.array(list(product((-0.1, 0.1), (-0.2, 0.2), (-0.3, 0.3))))
    shape = read('<box size="0.2 0.4 0.6"/>', origin())
    agree(shape, corners @ TURN.T + XYZ)
    assert np.allclose(shape.centre, XYZ)


@pytest.mark.parametrize(
    "rpy", [(0, 0, 0), (math.pi / 2, 0, 0), (0, math.pi / 2, 0), (0.4, -1.1, 2.3), (1.0, 1.0, 0)]
)
def test_cylinder_along_any_axis(rpy):
    turn = Rotation.from_euler("xyz", rpy).as_matrix()
    rims = np.vstack([disc(0.2, -0.35), disc(0.2, 0.35)])
    shape = read('<cylinder radius="0.2" length="0.7"/>', origin(rpy=rpy))
    agree(shape, rims @ turn.T + XYZ, error=1e-5)
    assert np.allclose(shape.centre, XYZ)
    assert np.allclose(shape.axis, turn[:, 2])


def test_sphere():
    shape = read('<sphere radius="0.2"/>', origin())
    ball = np.vstack([disc(0.2 * math.sin(a), 0.2 * math.cos(a)) for a in ROUND[:1001:4]])
    agree(shape, ball + XYZ, error=1e-4)
    assert shape.axis is None


def test_mesh_with_scale():
    shape = read(
        '<mesh filename=" a.stl " scale="0.5 2 -1"/>',
        origin(),
        vertices={"a.stl": TRIANGLE}.get,
    )
    agree(shape, (TRIANGLE * [0.5, 2.0, -1.0]) @ TURN.T + XYZ)


def test_mesh_without_scale_and_origin():
    agree(read('<mesh filename="a.stl"/>', vertices={"a.stl": TRIANGLE}.get), TRIANGLE)


def test_mesh_that_is_missing_is_not_known():
    shape = read('<mesh filename="a.stl"/>', origin())
    assert not shape.known
    assert not shape.placed(TURN, XYZ).known
    assert read('<sphere radius="0.2"/>').known


@pytest.mark.parametrize(
    "geometry", ['<box size="1 2 3"/>', '<cylinder radius="1" length="3"/>', '<sphere radius="1"/>']
)
def test_placed_in_another_frame(geometry):
    shape = read(geometry, origin())
    other, position = Rotation.from_euler("xyz", (-0.7, 0.2, 0.9)).as_matrix(), np.array([1, 2, 3])
    moved = shape.placed(other, position)
    for direction in directions():
        expected = shape.reach(other.T @ direction) + float(position @ direction)
        assert moved.reach(direction) == pytest.approx(expected)


def test_a_link_has_shapes_of_two_uses():
    link = ET.fromstring(
        '<link name="a"><visual><geometry><box size="1 1 1"/></geometry></visual>'
        '<collision><geometry><sphere radius="1"/></geometry></collision>'
        '<collision><geometry><cylinder radius="1" length="1"/></geometry></collision>'
        "<collision><geometry/></collision></link>"
    )
    kinds = {
        use: [(shape.use, shape.kind) for shape in read_shapes(link, use, {}.get)]
        for use in ("visual", "collision")
    }
    assert kinds["visual"] == [("visual", "box")]
    assert kinds["collision"] == [("collision", "sphere"), ("collision", "cylinder")]


def test_bounds_of_several_shapes():
    block = read('<box size="1 2 3"/>', '<origin xyz="1 0 0"/>')
    cylinder = read('<cylinder radius="0.2" length="1"/>')
    lower, upper = bounds([block, cylinder])
    assert np.allclose(lower, [-0.2, -1.0, -1.5])
    assert np.allclose(upper, [1.5, 1.0, 1.5])


def test_extents_about_an_axis():
    cylinder = read('<cylinder radius="0.2" length="1"/>', origin())
    assert np.allclose(extents([cylinder], XYZ, TURN[:, 2], 12), 0.2)
    along = XYZ + 0.4 * TURN[:, 2] + 0.1 * TURN[:, 0]
    off = extents([cylinder], along, TURN[:, 2], 36)
    assert off.shape == (36,)
    assert off.max() == pytest.approx(0.3, abs=1e-3)
    assert off.min() == pytest.approx(0.1, abs=1e-3)
    two = extents([cylinder, read('<sphere radius="0.5"/>', origin())], XYZ, TURN[:, 2], 12)
    assert np.allclose(two, 0.5)


def test_placement():
    part = ET.fromstring(f"<inertial>{origin()}</inertial>")
    rotation, position = placement(part)
    assert np.allclose(rotation, TURN)
    assert np.allclose(position, XYZ)
    rotation, position = placement(ET.fromstring("<inertial/>"))
    assert np.array_equal(rotation, np.eye(3))
    assert np.array_equal(position, np.zeros(3))


def test_mesh_file_is_read_once(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 2 3\nf 1 2 3\n", encoding="utf-8")
    reader = MeshReader()
    vertices = reader.vertices(path)
    assert sorted(vertices.tolist()) == sorted(TRIANGLE.tolist())
    path.unlink()
    assert reader.vertices(path) is vertices
    assert reader.unreadable == {}


@pytest.mark.parametrize(
    "content", ["", "this is no mesh", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"]
)
def test_mesh_that_cannot_be_read_says_why(tmp_path, content):
    path = tmp_path / "a.obj"
    path.write_text(content, encoding="utf-8")
    reader = MeshReader()
    assert reader.vertices(path) is None
    assert list(reader.unreadable) == [path]
    assert str(path) in reader.unreadable[path]
    path.unlink()
    assert reader.vertices(path) is None


def test_axis_without_a_direction_is_refused(tmp_path):
    """Pinocchio takes it for zero, so that no wheel is beside another, or itself."""
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    link = f'<link name="a"><inertial><mass value="1"/>{inertia}</inertial></link><link name="b"/>'
    joint = (
        '<joint name="wheel" type="continuous"><parent link="a"/><child link="b"/><axis/></joint>'
    )
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{link}{joint}</robot>', encoding="utf-8")
    with pytest.raises(mm.MobmanError, match="'wheel': <axis> xyz is 'missing'"):
        mm.load_robot(tmp_path / "r.urdf")
