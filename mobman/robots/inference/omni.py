"""Platforms on wheels with rollers."""

from __future__ import annotations

import numpy as np

from mobman.robots.inference import hints
from mobman.robots.inference.drive import Drive
from mobman.robots.inference.findings import Finding, Undecided
from mobman.robots.inference.wheels import SAME_RADIUS, Rolling

_EXACT = 1e-3  # m; and the least ratio of singular values


def omnidirectional(driven: list[Rolling], crooked: bool, hint: str) -> Drive:
    """An omnidirectional platform.

    Args:
        driven: Its wheels.
        crooked: Whether their axes have different directions.
        hint: What beside the wheels' own names speaks of rollers.

    Raises:
        Undecided: If there are fewer than three wheels.
    """
    if len(driven) < 3:
        raise Undecided(
            f"an omnidirectional platform has three wheels or more; found "
            f"{', '.join(w.name for w in driven) or 'none'}: name them by --wheel (once for each)"
        )
    why = f"{len(driven)} wheels with axes in different directions" if crooked else ""
    why = why or mecanum_sign(driven, hint) or "as asked for"
    kind = Finding("omni", "rollers across the wheel's axis") if crooked else Finding("mecanum")
    drive = Drive(Finding("omnidirectional", why), wheels=driven, kind=kind)
    if swivels := tuple(w.swivel.name for w in driven if w.swivel is not None):
        drive.uncertain.append(
            f"{', '.join(swivels)} swivel the wheels; they are locked and the wheels taken as "
            f"{kind.value} wheels"
        )
    return drive


def mecanum_fits(wheels: list[Rolling]) -> bool:
    """Whether wheels with rollers at 45 degrees would drive in every direction in these places."""
    if len(wheels) < 3:
        return False
    across = wheels[0].across
    ahead = np.array([across[1], -across[0]])
    centres = np.array([w.joint.centre for w in wheels])
    places = (centres - centres.mean(axis=0))[:, :2] @ np.column_stack([ahead, across])
    radii = [w.radius for w in wheels if w.radius is not None]
    if (
        not all(wheels[0].parallel(w) for w in wheels)
        or np.ptp(centres[:, 2]) > _EXACT
        or (radii and max(radii) - min(radii) > SAME_RADIUS)
        or np.any(np.abs(places) < _EXACT)
    ):
        return False
    rollers = np.column_stack([np.ones(len(places)), -np.sign(places[:, 0] * places[:, 1])])
    turning = places[:, 0] * rollers[:, 1] - places[:, 1] * rollers[:, 0]
    values = np.linalg.svd(np.column_stack([rollers, turning]), compute_uv=False)
    return bool(values[-1] > _EXACT * values[0])


def mecanum_sign(wheels: list[Rolling], hint: str) -> str:
    """What says that wheels have rollers; empty if nothing does."""
    if any(w.rollers for w in wheels):
        return "there are rollers behind the wheels"
    names = [name for w in wheels for name in (w.name, w.joint.child, *w.meshes)]
    for name in names:
        if hints.says(hints.MECANUM, name.rpartition("/")[2]):
            return f"the name {name.rpartition('/')[2]} says so"
    return f"the URDF says {hint}" if hint else ""
