"""Torques that act two sampling periods late: who knows the delay predicts, who does not diverges."""

import mobman as mm


def main(picture="delay.svg", duration=10.0):
    late = mm.Scenario(name="late", actuation=[{"type": "delay", "delay": 0.002}])
    laws = {
        "no delay": (mm.make_controller("tsm"), None),
        "2 ms, told": (mm.make_controller("tsm", delay_ticks=2), late),
        "2 ms, not told": (mm.make_controller("tsm"), late),
    }
    records = {
        label: mm.simulate("tiago_no_hand", law, "circle", duration=duration, scenario=scenario)
        for label, (law, scenario) in laws.items()
    }
    comparison = mm.compare(records)
    print(comparison.table[["status", "task_error_final"]])
    comparison.plot(picture)


if __name__ == "__main__":
    main()
