"""The wheels of a URDF: which joints roll, how large the wheels are, and how high the ground is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import combinations

import numpy as np

from mobman.arrays import Array
from mobman.robots.infer.findings import Inferred, Options, Undecided, says, says_which
from mobman.robots.infer.kinematics import Joint, Tree, followed, names_of
from mobman.robots.urdf.shapes import USES, Shape, Use, extent_about, radius_about

SAME_PLACE = 0.01  # m; between two wheels of one axle, along and above
SAME_RADIUS = 0.002  # m
_ON_GROUND = 0.04  # m; a wheel higher than this above the ground is none
_AXLE_HEIGHT = 0.35  # m above the lowest axle, where no geometry says how large a wheel is
_TRAVEL = (0.2, 0.8)  # m, rad; a joint with less in front of a wheel is its suspension
_PARALLEL = 0.995
_ROLLERS = 3  # joints behind a wheel that make rollers of them
_FEW_JOINTS = 3  # in front of a wheel
_SMALLEST = 0.005  # m; a wheel of that radius or less is one in another unit
_BETWEEN = 0.25  # of the track: how far a turret's axis may be from the middle of its wheels
_LEAST = 0.01  # m; a wheel's radius is above this
_DIGITS = 5
_OTHER = 0.1  # of the radius; what is asked for and differs by more is likely a slip
_LEANS = 0.5  # rad; what is more tilted turns about no wheel's axis
_ALIKE = 0.1  # rad; between the axes of one pair, and between an axis and the way across
ALLOWED = (0.005, 0.01)  # m, rad; what platforms with wheels allow between axles and axes


class Rolling:
    """A wheel: of a joint that rolls, or is said to."""

    def __init__(self, tree: Tree, joint: Joint) -> None:
        above, self.rollers = tree.chain(joint.parent), list(tree.behind(joint))
        self.joint, self.name, self.centre = joint, joint.name, joint.centre
        # turns it about the vertical freely
        self.swivel = next((j for j in above if j.swivels), None)
        self.steering = next((j for j in above if j.steers and not _suspends(j)), None)
        self.turning = self.swivel or self.steering
        # joints between it and the base with little travel
        self.suspension = [j for j in above if _suspends(j)]
        turning = [j for j in (self.swivel, self.steering) if j is not None]
        self.joints = [joint, *turning, *self.suspension, *self.rollers]
        # its own link, what is fixed to it, and rollers
        links = [link for j in (joint, *self.rollers) for link in tree.rigid(j.child)]
        self.meshes = [mesh for link in links for mesh in tree.links[link].iter("mesh")]
        # the radius that its geometry has (m)
        sizes = [_radius(tree, joint, use, links, bool(self.rollers)) for use in USES]
        self.collision, self.visual = (size for size, _ in sizes)
        said = self.collision or self.visual
        self.radius = None if said is None else float(said.value)
        # the middle of its tyre, on its axis in the root link's frame (m), shape (3,): the joint's own
        # place unless geometry says otherwise
        tyre = next((shape for size, shape in sizes if size is not None), None)
        beside = 0.0 if tyre is None else _beside(tyre, joint)
        self.middle: Array = joint.centre + beside * joint.axis

    @cached_property
    def across(self) -> Array:
        """Its axis in the ground plane, towards the root's +y (or +x), shape (2,)."""
        axis = self.joint.axis[:2] / np.linalg.norm(self.joint.axis[:2])
        ahead = axis[1] if abs(axis[1]) > 1e-3 else axis[0]
        return np.array(axis if ahead > 0 else -axis)

    @property
    def ahead(self) -> Array:
        """The direction in which it rolls, or the opposite one, shape (2,)."""
        return np.array([self.across[1], -self.across[0]])

    def says(self, what: str) -> bool:
        """True if one of its names says something."""
        return says(what, self.name, self.joint.child)

    def says_which(self, one: str, other: str) -> int:
        """+1 where its names say one thing, -1 the other, 0 neither or both."""
        return says_which(one, other, self.name, self.joint.child)

    def beside(self, other: Rolling) -> bool:
        """True if both are on one axle."""
        apart = other.centre - self.centre
        off = max(abs(float(apart[:2] @ self.ahead)), abs(float(apart[2])))
        return self.parallel(other) and off < SAME_PLACE

    def parallel(self, other: Rolling) -> bool:
        """True if two axes have one direction."""
        return abs(float(self.across @ other.across)) > _PARALLEL


def rolling_wheels(tree: Tree) -> tuple[list[Rolling], list[Rolling]]:
    """All wheels on the ground, in the file's order: driven ones, steered ones and casters; and those
    that are high above it. A mimic joint is a wheel if the joint that it follows is one."""
    found: dict[str, Rolling] = {}
    for joint in tree.movable:
        above = tree.chain(joint.parent)
        level = joint.horizontal and all(j.vertical or _suspends(j) for j in above)
        if level and _may_roll(tree, joint):
            found[joint.name] = Rolling(tree, joint)
    wheels = [w for w in found.values() if followed(tree, w.joint).joint in found]
    bottoms = {w: float(w.centre[2]) - w.radius for w in wheels if w.radius is not None}
    lowest = min(bottoms.values(), default=0.0)
    lowest_axle = min((float(w.centre[2]) for w in wheels), default=0.0)

    def touches(wheel: Rolling) -> bool:
        if wheel.radius is not None:
            return bottoms[wheel] - lowest < max(_ON_GROUND, 0.25 * wheel.radius)
        return float(wheel.centre[2]) - lowest_axle < _AXLE_HEIGHT

    low = [wheel for wheel in wheels if touches(wheel)]
    return low, [wheel for wheel in wheels if wheel not in low]


def pairs_of(wheels: Sequence[Rolling]) -> list[tuple[Rolling, Rolling]]:
    """Wheels on one axle, two and two: (one, the other towards the axis), in the file's order; of
    several on one axle the outermost pair."""
    pairs, rest = list[tuple[Rolling, Rolling]](), list(wheels)
    while rest:
        first = rest[0]
        axle = [first, *(wheel for wheel in rest[1:] if first.beside(wheel))]
        rest = [wheel for wheel in rest if wheel not in axle]
        axle.sort(key=lambda wheel: float(wheel.centre[:2] @ first.across))
        pairs += [(axle[0], axle[-1])] if len(axle) >= 2 else []
    return pairs


def around(swivel: Joint | None, one: Rolling, other: Rolling, *, alone: bool) -> bool:
    """True if two wheels are on either side of a swivel's axis, not both at a caster's fork: they are
    farther apart than a wheel is long, or there are no others that could drive."""
    assert swivel is not None
    track = other.centre[:2] - one.centre[:2]
    middle = 0.5 * (other.centre[:2] + one.centre[:2])
    off = float(abs((swivel.centre[:2] - middle) @ track) / (track @ track))
    wide, radius = float(np.linalg.norm(track)), one.radius or 0.0
    # a radius above the track is in another unit
    return off < _BETWEEN and (alone or wide > 2.0 * radius or radius > wide)


def _may_roll(tree: Tree, joint: Joint) -> bool:
    """True if a joint turns without limits, or is called a wheel, and has few joints in front of it and
    nothing behind it that moves but rollers."""
    behind = list(tree.behind(joint))
    leaves = all(j.endless and not any(tree.behind(j)) for j in behind)
    # or one for all of them, in the wheel's middle
    inside = all(np.linalg.norm(j.centre - joint.centre) < _LEAST for j in behind)
    return (
        not joint.prismatic
        and (joint.endless or says("wheel", joint.name, joint.child))
        and (not behind or (leaves and (inside or len(behind) >= _ROLLERS)))
        and len(tree.chain(joint.parent)) <= _FEW_JOINTS
    )


def _suspends(joint: Joint) -> bool:
    if joint.prismatic:
        return joint.width <= _TRAVEL[0]
    return not joint.vertical and joint.width <= _TRAVEL[1]


def _beside(tyre: Shape, joint: Joint) -> float:
    """Distance of a tyre's middle from its joint along the axis (m); of a mesh, which has hubs and
    covers, only where the joint lies beside all of it."""
    at = float(joint.centre @ joint.axis)
    low, high = -tyre.reach(-joint.axis) - at, tyre.reach(joint.axis) - at
    return 0.5 * (low + high) if tyre.kind != "mesh" or max(low, -high) > _LEAST else 0.0


def _radius(
    tree: Tree, joint: Joint, use: Use, turning: Sequence[str], rollers: bool
) -> tuple[Inferred | None, Shape | None]:
    """The radius that the collision or the visual geometry behind a joint has about its axis, and the
    shape that has it (None: several together); None if there is none, or if some of its meshes are
    missing: what is left may be the hub only."""
    shapes, about = tree.shapes(*turning, use=use), (joint.centre, joint.axis)
    complete = all(shape.known for _, shape in shapes)
    found: list[tuple[Inferred, Shape | None]] = [
        (Inferred(value, f"{use} {shape.kind} of {link}"), shape)
        for link, shape in sorted(shapes, key=lambda entry: entry[1].kind == "mesh")
        if (complete or shape.kind != "mesh") and (value := radius_about(shape, *about)) is not None
    ]
    if rollers and shapes and complete:  # they are round together only
        together = extent_about([shape for _, shape in shapes], *about)
        why = f"{use} geometry of {joint.child} and its rollers"
        found += [] if together is None else [(Inferred(together, why), None)]
    return max(found, key=lambda size: float(size[0].value), default=(None, None))


def footprint(tree: Tree, below: float) -> Inferred | None:
    """The ground (m) as the origin of a link made for it, if it is below a height (m): not the middle
    of a body that is called so."""
    for name in (name for name in tree.rigid(tree.root) if says("footprint", name)):
        height, own = float(tree.position[name][2]), lowest_point(tree, [name])
        if height < below - _LEAST and (own is None or own.value > height - _LEAST):
            return Inferred(height, name)
    return None


def lowest_point(tree: Tree, links: Sequence[str]) -> Inferred | None:
    """The height of the lowest point of the geometry of links (m)."""
    down = np.array([0.0, 0.0, -1.0])
    lowest = [
        Inferred(-shape.reach(down), f"the lowest point, {shape.use} {shape.kind} of {link}")
        for name in links
        for use in USES
        for link, shape in tree.shapes(name, use=use)
        if shape.known
    ]
    return min(lowest, key=lambda ground: float(ground.value), default=None)


def settle_radius(
    tree: Tree, wheels: Sequence[Rolling], others: Iterable[Rolling], options: Options
) -> tuple[Inferred, list[str]]:
    """The radius of the driven wheels and what is not certain about it.

    Sources are the collision geometry, the visual geometry and the axle's height above a footprint
    link; the first one counts, unless the other two agree against it. Where there is none of them,
    it is the axle's height above the lowest point of casters and other wheels: they stand on the
    ground, which a body with ground clearance does not. What is asked for comes before all.

    Raises:
        Undecided: If nothing tells.
    """
    uncertain: list[str] = []
    sources: list[Inferred] = []
    for use in USES:
        found = [radius for w in wheels if (radius := getattr(w, use)) is not None]
        values = sorted({radius.value for radius in found})
        sources += found[:1]
        if values and values[-1] - values[0] > SAME_RADIUS:
            radii = ", ".join(f"{value:.4g}" for value in values)
            uncertain.append(f"the {use} geometry gives the wheels radii of {radii} m")
    axle = float(np.mean([w.centre[2] for w in wheels]))
    if (ground := footprint(tree, axle)) is not None:
        sources.append(Inferred(axle - ground.value, f"height of the axle above {ground.why}"))
    if (asked := options.wheel_radius) is not None:
        return Inferred(asked, "as asked for"), [
            f"--wheel-radius {asked:.4g}: {source.why} says {round(source.value, _DIGITS)} m"
            for source in sources
            if abs(asked - source.value) > _OTHER * source.value
        ]
    if not sources:
        standing = [link for w in others for link in tree.rigid(w.joint.child)]
        standing += [link for link in tree.rigid(tree.root) if says("caster", link)]
        lowest = lowest_point(tree, standing)
        if lowest is None or axle - lowest.value < _LEAST:
            missing = [
                f"its mesh {mesh.get('filename', '').strip()} {mesh.get('problem')}"
                for mesh in wheels[0].meshes
                if "problem" in mesh.attrib
            ]
            raise Undecided(
                f"nothing tells the wheels' radius: {wheels[0].joint.child} has no cylinder or sphere, "
                f"{(missing or ['no round mesh'])[0]}, and there is no base_footprint below the axle: "
                "give --wheel-radius, or the folders of the meshes by --package-path"
            )
        uncertain.append(
            "the wheels' radius: their links have no geometry that was found, and the casters say where "
            "the ground is; check it or give --wheel-radius"
        )
        return Inferred(round(axle - lowest.value, _DIGITS), f"axle above {lowest.why}"), uncertain
    taken = sources[0]
    if len(sources) == 3:
        first, second, third = (source.value for source in sources)
        if abs(second - third) <= SAME_RADIUS < abs(first - second):
            taken = sources[1]
    value, why = round(taken.value, _DIGITS), taken.why
    apart = [float(np.linalg.norm(a.centre - b.centre)) for a, b in combinations(wheels, 2)]
    if value > (track := max(apart, default=math.inf)) or value < _SMALLEST:
        than = f"they are {track:.4g} m apart" if value > track else "that is no wheel's"
        unit = "; is its mesh in millimetres? Then give it scale 0.001" if "mesh" in why else ""
        raise Undecided(
            f"the wheels' radius would be {value:.4g} m ({why}), but {than}{unit}: correct the URDF, or "
            "give --wheel-radius (m) and --as-it-is"
        )
    for other in sources:
        if other is not taken and abs(other.value - taken.value) > SAME_RADIUS:
            said = round(other.value, _DIGITS)
            why += f"; {other.why} says {said}"
            uncertain.append(f"wheel_radius: {taken.why} says {value} m, {other.why} {said} m")
    return Inferred(value, why), uncertain


def what_to_name(tree: Tree) -> str:
    """Advice where no wheels drive: the nearest pair, its faults, and the joints that may be named."""
    joints = [joint for joint in tree.movable if not joint.follows and _may_roll(tree, joint)]
    found = [joint for joint in joints if abs(float(joint.axis[2])) < math.sin(_LEANS)]
    if len(found) < 2:
        upright = [j for j in tree.movable if j.endless and j.vertical and not any(tree.behind(j))]
        turning = f" ({names_of(upright)}: about the vertical)" if upright else ""
        only = f" but {found[0].name}" if found else ""
        return (
            f"the URDF has no joint{only} that could be named by --right-wheel and --left-wheel"
            f"{turning}; correct it"
        )
    compared = ((pair, _faults(tree, *pair)) for pair in combinations(found, 2))
    faults = {pair: said for pair, said in compared if said is not None}
    if not faults:
        may = names_of(found)
        return f"name them by --right-wheel and --left-wheel (joints that may be wheels: {may})"

    def rank(pair: tuple[Joint, Joint]) -> tuple[int, int, float]:
        """The fewest faults, the most telling names and the widest track first."""
        named = sum(says("wheel", joint.name, joint.child) for joint in pair)
        return len(faults[pair][0]), -named, -float(np.linalg.norm(pair[0].centre - pair[1].centre))

    near = min(faults, key=rank)
    said, nameable = faults[near]
    why = f"the nearest pair, {near[0].name} and {near[1].name}, was not taken: {'; '.join(said)}"
    if not nameable:
        return f"{why}; wheels of a pair are on one horizontal axle: correct the URDF"
    return f"{why}; name them by --right-wheel and --left-wheel if they drive"


def _faults(tree: Tree, one: Joint, other: Joint) -> tuple[list[str], bool] | None:
    """Reasons why two joints are no pair of driven wheels, and whether they can be named as one; None if
    they are not side by side at all."""
    both, apart = (one, other), other.centre - one.centre
    x, y = one.axis[:2] / np.linalg.norm(one.axis[:2])
    track, ahead = abs(float(apart[:2] @ [x, y])), abs(float(apart[:2] @ [y, -x]))
    along = min(abs(float(one.axis @ other.axis)), 1.0)
    if track < SAME_PLACE or along < math.cos(2.0 * _LEANS) or ahead > track:
        return None
    tilts = [math.asin(min(abs(float(joint.axis[2])), 1.0)) for joint in both]
    lean = " and ".join(f"{tilt:.3g}" for tilt in tilts)
    level, angle = abs(float(apart[2])), math.acos(along)
    radii = [radius for j in both if (radius := Rolling(tree, j).radius) is not None]
    unlike = len(radii) == 2 and abs(radii[0] - radii[1]) > SAME_RADIUS
    casters = [
        joint.name
        for joint in both
        if says("caster", joint.name, joint.child)
        or any(above.swivels for above in tree.chain(joint.parent))
    ]
    faults = {
        f"their axes are {lean} rad from horizontal (camber)": not all(j.horizontal for j in both),
        f"their heights differ by {level:.3g} m": level > SAME_PLACE,
        f"one is {ahead:.3g} m ahead of the other": ahead > SAME_PLACE,
        f"their axes are {angle:.3g} rad apart": angle > _ALIKE,
        f"their radii differ ({' and '.join(f'{r:.4g}' for r in radii)} m)": unlike,
        f"{' and '.join(casters)} swivels or is a caster's by its name": bool(casters),
    }
    nameable = max(level, ahead) <= ALLOWED[0] and max(*tilts, angle) <= ALLOWED[1]
    found = [fault for fault, there in faults.items() if there]
    return found or ["they are not on the ground, or smaller than other wheels"], nameable
