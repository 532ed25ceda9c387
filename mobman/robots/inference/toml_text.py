"""A robot's TOML with the reasons of its values as comments."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from mobman.robots.inference import origin
from mobman.robots.inference.criterion import DEFAULT, PLATFORM
from mobman.robots.inference.findings import Finding
from mobman.robots.inference.infer import Inference
from mobman.robots.inference.patterns import patterns
from mobman.robots.spec import UrdfSource

_WIDTH = 100


def robot_toml(found: Inference, name: str, source: UrdfSource) -> str:
    """The text of a robot's TOML.

    Args:
        found: What is known of the robot.
        name: Its name.
        source: Where its URDF is.
    """
    lines = [
        *_comment(
            f"Written by mobman robots add from {found.urdf.path.name}. Comments say why each value was "
            "taken; change what is wrong."
        ),
        *(line for doubt in found.uncertain for line in _comment(f"UNCERTAIN: {doubt}.")),
        "schema = 1",
        f"name = {_value(name)}",
        f"description = {_value(_description(found))}",
        f"source = {_value(_source(found, source))}",
        f"license = {_value(origin.licence(found.urdf.path))}",
        f"tags = {_value([found.platform.type.value])}",
        *("", "[urdf]"),
    ]
    if source.package is not None:
        lines.append(f"package = {_value(source.package)}")
    lines.append(f"path = {_value(source.path)}")
    if source.packages:
        lines.append(_entry("packages", Finding(source.packages, "where package://NAME/... is")))
    lines += [*_locks(found), "", "[platform]", *_platform(found)]
    own = f"{len(found.arm.joints)} joints, reach {found.arm.reach:.2f} m"
    lines += ["", f"[arm] # {own}", _entry("tip", found.arm.tip)]
    lines += ["", *_comment(_REST), "[rest]"]
    lines += [_entry(_key(joint), value) for joint, value in found.rest.items()]
    lines += ["", "[criterion] # K_F of (12)"]
    lines += [f"platform = {PLATFORM} # 1/m^2, 1/rad^2", f"default = {DEFAULT} # 1/rad^2"]
    return "\n".join([*lines, *_couplings(found), *_weights(found)]) + "\n"


_REST = (
    "Joint positions (m, rad) away from limits and singular postures; joints that are not named rest at "
    "0, locked ones are held there."
)
_WEIGHTS = (
    "The default is for a radian of the arm. With it a wheel's angle, which grows all the way, or a "
    "slide of a few centimetres would lead through algorithmic singularities."
)

_COUPLINGS = (
    "A steering angle does not move the tip at once, and so nothing else here asks for one: it would "
    "rest for ever. With these the platform steers to where the arm turns."
)


def _description(found: Inference) -> str:
    name = found.robot_name or found.urdf.path.stem
    return f"{name}: {found.platform.type.value} platform, arm of {len(found.arm.joints)} joints"


def _source(found: Inference, source: UrdfSource) -> str:
    place = source.path if source.package is None else f"{source.package}, {source.path}"
    said = origin.header(found.urdf.path)
    return f"{place}, robot {found.robot_name!r} of the URDF" + (f"; {said}" if said else "")


def _locks(found: Inference) -> list[str]:
    if not found.locks:
        return []
    lines = ["lock = ["]
    for lock in found.locks:
        names = patterns(lock.joints, found.joints)
        rows = [f"    {_value(pattern)}," for pattern in names]
        rows[0] += f" # {_clean(lock.why)}"
        lines += rows
    return [*lines, "]"]


def _platform(found: Inference) -> list[str]:
    drive = found.platform
    lines = [_entry("type", drive.type)]
    lines += [_entry(key, value) for key, value in found.fields.items()]
    if drive.rolling and (half := drive.half_track) is not None:
        lines += _comment(f"half_track: half the distance of the wheels' centres is {half:.4f} m")
    if drive.steering and drive.centre is not None:
        ahead = drive.steering[0].centre[:2] - drive.centre[:2]
        base = float(ahead @ drive.forward.direction)
        lines += _comment(f"wheelbase: the steering is {base:.4f} m ahead of the rear axle")
    return lines


def _couplings(found: Inference) -> list[str]:
    if not found.couplings:
        return []
    rows = [
        f"    {{ joint = {_value(one.joint)}, to = {_value(one.to)}, ratio = {_value(one.ratio)}, "
        f"weight = {_value(one.weight)} }},"
        for one in found.couplings
    ]
    return [*_comment(_COUPLINGS), "couplings = [", *rows, "]"]


def _weights(found: Inference) -> list[str]:
    if not found.weights:
        return []
    entries = [_entry(_key(joint), weight) for joint, weight in found.weights.items()]
    return [*_comment(_WEIGHTS), "[criterion.weights]", *entries]


def _entry(key: str, finding: Finding) -> str:
    line = f"{key} = {_value(finding.value)}"
    return f"{line} # {_clean(finding.why)}" if finding.why else line


def _comment(text: str) -> list[str]:
    """A text as lines of comments."""
    lines, line = [], "#"
    for word in _clean(text).split():
        if len(line) + 1 + len(word) > _WIDTH and line != "#":
            lines.append(line)
            line = "#"
        line += f" {word}"
    return [*lines, line]


def _clean(text: str) -> str:
    """A text that may stand in a comment: TOML allows no control characters there."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _key(name: str) -> str:
    bare = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if bare else _value(name)


def _value(value: Any) -> str:
    """A value in TOML; strings have JSON's escapes, which TOML's include."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Sequence):
        return f"[{', '.join(_value(item) for item in value)}]"
    if isinstance(value, float):
        return repr(float(value))
    return str(value)
