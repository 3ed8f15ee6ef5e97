"""The dynamics of a robot in the coordinates of its drives, for robots whose motors move several joints.

With q = T m, the rows of joints in a generalised force become tau_m = T^T tau_q, and a mass matrix T^T Z T.
The torque required of a motor is a row of its own, in which its friction is a function of its own motion.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference_model.codegen.kept import kept
from reference_model.evaluation.model import RobotModel
from robot_model import Robot

__all__ = ["DriveModel", "drive_model"]

Array = NDArray[np.float64]


@kept
def drive_model(robot: Robot) -> RobotModel:
    """The model of a robot along motions of its drives; that of its joints where each has its own."""
    return DriveModel(robot) if robot.transmissions else RobotModel(robot)


class DriveModel(RobotModel):
    """`RobotModel` whose motions and joint rows are those of the drives.

    Motors of transmissions have no bearing: their loads are zero, and `joint_loads` has those of the joints.

    Args:
        robot: the description.

    Attributes:
        joints: names of the drives.
        forward: T, the joints' coordinates from the drives', shape (n, n).
        coupled: places of the motors of transmissions.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self.joints = tuple(drive.name for drive in robot.drives)
        self.forward = robot.transmitting
        self.coupled = tuple(k for k, drive in enumerate(robot.drives) if drive.joint is None)
        self._whole = np.eye(self.rows)
        own = slice(self.tree.offset, self.tree.offset + len(self.joints))
        self._whole[own, own] = self.forward

    def inverse_dynamics(self, *motion: ArrayLike, **given: Any) -> Array:
        return np.asarray(super().inverse_dynamics(*self._of_joints(motion), **given) @ self._whole)

    def regressor(self, *motion: ArrayLike, **given: Any) -> Array:
        return self._rows(super().regressor(*self._of_joints(motion), **given))

    def motion_jacobians(self, *motion: ArrayLike, **given: Any) -> tuple[Array, Array, Array]:
        found = super().motion_jacobians(*self._of_joints(motion), **given)
        first, second, third = (self._rows(one) @ self.forward for one in found)
        return first, second, third

    def mass_matrix(self, position: ArrayLike, **given: Any) -> Array:
        matrix = super().mass_matrix(self._of_joints([position])[0], **given)
        return np.asarray(self._rows(matrix) @ self._whole)

    def bearing_loads(self, *motion: ArrayLike, **given: Any) -> Array:
        found = self.joint_loads(*motion, **given).copy()
        found[:, self.coupled] = 0.0
        return found

    def joint_loads(self, *motion: ArrayLike, **given: Any) -> Array:
        """Loads of the joints' bearings, shape (N, n, 4), in the order of `balance.LOADS`."""
        return super().bearing_loads(*self._of_joints(motion), **given)

    def reconstruct_passive(self, time: ArrayLike, *motion: ArrayLike, **given: Any) -> Any:
        return super().reconstruct_passive(time, *self._of_joints(motion), **given)

    def _of_joints(self, motion: Any) -> list[Array]:
        """Motion of the joints from that of the drives, shape (N, n) each."""
        return [np.asarray(part, dtype=float) @ self.forward.T for part in motion]

    def _rows(self, values: Array) -> Array:
        """Rows of drives of an array (N, rows, ...) of forces."""
        return np.asarray(np.einsum("ij,ni...->nj...", self._whole, values))
