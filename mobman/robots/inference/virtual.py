"""Joints without a body in front of the base, as simulators that know no wheels want them."""

from __future__ import annotations

from mobman.robots.inference.tree import Joint, Tree


def virtual_joints(tree: Tree) -> list[Joint]:
    """The planar joints (x, y, turning) between the root and the platform's first real link.

    They follow each other, nothing branches off, and the links between them are bare.
    """
    found: list[Joint] = []
    link = tree.root
    while True:
        body = tree.rigid(link)
        following = tree.next_joints(link)
        if len(following) != 1 or any(_has_body(tree, name) for name in body):
            break
        joint = following[0]
        planar = joint.horizontal if joint.prismatic else joint.vertical
        if not planar or (not joint.prismatic and not (joint.endless or joint.swivels)):
            break
        found.append(joint)
        link = joint.child
    slides = any(joint.prismatic for joint in found)
    turns = any(not joint.prismatic for joint in found)
    return found if slides and turns else []


def _has_body(tree: Tree, link: str) -> bool:
    return any(tree.links[link].find(tag) is not None for tag in ("visual", "collision"))
