"""Motion and dynamics of one recording on the samples that a filter keeps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.motion.estimate import Motion
from robot_model import Joint, Robot

__all__ = ["Along"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Along:
    """One recording.

    Attributes:
        robot: the nominal robot.
        dynamics: of it along the recording.
    """

    robot: Robot
    dynamics: MotionDynamics

    @property
    def motion(self) -> Motion:
        """Of the joints."""
        return self.dynamics.motion

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Those that move."""
        return self.robot.moving_joints

    @property
    def time(self) -> Array:
        """Of the samples that the filter keeps [s], shape (R,)."""
        return self.motion.reduced_time

    @property
    def position(self) -> Array:
        """At these, shape (R, n)."""
        return self.motion.position[self._kept]

    @property
    def velocity(self) -> Array:
        """At these, shape (R, n)."""
        return self.motion.velocity[self._kept]

    @property
    def _kept(self) -> slice | NDArray[np.int_]:
        return self.motion.low_pass.kept(self.motion.time.size)
