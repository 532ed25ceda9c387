"""Position and orientation: the tip follows a circle and turns with it.

It starts 0.5 rad and some centimetres away; the orientation error is free of Euler angles."""

import mobman as mm


def main(picture="pose_circle.svg", duration=10.0):
    robot = mm.load_robot("ridgeback_panda")
    task = mm.make_task("pose-circle", robot, orientation="turn")
    record = mm.simulate(robot, "tsm", task, duration=duration)
    print(record, record.metrics["orientation_error_final"], "rad")
    record.plot(picture)


if __name__ == "__main__":
    main()
