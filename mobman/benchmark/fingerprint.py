"""What a robot is, in one string: its description and its URDFs."""

from __future__ import annotations

import hashlib
import json

from mobman.robots.spec import RobotSpec
from mobman.robots.urdf.read import urdf_sources


def fingerprint(spec: RobotSpec) -> str:
    """Hash of a robot's description and of the content of its URDFs, hexadecimal.

    Raises:
        SpecError: If a URDF is not there.
    """
    text = json.dumps(spec.model_dump(mode="json", by_alias=True), sort_keys=True)
    urdf = urdf_sources(spec).sha256()
    return hashlib.sha256((text + urdf).encode()).hexdigest()[:16]
