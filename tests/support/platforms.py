"""A robot on each type of platform, described by its numbers, with an arm of the data package."""

from __future__ import annotations

from typing import Any

import numpy as np

BODY = {"mass": 46.0, "size": [0.9, 0.5, 0.25], "ground_clearance": 0.12}
WHEELED = {**BODY, "wheel_mass": 2.6, "wheel_width": 0.11}
R, W, LENGTH = 0.15, 0.27, 0.6
ANGLES = [np.pi / 3, np.pi, -np.pi / 3]

PLATFORMS: dict[str, dict[str, Any]] = {
    "differential": {
        "type": "differential",
        "wheel_radius": R,
        "half_track": W,
        "reference_offset": 0.1,
        "body": WHEELED,
    },
    "unicycle": {"type": "unicycle", "reference_offset": 0.1, "body": BODY},
    "planar": {"type": "planar", "body": BODY},
    "skid-steer": {
        "type": "skid-steer",
        "wheel_radius": R,
        "half_track": W,
        "track_factor": 1.5,
        "reference_offset": 0.05,
        "body": {**WHEELED, "wheelbase": LENGTH},
    },
    "car-like": {
        "type": "car-like",
        "wheel_radius": R,
        "half_track": W,
        "wheelbase": LENGTH,
        "body": {**WHEELED, "centre": [0.3, 0.0], "steering_limit": 0.6, "knuckle_mass": 1.0},
    },
    "mecanum": {
        "type": "omnidirectional",
        "kind": "mecanum",
        "wheel_radius": R,
        "body": {**WHEELED, "wheelbase": LENGTH, "half_track": W},
    },
    "omni": {
        "type": "omnidirectional",
        "kind": "omni",
        "wheel_radius": R,
        "body": {**WHEELED, "circle": W, "angles": [float(angle) for angle in ANGLES]},
    },
    "swerve": {
        "type": "swerve",
        "wheel_radius": R,
        "body": {**WHEELED, "wheelbase": LENGTH, "half_track": W, "module_mass": 2.0},
    },
    "multi-axle": {  # three axles, the middle one fixed, the front and the rear one steered
        "type": "multi-axle",
        "wheel_radius": R,
        "driven": ["wheel_2_right", "wheel_2_left", "wheel_3_right", "wheel_3_left"],
        "body": {
            **WHEELED,
            "axles": [0.5, 0.0, -0.3],
            "steered": [1, 3],
            "half_track": W,
            "steering_limit": 0.7,
            "knuckle_mass": 1.5,
        },
    },
    "turret": {
        "type": "turret",
        "wheel_radius": R,
        "half_track": W,
        "offset": 0.11,
        "body": {**WHEELED, "carriage_mass": 5.0},
    },
    "fixed": {"type": "fixed", "body": BODY},
}
ARM = {
    "package": "example-robot-data",
    "path": "ur_description/urdf/ur5_robot.urdf",
    "parent": "deck",
}
REST = {
    "shoulder_lift_joint": -1.2,
    "elbow_joint": 1.6,
    "wrist_1_joint": -1.9,
    "wrist_2_joint": -1.5,
}


def on(platform: str | dict[str, Any], /, **changes: Any) -> dict[str, Any]:
    """The description of an arm on a platform; fields of ``[platform]`` may be changed."""
    kind = PLATFORMS[platform] if isinstance(platform, str) else platform
    return {
        "schema": 1,
        "name": f"ur5 on {kind['type']}".replace(" ", "_"),
        "platform": {**kind, **changes},
        "mount": [ARM],
        "arm": {"tip": "tool0"},
        "rest": REST,
        "criterion": {"wheels": 0.0005},
    }
