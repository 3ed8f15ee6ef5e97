"""Motion of a base, as arrays over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_model import InputError

__all__ = ["BASE_NUMBERS", "BaseMotion"]

#: Numbers per sample of a stacked base motion: attitude 4, then four columns of 3.
BASE_NUMBERS = 16


@dataclass(frozen=True)
class BaseMotion:
    """Attitude, rates and accelerations of the base frame; rates and accelerations in *base axes*.

    Attributes:
        attitude: quaternion w, x, y, z, base to inertial axes, shape (N, 4); any length above zero.
        angular_velocity: [rad/s], shape (N, 3).
        linear_velocity: inertial velocity of the base frame's origin [m/s], shape (N, 3).
        angular_acceleration: [rad/s^2], shape (N, 3).
        linear_acceleration: inertial acceleration of the base frame's origin [m/s^2], shape (N, 3); gravity
            is not in it (an accelerometer at the origin reads this minus gravity).

    Raises `InputError` when shapes disagree.
    """

    attitude: NDArray[np.float64]
    angular_velocity: NDArray[np.float64]
    linear_velocity: NDArray[np.float64]
    angular_acceleration: NDArray[np.float64]
    linear_acceleration: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name, width in zip(self.__dataclass_fields__, (4, 3, 3, 3, 3)):
            array = np.atleast_2d(np.asarray(getattr(self, name), dtype=float))
            object.__setattr__(self, name, array)
            if array.shape != (len(self.attitude), width):
                raise InputError(
                    f"base motion: {name} has shape {array.shape}, not ({len(self.attitude)}, {width})."
                )

    def __len__(self) -> int:
        return len(self.attitude)

    @classmethod
    def at_rest(cls, attitude: NDArray[np.float64], samples: int = 1) -> BaseMotion:
        """A base at rest; `attitude` has shape (4,)."""
        still = np.zeros((samples, 3))
        return cls(np.tile(attitude, (samples, 1)), still, still, still, still)

    def stacked(self) -> NDArray[np.float64]:
        """attitude, [linear; angular] velocity, [linear; angular] acceleration, shape (N, 16)."""
        return np.hstack(
            [
                self.attitude,
                self.linear_velocity,
                self.angular_velocity,
                self.linear_acceleration,
                self.angular_acceleration,
            ]
        )

    @classmethod
    def from_stacked(cls, numbers: NDArray[np.float64]) -> BaseMotion:
        """The inverse of `stacked`."""
        return cls(numbers[:, :4], numbers[:, 7:10], numbers[:, 4:7], numbers[:, 13:16], numbers[:, 10:13])
