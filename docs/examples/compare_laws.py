"""Four laws on a plant that is heavier than they suppose, with the same measured acceleration.

It is a filtered difference of noisy velocities: `tsm` and `time-delay` meet where noise decides.
With its default gains computed torque with an integral folds the arm, and the pseudo-inverse is off."""

import mobman as mm

LAWS = ("tsm", "time-delay", "computed-torque-integral", "pseudo-inverse")
MEASURED = mm.Scenario(
    name="measured",
    extends=["heavier"],
    sensors=[{"type": "noise", "velocity": 1e-4}],
    acceleration={"type": "filtered-difference", "cutoff": 100.0},
)


def main(picture="compare_laws.svg", duration=10.0):
    records = [
        mm.simulate("tiago_no_hand", law, "circle", duration=duration, scenario=MEASURED)
        for law in LAWS
    ]
    comparison = mm.compare(records)
    print(comparison.table[["status", "task_error_final", "torque_limit_ratio"]])
    comparison.plot(picture)


if __name__ == "__main__":
    main()
