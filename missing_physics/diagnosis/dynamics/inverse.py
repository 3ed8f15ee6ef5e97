"""Inverse dynamics of the nominal robot along a motion, and everything in which it is linear.

Flexible links move as the joints' motion makes them (`modal/smoother.py` corrects their vibration); a change
of generalised forces is followed quasi-statically, without change of their accelerations, which holds below
their natural frequencies.

A free base moves as momentum conservation demands. Its six rows of the equations of motion hold no actuator
force, so the base acceleration is eliminated: with Z the mass matrix, a change r = [r_b; r_m] of the
generalised forces changes the joint torques by ``r_m - Z_mb Z_bb^-1 r_b`` (as in computed torque for a
free-floating base). Where a gyro is recorded its rates are predicted as well (see `dynamics/base_rates.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from missing_physics.diagnosis.dynamics.base_rates import BaseResponse, rotation_matrices
from missing_physics.diagnosis.modal.response import POSES, ModalResponse
from missing_physics.diagnosis.motion.estimate import Motion
from missing_physics.diagnosis.terms.term import BODY_NUMBERS
from reference_model.evaluation.model import BaseMotion, RobotModel
from reference_model.passive.inner_motion import InnerMotion

__all__ = ["MotionDynamics", "Passive", "joint_inertia"]

Array = NDArray[np.float64]

#: Step of a central difference by a joint's position [rad or m]: errors of 1e-8 of a momentum that turns.
POSITION_STEP = 1e-4


class Passive(TypedDict):
    """What the functions of a model want to know beside the joints' motion."""

    base: BaseMotion | None
    inner: InnerMotion | None
    inertial: Array


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
    """What the nominal model says along one motion; arrays are at the full sampling rate.

    What is predicted, the *outputs*, are the torques of the n joints and then the `further` channels.
    """

    def __init__(
        self, model: RobotModel, motion: Motion, further: Sequence[str] = (), about: Array | None = None
    ) -> None:
        """Follow the passive coordinates along `motion`.

        Args:
            model: the nominal robot.
            motion: of its joints.
            further: gyro channels of a free base that are predicted beside the torques.
            about: inertial numbers at which everything is linearised, shape (P,); the nominal ones when left
                out. The base's motion, and so what is predicted, is not linear in them.
        """
        self.model = model
        self.motion = motion
        self.further = tuple(further)
        self.about = model.inertial if about is None else about
        self._axes = ["xyz".index(channel[-1]) for channel in further]
        self._state = (motion.position, motion.velocity, motion.acceleration)
        self._base, self._inner = model.reconstruct_passive(motion.time, *self._state, inertial=self.about)

    @property
    def state(self) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration of the joints, shape (N, n) each."""
        return self._state

    @property
    def base(self) -> BaseMotion | None:
        """Motion of a free base; None when it is fixed."""
        return self._base

    @property
    def inner(self) -> InnerMotion | None:
        """Motion of the flexible links; None without any."""
        return self._inner

    @property
    def base_inertia(self) -> Array:
        """Mass matrix of a free base with all that it carries, shape (N, 6, 6)."""
        return self._mass_matrix[:, :6, :6]

    @property
    def step(self) -> float:
        """Sample time [s]."""
        return 1.0 / self.motion.low_pass.rate

    @property
    def _passive(self) -> Passive:
        return {"base": self._base, "inner": self._inner, "inertial": self.about}

    @cached_property
    def outputs(self) -> Array:
        """What is predicted with the numbers of `about`, shape (N, m)."""
        if self._base is None:
            return self.torque
        return np.column_stack([self.torque, self._base.angular_velocity[:, self._axes]])

    @cached_property
    def nominal_outputs(self) -> Array:
        """What is predicted with the nominal numbers, by the linearisation at `about`, shape (N, m)."""
        change = self.model.inertial - self.about
        return self.outputs + self.regressor @ change if change.any() else self.outputs

    @cached_property
    def torque(self) -> Array:
        """Joint torques by inverse dynamics, shape (N, n)."""
        rows = self.model.inverse_dynamics(*self._state, **self._passive)
        return self._joint_rows(rows[:, :, None])[:, :, 0]

    @property
    def modal_response(self) -> ModalResponse | None:
        """How flexible links answer small changes of forces and motion; None without flexible links."""
        return None if self._inner is None else self.motion_response

    @cached_property
    def motion_response(self) -> ModalResponse:
        """How joints and flexible links answer small changes of forces."""
        motion, tree = self.motion, self.model.tree
        rows = self._poses
        bodies = [body.flexible for body in tree.bodies if body.flexible]
        return ModalResponse.of(
            self.model.mass_matrix(motion.position[rows], **self.passive_at(rows, inner=False)),
            block_diag(*(body.stiffness for body in bodies)) if bodies else np.zeros((0, 0)),
            block_diag(*(body.damping for body in bodies)) if bodies else np.zeros((0, 0)),
            base=tree.offset,
            samples=motion.time.size,
            step=1.0 / motion.low_pass.rate,
        )

    def base_rows(self, rows: NDArray[np.int_]) -> Array:
        """Change of a free base's angular velocity by [dq; dx; dq'; dx'] of joints and modes, (K, 3, 2 g).

        At K of the samples. Momentum stays what it was: what the changed motion makes of angular momentum
        about the centre of mass, the base's turning takes back.
        """
        count = self.model.tree.offset
        passive = self.passive_at(rows)
        base, inner = passive["base"], passive["inner"]
        assert base is not None
        position, velocity = (part[rows] for part in self._state[:2])
        z = self.model.mass_matrix(position, **passive)[:, :6]
        lever = np.linalg.solve(z[:, :3, :3], z[:, :3])
        central = z[:, 3:] - z[:, 3:, :3] @ lever
        columns = []
        for k in range(z.shape[2] - count):
            ends = []
            for sign in (1.0, -1.0):
                moved, bent, n = position.copy(), inner, position.shape[1]
                if k < n:
                    moved[:, k] += sign * POSITION_STEP
                else:
                    assert inner is not None
                    modal = inner.modal.copy()
                    modal[:, k - n] += sign * POSITION_STEP
                    bent = replace(inner, modal=modal)
                ends.append(
                    self.model.momentum(moved, velocity, base=base, inner=bent, inertial=self.about)[1]
                )
            columns.append((ends[0] - ends[1]) / (2 * POSITION_STEP))
        turned = rotation_matrices(base.attitude).transpose(0, 2, 1) @ np.stack(columns, axis=2)
        change = np.concatenate([turned, central[:, :, count:]], axis=2)
        return -np.asarray(np.linalg.solve(central[:, :, 3:6], change))

    def tip_acceleration(self, link: str) -> Array:
        """Acceleration of a flexible link's tip, its own axes [m/s^2], shape (N, 3)."""
        return self.model.node_motion(link, *self._state, **self._passive).acceleration

    @property
    def _poses(self) -> NDArray[np.int_]:
        return np.linspace(0, self.motion.time.size - 1, POSES).astype(int)

    def passive_at(self, rows: NDArray[np.int_], *, inner: bool = True) -> Passive:
        """What a model wants to know at some samples; links undeformed unless `inner`."""
        base = None if self._base is None else BaseMotion.from_stacked(self._base.stacked()[rows])
        bent = None
        if inner and self._inner is not None:
            bent = InnerMotion(*(np.asarray(part)[rows] for part in vars(self._inner).values()))
        return {"base": base, "inner": bent, "inertial": self.about}

    def moved(self, errors: Sequence[Array]) -> Array:
        """Change of the outputs by another joint motion, shape (N, m, k), to first order.

        Args:
            errors: of position, velocity and acceleration, shape (N, n, k) each.
        """
        joints = self._torques_by_motion @ np.concatenate(errors, axis=1)
        if not self.further:
            return joints
        momentum = self._momentum_by_position @ errors[0]
        rates = self._base_response.rates_of_motion(momentum, errors[1], self._joints)
        return np.concatenate([joints, rates[:, self._axes]], axis=1)

    @cached_property
    def _momentum_by_position(self) -> Array:
        """Derivative of the angular momentum about the centre of mass, inertial axes, (N, 3, n)."""
        position, velocity = self._state[:2]
        columns = []
        for joint in range(position.shape[1]):
            ends = []
            for sign in (1.0, -1.0):
                moved = position.copy()
                moved[:, joint] += sign * POSITION_STEP
                ends.append(self.model.momentum(moved, velocity, **self._passive)[1])
            columns.append((ends[0] - ends[1]) / (2 * POSITION_STEP))
        return np.stack(columns, axis=2)

    @cached_property
    def _torques_by_motion(self) -> Array:
        """Derivative of the torques by position, velocity and acceleration, shape (N, n, 3 n)."""
        jacobians = self.model.motion_jacobians(*self._state, **self._passive)
        return self._joint_rows(np.concatenate(jacobians, axis=2))

    @cached_property
    def inertia(self) -> Array:
        """Derivative of each joint's torque by its own acceleration, shape (N, n)."""
        n = len(self.model.joints)
        return np.diagonal(self._torques_by_motion[:, :, 2 * n :], axis1=1, axis2=2)

    @cached_property
    def regressor(self) -> Array:
        """Derivative of the outputs by the inertial numbers, shape (N, m, P)."""
        return self.response(self.model.regressor(*self._state, **self._passive))

    @cached_property
    def loads(self) -> Array:
        """Bearing loads in the order of `reference_model.dynamics.balance.LOADS`, shape (N, n, 4)."""
        return np.asarray(self.model.bearing_loads(*self._state, **self._passive))

    def body_columns(self, body: str) -> Array:
        """Derivative by the ten numbers of `body` and by gravity, shape (N, n, 13)."""
        names = list(self.model.inertial_names)
        columns = np.zeros((*self.regressor.shape[:2], len(BODY_NUMBERS) + 3))
        wanted = [f"{body}.{number}" for number in BODY_NUMBERS] + [f"gravity.{axis}" for axis in "xyz"]
        for place, name in enumerate(wanted):
            if name in names:
                columns[:, :, place] = self.regressor[:, :, names.index(name)]
        return columns

    def response(self, rows: Array) -> Array:
        """Change of the outputs by a change of the generalised forces (N, rows, k), shape (N, m, k)."""
        joints = self._joint_rows(rows)
        if not self.further:
            return joints
        return np.concatenate([joints, self._base_response.rates(rows[:, :6])[:, self._axes]], axis=1)

    def joint_rows(self, rows: Array, samples: NDArray[np.int_]) -> Array:
        """Change of the torques, (K, n, k), by generalised forces (K, rows, k) at K of the samples."""
        joints = rows[:, self._joints]
        return joints if self._base is None else joints - self._elimination[samples] @ rows[:, :6]

    def _joint_rows(self, rows: Array) -> Array:
        """Joint rows of (N, rows, k), with the base acceleration eliminated when it is free."""
        joints = rows[:, self._joints]
        return joints if self._base is None else np.asarray(joints - self._elimination @ rows[:, :6])

    @property
    def _joints(self) -> slice:
        start = self.model.tree.offset
        return slice(start, start + len(self.model.joints))

    @cached_property
    def _base_response(self) -> BaseResponse:
        assert self._base is not None
        return BaseResponse(self.motion.time, self._base, self._mass_matrix[:, :6])

    @cached_property
    def _elimination(self) -> Array:
        """Z_mb Z_bb^-1, shape (N, n, 6)."""
        z = self._mass_matrix[:, :, :6]
        return np.asarray(
            np.linalg.solve(z[:, :6].transpose(0, 2, 1), z[:, self._joints].transpose(0, 2, 1)).transpose(
                0, 2, 1
            )
        )

    @cached_property
    def _mass_matrix(self) -> Array:
        """Shape (N, rows, rows), base rows first."""
        return self.model.mass_matrix(self.motion.position, **self._passive)
