"""A start 2 m away with the motors of the URDF: the hedge keeps the integrals from winding up."""

import mobman as mm

FAR = mm.Scenario(name="far", extends=["real-limits"], start_offset=2.0)


def main(picture="limits.svg", duration=15.0):
    laws = {
        "clipped": mm.make_controller("tsm"),
        "hedge": mm.make_controller("tsm", saturation="hedge", v_max=0.5, a_max=0.5),
    }
    records = {
        label: mm.simulate("tiago_no_hand", law, "circle", duration=duration, scenario=FAR)
        for label, law in laws.items()
    }
    comparison = mm.compare(records)
    print(comparison.table[["status", "task_error_final", "torque_limit_ratio"]])
    comparison.plot(picture)


if __name__ == "__main__":
    main()
