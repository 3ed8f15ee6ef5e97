"""Motors that move several joints together, in plain numbers.

A transmission states q = T m, its joints' motion from its motors'. Power is the same on both sides, so that
forces go from motors to joints by the transposed inverse of T, and back by its transpose.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from robot_model import Robot

__all__ = ["Transmissions"]

Array = NDArray[np.float64]


class Transmissions:
    """The transmissions of a robot; vectors are in the order of its moving joints and drives.

    Attributes:
        motors: name of each motor to its index; joints with their own motor are not included.
    """

    def __init__(self, robot: Robot) -> None:
        order = [joint.name for joint in robot.moving_joints]
        self.motors: dict[str, int] = {}
        self._there, self._back = np.eye(len(order)), np.eye(len(order))
        for transmission in robot.transmissions:
            rows = [order.index(name) for name in transmission.joints]
            matrix = np.array(transmission.matrix)
            self._there[np.ix_(rows, rows)] = matrix
            self._back[np.ix_(rows, rows)] = np.linalg.solve(matrix, np.eye(len(rows)))
            self.motors |= {motor.name: row for motor, row in zip(transmission.motors, rows)}

    def to_motors(self, joints: Sequence[float]) -> list[float]:
        """Positions, velocities or errors of the motors from those of the joints."""
        return (self._back @ joints).tolist() if self.motors else list(joints)

    def to_joints(self, motors: Sequence[float]) -> list[float]:
        """The same of the joints from those of the motors."""
        return (self._there @ motors).tolist() if self.motors else list(motors)

    def forces_on_joints(self, motors: Sequence[float]) -> list[float]:
        """Forces on the joints due to forces on the motors [N m or N]."""
        return (motors @ self._back).tolist() if self.motors else list(motors)

    def forces_on_motors(self, joints: Sequence[float]) -> list[float]:
        """Forces on the motors required for forces on the joints [N m or N]."""
        return (joints @ self._there).tolist() if self.motors else list(joints)

    def inertia(self, robot: Robot, apart: Collection[int] = ()) -> Array:
        """Mass matrix of the rotors on the joints, shape (n, n), without the drives with index in `apart`."""
        rotors = [0.0 if k in apart else drive.reflected_inertia for k, drive in enumerate(robot.drives)]
        return np.asarray((self._back.T * rotors) @ self._back)
