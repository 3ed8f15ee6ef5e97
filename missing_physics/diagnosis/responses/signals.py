"""What an effect at a joint may depend on, along a recorded motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics

__all__ = ["signals_along"]

Array = NDArray[np.float64]

#: Temperature assumed where none is recorded [K].
ROOM_TEMPERATURE = 293.15


def signals_along(dynamics: MotionDynamics, joint: int, driving: Array) -> Array:
    """`JointSignals.CHANNELS` of one joint at the full rate, without friction, shape (N, 11).

    Args:
        dynamics: along the motion.
        joint: index among the moving joints.
        driving: torque of its actuator, shape (N,); where it is not known, what the motion takes.
    """
    motion = dynamics.motion
    temperature = motion.temperature[:, joint]
    return np.column_stack(
        [
            motion.time,
            motion.position[:, joint],
            motion.velocity[:, joint],
            motion.acceleration[:, joint],
            driving if np.isfinite(driving).all() else dynamics.torque[:, joint],
            np.zeros(motion.time.size),
            dynamics.loads[:, joint],
            np.where(np.isfinite(temperature), temperature, ROOM_TEMPERATURE),
        ]
    )
