"""Wheels on MuJoCo's ground in place of wheels that roll by construction (extra `mujoco`).

Computed torque with an integral asks for more at the start than the tyres give, and is lost."""

import mobman as mm


def main(picture="ground.svg", duration=6.0):
    records = {
        f"{law}, {scenario}": mm.simulate(
            "tiago_no_hand", law, "circle", duration=duration, scenario=scenario
        )
        for scenario in ("nominal", "contact")
        for law in ("tsm", "computed-torque-integral")
    }
    comparison = mm.compare(records)
    print(comparison.table["task_error_final"])
    comparison.plot(picture)


if __name__ == "__main__":
    main()
