"""A robot's torques along an exactly known motion, and the contribution of each effect.

Written for the challenge independently of the diagnosis, so that neither concealment nor score use
the method under test. The motion is Exudyn's without sensors; the equations are the reference model's.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.challenge.torques.passive import PassiveRows
from reference_model.dynamics.balance import LOADS
from reference_model.effects.along import EffectAlong
from reference_model.effects.base import BodyEffect, GearEffect, JointEffect, JointSignals, SensorEffect
from reference_model.effects.catalogue import get_effect
from reference_model.evaluation.model import RobotModel
from reference_model.passive.prescribed import prescribed
from reference_model.plant.acting import AMBIENT_TEMPERATURE
from robot_model import EffectUse, Recording, Robot

__all__ = ["ArmAlong"]

Array = NDArray[np.float64]

STATE = ("position", "velocity", "acceleration")
#: Degree of the spline for the derivatives of a position error.
SPLINE = 5
#: Relative step of a numerical derivative with respect to beam parameters.
BEAM_STEP = 0.01


class ArmAlong:
    """`robot` along the noise-free recording `exact`.

    All results are contributions to the torque channels, shape (N, n): measured minus nominal is the sum of
    the contributions of the hidden effects.
    """

    def __init__(self, robot: Robot, exact: Recording) -> None:
        self.robot, self.exact, self.model = robot, exact, RobotModel(robot)
        self.time = exact.time
        self.joints = self.model.joints
        self._bending = {link.name for link in robot.flexible_links}
        self.state = tuple(self._columns(name) for name in STATE)
        self._base, self._inner = self.model.reconstruct_passive(exact.time, *self.state)

    def _columns(self, quantity: str) -> Array:
        return np.column_stack([self.exact[f"{joint}.{quantity}"] for joint in self.joints])

    @cached_property
    def torque(self) -> Array:
        """Actuator torques."""
        return self._columns("torque")

    @cached_property
    def rigid(self) -> Array:
        """Inverse dynamics of the described robot without effects."""
        rows = self.model.inverse_dynamics(*self.state, **self._passive)
        first = 6 * self.model.free_base  # the rows of base and links vanish along the motion
        return np.asarray(rows[:, first : first + len(self.joints)])

    @cached_property
    def regressor(self) -> Array:
        """Derivative of `rigid` with respect to `model.inertial_names`, shape (N, n, P)."""
        return self._rows.torque(self.model.regressor(*self.state, **self._passive))

    @cached_property
    def inertance(self) -> tuple[Array, Array, Array]:
        """Derivatives of the torques w.r.t. position, velocity and acceleration of fast motion, (N, n, n)."""
        q, v, a = (self._rows.stiff(jacobian) for jacobian in self._jacobians)
        return q, v, a

    @cached_property
    def _jacobians(self) -> tuple[Array, Array, Array]:
        return self.model.motion_jacobians(*self.state, **self._passive)

    @cached_property
    def _loads(self) -> Array:
        return np.asarray(self.model.bearing_loads(*self.state, **self._passive))

    @property
    def _passive(self) -> dict[str, Any]:
        """Motion of base and flexible links."""
        return {"base": self._base, "inner": self._inner}

    @cached_property
    def _rows(self) -> PassiveRows:
        return PassiveRows.of(self.model, self.time, self.state[0], self._base, self._inner)

    def nominal(self) -> Array:
        """Torque of the described robot with all its effects at joints and bodies."""
        return self._nominal

    @cached_property
    def _nominal(self) -> Array:
        uses = [use for use in self.robot.effects if not isinstance(get_effect(use.effect), SensorEffect)]
        return self.rigid + np.sum([self.part(use) for use in uses], axis=0) if uses else self.rigid

    def part(self, use: EffectUse, *, friction: Array | None = None) -> Array:
        """Contribution of an effect to measured minus nominal torque, shape (N, n).

        `friction` is the torque of the joint's friction laws, for modifiers; by default the recorded one.
        """
        effect = get_effect(use.effect)
        values = {**effect.defaults(), **use.parameters}
        if not effect.along_motion or use.at in self._bending:
            return self._simulated_part(use)
        if isinstance(effect, BodyEffect):
            return self._body_part(effect, use.at, values)
        if isinstance(effect, GearEffect):
            return np.zeros_like(
                self.rigid
            )  # it changes the motion of the motor but not the transmitted torque
        if isinstance(effect, SensorEffect):
            return self._sensor_part(effect, use.at, values)
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
            "temperature": self._temperature(joint.name),
        }
        signals = np.column_stack([known[name] for name in JointSignals.CHANNELS])
        gear = joint.actuator.gear_ratio if joint.actuator else 1.0
        arms = (joint.bearing.radial_arm, joint.bearing.axial_arm) if joint.bearing else (0.0, 0.0)
        return EffectAlong(effect, gear_ratio=gear, bearing_arms=arms).torque(signals, values)

    def _temperature(self, joint: str) -> Array:
        channel = f"{joint}.temperature"
        return self.exact[channel] if channel in self.exact else np.full_like(self.time, AMBIENT_TEMPERATURE)

    def _simulated_part(self, use: EffectUse) -> Array:
        """Change of the torques by a change of the robot, from simulations of both along the motion."""
        return self._prescribed(self._bare.with_effects(use)) - self._unchanged

    @cached_property
    def _bare(self) -> Robot:
        return self.robot.model_copy(update={"effects": ()})

    @cached_property
    def _unchanged(self) -> Array:
        return self._prescribed(self._bare)

    def _prescribed(self, robot: Robot) -> Array:
        made = prescribed(robot, self.time, *self.state)
        return np.column_stack([made[f"{name}.torque"] for name in self.joints])

    @cached_property
    def beam_columns(self) -> tuple[Array, ...]:
        """Derivatives of the torques with respect to relative changes of the parameters of flexible links.

        Parameters are stiffness, mass of the beam and mass at its tip, (N, n) each.
        """
        found = []
        for link in self._bare.flexible_links:
            assert link.beam is not None
            beam, up = link.beam, 1 + BEAM_STEP
            stiffer = {"young": up * beam.young, "shear": up * beam.shear}
            tip = beam.tip.model_copy(update={"mass": up * beam.tip.mass})
            changes: list[dict[str, Any]] = [stiffer, {"density": up * beam.density}]
            changes += [{"tip": tip}] if beam.tip.mass else []
            for change in changes:
                other = link.model_copy(update={"beam": beam.model_copy(update=change)})
                links = tuple(other if own is link else own for own in self._bare.links)
                moved = self._prescribed(self._bare.model_copy(update={"links": links}))
                found.append((moved - self._unchanged) / BEAM_STEP)
        return tuple(found)

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
        rows = np.zeros(self._jacobians[0].shape[:2])
        for jacobian, order in zip(self._jacobians, range(3)):
            rows -= jacobian[:, :, k] * spline(self.time, order)[:, None]
        return np.asarray(self._rows.torque(rows[:, :, None])[:, :, 0])


def _numbers(constant: ca.SX | float) -> Array:
    """A constant expression as a two-dimensional array."""
    return np.asarray(ca.evalf(ca.SX(constant)).full())
