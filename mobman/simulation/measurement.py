"""What the controller is given at a tick."""

from __future__ import annotations

from mobman.arrays import Array
from mobman.simulation.accelerometer import Accelerometer
from mobman.simulation.sensors.sensor import Sensor


class Measurement:
    """(q, z, z') as the sensors show them.

    Args:
        accelerometer: How z' is known.
        sensors: Their errors, in the order in which they happen.
    """

    def __init__(self, accelerometer: Accelerometer, sensors: list[Sensor]) -> None:
        self._accelerometer, self._sensors = accelerometer, sensors

    def take(self, q: Array, z: Array, z_dot: Array) -> tuple[Array, Array, Array]:
        """The measured ones, new arrays; to be called once at every tick.

        Args:
            q: The true configuration, shape (nq,).
            z: The true reduced velocity, shape (nz,).
            z_dot: The true z' under the torque held until now, shape (nz,).
        """
        q_now, z_now = q.copy(), z.copy()
        for sensor in self._sensors:
            sensor.state(q_now, z_now)
        acceleration = self._accelerometer.measure(z_now, z_dot)
        for sensor in self._sensors:
            sensor.acceleration(acceleration)
        return q_now, z_now, acceleration
