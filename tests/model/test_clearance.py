"""The criterion that keeps links away from obstacles: derivatives, cover, and what it does to runs."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest
from support.differences import derivative, jacobian, relative

import mobman as mm
from mobman.errors import GainError, UsageError
from mobman.model.build import load_geometry
from mobman.model.criterion import criteria

SHAPES = {
    "half-space": {"type": "half-space", "point": (1.5, 0, 0), "normal": (-2.0, 0.3, 0.1)},
    "sphere": {"type": "sphere", "centre": (1.1, 0.2, 0.7), "radius": 0.2},
    "cylinder": {"type": "cylinder", "centre": (1.0, -0.4, 0.3), "radius": 0.1, "height": 0.9},
    "box": {"type": "box", "centre": (1.2, 0.3, 0.4), "size": (0.4, 0.6, 0.3), "yaw": 0.4},
}


def term_of(robot, *shapes, margin=0.6):
    kind = criteria.get("clearance")
    return kind(weight=20.0, margin=margin, obstacles=list(shapes)).on(robot)


def as_coal(shape):
    """The obstacle as a shape of coal, and its placement."""
    place = coal.Transform3s(np.eye(3), np.array(shape.get("centre", (0, 0, 0)), float))
    if shape["type"] == "sphere":
        return coal.Sphere(shape["radius"]), place
    if shape["type"] == "cylinder":
        return coal.Cylinder(shape["radius"], shape["height"]), place
    if shape["type"] == "box":
        place.setRotation(pin.utils.rotate("z", shape["yaw"]))
        return coal.Box(*shape["size"]), place
    normal = np.array(shape["normal"]) / np.linalg.norm(shape["normal"])
    return coal.Halfspace(normal, float(normal @ np.array(shape["point"]))), place


@pytest.mark.parametrize("kind", SHAPES)
def test_distances_of_points_are_coals_or_a_little_less(kind):
    term = term_of(mm.load_robot("fixed_panda"), SHAPES[kind] | {})
    obstacle, random = term.obstacles[0], np.random.default_rng(3)
    points = random.uniform(-2.0, 2.0, (300, 3))
    d = obstacle.distance(points).value
    shape, place = as_coal(SHAPES[kind])
    expected = np.array(
        [
            coal.distance(
                coal.Sphere(1e-9),
                coal.Transform3s(np.eye(3), point),
                shape,
                place,
                coal.DistanceRequest(),
                coal.DistanceResult(),
            )
            for point in points
        ]
    )
    outside = expected > 1e-3
    assert outside.sum() > 100
    assert np.all(d[outside] <= expected[outside] + 1e-6)
    assert np.all(d[outside] >= expected[outside] / 3**0.25 - 1e-6)
    if kind in ("half-space", "sphere"):
        assert np.allclose(d[outside], expected[outside], atol=1e-6)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in ("youbot", "hsr", "stretch") else pytest.mark.slow)
        for name in mm.list_robots()
    ],
)
def test_its_derivatives(name):
    robot = mm.load_robot(name)
    random, h, tried = np.random.default_rng(1), 1e-4, 0
    ahead = robot.tip_pose(robot.q_rest).translation + np.array([0.5, 0.2, 0.1])
    for shape in SHAPES.values():
        where = "point" if shape["type"] == "half-space" else "centre"
        term = term_of(robot, shape | {where: tuple(ahead)}, margin=1.0)
        q = robot.consistent(robot.q_rest + 0.05 * random.standard_normal(robot.nq))
        q_dot = random.standard_normal(robot.nq)
        gradient = jacobian(lambda x, t=term: np.array([t.value(x)]), q, h)[0]
        tried += np.abs(gradient).max() > 1e-3
        assert relative(term.gradient(q), gradient) < 1e-8
        assert relative(term.hessian(q), jacobian(term.gradient, q, h)) < 1e-8
        # of class C^3: only the smaller step stays on one side of the edges of zones and faces
        errors = [
            relative(
                term.hessian_rate(q, q_dot),
                derivative(lambda s, t=term, q=q, d=q_dot: t.hessian(q + s * d), step),
            )
            for step in (h, h / 30.0)
        ]
        assert min(errors) < 1e-8
    assert tried == len(SHAPES)


def test_links_are_farther_away_than_it_says():
    robot = mm.load_robot("tiago")
    geometry, data = load_geometry(robot).collision, robot.model.createData()
    placed, random = pin.GeometryData(geometry), np.random.default_rng(5)
    for shape in (SHAPES["sphere"], SHAPES["box"]):
        term, (solid, place) = term_of(robot, shape), as_coal(shape)
        for _ in range(3):
            q = robot.consistent(robot.q_rest + 0.3 * random.standard_normal(robot.nq))
            pin.updateGeometryPlacements(robot.model, data, geometry, placed, q)
            least = min(
                coal.distance(
                    link.geometry,
                    coal.Transform3s(where.rotation, where.translation),
                    solid,
                    place,
                    coal.DistanceRequest(),
                    coal.DistanceResult(),
                )
                for link, where in zip(geometry.geometryObjects, placed.oMg, strict=True)
                if "wheel" not in link.name
            )
            assert least - 0.35 < term.clearance(q) <= max(least, 0.0) + 1e-9


def test_the_arm_passes_farther_from_a_pillar():
    robot, least = mm.load_robot("tiago_no_hand"), []
    plain = mm.simulate(robot, "tsm", "circle", duration=6.0, dt=4e-3)
    elbow = robot.arm_origin(plain.q[-1])
    pillar = {
        "type": "cylinder",
        "centre": (elbow[0] - 0.1, elbow[1] + 0.75, 0.6),
        "radius": 0.05,
        "height": 1.2,
    }
    term = {"type": "clearance", "weight": 5.0, "margin": 0.4, "obstacles": [pillar]}
    measure = term_of(robot, pillar)
    law = mm.make_controller("tsm", criteria=[term])
    for record in (plain, mm.simulate(robot, law, "circle", duration=6.0, dt=4e-3)):
        assert record.ok
        assert record.metrics["task_error_final"] < 1e-4
        least.append(min(measure.clearance(q) for q in record.q[::10]))
    assert least[1] > least[0] + 0.02


def test_what_is_wrong_is_told():
    with pytest.raises(GainError, match=r"criteria\[0\].*obstacles"):
        mm.make_controller("tsm", criteria=[{"type": "clearance", "weight": 1.0, "obstacles": []}])
    bad = {"type": "clearance", "weight": 1.0, "obstacles": [{"type": "cone"}]}
    with pytest.raises(GainError, match="'half-space', 'sphere', 'cylinder', 'box'"):
        mm.make_controller("tsm", criteria=[bad])
    flat = SHAPES["half-space"] | {"normal": (0, 0, 0)}
    with pytest.raises(GainError, match="normal"):
        mm.make_controller("tsm", criteria=[bad | {"obstacles": [flat]}])
    on_top = {"type": "sphere", "centre": (0, 0, 0.3), "radius": 0.4}
    with pytest.raises(UsageError, match=r"'base_theta' .* is in obstacles\[0\] \(sphere\)"):
        term_of(mm.load_robot("youbot"), on_top)
