"""Meshes: missing ones stop nothing, and those that are there are measured."""

from __future__ import annotations

import math
import re
from itertools import pairwise

import pytest
from support.variants import youbot_urdf, youbot_with_urdf

import mobman as mm
from mobman.checks.checks import run_checks

CYLINDER = '<geometry><cylinder radius="0.05" length="0.044"/></geometry>'


def stl(radius, length, sides=64):
    """A prism about z, which stands for a cylinder."""
    ring = [2.0 * math.pi * i / sides for i in range(sides + 1)]
    lines = ["solid wheel"]
    for a, b in pairwise(ring):
        corners = [
            (radius * math.cos(angle), radius * math.sin(angle), z)
            for angle, z in ((a, -0.5 * length), (b, -0.5 * length), (a, 0.5 * length))
        ]
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid wheel", ""])


@pytest.fixture
def with_wheels(tmp_path):
    """The youBot with meshes for its wheels' cylinders."""

    def make(filename, scale="1 1 1", content=None):
        if content is not None:
            (tmp_path / "wheel.stl").write_text(content, encoding="utf-8")
        mesh = f'<geometry><mesh filename="{filename}" scale="{scale}"/></geometry>'
        text = youbot_urdf().replace(CYLINDER, mesh)
        assert text != youbot_urdf()
        return mm.load_robot(youbot_with_urdf(tmp_path, text))

    return make


def only(robot, check):
    return run_checks(robot, only=[check])


def test_mesh_beside_the_urdf_is_read_and_measured(with_wheels):
    robot = with_wheels("wheel.stl", content=stl(0.05, 0.044))
    assert [item.status for item in only(robot, "meshes")] == ["ok"]
    radius = only(robot, "wheel-radius")
    assert [item.status for item in radius] == ["ok"]  # one row for wheels that are alike
    assert radius[0].found.startswith("wheels 'phi_1', 'phi_2': radius 0.05 m")
    assert "0.05 m in the collision" in radius[0].found


def test_mesh_in_millimetres_needs_its_scale(with_wheels):
    in_millimetres = stl(50.0, 44.0)
    scaled = with_wheels("wheel.stl", "0.001 0.001 0.001", in_millimetres)
    assert {item.status for item in only(scaled, "wheel-radius")} == {"ok"}
    findings = only(with_wheels("wheel.stl", content=in_millimetres), "wheel-radius")
    assert {item.status for item in findings} == {"wrong"}
    assert "50 m in the collision" in findings[0].found


def box(size):
    """A cube as a mesh: its faces' diagonals reach further than the wheel that it stands for."""
    return stl(size / math.sqrt(2.0), size, sides=4)


def test_mesh_that_is_a_box_tells_no_radius(tmp_path):
    """Simulators are given such boxes for wheels; the visual geometry has the radius."""
    (tmp_path / "box.stl").write_text(box(0.1), encoding="utf-8")
    shape = '<collision><geometry><mesh filename="box.stl"/></geometry></collision>'
    wheel = re.compile(rf"<collision>(\s*<origin[^>]*>)?\s*{re.escape(CYLINDER)}\s*</collision>")
    text, count = wheel.subn(shape, youbot_urdf())
    assert count == 2
    (finding,) = only(mm.load_robot(youbot_with_urdf(tmp_path, text)), "wheel-radius")
    assert finding.status == "ok"
    assert "0.05 m in the visual" in finding.found
    assert "collision" not in finding.found


def test_hub_tells_no_radius_where_the_tyre_is_missing(tmp_path):
    """A link that is fixed to the wheel lacks its mesh: what is left is known to be too small."""
    hub = CYLINDER.replace('radius="0.05"', 'radius="0.03"')
    text = youbot_urdf().replace(CYLINDER, hub)
    assert text != youbot_urdf()
    mesh = '<origin rpy="1.5707963 0 0"/><geometry><mesh filename="tyre.stl"/></geometry>'
    tyres = "".join(
        f"""<joint name="t{i}" type="fixed"><parent link="wheel_{i}"/><child link="tyre_{i}"/></joint>
        <link name="tyre_{i}"><collision>{mesh}</collision><visual>{mesh}</visual></link>"""
        for i in (1, 2)
    )
    text = text.replace("</robot>", f"{tyres}</robot>")
    (finding,) = only(mm.load_robot(youbot_with_urdf(tmp_path, text)), "wheel-radius")
    assert finding.status == "warning"
    assert "no round geometry (that could be read)" in finding.found
    (tmp_path / "tyre.stl").write_text(stl(0.05, 0.044), encoding="utf-8")
    (finding,) = only(mm.load_robot(youbot_with_urdf(tmp_path, text)), "wheel-radius")
    assert finding.status == "ok"


def test_a_missing_mesh_is_not_told_twice(with_wheels):
    (finding,) = only(with_wheels("file:///nowhere/wheel.stl"), "meshes")
    assert "1 mesh missing" in finding.found


def test_missing_meshes_stop_no_other_check(with_wheels):
    robot = with_wheels("package://nowhere/wheel.stl")
    findings = run_checks(robot, simulation=False)
    assert {item.status for item in findings} == {"ok", "warning"}
    assert not any("the check ended with" in item.found for item in findings)
    missing = next(item for item in findings if item.check == "meshes")
    assert "1 mesh missing: 'package://nowhere/wheel.stl' of link 'wheel_1'" in missing.found
    assert sum(item.check == "wheel-radius" for item in findings) == 1


@pytest.mark.parametrize("content", ["", "solid nothing\nendsolid nothing\n", "\x00\x01\x02"])
def test_unreadable_mesh_is_named(with_wheels, content):
    findings = only(with_wheels("wheel.stl", content=content), "meshes")
    assert [item.status for item in findings] == ["warning"]
    assert "1 mesh unreadable" in findings[0].found
    assert "wheel.stl" in findings[0].found


def test_mesh_by_an_absolute_path_does_not_travel(with_wheels, tmp_path):
    findings = only(with_wheels(f"file://{tmp_path}/wheel.stl", content=stl(0.05, 0.044)), "meshes")
    assert [item.status for item in findings] == ["warning"]
    assert "outside the URDF's package" in findings[0].found
    assert "package://" in findings[0].fix


def test_prefix_of_a_mount_is_part_of_the_links_name(tmp_path):
    (tmp_path / "pole.urdf").write_text(
        '<robot name="p"><link name="pole"><visual><geometry><mesh filename="none.stl"/></geometry>'
        "</visual></link></robot>"
    )
    content = youbot_with_urdf(tmp_path, youbot_urdf())
    content["mount"] = [{"path": "pole.urdf", "parent": "platform", "prefix": "my_"}]
    findings = only(mm.load_robot(content), "meshes")
    assert "'none.stl' of link 'my_pole'" in findings[0].found
