"""The page of a robot, standalone: what is in the scene and where, on every registered robot."""

from __future__ import annotations

import io

import numpy as np
import pinocchio as pin
import pytest
from PIL import Image

import mobman as mm
from mobman.model.build import load_geometry
from tests.support.poses import largest_difference

TOLERANCE = 1e-6


@pytest.fixture
def shown(replay):
    """A robot, and a page that shows it at rest."""
    robot, _, page = replay
    page.evaluate("q => mobman.setConfiguration(q)", robot.q_rest.tolist())
    return robot, page


@pytest.mark.parametrize("replay", ["youbot", "hunter_ur10"], indirect=True)
def test_scene_has_the_robots_geometry_where_pinocchio_has_it(shown):
    robot, page = shown
    geometry = load_geometry(robot)
    objects = page.evaluate("mobman.objects()")
    poses = page.evaluate("mobman.poses(mobman.objects().map(object => object.name))")
    for role, model in (("visual", geometry.visual), ("collision", geometry.collision)):
        data = robot.model.createData()
        geometry_data = model.createData()
        pin.updateGeometryPlacements(robot.model, data, model, geometry_data, robot.q_rest)
        names = [one["name"] for one in objects if one["role"] == role]
        for i, expected in enumerate(model.geometryObjects):
            link = expected.name.rpartition("_")[0]
            own = [name for name in names if name.rpartition(f"_{role}_")[0] == link]
            nearest = min(
                np.abs(np.array(poses[name]) - geometry_data.oMg[i].homogeneous).max()
                for name in own
            )
            assert nearest <= TOLERANCE, f"{expected.name} is not where it should be"
        links = {one.name.rpartition("_")[0] for one in model.geometryObjects}
        assert {name.rpartition(f"_{role}_")[0] for name in names} == links
    shown_now = {one["layer"] for one in objects if one["visible"]}
    assert shown_now == {"visual"}


@pytest.mark.parametrize("replay", ["youbot", "hunter_ur10"], indirect=True)
def test_joints_are_where_pinocchio_has_them(shown):
    robot, page = shown
    assert page.evaluate("mobman.joints()") == list(robot.model.names)[1:]
    assert largest_difference(page, robot, robot.q_rest) <= TOLERANCE
    random = np.random.default_rng(3)
    for _ in range(3):
        q = random.uniform(-3.0, 3.0, robot.nq)
        q[:2] = random.uniform(-80.0, 80.0, 2)
        page.evaluate("q => mobman.setConfiguration(q)", q.tolist())
        assert largest_difference(page, robot, q) <= TOLERANCE


def test_every_coordinate_has_a_slider_that_moves_it(shown):
    robot, page = shown
    named = page.evaluate(
        "[...document.querySelectorAll('.slider input')].map(i => i.dataset.joint)"
    )
    assert sorted(named) == sorted(robot.joint_names)
    q = robot.q_rest.copy()
    for i, name in enumerate(robot.joint_names):
        q[i] += 0.01
        page.evaluate(
            """([name, value]) => {
                const slider = document.querySelector(`.slider input[data-joint="${name}"]`);
                slider.value = value;
                slider.dispatchEvent(new Event("input"));
            }""",
            [name, q[i]],
        )
    assert largest_difference(page, robot, q) <= TOLERANCE


def test_switches_show_and_hide(shown):
    _, page = shown

    def visible(layer):
        return page.evaluate(
            "layer => [...new Set(mobman.app.runs[0].robot.layers[layer].map(o => o.visible))]",
            layer,
        )

    for layer in ("collision", "masses", "frames"):
        assert visible(layer) == [False]
        page.check(f"#show-{layer}")
        assert visible(layer) == [True]
        page.uncheck(f"#show-{layer}")
    page.uncheck("#show-visual")
    assert visible("visual") == [False]
    page.check("#show-visual")
    assert visible("visual") == [True]
    with pytest.raises(Exception, match="no layer wheels: allowed: trails, efforts, visual"):
        page.evaluate("mobman.show('wheels', true)")


def test_wheels_can_be_seen_to_turn(shown):
    """Something on each wheel does not look the same from every side."""
    robot, page = shown
    objects = page.evaluate("mobman.objects()")
    model = robot.model
    for wheel in robot.platform.wheels:
        index = model.getJointId(wheel.joint)
        on_wheel = [one for one in objects if one["joint"] == index and one["layer"] == "visual"]
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        column = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.LOCAL)
        axis = column[3:, model.joints[index].idx_v]
        at = page.evaluate("names => mobman.poses(names)", [one["name"] for one in on_wheel])
        centre = np.array(page.evaluate("name => mobman.pose(name)", wheel.joint))
        off_axis = [
            one["name"]
            for one in on_wheel
            if np.linalg.norm(
                np.cross(axis, (np.linalg.inv(centre) @ np.array(at[one["name"]]))[:3, 3])
            )
            > 0.2 * wheel.radius
        ]
        marked = {one["name"] for one in on_wheel if one["role"] == "mark"}
        boxes = page.evaluate(
            """names => names.filter(name =>
                mobman.app.runs[0].robot.named.get(name).geometry.type === "BoxGeometry")""",
            [one["name"] for one in on_wheel],
        )
        assert marked & set(off_axis) or boxes, f"the wheel {wheel.joint} looks round"


@pytest.mark.parametrize(
    "name",
    [*(pytest.param(name, marks=pytest.mark.slow) for name in ("youbot", "tiago")), "husky_ur5"],
)
def test_picture_shows_the_robot(name, opened, tmp_path):
    """Not blank: the robot takes its part of the picture, with colours of its own. Of primitives, of
    meshes, and of both; drawing without a graphics card takes too long for all robots."""
    robot = mm.load_robot(name)
    with opened(mm.view(robot, html=tmp_path / "robot.html").url, draws=True) as page:
        with_robot = _pixels(page)
        page.evaluate("mobman.show('visual', false)")
        without = _pixels(page)
    assert with_robot.std() > 10.0
    changed = np.abs(with_robot - without).max(axis=2) > 40.0
    assert 0.005 < changed.mean() < 0.7, "the robot does not take its part of the picture"
    if robot.name == "youbot":  # orange, and nothing else is
        r, g, b = with_robot[changed].T
        assert np.mean((r > 1.4 * g) & (g > 1.4 * b)) > 0.1


def test_a_robot_alone_has_its_page(opened, tmp_path):
    robot = mm.load_robot("youbot")
    file = tmp_path / "robot.html"
    with opened(mm.view("youbot", html=file).url) as page:
        assert largest_difference(page, robot, robot.q_rest) <= TOLERANCE
        assert page.is_hidden("#clock")
        page.evaluate("q => mobman.setConfiguration(q)", (robot.q_rest + 0.1).tolist())
        assert largest_difference(page, robot, robot.q_rest) > 0.05
        page.click("#rest")
        assert largest_difference(page, robot, robot.q_rest) <= TOLERANCE
        tip = robot.tip_pose(robot.q_rest).translation
        shown = [float(word) for word in page.inner_text("#tip").split()[1:4]]
        assert shown == pytest.approx(tip, abs=6e-4)


def _pixels(page):
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), dtype=float)
