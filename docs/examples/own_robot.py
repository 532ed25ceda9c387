"""A custom robot without a file: a platform by its numbers, with an arm's URDF on its deck."""

import mobman as mm

ROBOT = {
    "schema": 1,
    "name": "mine",
    "platform": {
        "type": "differential",
        "wheel_radius": 0.1,
        "half_track": 0.25,
        "body": {
            "mass": 40,
            "size": [0.7, 0.45, 0.3],
            "ground_clearance": 0.05,
            "wheel_mass": 1.5,
            "wheel_width": 0.05,
        },
    },
    "mount": [
        {
            "package": "example-robot-data",
            "path": "ur_description/urdf/ur3_robot.urdf",
            "parent": "deck",
        }
    ],
    "arm": {"tip": "tool0"},
    "rest": {"shoulder_lift_joint": -1.2, "elbow_joint": 1.6, "wrist_1_joint": -1.9},
}


def main(picture="own_robot.svg", duration=10.0):
    record = mm.simulate(mm.load_robot(ROBOT), "tsm", "circle", duration=duration)
    print(record)
    record.plot(picture)


if __name__ == "__main__":
    main()
