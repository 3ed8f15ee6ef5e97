"""Controllers: the actuator torque that is commanded at each joint.

A law is split into the value that a digital controller holds between its ticks (`output`: torques, or the
duty cycles of a servo) and the resulting motor torque at this instant (`torque`). A continuous controller
computes both at every evaluation of the forces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.rotation import to_quaternion
from exudyn_model.bodies.transmissions import Transmissions
from exudyn_model.control.base import ControlLaw, JointState, initial_joints
from exudyn_model.control.feedforward import FrictionFeedforward
from exudyn_model.control.full_dynamics import FullDynamics
from exudyn_model.control.gains import gains
from exudyn_model.control.nominal import Nominal
from exudyn_model.control.nonlinear import AdaptiveNetworkLaw, SlidingModeLaw
from exudyn_model.control.rigid_dynamics import BaseState
from robot_model import (
    AdaptiveNetwork,
    ComputedTorque,
    Drive,
    InputError,
    JointPD,
    Robot,
    SlidingMode,
    VoltageServo,
)

__all__ = ["ControlLaw", "JointState", "control_law", "initial_joints"]


Array = NDArray[np.float64]


class _NoTorque(ControlLaw):
    def output(self, state: JointState, integral: Sequence[float]) -> list[float]:
        return [0.0] * len(self._motions)


class _JointPD(ControlLaw):
    """u = kp (r - q) + ki int(r - q) + kd (rd - qd) [+ nominal static gravity torque] [+ friction]."""

    def __init__(self, robot: Robot, nominal: Nominal) -> None:
        settings = robot.controller
        assert isinstance(settings, JointPD)
        super().__init__(robot, sample_time=settings.sample_time)
        self._gains = list(zip(*(gains(robot, getattr(settings, key)) for key in ("kp", "ki", "kd"))))
        self.integrates = any(ki for _, ki, _ in self._gains)
        self._friction = FrictionFeedforward(robot, settings)
        needs = settings.gravity_feedforward or self._friction.needs_loads
        self._nominal = nominal if needs else None
        self.needs_inner = isinstance(self._nominal, FullDynamics)
        self._gravity = settings.gravity_feedforward
        self._still = [0.0] * len(self._motions)

    def output(self, state: JointState, integral: Sequence[float]) -> list[float]:
        torques, goals = [], self.goals(state.time)
        rows = zip(self._gains, goals, state.position, state.velocity, integral)
        for (kp, ki, kd), (r, rd, _), q, qd, total in rows:
            torques.append(kp * (r - q) + ki * total + kd * (rd - qd))
        if self._gravity and self._nominal is not None:
            base = BaseState(state.base.rotation, np.zeros(3)) if state.base else None
            inner = state.inner and replace(state.inner, ball_rates=0 * state.inner.ball_rates)
            weights = self._nominal(state.position, self._still, self._still, base=base, inner=inner)
            torques = [u + weight for u, weight in zip(torques, weights)]
        return self._friction.added(torques, [rd for _, rd, _ in goals], lambda: self._loads(state))

    def _loads(self, state: JointState) -> list[float]:
        assert self._nominal is not None
        wanted = [rdd for _, _, rdd in self.goals(state.time)]
        found = self._nominal.needed(
            state.position, state.velocity, wanted, base=state.base, inner=state.inner
        )
        return self._friction.loads(self._nominal.coordinate, found)


class _ComputedTorque(ControlLaw):
    """Nominal inverse dynamics at the acceleration rdd + kd (rd - qd) + kp (r - q) [+ friction].

    A base with gains is held: its desired acceleration is base_kp e - base_kd v, with e the displacement back
    to its initial pose, the rotation as twice the vector part of the return quaternion; all in base axes.
    """

    def __init__(self, robot: Robot, nominal: Nominal) -> None:
        settings = robot.controller
        assert isinstance(settings, ComputedTorque)
        super().__init__(robot, sample_time=settings.sample_time)
        self._gains = list(zip(gains(robot, settings.kp), gains(robot, settings.kd)))
        # Its gains are rates of the closed loop, far slower than a step, as long as the actual inertia is
        # that of its model; the root of a flexible link that it assumes rigid is much lighter.
        self.bent_links = nominal.bent_links
        self.stiff = bool(robot.flexible_links) and not self.bent_links
        self.needs_inner = isinstance(nominal, FullDynamics)
        self._nominal = nominal
        self._friction = FrictionFeedforward(robot, settings)
        self.holds_base = settings.base_kp is not None
        self._base_gains = settings.base_kp or 0.0, settings.base_kd

    def output(self, state: JointState, integral: Sequence[float]) -> list[float]:
        wanted, goals = [], self.goals(state.time)
        for (kp, kd), (r, rd, rdd), q, qd in zip(self._gains, goals, state.position, state.velocity):
            wanted.append(rdd + kd * (rd - qd) + kp * (r - q))
        rates = [rd for _, rd, _ in goals]
        if not self.holds_base and not self._friction.needs_loads:
            torques = self._nominal(
                state.position, state.velocity, wanted, base=state.base, inner=state.inner
            )
            return self._friction.added(torques, rates, list)
        found = self._nominal.needed(
            state.position,
            state.velocity,
            wanted,
            base=state.base,
            held=self._held(state),
            inner=state.inner,
        )
        order = self._nominal.coordinate
        torques = self._friction.added(found.torques, rates, lambda: self._friction.loads(order, found))
        return [*torques, *found.wrench] if self.holds_base else torques

    def torque(self, output: Sequence[float], state: JointState) -> list[float]:
        return list(output[: len(self._motions)])

    def wrench(self, output: Sequence[float]) -> list[float]:
        return list(output[len(self._motions) :])

    def _held(self, state: JointState) -> Array | None:
        """Desired accelerations of a held base, shape (6,)."""
        base = state.base
        if not self.holds_base or base is None:
            return None
        assert base.position is not None
        assert base.velocity is not None
        kp, kd = self._base_gains
        nominal, inward = self._nominal, base.rotation.T
        back = to_quaternion(inward @ nominal.base_rotation)
        error = np.concatenate([inward @ (nominal.base_position - base.position), 2 * back[1:]])
        drift = np.concatenate([inward @ base.velocity, base.angular_velocity])
        held: Array = kp * error - kd * drift
        return held


class _VoltageServo(ControlLaw):
    """Winding voltage clip(gain (r - q), +-1) supply, and the motor n k_t (V - k_t n qd) / R at the joint."""

    def __init__(self, robot: Robot) -> None:
        settings = robot.controller
        assert isinstance(settings, VoltageServo)
        super().__init__(robot, sample_time=settings.sample_time)
        self._gain = gains(robot, settings.gain)
        self._supply = settings.supply
        self.at_drives, self._coupling = True, Transmissions(robot)
        self._motors = [_motor(drive) for drive in robot.drives]

    def output(self, state: JointState, integral: Sequence[float]) -> list[float]:
        errors = self._coupling.to_motors(self.errors(state))
        return [max(-1.0, min(1.0, gain * error)) for gain, error in zip(self._gain, errors)]

    def torque(self, output: Sequence[float], state: JointState) -> list[float]:
        return [
            k / resistance * (duty * self._supply - k * qd)
            for duty, qd, (k, resistance) in zip(output, state.velocity, self._motors)
        ]

    def voltage(self, output: Sequence[float]) -> list[float] | None:
        return [duty * self._supply for duty in output]


def control_law(robot: Robot, nominal: Nominal) -> ControlLaw:
    """The robot's controller; `nominal` is its model without effects.

    Raises:
        InputError: a servo without motor data.
    """
    match robot.controller:
        case JointPD():
            return _JointPD(robot, nominal)
        case ComputedTorque():
            return _ComputedTorque(robot, nominal)
        case SlidingMode():
            return SlidingModeLaw(robot, nominal)
        case AdaptiveNetwork():
            return AdaptiveNetworkLaw(robot, nominal)
        case VoltageServo():
            return _VoltageServo(robot)
    return _NoTorque(robot)


def _motor(drive: Drive) -> tuple[float, float]:
    """Gear ratio times torque constant [N m/A at the joint], and resistance [ohm]."""
    actuator = drive.actuator
    if actuator is None or actuator.torque_constant is None or actuator.resistance is None:
        where, keys = f"motor '{drive.name}'", "torque_constant and resistance"
        if drive.joint is not None:
            where, keys = f"joint '{drive.name}'", "actuator.torque_constant and actuator.resistance"
        raise InputError(f"{where} needs {keys} for a voltage servo.")
    return actuator.gear_ratio * actuator.torque_constant, actuator.resistance
