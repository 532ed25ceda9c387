"""How high the ground is, and how large the wheels are that stand on it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from mobman.robots.inference import hints
from mobman.robots.inference.findings import Finding, Options, Undecided
from mobman.robots.inference.geometry import Geometry
from mobman.robots.inference.radius import Radius
from mobman.robots.inference.tree import Tree
from mobman.robots.inference.wheels import SAME_RADIUS, Rolling
from mobman.robots.urdf.shapes import USES

_LEAST = 0.01  # m; a wheel's radius is above this
_DIGITS = 5
_OTHER = 0.1  # of the radius; what is asked for and differs by more is likely a slip


@dataclass(frozen=True)
class Ground:
    """The ground in the root link's frame.

    Attributes:
        height: m.
        why: What says so.
    """

    height: float
    why: str


def footprint(tree: Tree, below: float) -> Ground | None:
    """The ground as the origin of a link made for it, if it is below a height (m)."""
    for name in (tree.root, *tree.rigid(tree.root)):
        height = float(tree.position[name][2])
        if hints.says(hints.FOOTPRINT, name) and height < below - _LEAST:
            return Ground(height, name)
    return None


def lowest_point(links: Iterable[str], geometry: Geometry) -> Ground | None:
    """The lowest point of the geometry of links."""
    down = np.array([0.0, 0.0, -1.0])
    lowest = [
        Ground(-shape.reach(down), f"the lowest point, {shape.use} {shape.kind} of {link}")
        for link in links
        for use in USES
        for shape in geometry.shapes(link, use)
        if shape.known
    ]
    return min(lowest, key=lambda ground: ground.height, default=None)


def settle_radius(
    tree: Tree, wheels: Sequence[Rolling], options: Options, geometry: Geometry
) -> tuple[Finding, list[str]]:
    """The radius of the driven wheels and what is not certain about it.

    Sources are the collision geometry, the visual geometry and the axle's height above a footprint
    link; the first one counts, unless the other two agree against it. Where there is none of them,
    it is the axle's height above the robot's lowest point. What is asked for comes before all.

    Raises:
        Undecided: If nothing tells.
    """
    uncertain: list[str] = []
    sources: list[Radius] = []
    for use in USES:
        found = [radius for w in wheels if (radius := getattr(w, use)) is not None]
        if not found:
            continue
        sources.append(found[0])
        values = [radius.value for radius in found]
        if max(values) - min(values) > SAME_RADIUS:
            uncertain.append(f"the {use} geometry gives the wheels radii of {_list(values)} m")
    axle = float(np.mean([w.joint.centre[2] for w in wheels]))
    if (ground := footprint(tree, axle)) is not None:
        sources.append(Radius(axle - ground.height, f"height of the axle above {ground.why}"))
    if (asked := options.wheel_radius) is not None:
        return Finding(asked, "as asked for"), [
            f"--wheel-radius {asked:.4g}: {source.why} says {_rounded(source.value)} m"
            for source in sources
            if abs(asked - source.value) > _OTHER * source.value
        ]
    if not sources:
        lowest = lowest_point(tree.rigid(tree.root), geometry)
        if lowest is None or axle - lowest.height < _LEAST:
            raise Undecided(
                f"nothing tells the wheels' radius: {wheels[0].joint.child} has no cylinder or sphere, "
                f"{_meshes(wheels[0], geometry)}, and there is no base_footprint below the axle: give "
                "--wheel-radius, or the folders of the meshes by --package-path"
            )
        uncertain.append(
            "the wheels' radius: their links have no geometry that was found; check it or give "
            "--wheel-radius"
        )
        return Finding(_rounded(axle - lowest.height), f"axle above {lowest.why}"), uncertain
    taken = _outvoted(sources) or sources[0]
    why = taken.why
    for other in sources:
        if other is not taken and abs(other.value - taken.value) > SAME_RADIUS:
            why += f"; {other.why} says {_rounded(other.value)}"
            uncertain.append(
                f"wheel_radius: {taken.why} says {_rounded(taken.value)} m, {other.why} "
                f"{_rounded(other.value)} m"
            )
    return Finding(_rounded(taken.value), why), uncertain


def _meshes(wheel: Rolling, geometry: Geometry) -> str:
    missing = [name for name in dict.fromkeys(wheel.meshes) if geometry.lacks(name)]
    return f"its mesh {missing[0]} is missing" if missing else "no round mesh"


def _outvoted(sources: list[Radius]) -> Radius | None:
    """What two sources agree on against the first one."""
    if len(sources) < 3:
        return None
    first, second, third = (source.value for source in sources)
    agree = abs(second - third) <= SAME_RADIUS and abs(first - second) > SAME_RADIUS
    return sources[1] if agree else None


def _rounded(value: float) -> float:
    return round(value, _DIGITS)


def _list(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.4g}" for value in sorted(set(values)))
