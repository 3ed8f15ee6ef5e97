"""Inverse dynamics of the nominal robot along a recorded motion.

A free base moves according to momentum conservation. Its six rows of the equations of motion contain no
actuator force, so the base acceleration is eliminated: with Z the mass matrix, generalised forces
r = [r_b; r_m] need the joint torques ``r_m - Z_mb Z_bb^-1 r_b`` (as in computed torque for a free-floating
base). If a gyro is recorded its rates are predicted as well. Flexible links respond to the joints' motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from missing_physics.motion.estimate import Motion
from reference_model.evaluation.model import BaseMotion, RobotModel
from reference_model.passive.inner_motion import InnerMotion

__all__ = ["MotionDynamics", "joint_inertia"]

Array = NDArray[np.float64]


class _Passive(TypedDict):
    """Arguments of a model's functions in addition to the joints' motion."""

    base: BaseMotion | None
    inner: InnerMotion | None


def joint_inertia(model: RobotModel, position: Array) -> Array:
    """Effective inertia of each joint at `position` [kg m^2 or kg], shape (n,)."""
    n = len(model.joints)
    at = np.repeat(position[None, :], n, axis=0)
    still = np.zeros_like(at)
    base = BaseMotion.at_rest(np.array([1.0, 0.0, 0.0, 0.0]), n) if model.free_base else None
    moved = model.inverse_dynamics(at, still, np.eye(n), base=base)
    rest = model.inverse_dynamics(at, still, still, base=base)
    start = model.tree.offset
    return np.abs(np.diagonal((moved - rest)[:, start : start + n])).copy()


class MotionDynamics:
    """Torques and base rates that the nominal model predicts along one motion, at the full sampling rate.

    Attributes:
        model: the nominal robot.
        motion: of its joints.
        further: gyro channels of a free base that are predicted in addition to the torques.
    """

    def __init__(self, model: RobotModel, motion: Motion, further: Sequence[str] = ()) -> None:
        self.model = model
        self.motion = motion
        self.further = tuple(further)
        self._state = (motion.position, motion.velocity, motion.acceleration)
        self._base, self._inner = model.reconstruct_passive(motion.time, *self._state)

    @property
    def base(self) -> BaseMotion | None:
        """Motion of a free base after a start from rest; None for a fixed one."""
        return self._base

    @property
    def inner(self) -> InnerMotion | None:
        """Motion of flexible links that start undeformed and at rest; None for rigid ones."""
        return self._inner

    @property
    def _passive(self) -> _Passive:
        return {"base": self._base, "inner": self._inner}

    @cached_property
    def torque(self) -> Array:
        """Joint torques, shape (N, n)."""
        rows = self.model.inverse_dynamics(*self._state, **self._passive)
        return self._joint_rows(rows[:, :, None])[:, :, 0]

    @cached_property
    def base_rates(self) -> Array:
        """Angular velocity of a free base in the order of `further` [rad/s], shape (N, len(further))."""
        if self._base is None:
            return np.zeros((self.motion.time.size, 0))
        axes = ["xyz".index(channel[-1]) for channel in self.further]
        return np.asarray(self._base.angular_velocity[:, axes])

    @cached_property
    def gravity(self) -> Array:
        """Derivative of the joint torques by gravity's three components, shape (N, n, 3)."""
        names = list(self.model.inertial_names)
        columns = [names.index(f"gravity.{axis}") for axis in "xyz"]
        return self._joint_rows(self.model.regressor(*self._state, **self._passive)[:, :, columns])

    def _joint_rows(self, rows: Array) -> Array:
        """Joint rows of (N, rows, k), with the base acceleration eliminated if it is free."""
        start = self.model.tree.offset
        own = slice(start, start + len(self.model.joints))
        if self._base is None:
            return rows[:, own]
        z = self.model.mass_matrix(self.motion.position, **self._passive)[:, :, :6]
        lever = np.linalg.solve(z[:, :6].transpose(0, 2, 1), z[:, own].transpose(0, 2, 1))
        return np.asarray(rows[:, own] - lever.transpose(0, 2, 1) @ rows[:, :6])
