"""A custom task, from side to side: any object with `desired` is one."""

import numpy as np

import mobman as mm


class Sway:
    """p_d = centre + (0, size sin(rate t), 0), with its three derivatives."""

    name = "sway"

    def __init__(self, centre, size=0.1, rate=1.0):
        self.centre, self.side, self.rate = centre, np.array([0.0, size, 0.0]), rate

    def desired(self, t):
        w, side = self.rate, self.side
        s, c = np.sin(w * t), np.cos(w * t)
        return self.centre + side * s, side * w * c, -side * w**2 * s, -side * w**3 * c


def main(picture="own_task.svg", duration=10.0):
    robot = mm.load_robot("youbot")
    task = Sway(robot.tip_pose(robot.q_rest).translation + np.array([0.1, 0.0, -0.05]))
    records = [
        mm.simulate(robot, law, task, duration=duration, scenario="heavier")
        for law in ("tsm", "pseudo-inverse")
    ]
    mm.compare(records).plot(picture)


if __name__ == "__main__":
    main()
