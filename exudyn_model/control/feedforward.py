"""Friction feed-forward: the friction expected along the reference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import tanh

import numpy as np

from exudyn_model.bodies.bearing import Load
from exudyn_model.control.gains import gains
from exudyn_model.control.rigid_dynamics import Needed
from robot_model import ComputedTorque, JointPD, Robot

__all__ = ["FrictionFeedforward"]

#: Speed of the reference over which it changes its sign, tanh(rd / FEEDFORWARD_TRANSITION) [rad/s or m/s].
FEEDFORWARD_TRANSITION = 1e-4


class FrictionFeedforward:
    """u = (level + coefficient W) sgn(rd), W of the bearing at the nominal motion."""

    def __init__(self, robot: Robot, controller: JointPD | ComputedTorque) -> None:
        self._levels = gains(robot, controller.coulomb_feedforward)
        self._shares = gains(robot, controller.load_feedforward)
        self._joints = robot.moving_joints

    @property
    def needs_loads(self) -> bool:
        """Whether the feed-forward of a joint depends on the nominal load of its bearing."""
        return any(self._shares)

    def added(
        self, torques: Sequence[float], rates: Sequence[float], loads: Callable[[], Sequence[float]]
    ) -> list[float]:
        """Torques with the feed-forward at reference velocities `rates`; `loads` gives W of every joint."""
        weights = loads() if self.needs_loads else [0.0] * len(self._levels)
        rows = zip(torques, self._levels, self._shares, weights, rates)
        return [
            u + (level + share * weight) * tanh(rate / FEEDFORWARD_TRANSITION)
            for u, level, share, weight, rate in rows
        ]

    def loads(self, coordinate: Sequence[int], needed: Needed) -> list[float]:
        """Friction moments W of all bearings [N m or N], zero without one.

        `coordinate` is the place of every entry of `needed.joints` among the moving joints.
        """
        found = [0.0] * len(self._joints)
        axis = np.array([0.0, 0.0, 1.0])
        for k, (force, moment) in zip(coordinate, needed.joints):
            joint = self._joints[k]
            if joint.bearing is not None:
                load = Load.of(joint.kind, np.array(force), np.array(moment), axis)
                found[k] = load.friction_moment(joint.bearing)
        return found
