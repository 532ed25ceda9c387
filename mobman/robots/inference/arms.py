"""Arms, what is at their ends, and which frame is the tip."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mobman.robots.inference import hints
from mobman.robots.inference.findings import Finding, Undecided
from mobman.robots.inference.tree import Joint, Tree

_SHORT = 0.15  # m; a branch at the end of an arm that reaches no further is a finger
_REACH = 0.05  # m; what reaches less far is no arm: a ball caster, for one
_ARM = 3  # joints from which on a chain is an arm
_CARRIED = 2  # joints in front of a gripper, at least


@dataclass(frozen=True)
class Arm:
    """A serial chain and the frame at its end.

    Attributes:
        joints: From the root to the tip, mimic joints and fingers left out.
        own: How many of them no other arm shares.
        tip: Link whose origin is the end-effector, and why.
        reach: Length of the chain from its first own joint to the tip (m), prismatic joints extended.
    """

    joints: tuple[Joint, ...]
    own: int
    tip: Finding
    reach: float


class Branches:
    """What moves and is not the platform: arms, heads, grippers.

    Args:
        tree: The robot.
        taken: Joints of the platform and in front of it.

    Attributes:
        fingers: Names of the joints of grippers and hands.
        ends: Last joint of each chain that is not a finger.
    """

    def __init__(self, tree: Tree, taken: set[str]) -> None:
        self._tree = tree
        self._taken = taken
        self.joints = [joint for joint in tree.movable if joint.name not in taken]
        self.fingers = self._find_fingers()
        self.moving = [
            joint for joint in self.joints if joint.name not in self.fingers and not joint.mimic
        ]
        names = {joint.name for joint in self.moving}
        self.ends = [
            joint
            for joint in self.moving
            if not any(following.name in names for following in tree.behind(joint))
        ]

    def arms(self) -> list[Arm]:
        """The chains that may be arms, heads left out where there is something else."""
        chains = [arm for arm in map(self._arm, self.ends) if arm.reach > _REACH]
        heads = [chain for chain in chains if self._is_head(chain)]
        chains = [chain for chain in chains if chain not in heads] or chains
        for enough in (
            lambda arm: arm.own >= _ARM,
            lambda arm: len(arm.joints) >= _ARM,
            lambda arm: True,
        ):
            if found := [arm for arm in chains if enough(arm)]:
                return found
        return []

    def chain(self, link: str) -> tuple[Joint, ...]:
        """The joints that move a link, fingers and mimic joints left out."""
        moving = set(self.moving)
        return tuple(joint for joint in self._tree.chain(link) if joint in moving)

    def heads(self) -> list[Joint]:
        """Joints that belong to heads only."""
        found: dict[str, Joint] = {}
        for chain in map(self._arm, self.ends):
            if self._is_head(chain):
                found |= {joint.name: joint for joint in chain.joints[-chain.own :]}
        return list(found.values())

    def _is_head(self, arm: Arm) -> bool:
        own = arm.joints[-arm.own :]
        return hints.common(hints.HEAD, [f"{joint.name}_{joint.child}" for joint in own])

    def _arm(self, end: Joint) -> Arm:
        joints = self.chain(end.child)
        own = 0
        for joint in reversed(joints):
            shared = any(
                other is not end and joint in self._tree.chain(other.child) for other in self.ends
            )
            if shared:
                break
            own += 1
        tip = self._tip(end)
        return Arm(joints, own, tip, reach(self._tree, joints[len(joints) - own :], tip.value))

    def _tip(self, end: Joint) -> Finding:
        """The best frame on the last link of a chain."""
        tree = self._tree
        body = tree.rigid(end.child)
        palms = [joint.parent for joint in tree.next_joints(end.child)]
        frames = [name for name in body if not hints.says(hints.NO_TIP, name)] or body
        for pattern, what in hints.TIPS:
            if hints.common(pattern, tree.links):
                continue
            named = [name for name in frames if hints.says(pattern, name)]
            # a finger that is fixed is no tip, nor is what only its name has in common with one
            named = [name for name in named if not hints.says(r"finger|thumb", name)] or []
            if named:
                # a base is where its fingers are, a tool as far out as it goes
                base = pattern in hints.BASES
                best = max(
                    named,
                    key=lambda name: (base and name in palms, tree.depth(name), -body.index(name)),
                )
                return Finding(best, what)
        if palms:
            return Finding(max(palms, key=tree.depth), "the link that carries the fingers")
        return Finding(max(frames, key=tree.depth), "the last link of the chain")

    def _find_fingers(self) -> set[str]:
        tree, own = self._tree, [joint.name for joint in self.joints]
        telling = not hints.common(hints.FINGER, own)
        found: set[str] = set()
        for joint in self.joints:
            before = [j for j in tree.chain(joint.parent) if j.name not in self._taken]
            if any(j.name in found for j in before):
                found.add(joint.name)
            elif len(before) >= _CARRIED:
                # a wrist that carries a fixed jaw is no finger: its link alone says little
                leaf = not tree.next_joints(joint.child)
                named = hints.says(hints.FINGER, joint.name) or (
                    leaf and hints.says(hints.FINGER_LINK, joint.child)
                )
                named = named and telling and self._at_the_end(joint)
                if named or self._one_of_several(joint):
                    found.add(joint.name)
        # the file may have what is behind a finger before it
        for joint in self.joints:
            if any(j.name in found for j in tree.chain(joint.parent)):
                found.add(joint.name)
        return found

    def _at_the_end(self, joint: Joint) -> bool:
        """Whether what is behind a joint is no larger than a gripper."""
        return max((len(c) for c in self._chains(joint)), default=1) <= 5 and (
            self._length(joint) < 2.0 * _SHORT
        )

    def _one_of_several(self, joint: Joint) -> bool:
        """Whether a short chain starts at a place where nothing but short chains start."""
        before = [j for j in self._tree.chain(joint.parent) if j.name not in self._taken]
        if len(before) < _ARM:
            return False
        siblings = self._tree.next_joints(before[-1].child)
        return len(siblings) >= 2 and all(self._length(sibling) <= _SHORT for sibling in siblings)

    def _length(self, joint: Joint) -> float:
        """How far a chain that starts with a joint reaches (m)."""
        return max(
            (reach(self._tree, chain, chain[-1].child) for chain in self._chains(joint)),
            default=0.0,
        )

    def _chains(self, joint: Joint) -> Iterable[list[Joint]]:
        following = self._tree.next_joints(joint.child)
        if not following:
            yield [joint]
        for behind in following:
            for chain in self._chains(behind):
                yield [joint, *chain]


def reach(tree: Tree, joints: Iterable[Joint], tip: str) -> float:
    """Length of a chain from its first joint to a link (m), prismatic joints extended."""
    joints = list(joints)
    places = [joint.centre for joint in joints] + [tree.position[tip]]
    length = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(places))
    return length + sum(joint.width for joint in joints if joint.prismatic and joint.width < 10.0)


def choose_arm(tree: Tree, branches: Branches, tip: str | None) -> Arm:
    """The arm that the user names by its tip, or the only one.

    Raises:
        Undecided: If there is none or several, or the tip is no link or does not move.
    """
    arms = branches.arms()
    listing = "; ".join(
        f"{arm.tip.value} ({len(arm.joints)} joints, {arm.own} of its own, reach {arm.reach:.2f} m)"
        for arm in arms
    )
    if tip is not None:
        if tip not in tree.links:
            raise Undecided(
                f"--tip {tip!r} is no link of the URDF; ends of arms: {listing or 'none'}"
            )
        joints = branches.chain(tip)
        if not joints:
            raise Undecided(
                f"--tip {tip!r} is moved by no joint of an arm; ends of arms: {listing or 'none'}"
            )
        of = next((arm for arm in arms if arm.joints == joints), None)
        own = of.own if of is not None else len(joints)
        chain = joints[len(joints) - own :]
        return Arm(joints, own, Finding(tip, "as asked for"), reach(tree, chain, tip))
    if not arms:
        raise Undecided(
            "no arm was found: beside the platform no joint moves; mount one by [[mount]] in a TOML file"
        )
    if len(arms) > 1:
        raise Undecided(f"there are {len(arms)} arms: name the end of one by --tip: {listing}")
    return arms[0]
