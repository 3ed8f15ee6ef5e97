"""Inverse dynamics of the nominal robot along a motion, and everything in which it is linear.

Flexible links move as the joints' motion makes them (`modal_smoother` corrects their vibration); a change of
generalised forces is followed quasi-statically, without change of their accelerations, which holds below
their natural frequencies.

A free base moves as momentum conservation demands. Its six rows of the equations of motion hold no actuator
force, so the base acceleration is eliminated: with Z the mass matrix, a change r = [r_b; r_m] of the
generalised forces changes the joint torques by ``r_m - Z_mb Z_bb^-1 r_b`` (as in computed torque for a
free-floating base).
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from missing_physics.diagnosis.modal_smoother import POSES, ModalResponse
from missing_physics.diagnosis.motion import Motion
from missing_physics.diagnosis.terms import BODY_NUMBERS
from reference_model.model import BaseMotion, RobotModel

__all__ = ["MotionDynamics", "joint_inertia"]

Array = NDArray[np.float64]


def joint_inertia(model: RobotModel, position: Array) -> Array:
    """Inertia that each joint feels at `position` [kg m^2 or kg], shape (n,)."""
    n = len(model.joints)
    at = np.repeat(position[None, :], n, axis=0)
    still = np.zeros_like(at)
    base = _still_base(n) if model.free_base else None
    moved = model.inverse_dynamics(at, still, np.eye(n), base=base)
    rest = model.inverse_dynamics(at, still, still, base=base)
    start = model.tree.offset
    return np.abs(np.diagonal((moved - rest)[:, start : start + n])).copy()


def _still_base(rows: int) -> BaseMotion:
    zeros = np.zeros((rows, 3))
    attitude = np.tile([1.0, 0.0, 0.0, 0.0], (rows, 1))
    return BaseMotion(
        attitude=attitude,
        angular_velocity=zeros,
        linear_velocity=zeros,
        angular_acceleration=zeros,
        linear_acceleration=zeros,
    )


class MotionDynamics:
    """What the nominal model says along one motion; arrays are at the full sampling rate."""

    def __init__(self, model: RobotModel, motion: Motion) -> None:
        self.model = model
        self.motion = motion
        self._state = (motion.position, motion.velocity, motion.acceleration)
        self._base, self._inner = model.reconstruct_passive(motion.time, *self._state)

    @cached_property
    def torque(self) -> Array:
        """Joint torques by inverse dynamics, shape (N, n)."""
        rows = self.model.inverse_dynamics(*self._state, base=self._base, inner=self._inner)
        return self._joint_rows(rows[:, :, None])[:, :, 0]

    @cached_property
    def modal_response(self) -> ModalResponse | None:
        """How flexible links answer small changes of forces and motion; None without flexible links."""
        if self._inner is None:
            return None
        motion, tree = self.motion, self.model.tree
        rows = np.linspace(0, motion.time.size - 1, POSES).astype(int)
        base = None if self._base is None else BaseMotion.from_stacked(self._base.stacked()[rows])
        bodies = [body.flexible for body in tree.bodies if body.flexible]
        return ModalResponse.of(
            self.model.mass_matrix(motion.position[rows], base=base),
            block_diag(*(body.stiffness for body in bodies)),
            block_diag(*(body.damping for body in bodies)),
            base=tree.offset,
            samples=motion.time.size,
            step=1.0 / motion.low_pass.rate,
        )

    @cached_property
    def jacobians(self) -> tuple[Array, Array, Array]:
        """Derivatives by position, velocity and acceleration, each of shape (N, n, n)."""
        by = self.model.motion_jacobians(*self._state, base=self._base, inner=self._inner)
        return tuple(self._joint_rows(rows) for rows in by)  # type: ignore[return-value]

    @cached_property
    def regressor(self) -> Array:
        """Derivative by the inertial numbers, shape (N, n, P)."""
        return self._joint_rows(self.model.regressor(*self._state, base=self._base, inner=self._inner))

    @cached_property
    def loads(self) -> Array:
        """Bearing loads in the order of `reference_model.balance.LOADS`, shape (N, n, 4)."""
        return np.asarray(self.model.bearing_loads(*self._state, base=self._base, inner=self._inner))

    def body_columns(self, body: str) -> Array:
        """Derivative by the ten numbers of `body` and by gravity, shape (N, n, 13)."""
        names = list(self.model.inertial_names)
        columns = np.zeros((*self.regressor.shape[:2], len(BODY_NUMBERS) + 3))
        wanted = [f"{body}.{number}" for number in BODY_NUMBERS] + [f"gravity.{axis}" for axis in "xyz"]
        for place, name in enumerate(wanted):
            if name in names:
                columns[:, :, place] = self.regressor[:, :, names.index(name)]
        return columns

    def _joint_rows(self, rows: Array) -> Array:
        """Joint rows of (N, rows, k), with the base acceleration eliminated when it is free."""
        joints = rows[:, self._joints]
        return joints if self._base is None else np.asarray(joints - self._elimination @ rows[:, :6])

    @property
    def _joints(self) -> slice:
        start = self.model.tree.offset
        return slice(start, start + len(self.model.joints))

    @cached_property
    def _elimination(self) -> Array:
        """Z_mb Z_bb^-1, shape (N, n, 6)."""
        assert self._base is not None
        rest = self.model.inverse_dynamics(*self._state, base=self._base, inner=self._inner)
        columns = []
        for field in ("linear_acceleration", "angular_acceleration"):
            for axis in range(3):
                moved = getattr(self._base, field) + np.eye(3)[axis]
                base = replace(self._base, **{field: moved})
                columns.append(self.model.inverse_dynamics(*self._state, base=base, inner=self._inner) - rest)
        z = np.stack(columns, axis=2)
        return np.asarray(
            np.linalg.solve(z[:, :6].transpose(0, 2, 1), z[:, self._joints].transpose(0, 2, 1)).transpose(
                0, 2, 1
            )
        )
