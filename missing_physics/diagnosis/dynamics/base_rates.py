"""What the rates of a free base say of the robot, whatever the torques of its joints are.

The joints' motion alone tells how a free base turns (see `reference_model.passive.free_base`). A gyro on it
therefore adds equations in which no torque, friction or torque scale appears: what differs there is a mass
property, a motion that was measured wrongly, or something outside the robot. Internal effects at the joints
cannot do it.

A change r of the generalised forces at the base along the same joint motion changes the momentum that the
joints' motion makes by the integral of r, taken in inertial axes about a fixed point; the base's twist V
makes up for it:

    Z_bb dV = -integral of r dt,    Z_bb the inertia of the whole robot about the base's origin.

Another joint motion changes the angular momentum L about the centre of mass at once, and the base makes up
for it by its angular velocity: I dw = -dL, I the inertia of the whole robot about its centre of mass.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from reference_model.evaluation.model import BaseMotion
from robot_model import Recording, Robot

__all__ = ["BaseResponse", "base_rate_channels", "covered", "rotation_matrices"]

Array = NDArray[np.float64]

#: A gap is longer than this many samples of a channel's own clock.
GAP = 1.5
#: A gyro's channels in the order of the axes.
GYRO = tuple(f"base.angular_velocity.{axis}" for axis in "xyz")


def base_rate_channels(robot: Robot, recordings: Sequence[Recording]) -> tuple[str, ...]:
    """The gyro channels that every one of `recordings` holds; none for a fixed base.

    None either for flexible links: their vibration turns the base by more than a gyro's noise, and is not
    known as well as that from the joints' motion.
    """
    if robot.base.kind != "free" or robot.flexible_links:
        return ()
    return tuple(
        channel
        for channel in GYRO
        if all(channel in r and covered(r, channel).sum() > 0.5 * len(r) for r in recordings)
    )


def covered(recording: Recording, channel: str) -> NDArray[np.bool_]:
    """Instants at which a channel, perhaps of a slower clock, was recorded without a gap, shape (N,)."""
    good = np.flatnonzero(np.isfinite(recording[channel]))
    inside = np.zeros(len(recording), dtype=bool)
    if good.size > 1:
        steps = np.diff(good)
        inside[good[0] : good[-1]] = np.repeat(steps <= GAP * np.median(steps), steps)
    inside[good] = True
    return inside


class BaseResponse:
    """Changes of a free base's angular velocity that changed generalised forces make."""

    def __init__(self, time: Array, base: BaseMotion, mass_matrix: Array) -> None:
        """From the rows [linear; angular] of the base, its axes, and all columns, shape (N, 6, rows)."""
        self._time, self._rows = time, mass_matrix
        self._turn = rotation_matrices(base.attitude)
        travel = np.einsum("nij,nj->ni", self._turn, base.linear_velocity)
        self._place = cumulative_trapezoid(travel, time, axis=0, initial=0.0)

    def rates(self, forces: Array) -> Array:
        """Change of the angular velocity [rad/s], shape (N, 3, k), by force and moment changes (N, 6, k).

        These are what the motion needs more than before, at the base's origin and in its axes.
        """
        force, moment = (np.einsum("nij,njk->nik", self._turn, part) for part in np.split(forces, 2, axis=1))
        moment = moment + _cross(self._place, force)
        both = np.concatenate([force, moment], axis=1)
        momentum = cumulative_trapezoid(both, self._time, axis=0, initial=0.0)
        linear, angular = np.split(momentum, 2, axis=1)
        angular = angular - _cross(self._place, linear)
        back = self._turn.transpose(0, 2, 1)
        own = np.concatenate([back @ linear, back @ angular], axis=1)
        return -np.asarray(np.linalg.solve(self._rows[:, :, :6], own))[:, 3:]

    def rates_of_motion(self, momentum: Array, velocity: Array, joints: slice) -> Array:
        """Change of the angular velocity [rad/s], shape (N, 3, k), by another joint motion.

        Args:
            momentum: change of the angular momentum about the centre of mass by the joints' positions, at
                their velocities, inertial axes, shape (N, 3, k).
            velocity: change of the joints' velocities, shape (N, n, k).
            joints: columns of the mass matrix that belong to the joints.
        """
        linear, angular = self._rows[:, :3], self._rows[:, 3:]
        lever = np.linalg.solve(linear[:, :, :3], linear)  # what the base's linear velocity makes up for
        central = angular - angular[:, :, :3] @ lever
        change = self._turn.transpose(0, 2, 1) @ momentum + central[:, :, joints] @ velocity
        return -np.asarray(np.linalg.solve(central[:, :, 3:6], change))


def _cross(vector: Array, columns: Array) -> Array:
    """vector x column for (N, 3) and (N, 3, k)."""
    return np.asarray(np.cross(vector[:, :, None], columns, axis=1))


def rotation_matrices(quaternion: Array) -> Array:
    """Base to inertial axes, shape (N, 3, 3), from w, x, y, z."""
    w, x, y, z = (quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)).T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1),
        ],
        axis=1,
    )
