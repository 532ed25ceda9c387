"""A path over an algorithmic singularity: the extended Jacobian loses its rank, the arm does not.

The laws on the extended Jacobian end there; `tsm-null-space` does without it, and passes."""

import mobman as mm


def main(picture="singularity.svg", duration=12.0):
    robot = mm.load_robot("husky_ur5")
    task = mm.make_task("algorithmic-singularity", robot)
    records = [
        mm.simulate(robot, law, task, duration=duration)
        for law in ("tsm", "extended-jacobian", "tsm-null-space")
    ]
    comparison = mm.compare(records)
    print(comparison.table[["status", "task_error_final", "torque_limit_ratio"]])
    comparison.plot(picture)


if __name__ == "__main__":
    main()
