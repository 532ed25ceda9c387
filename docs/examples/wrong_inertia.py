"""How much a wrong inertia costs computed torque with an integral, and `tsm`.

The plant has the nominal masses, then 1.3 and 1.6 times these with a payload that no law knows."""

import mobman as mm

PLANTS = {"as supposed": (1.0, 0.0), "1.3, 1 kg": (1.3, 1.0), "1.6, 2 kg": (1.6, 2.0)}


def main(picture="wrong_inertia.svg", duration=10.0):
    records = {}
    for law in ("computed-torque-integral", "tsm"):
        for label, (factor, payload) in PLANTS.items():
            plant = mm.Scenario(name="plant", mass_factor=factor, payload=payload)
            records[f"{law}, {label}"] = mm.simulate(
                "husky_ur5", law, "circle", duration=duration, plant=plant
            )
    comparison = mm.compare(records)
    print(comparison.table["task_error_final"])
    comparison.plot(picture)


if __name__ == "__main__":
    main()
