"""Arms of a URDF: what is at their ends, which frame is the tip, and a rest posture."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from mobman.arrays import Array
from mobman.robots.infer.findings import TIPS, Inferred, Undecided, common, says
from mobman.robots.infer.kinematics import Chain, Joint, Tree, followed, followers, held
from mobman.robots.urdf.validate import listed

_CARRYING = ("the palm", "the gripper's base")  # tips that are where their fingers are
_SHORT = 0.15  # m; a branch at the end of an arm that reaches no further is a finger
_REACH = 0.05  # m; what reaches less far is no arm: a ball caster, for one
_ARM = 3  # joints from which on a chain is an arm
_CARRIED = 2  # joints in front of a gripper, at least
_SAMPLES = 4000
_SEED = 0
_INSIDE = 0.8  # of a joint's range is where it may rest
_ENDLESS = 0.5 * math.pi  # rad; how far a joint without limits may be from zero
_LEVER = 1.0  # rad; columns of the Jacobian are for so much of a turn, or for half a slide's way
_LOSS = 0.04  # of the score, for a joint that rests at zero or in the middle instead
_STEP = {True: 0.01, False: 0.05}  # m, rad; what numbers are rounded to
_RANK = 1e-3  # of the largest singular value
_REFINEMENTS = ((0.2, 600), (0.06, 600))  # of the range; samples


class Arm(NamedTuple):
    """A serial chain and the frame at its end."""

    joints: tuple[Joint, ...]
    """From the root to the tip, without fingers, and what mimic joints there follow in the place of
    these."""
    own: int  # how many of them no other arm shares
    tip: Inferred  # link whose origin is the end-effector, and why
    reach: float  # of the chain from its first own joint to the tip (m), prismatic joints extended


class Branches:
    """Arms, heads and grippers: all that moves and is not taken by the platform, or in front of it."""

    def __init__(self, tree: Tree, taken: set[str]) -> None:
        self._tree, self._taken = tree, taken
        self.joints = [joint for joint in tree.movable if joint.name not in taken]
        self.fingers = self._find_fingers()  # names of the joints of grippers and hands
        moving = {j: None for j in self.joints if j.name not in self.fingers and not j.follows}
        self._moving = moving.keys()
        # the last joint of each chain that is not a finger
        self.ends = [joint for joint in moving if self._moving.isdisjoint(tree.behind(joint))]

    def arms(self) -> list[Arm]:
        """The chains that may be arms, heads left out where there is something else."""
        chains = [arm for arm in map(self._arm, self.ends) if arm.reach > _REACH]
        chains = [arm for arm in chains if not self._is_head(arm)] or chains
        own = [arm for arm in chains if arm.own >= _ARM]
        return own or [arm for arm in chains if len(arm.joints) >= _ARM] or chains

    def chain(self, link: str) -> tuple[Joint, ...]:
        """The joints that move a link without fingers, and for mimic joints those that they follow."""
        tree = self._tree
        on_the_way = (tree.joint(followed(tree, joint).joint) for joint in tree.chain(link))
        return tuple(dict.fromkeys(j for j in on_the_way if j is not None and j in self._moving))

    def heads(self) -> list[Joint]:
        """Joints that belong to heads only."""
        heads = [arm for arm in map(self._arm, self.ends) if self._is_head(arm)]
        return list(dict.fromkeys(joint for arm in heads for joint in arm.joints[-arm.own :]))

    def _is_head(self, arm: Arm) -> bool:
        return common("head", [f"{joint.name}_{joint.child}" for joint in arm.joints[-arm.own :]])

    def _arm(self, end: Joint) -> Arm:
        joints, tip = self.chain(end.child), self._tip(end)
        others = [self._tree.chain(other.child) for other in self.ends if other is not end]
        shared = [any(joint in other for other in others) for joint in joints]
        own = [*reversed(shared), True].index(True)
        return Arm(joints, own, tip, reach(self._tree, joints[len(joints) - own :], tip.value))

    def _tip(self, end: Joint) -> Inferred:
        """The best frame on the last link of a chain."""
        tree, link = self._tree, end.child

        def follows(joint: Joint) -> bool:
            """True for a mimic joint of an arm: a levelled wrist, the stages of a telescope."""
            master = tree.joint(followed(tree, joint).joint) if joint.follows else None
            return master in self._moving and joint.name not in self.fingers

        while following := [joint for joint in tree.next_joints(link) if follows(joint)]:
            link = following[0].child
        body, palms = tree.rigid(link), [joint.parent for joint in tree.next_joints(link)]
        depth = {name: len(tree.way(name)) for name in (*body, *palms)}
        frames = [name for name in body if not says("no_tip", name)] or body
        for what in TIPS:
            # a finger that is fixed is no tip, nor is what only its name has in common with one
            named = [n for n in frames if says(what, n) and not says("fixed_finger", n)]
            if named and not common(what, tree.links):
                # a base is where its fingers are, a tool as far out as it goes
                near = set(palms) if what in _CARRYING else set[str]()
                best = max(named, key=lambda n: (n in near, depth[n], -body.index(n)))
                return Inferred(best, what)
        if palms:
            return Inferred(max(palms, key=depth.__getitem__), "the link that carries the fingers")
        return Inferred(max(frames, key=depth.__getitem__), "the last link of the chain")

    def _find_fingers(self) -> set[str]:
        tree = self._tree
        telling = not common("finger", [joint.name for joint in self.joints])
        found: set[str] = set()
        # the file may have what is behind a finger before it
        for joint in sorted(self.joints, key=lambda joint: len(tree.chain(joint.child))):
            before = [j for j in tree.chain(joint.parent) if j.name not in self._taken]
            if any(j.name in found for j in before):
                found.add(joint.name)
            elif len(before) >= _CARRIED:
                # a wrist that carries a fixed jaw is no finger: its link alone says little
                leaf = not tree.next_joints(joint.child)
                named = says("finger", joint.name) or (leaf and says("finger_link", joint.child))
                if (named and telling and self._at_the_end(joint)) or self._one_of_several(before):
                    found.add(joint.name)
        return found

    def _at_the_end(self, joint: Joint) -> bool:
        """True if all behind a joint is no larger than a gripper."""
        longest = max(len(chain) for chain in self._chains(joint))
        return longest <= 5 and self._length(joint) < 2.0 * _SHORT

    def _one_of_several(self, before: Sequence[Joint]) -> bool:
        """True if several chains start behind these joints, and all are short."""
        siblings = self._tree.next_joints(before[-1].child) if len(before) >= _ARM else []
        return len(siblings) >= 2 and all(self._length(sibling) <= _SHORT for sibling in siblings)

    def _length(self, joint: Joint) -> float:
        """The reach of the longest chain that starts with a joint (m)."""
        return max(reach(self._tree, chain, chain[-1].child) for chain in self._chains(joint))

    def _chains(self, joint: Joint) -> Iterator[list[Joint]]:
        following = self._tree.next_joints(joint.child)
        if not following:
            yield [joint]
        for behind in following:
            yield from ([joint, *chain] for chain in self._chains(behind))


def reach(tree: Tree, joints: Sequence[Joint], tip: str) -> float:
    """Length of a chain from its first joint to a link (m), prismatic joints extended, those that
    follow others as far as these take them."""
    places = [joint.centre for joint in joints] + [tree.position[tip]]
    length = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(places))
    counted, masters = {*joints, *tree.chain(tip)}, {joint.name: joint for joint in joints}
    for joint in (*joints, *followers(tree, joints)):
        if joint.prismatic and joint in counted:
            law, way = followed(tree, joint), joint.width
            master = masters.get(law.joint, joint)
            if master is not joint:
                way = min(way, abs(law.multiplier) * master.width)
            length += way if way < 10.0 else 0.0
    return length


def choose_arm(tree: Tree, branches: Branches, tip: str | None) -> Arm:
    """The arm that the user names by its tip, or the only one; Undecided if there is none or several, or
    the tip is no link or does not move."""
    arms = branches.arms()
    listing = "; ".join(
        f"{arm.tip.value} ({len(arm.joints)} joints, {arm.own} of its own, reach {arm.reach:.2f} m)"
        for arm in arms
    )
    if tip is not None:
        joints = branches.chain(tip) if tip in tree.links else ()
        if not joints:
            what = "moved by no joint of an arm" if tip in tree.links else "no link of the URDF"
            raise Undecided(f"--tip {tip!r} is {what}; ends of arms: {listing or 'none'}")
        own = next((arm.own for arm in arms if arm.joints == joints), len(joints))
        way = reach(tree, joints[len(joints) - own :], tip)
        return Arm(joints, own, Inferred(tip, "as asked for"), way)
    if not arms:
        raise Undecided(
            "no arm was found: beside the platform no joint moves; mount one by --mount ARM.urdf --on "
            "LINK [--prefix P], or by [[mount]] in a TOML file; links: " + listed(tree.links)
        )
    if len(arms) > 1:
        raise Undecided(f"there are {len(arms)} arms: name the end of one by --tip: {listing}")
    return arms[0]


class Surroundings(NamedTuple):
    """The ground and the platform under an arm."""

    ground: float  # height of the ground in the root's frame (m)
    forward: Array  # unit vector in the plane, shape (2,)
    box: Array | None
    """Corners of the platform's body in the root's frame (m), shape (2, 3); None: not known."""


def rest_of(tree: Tree, arm: Arm, still: set[str], around: Surroundings) -> dict[str, Inferred]:
    """Positions of all joints that do not rest at zero (m, rad)."""
    tip = arm.tip.value
    at = held(tree, still, {})
    values: dict[str, float] = {}
    # a mimic joint on the way to the tip moves it to where its master rests: once more from there
    for _ in range(2):
        values = _rest_posture(Chain(tree, arm.joints, tip, at), around)
        before, at = at, held(tree, still, values)
        if all(at.get(j.name) == before.get(j.name) for j in tree.chain(tip) if j.name in still):
            break
    return {name: Inferred(value) for name, value in values.items()} | at


def _rest_posture(chain: Chain, around: Surroundings) -> dict[str, float]:
    """Rounded joint positions, by name (m, rad); the same for the same robot.

    The least singular value of the tip's linear Jacobian (of those that are not zero everywhere) is
    made large, with the joints away from their limits, motors that can well hold them, and the tip in
    front of or beside the platform and well above the ground; joints that matter little are at zero, or
    in the middle of their range.
    """
    joints, limits = chain.joints, chain.limits.tolist()
    low, high = np.array([_range(*one) for one in zip(joints, limits, strict=True)]).T
    random = np.random.default_rng(_SEED)
    score = _Score(chain, around, low, high, random)
    q = low + (high - low) * random.random((_SAMPLES, len(joints)))
    best = q[np.argmax(score(q))]
    for width, count in _REFINEMENTS:
        near = best + width * (high - low) * random.uniform(-1.0, 1.0, (count, len(joints)))
        near = np.vstack([best, np.clip(near, low, high)])
        best = near[np.argmax(score(near))]
    for i, joint in enumerate(joints):  # zero, or the middle of a range, where that costs little
        simple = [0.0] if low[i] <= 0.0 <= high[i] else []
        for choice in (*simple, _rounded(0.5 * (low[i] + high[i]), joint)):
            trial = np.where(np.arange(len(best)) == i, choice, best)
            least = (1.0 - _LOSS) * float(score(best[None])[0])
            if low[i] <= choice <= high[i] and float(score(trial[None])[0]) >= least:
                best = trial
                break
    values = zip(joints, best.tolist(), limits, strict=True)
    return {joint.name: _rounded(value, joint, *ends) for joint, value, ends in values}


def _range(joint: Joint, limits: tuple[float, float]) -> tuple[float, float]:
    """The positions in which a joint with these limits may rest (m, rad)."""
    lower, upper = limits
    if joint.endless or not math.isfinite(upper - lower):
        middle = min(max(0.0, lower), upper)  # one of the limits may be there
        return max(lower, middle - _ENDLESS), min(upper, middle + _ENDLESS)
    middle, half = 0.5 * (lower + upper), _INSIDE * (0.5 * (upper - lower))
    low, high = middle - half, middle + half
    if not joint.prismatic:  # several turns are no more use than one
        low, high = max(low, min(-0.75 * math.pi, high)), min(high, max(0.75 * math.pi, low))
    return low, high


class _Score:
    """A score of postures: a number above 0 for each."""

    def __init__(
        self, chain: Chain, around: Surroundings, low: Array, high: Array, random: Generator
    ) -> None:
        self._chain, self._around = chain, around
        self._middle, self._half = 0.5 * (low + high), 0.5 * np.maximum(high - low, 1e-9)
        sliding = [joint.prismatic for joint in chain.joints]
        self._scale = np.where(sliding, self._half, np.minimum(_LEVER, self._half))
        sampled = low + (high - low) * random.random((200, len(low)))
        centres, _, tip, jacobian = chain.places(sampled)
        values = np.linalg.svd(jacobian * self._scale, compute_uv=False)
        self._size = float(np.max(np.linalg.norm(tip - centres[:, 0], axis=1))) or 1.0
        self._rank = max(int(np.sum(values > _RANK * self._size, axis=1).max()), 1)
        # joints that start in the body, such as a lift's, cannot but be there
        self._outside = np.ones(len(low) + 1, dtype=bool)
        if around.box is not None:
            middle = chain.places(self._middle[None])[0][0]
            self._outside[:-1] = ~((middle > around.box[0]) & (middle < around.box[1])).all(axis=1)

    def __call__(self, q: Array) -> Array:
        centres, _, tip, jacobian = self._chain.places(q)
        jacobian = jacobian * self._scale / self._size
        values = np.linalg.svd(jacobian, compute_uv=False)[:, self._rank - 1]
        if self._rank < 3:  # the platform does not move the tip up: what is left must
            values = values * np.minimum(np.linalg.norm(jacobian[:, 2], axis=1), 1.0)
        used = np.abs(q - self._middle) / self._half
        margin = np.mean(1.0 - 0.5 * used**4, axis=1)
        small = np.exp(-0.02 * np.mean((q / np.maximum(self._half, 1e-9)) ** 2, axis=1))
        # a motor that gives half of what it can holds well, one that gives all of it does not
        holds = np.clip(2.0 - 2.0 * self._chain.loads(q), 0.05, 1.0)
        return np.array((values + 1e-6) * margin * small * holds * self._where(centres, tip))

    def _where(self, centres: Array, tip: Array) -> Array:
        """Below 1 for a tip behind, low or in the platform, and for links in the ground."""
        around, size = self._around, self._size
        # joints of a lift or turntable are not yet the arm: from where it begins to reach out
        out = (tip - centres[:, 0])[:, :2]
        ahead, beside = out @ around.forward, np.linalg.norm(out, axis=1)
        factor = np.where(ahead < -0.1 * beside, 0.3, 1.0)
        factor *= np.clip(beside / (0.35 * size), 0.05, 1.0)
        factor *= np.clip((tip[:, 2] - around.ground) / min(0.25, 0.35 * size), 0.02, 1.0)
        factor *= np.where(centres[:, :, 2].min(axis=1) - around.ground < 0.02, 0.1, 1.0)
        if around.box is not None:
            low, high = around.box
            points = np.concatenate([centres, tip[:, None]], axis=1)
            inside = ((points > low) & (points < high)).all(axis=2) & self._outside
            factor *= np.where(inside.any(axis=1), 0.1, 1.0)
        return factor


def _rounded(
    value: float, joint: Joint, lower: float = -math.inf, upper: float = math.inf
) -> float:
    step = _STEP[joint.prismatic]
    rounded = round(round(value / step) * step, 4)
    return rounded + 0.0 if lower <= rounded <= upper else min(max(value, lower), upper)
