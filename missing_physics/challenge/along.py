"""A robot's torques along an exactly known motion, and what each effect adds to them.

Written for the challenge apart from the diagnosis, so that neither the concealment nor the score uses
anything of what is judged. The motion is Exudyn's without sensors; the equations are the reference model's.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from reference_model.acting import AMBIENT_TEMPERATURE
from reference_model.balance import LOADS
from reference_model.effects.along import EffectAlong
from reference_model.effects.base import BodyEffect, JointEffect, JointSignals, SensorEffect
from reference_model.effects.catalogue import get_effect
from reference_model.effects.structure import StructureEffect
from reference_model.model import RobotModel
from reference_model.prescribed import prescribed
from robot_model import EffectUse, Recording, Robot

__all__ = ["ArmAlong"]

Array = NDArray[np.float64]

STATE = ("position", "velocity", "acceleration")
#: Degree of the spline through a faulty position whose derivatives are wanted.
SPLINE = 5


class ArmAlong:
    """`robot` along `exact`, every channel without noise.

    All results are parts of what the torque channels say, shape (N, n): measured minus nominal is the sum of
    the parts of what is hidden.
    """

    def __init__(self, robot: Robot, exact: Recording) -> None:
        self.robot, self.exact, self.model = robot, exact, RobotModel(robot)
        self.time = exact.time
        self.joints = self.model.joints
        self.state = tuple(self._columns(name) for name in STATE)
        self._base = self.model.reconstruct_base(exact.time, *self.state) if self.model.free_base else None

    def _columns(self, quantity: str) -> Array:
        return np.column_stack([self.exact[f"{joint}.{quantity}"] for joint in self.joints])

    @cached_property
    def torque(self) -> Array:
        """What the actuators gave."""
        return self._columns("torque")

    @cached_property
    def rigid(self) -> Array:
        """Inverse dynamics of the description, effects left out."""
        return self._joint_rows(self.model.inverse_dynamics(*self.state, base=self._base)[:, :, None])[
            :, :, 0
        ]

    @cached_property
    def regressor(self) -> Array:
        """Derivative of `rigid` by `model.inertial_names`, shape (N, n, P)."""
        return self._joint_rows(self.model.regressor(*self.state, base=self._base))

    @cached_property
    def jacobians(self) -> tuple[Array, Array, Array]:
        """Derivatives of `rigid` by position, velocity and acceleration, (N, n, n) each."""
        q, v, a = self.model.motion_jacobians(*self.state, base=self._base)
        return self._joint_rows(q), self._joint_rows(v), self._joint_rows(a)

    @cached_property
    def _loads(self) -> Array:
        return np.asarray(self.model.bearing_loads(*self.state, base=self._base))

    @cached_property
    def _reduction(self) -> Array:
        """Z_jb Z_bb^-1 of a free base, shape (N, n, 6)."""
        z = self.model.mass_matrix(self.state[0], base=self._base)
        return np.asarray(np.linalg.solve(z[:, :6, :6], z[:, :6, 6:]).transpose(0, 2, 1))

    def _joint_rows(self, rows: Array) -> Array:
        """Joint rows of (N, rows, k); no force acts on a free base, so its acceleration is eliminated."""
        if self._base is None:
            return rows
        return np.asarray(rows[:, 6:] - self._reduction @ rows[:, :6])

    def nominal(self) -> Array:
        """The torque that the description with all its effects at joints and bodies needs."""
        return self._nominal

    @cached_property
    def _nominal(self) -> Array:
        uses = [use for use in self.robot.effects if not isinstance(get_effect(use.effect), SensorEffect)]
        return self.rigid + np.sum([self.part(use) for use in uses], axis=0) if uses else self.rigid

    def part(self, use: EffectUse, *, friction: Array | None = None) -> Array:
        """What an effect adds to measured minus nominal torque, shape (N, n).

        `friction` is that of the joint's friction laws, for modifiers; the recorded one when left out.
        """
        effect = get_effect(use.effect)
        values = {**effect.defaults(), **use.parameters}
        if isinstance(effect, BodyEffect):
            return self._body_part(effect, use.at, values)
        if isinstance(effect, SensorEffect):
            return self._sensor_part(effect, use.at, values)
        if isinstance(effect, StructureEffect):
            return self._structure_part(use)
        assert isinstance(effect, JointEffect)
        found = np.zeros_like(self.rigid)
        k = self.joints.index(use.at)
        found[:, k] = -self._joint_part(effect, k, values, friction)
        return found

    def _joint_part(
        self, effect: JointEffect, k: int, values: Mapping[str, float], friction: Array | None
    ) -> Array:
        joint = self.robot.moving_joints[k]
        known = {
            "time": self.time,
            **{name: column[:, k] for name, column in zip(STATE, self.state)},
            "torque": self.torque[:, k],
            "friction": self.exact[f"{joint.name}.friction_torque"] if friction is None else friction,
            **{name: self._loads[:, k, column] for column, name in enumerate(LOADS)},
            "temperature": np.full_like(self.time, AMBIENT_TEMPERATURE),
        }
        signals = np.column_stack([known[name] for name in JointSignals.CHANNELS])
        gear = joint.actuator.gear_ratio if joint.actuator else 1.0
        arms = (joint.bearing.radial_arm, joint.bearing.axial_arm) if joint.bearing else (0.0, 0.0)
        return EffectAlong(effect, gear_ratio=gear, bearing_arms=arms).torque(signals, values)

    def _structure_part(self, use: EffectUse) -> Array:
        """What a change of structure does to the torques, both robots simulated along the motion."""
        bare = self.robot.model_copy(update={"effects": ()})
        torques = []
        for robot in (bare.with_effects(use), bare):
            made = prescribed(robot, self.time, *self.state)
            torques.append(np.column_stack([made[f"{name}.torque"] for name in self.joints]))
        return np.asarray(torques[0] - torques[1])

    def _body_part(self, effect: BodyEffect, body: str, values: Mapping[str, float]) -> Array:
        terms = effect.terms(values)
        numbers = {f"{body}.mass": float(_numbers(terms.mass)[0, 0])}
        moment, inertia = _numbers(terms.first_moment).ravel(), _numbers(terms.inertia)
        numbers |= {f"{body}.first_moment.{axis}": moment[k] for k, axis in enumerate("xyz")}
        for one, other in ("xx", "yy", "zz", "xy", "xz", "yz"):
            numbers[f"{body}.inertia.{one}{other}"] = inertia["xyz".index(one), "xyz".index(other)]
        gravity = _numbers(terms.gravity).ravel()
        numbers |= {f"gravity.{axis}": gravity[k] for k, axis in enumerate("xyz")}
        change = np.array([numbers.get(name, 0.0) for name in self.model.inertial_names])
        return np.asarray(self.regressor @ change)

    def _sensor_part(self, effect: SensorEffect, channel: str, values: Mapping[str, float]) -> Array:
        found = np.zeros_like(self.rigid)
        place, _, quantity = channel.partition(".")
        if place not in self.joints or quantity not in ("torque", "position"):
            return found
        k = self.joints.index(place)
        error = effect.apply(self.time, self.exact[channel], values) - self.exact[channel]
        if quantity == "torque":
            found[:, k] = error
            return found
        spline = make_interp_spline(self.time, error, k=SPLINE)
        for jacobian, order in zip(self.jacobians, range(3)):
            found -= jacobian[:, :, k] * spline(self.time, order)[:, None]
        return found


def _numbers(constant: ca.SX | float) -> Array:
    """A constant expression as an array of two dimensions."""
    return np.asarray(ca.evalf(ca.SX(constant)).full())
