"""The wheels of a URDF: which joints roll, what they are mounted on, and which of them drive."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mobman.arrays import Array
from mobman.robots.inference import hints
from mobman.robots.inference.geometry import Geometry
from mobman.robots.inference.radius import Radius, mesh_names, wheel_radius
from mobman.robots.inference.tree import Joint, Tree

SAME_PLACE = 0.01  # m; between two wheels of one axle, along and above
SAME_RADIUS = 0.002  # m
_ON_GROUND = 0.04  # m; a wheel higher than this above the ground is none
_AXLE_HEIGHT = 0.35  # m above the lowest axle, where no geometry says how large a wheel is
_TRAVEL = (0.2, 0.8)  # m, rad; a joint with less in front of a wheel is its suspension
_PARALLEL = 0.995
_ROLLERS = 3  # joints behind a wheel that make rollers of them
FEW_JOINTS = 3  # in front of a wheel


@dataclass(frozen=True, eq=False)
class Rolling:
    """A wheel.

    Attributes:
        joint: Its joint.
        collision, visual: What its geometry says of its radius.
        swivel: The joint that lets it turn about the vertical freely.
        steering: The joint that steers it.
        suspension: Joints between it and the base with little travel.
    """

    joint: Joint
    collision: Radius | None
    visual: Radius | None
    swivel: Joint | None
    steering: Joint | None
    suspension: tuple[Joint, ...]
    rollers: tuple[Joint, ...]
    meshes: tuple[str, ...]

    @property
    def name(self) -> str:
        """Of its joint."""
        return self.joint.name

    @property
    def radius(self) -> float | None:
        """What its geometry says (m)."""
        said = self.collision or self.visual
        return None if said is None else said.value

    @cached_property
    def across(self) -> Array:
        """Its axis in the ground plane, towards the root's +y (or +x), shape (2,)."""
        axis = self.joint.axis[:2] / np.linalg.norm(self.joint.axis[:2])
        ahead = axis[1] if abs(axis[1]) > 1e-3 else axis[0]
        result: Array = axis if ahead > 0 else -axis
        return result

    def says(self, pattern: str) -> bool:
        """Whether its names have what a pattern looks for."""
        return hints.says(pattern, self.name, self.joint.child)

    def parallel(self, other: Rolling) -> bool:
        """Whether two axes have one direction."""
        return abs(float(self.across @ other.across)) > _PARALLEL


def rolling_wheels(tree: Tree, geometry: Geometry, ignored: set[str]) -> list[Rolling]:
    """All wheels on the ground, in the file's order: driven ones, steered ones and casters.

    Args:
        tree: The robot.
        geometry: Its shapes.
        ignored: Joints that count as fixed, such as virtual ones in front of the base.
    """
    found = []
    for joint in tree.movable:
        wheel = None if joint.name in ignored else _rolling(tree, joint, geometry, ignored)
        if wheel is not None:
            found.append(wheel)
    return _on_ground(found)


def as_wheel(tree: Tree, joint: Joint, geometry: Geometry, ignored: set[str]) -> Rolling:
    """A joint that is said to be a wheel."""
    above = [j for j in tree.chain(joint.parent) if j.name not in ignored]
    return _make(tree, joint, above, geometry)


def pairs_of(wheels: list[Rolling]) -> list[tuple[Rolling, Rolling]]:
    """Wheels on one axle, two and two: (one, the other towards the axis), in the file's order.

    Several wheels on one axle give their outermost pair.
    """
    pairs: list[tuple[Rolling, Rolling]] = []
    rest = list(wheels)
    while rest:
        first = rest[0]
        axle = [w for w in rest if _one_axle(first, w)]
        rest = [w for w in rest if w not in axle]
        axle.sort(key=lambda w: float(w.joint.centre[:2] @ first.across))
        if len(axle) >= 2:
            pairs.append((axle[0], axle[-1]))
    return pairs


def _one_axle(one: Rolling, other: Rolling) -> bool:
    apart = other.joint.centre - one.joint.centre
    along = apart[:2] @ np.array([one.across[1], -one.across[0]])
    return bool(
        one.parallel(other) and abs(along) < SAME_PLACE and abs(float(apart[2])) < SAME_PLACE
    )


def _rolling(tree: Tree, joint: Joint, geometry: Geometry, ignored: set[str]) -> Rolling | None:
    if joint.mimic or joint.prismatic or not joint.horizontal:
        return None
    if not joint.endless and not hints.says(r"wheel(?!_?base)", joint.name, joint.child):
        return None
    if not carries_nothing(tree, joint):
        return None
    above = [j for j in tree.chain(joint.parent) if j.name not in ignored]
    if len(above) > FEW_JOINTS or not all(j.vertical or _suspends(j) for j in above):
        return None
    return _make(tree, joint, above, geometry)


def carries_nothing(tree: Tree, joint: Joint) -> bool:
    """Whether a joint carries nothing that moves, or nothing but rollers."""
    behind = list(tree.behind(joint))
    leaves = all(not any(tree.behind(j)) for j in behind)
    return not behind or (leaves and len(behind) >= _ROLLERS and all(j.endless for j in behind))


def _make(tree: Tree, joint: Joint, above: list[Joint], geometry: Geometry) -> Rolling:
    return Rolling(
        joint=joint,
        collision=wheel_radius(tree, joint, "collision", geometry),
        visual=wheel_radius(tree, joint, "visual", geometry),
        swivel=next((j for j in above if j.swivels), None),
        steering=next((j for j in above if j.steers and not _suspends(j)), None),
        suspension=tuple(j for j in above if _suspends(j)),
        rollers=tuple(tree.behind(joint)),
        meshes=tuple(mesh_names(tree, joint)),
    )


def _suspends(joint: Joint) -> bool:
    if joint.prismatic:
        return joint.width <= _TRAVEL[0]
    return not joint.vertical and joint.width <= _TRAVEL[1]


def _on_ground(wheels: list[Rolling]) -> list[Rolling]:
    """Without what turns like a wheel but is high above the ground."""
    if not wheels:
        return []
    heights = {w: float(w.joint.centre[2]) for w in wheels}
    bottoms = {w: heights[w] - w.radius for w in wheels if w.radius is not None}
    lowest = min(bottoms.values(), default=None)
    lowest_axle = min(heights.values())

    def touches(wheel: Rolling) -> bool:
        if lowest is not None and wheel.radius is not None:
            return bottoms[wheel] - lowest < max(_ON_GROUND, 0.25 * wheel.radius)
        return heights[wheel] - lowest_axle < _AXLE_HEIGHT

    return [w for w in wheels if touches(w)]
