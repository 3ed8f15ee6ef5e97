"""Coordinates of joints and of drives as expressions, related by a robot's transmissions.

q = T m and tau_m = T^T tau_q, m = C q and tau_q = C^T tau_m (see `robot_model.description.transmission`).
Without transmissions both sides are the same.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from robot_model import Robot

__all__ = ["Coupling"]


class Coupling:
    """The transmissions of a robot.

    Args:
        robot: the description.

    Attributes:
        motors: name of each motor of a transmission to its index among the drives.
    """

    def __init__(self, robot: Robot) -> None:
        self.motors = {drive.name: k for k, drive in enumerate(robot.drives) if drive.joint is None}
        self._forward = _sparse(robot.transmitting) if self.motors else None
        self._backward = _sparse(robot.coupling) if self.motors else None

    def drives(self, joints: ca.SX) -> ca.SX:
        """Motion of the drives from that of the joints, n x 1."""
        return joints if self._backward is None else self._backward @ joints

    def joints(self, drives: ca.SX) -> ca.SX:
        """Motion of the joints from that of the drives, n x 1."""
        return drives if self._forward is None else self._forward @ drives

    def on_joints(self, force: ca.SX) -> ca.SX:
        """Forces on the joints due to forces on the drives [N m or N], n x 1."""
        return force if self._backward is None else self._backward.T @ force

    def on_drives(self, force: ca.SX) -> ca.SX:
        """Forces on the drives required for forces on the joints [N m or N], n x 1."""
        return force if self._forward is None else self._forward.T @ force

    def inertia(self, reflected: ca.SX) -> ca.SX:
        """Mass matrix on the joints of drives with these reflected inertias, n x n."""
        rotors = ca.diag(reflected)
        return rotors if self._backward is None else self._backward.T @ rotors @ self._backward


def _sparse(matrix: NDArray[np.float64]) -> ca.SX:
    return ca.SX(ca.sparsify(ca.DM(matrix)))
