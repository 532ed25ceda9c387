"""A law at 1 kHz in a plain loop, against a stand-in for the robot in another process.

    python docs/examples/deploy.py [--robot NAME] [--base torque|velocity] [--seconds S] [--lockstep]

The loop is what runs on a robot; :class:`Link` and :func:`stand_in` are what a driver replaces.
"""

from __future__ import annotations

import argparse
import json
import socket
import struct
import subprocess
import sys
import time

import numpy as np

import mobman as mm

DT = 1e-3  # s
SERVO = 5e-3  # s: time constant of a base that takes velocities
FILTER = 2e-3  # s: time constant of the estimate of z'


class Link:
    """Rows of numbers to another process and back; of rows that wait, the newest counts."""

    def __init__(self, connection: socket.socket, length: int) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connection, self._format, self._waiting = connection, f"<{length}d", b""

    def send(self, *parts: np.ndarray) -> None:
        row = np.concatenate(parts)
        self._connection.sendall(struct.pack(f"<{len(row)}d", *row))

    def newest(self, wait: bool) -> np.ndarray | None:
        """The newest row, waiting for one or not; None if none came.

        Raises:
            ConnectionError: If the other end has closed.
        """
        size, row = struct.calcsize(self._format), None
        self._connection.setblocking(wait)
        while row is None or not wait:
            try:
                got = self._connection.recv(1 << 16)
            except BlockingIOError:
                break
            if not got:
                raise ConnectionError("the other end has closed")
            self._waiting += got
            whole = len(self._waiting) // size * size
            if whole:
                row = np.array(struct.unpack(self._format, self._waiting[whole - size : whole]))
                self._waiting = self._waiting[whole:]
        self._connection.setblocking(True)
        return row


def stand_in(port: int, name: str, base: str, lockstep: bool) -> None:
    """The robot: takes commands, moves, and tells q and z every millisecond, until the link closes."""
    robot = mm.load_robot(name)
    n_base = robot.n_alpha
    link = Link(socket.create_connection(("127.0.0.1", port)), robot.nz)
    q, z, command = robot.q_rest.copy(), np.zeros(robot.nz), np.zeros(robot.nz)
    command[n_base:] = _holding(robot, q)[n_base:]
    if base == "torque":
        command[:] = _holding(robot, q)
    started, tick = False, 0.0
    while True:
        link.send(q, z)
        row = link.newest(wait=lockstep or not started)  # the brakes hold until the first command
        if not started:
            started, tick = True, time.monotonic()
        command = command if row is None else row
        M, bias, B = robot.dynamics(q, z)
        if base == "velocity":  # its servo makes the base's z', and the arm bears what that takes
            z_dot = np.empty(robot.nz)
            z_dot[:n_base] = (command[:n_base] - z[:n_base]) / SERVO
            rest = command[n_base:] - bias[n_base:] - M[n_base:, :n_base] @ z_dot[:n_base]
            z_dot[n_base:] = np.linalg.solve(M[n_base:, n_base:], rest)
        else:
            z_dot = np.linalg.solve(M, B @ command - bias)
        z = z + DT * z_dot
        q = robot.consistent(q + DT * (robot.velocity_map(q) @ z))
        tick += DT
        if not lockstep:
            time.sleep(max(0.0, tick - time.monotonic()))


def _holding(robot: mm.MobileManipulator, q: np.ndarray) -> np.ndarray:
    """The torque that holds the robot at rest, shape (nz,)."""
    _, bias, B = robot.dynamics(q, np.zeros(robot.nz))
    return np.linalg.solve(B, bias)


def control(link: Link, name: str, base: str, seconds: float, lockstep: bool) -> dict[str, float]:
    """Run ``tsm`` on the link; the errors, and how the clock was kept."""
    robot = mm.load_robot(name)
    n_base = robot.n_alpha
    task = mm.make_task("circle", robot)
    law = mm.make_controller("tsm")  # bears torques that act a tick late
    for _ in range(2):  # the first step loads the law's machine code
        law.reset(robot, task, DT)
        law.step(0.0, robot.q_rest, np.zeros(robot.nz), np.zeros(robot.nz))
    law.reset(robot, task, DT)
    before, z_dot = None, np.zeros(robot.nz)
    errors, busy, overruns = [], [], 0
    deadline = 0.0
    for tick in range(round(seconds / DT)):
        row = link.newest(wait=True)
        began = time.perf_counter()
        deadline = deadline or time.monotonic()
        assert row is not None
        q, z = row[: robot.nq], row[robot.nq :]
        if before is not None:  # z' is not measured: differences, and a filter against noise
            z_dot += DT / (DT + FILTER) * ((z - before) / DT - z_dot)
        before = z
        command = law.step(tick * DT, q, z, z_dot)
        if base == "velocity":
            command[:n_base] = law.reference()[0][:n_base]
        link.send(command)
        busy.append(time.perf_counter() - began)
        errors.append(robot.tip_pose(q).translation - task.desired(tick * DT)[0])
        if not lockstep:
            deadline += DT
            if (left := deadline - time.monotonic()) < 0.0:  # what is lost is not made up for
                overruns, deadline = overruns + 1, time.monotonic()
            else:
                time.sleep(left)
    late = np.linalg.norm(errors[-len(errors) // 5 :], axis=1)
    return {
        "ticks": len(errors),
        "overruns": overruns,
        "step_median_us": 1e6 * float(np.median(busy)),
        "step_99th_us": 1e6 * float(np.quantile(busy, 0.99)),
        "error_start": float(np.linalg.norm(errors[0])),
        "error_late": float(late.max()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--robot", default="tiago_no_hand")
    parser.add_argument("--base", choices=("torque", "velocity"), default="torque")
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--lockstep", action="store_true", help="wait for each other, not for time")
    parser.add_argument("--stand-in", type=int, metavar="PORT", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.stand_in is not None:
        try:
            stand_in(given.stand_in, given.robot, given.base, given.lockstep)
        except ConnectionError:
            return
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = str(server.getsockname()[1])
        robot = subprocess.Popen([sys.executable, __file__, *sys.argv[1:], "--stand-in", port])
        try:
            connection, _ = server.accept()
            robot_row = mm.load_robot(given.robot)
            link = Link(connection, robot_row.nq + robot_row.nz)
            found = control(link, given.robot, given.base, given.seconds, given.lockstep)
            connection.close()
        finally:
            robot.terminate()
            robot.wait()
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
