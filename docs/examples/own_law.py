"""A custom law in twenty lines, beside a baseline: any object with `reset` and `step` is one."""

import numpy as np

import mobman as mm


class JacobianTranspose:
    """B v = Pz + G - j_e^T (K_p e + K_v e') - K_d z."""

    name = "jacobian-transpose"

    def reset(self, robot, task, dt):
        self.robot, self.task = robot, task

    def step(self, t, q, z, z_dot):
        p_d, p_d_dot, *_ = self.task.desired(t)
        j_e = self.robot.tip_jacobian(q)[:3] @ self.robot.velocity_map(q)
        e = self.robot.tip_pose(q).translation - p_d
        force = 400.0 * e + 100.0 * (j_e @ z - p_d_dot)
        _, bias, B = self.robot.dynamics(q, z)
        return np.linalg.solve(B, bias - j_e.T @ force - 0.5 * z)


def main(picture="own_law.svg", duration=10.0):
    records = [
        mm.simulate("youbot", law, "circle", duration=duration)
        for law in (JacobianTranspose(), "pseudo-inverse")
    ]
    comparison = mm.compare(records)
    print(comparison.table["task_error_final"])
    comparison.plot(picture)


if __name__ == "__main__":
    main()
