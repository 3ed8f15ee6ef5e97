"""A robot's dynamics along a reference motion, and the force that they leave unexplained at each joint.

The acceleration that counts is that of the recorded positions themselves: their second difference over two
steps is the mean of the true acceleration under a triangle over these steps. So everything that is compared
with it, torque and laws alike, is averaged under the same triangle, and no filter stands between a reversal
and the sample at which it happened.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.statespace.course import Course
from missing_physics.statespace.signals import Signals
from reference_model.model import RobotModel

__all__ = ["Plant", "under_triangle"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Plant:
    """A rigid robot on a fixed base along one course. N samples, n joints, P inertial numbers.

    What is averaged under the triangle lacks both ends and has N - 2 samples.

    Attributes:
        joints: their names.
        signals: what was recorded.
        course: the reference motion.
        needed: torque by inverse dynamics along the course, shape (N, n) [N m or N].
        unexplained: recorded torque less what the recorded motion needs, averaged, shape (N - 2, n).
        inertia, damping, stiffness: derivatives of `needed` by acceleration, rate and position of the joints,
            shape (N, n, n).
        regressor: derivative of the averaged needed torque by the inertial numbers, shape (N - 2, n, P).
        loads: bearing loads in the order of `reference_model.balance.LOADS`, shape (N, n, 4).
    """

    joints: tuple[str, ...]
    signals: Signals
    course: Course
    needed: Array
    unexplained: Array
    inertia: Array
    damping: Array
    stiffness: Array
    regressor: Array
    loads: Array

    @classmethod
    def along(cls, model: RobotModel, signals: Signals, course: Course, inertial: Array) -> Plant:
        """Evaluate everything at the inertial numbers `inertial`, shape (P,)."""
        state = course.position, course.velocity, course.acceleration
        needed = model.inverse_dynamics(*state, inertial=inertial)
        stiffness, damping, inertia = model.motion_jacobians(*state, inertial=inertial)
        recorded = np.diff(signals.position, 2, axis=0) / signals.step**2
        apart = np.einsum("tij,tj->ti", under_triangle(inertia), recorded) - under_triangle(
            np.einsum("tij,tj->ti", inertia, course.acceleration)
        )
        regressor = model.regressor(*state, inertial=inertial)
        regressor[:, :, -3:] = 0.0  # of gravity: its share is the masses'
        return cls(
            joints=tuple(model.joints),
            signals=signals,
            course=course,
            needed=needed,
            unexplained=under_triangle(signals.torque - needed) - apart,
            inertia=inertia,
            damping=damping,
            stiffness=stiffness,
            regressor=under_triangle(regressor),
            loads=model.bearing_loads(*state, inertial=inertial),
        )


def under_triangle(values: Array) -> Array:
    """Means of series that run linearly between samples, weighted with a triangle of two steps."""
    return np.asarray((values[:-2] + 4.0 * values[1:-1] + values[2:]) / 6.0)
