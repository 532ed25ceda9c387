"""Whether the joints of a URDF make one tree of its links."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

from mobman.robots.urdf.problems import Problems, listed


def check_tree(
    links: Sequence[ET.Element],
    joints: Sequence[ET.Element],
    link_names: set[str],
    problems: Problems,
) -> None:
    """Note what keeps the joints from making one tree.

    Args:
        links: The ``<link>`` elements.
        joints: The ``<joint>`` elements.
        link_names: The links' names.
        problems: Where to note it.
    """
    before = len(problems)
    by_child: dict[str, ET.Element] = {}
    parents: dict[str, str] = {}
    for joint in joints:
        owner = f"joint {joint.get('name', '')!r}"
        parent = _end(joint, "parent", owner, link_names, problems)
        child = _end(joint, "child", owner, link_names, problems)
        if child is None:
            continue
        if child in by_child:
            first = by_child[child]
            problems.add(
                joint,
                f"{owner}: its child {child!r} is the child of joint {first.get('name')!r} (line "
                f"{problems.line(first)}) as well; a link has one parent",
            )
            continue
        by_child[child] = joint
        if parent is not None:
            parents[child] = parent
    if len(problems) > before or not all(link.get("name") for link in links):
        return  # the rest would follow from that
    _check_loops(parents, by_child, problems)
    roots = [name for link in links if (name := link.get("name", "")) and name not in by_child]
    if len(roots) > 1:
        second = next(link for link in links if link.get("name") == roots[1])
        problems.add(
            second,
            f"{len(roots)} root links ({listed(roots)}); allowed: one: connect the others by joints",
        )


def _end(
    joint: ET.Element, tag: str, owner: str, link_names: set[str], problems: Problems
) -> str | None:
    """The link at one end of a joint, or None if it is none."""
    element = joint.find(tag)
    name = None if element is None else element.get("link")
    if element is None or not name:
        problems.add(joint, f'{owner} has no {tag}; give it <{tag} link="..."/>')
        return None
    if name not in link_names:
        advice = problems.near(name, link_names) or "; add the link, or remove the joint"
        problems.add(element, f"{owner}: its {tag} {name!r} is no link{advice}")
        return None
    return name


def _check_loops(
    parents: Mapping[str, str], by_child: Mapping[str, ET.Element], problems: Problems
) -> None:
    """Note every circle of links, once; without a root link there is one."""
    rooted: set[str] = set()
    for start in parents:
        path: list[str] = []
        on_path: set[str] = set()
        name = start
        while name in parents and name not in rooted and name not in on_path:
            path.append(name)
            on_path.add(name)
            name = parents[name]
        if name in on_path:
            circle = path[path.index(name) :]
            shown = listed([repr(link) for link in reversed(circle)])
            problems.add(
                by_child[circle[0]],
                f"the links {shown} are each other's parents in a circle, apart from any root; remove "
                f"one of the joints {listed([repr(by_child[c].get('name')) for c in circle])}",
            )
        rooted |= on_path
