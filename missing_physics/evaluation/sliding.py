"""How joints slide, stop and turn back along a recorded motion, by the friction that a robot file has.

Which way dry friction acts near rest does not follow from a smoothed velocity, see `stops`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.band import low_passed
from missing_physics.evaluation.joint_motion import SIGN_UNCERTAINTY, JointMotion
from missing_physics.evaluation.stops import NEAR, Stops, through_stops
from reference_model.effects.along import EffectAlong
from reference_model.effects.base import JointSignals
from reference_model.evaluation.drive_model import drive_model
from reference_model.plant.truth import Truth

__all__ = ["SPEEDS", "Acting", "Sliding", "sliding"]

Array = NDArray[np.float64]

#: Speeds at which the level of dry friction is tabled, over the joint's largest: dense where it changes.
SPEEDS = np.concatenate([[0.0], np.geomspace(1e-5, 1.0, 60)])
#: No level of friction is smaller [N m or N].
SMALLEST = 1e-12
VELOCITY = JointSignals.CHANNELS.index("velocity")


@dataclass(frozen=True)
class Acting:
    """One effect at one joint along the motion.

    Attributes:
        along: the effect; directed where it has no states.
        parameters: its numbers.
        signals: `JointSignals.CHANNELS`, shape (N, 11).
        is_law: whether it is a law of friction.
    """

    along: EffectAlong
    parameters: dict[str, float]
    signals: Array
    is_law: bool

    def force(self, direction: Array, signals: Array | None = None) -> Array:
        """On the joint [N m or N], shape (N,).

        Args:
            direction: of the joint's motion, -1 to 1, shape (N,).
            signals: in place of its own, shape (N, 11).
        """
        rows = self.signals if signals is None else signals
        if not self.along.effect.states:
            rows = np.column_stack([rows, direction])
        return self.along.torque(rows, self.parameters)

    def level(self, signals: Array | None = None) -> Array:
        """Of dry friction in it, shape (N,): half of what changes with the direction."""
        rows = self.signals if signals is None else signals
        if self.along.effect.states:
            bears = np.median(np.abs(self.along.torque(self.signals, self.parameters)))
            return np.full(len(rows), bears if self.is_law else 0.0)
        one = np.ones(len(rows))
        return np.asarray(0.5 * (self.force(-one, rows) - self.force(one, rows)))


@dataclass(frozen=True)
class Sliding:
    """Velocity as friction bends it, and the direction of dry friction, -1 to 1, shape (N, n) each."""

    velocity: Array
    direction: Array


def sliding(truth: Truth, motion: JointMotion, needed: Array, acting: Sequence[Sequence[Acting]]) -> Sliding:
    """Along a motion of n joints.

    As the smoothed velocity has it where links bend, motors move by themselves or through transmissions,
    and where no torque is known.

    Args:
        truth: the robot.
        motion: of its joints.
        needed: torque of the actuators without what acts at joints [N m or N], shape (N, n).
        acting: effects at each joint.
    """
    direction = np.tanh(motion.velocity / motion.sign_speed)
    level = np.zeros_like(needed)
    for k, effects in enumerate(acting):
        level[:, k] = sum((one.level() for one in effects), level[:, k])
    robot = truth.robot
    known = np.isfinite(motion.torque).all(axis=0)
    asked = np.asarray(known & (level > 0.0).any(axis=0))
    if not asked.any() or robot.flexible_links or robot.transmissions or truth.gears.drives:
        return Sliding(motion.velocity, direction)
    torque = np.where(known, motion.torque, 0.0)
    smooth = _smooth(motion, torque)
    left = np.where(known, smooth - needed, np.nan)
    speeds = np.abs(motion.velocity).max(axis=0)[:, None] * SPEEDS
    curve = np.zeros_like(speeds)
    for k, effects in enumerate(acting):
        for one in effects:
            if not (one.along.effect.states and one.is_law):
                left[:, k] += one.force(direction[:, k]) + one.level() * direction[:, k]
            middle = np.tile(np.median(one.signals, axis=0), (SPEEDS.size, 1))
            middle[:, VELOCITY] = speeds[k]
            curve[k] += one.level(middle)
    now = [np.interp(np.abs(v), *table) for v, table in zip(motion.velocity.T, zip(speeds, curve))]
    noise = motion.sign_speed / SIGN_UNCERTAINTY
    near = (np.abs(motion.velocity) <= NEAR * noise) & asked
    held = np.clip(np.nan_to_num(left) / np.maximum(level, SMALLEST), -1.0, 1.0)
    stops = Stops(
        step=1.0 / motion.rate,
        velocity=motion.velocity,
        noise=np.broadcast_to(noise, needed.shape),
        left=left,
        level=level,
        still=np.maximum(level + curve[:, 0] - np.column_stack(now), 0.0),
        speeds=speeds,
        rise=curve - curve[:, :1],
        jumps=torque - smooth,
        mobility=_mobility(truth, motion),
        memory=0.5 / motion.band.motion,
        smooth=lambda values: _smooth(motion, values),
    )
    velocity, direction, _ = through_stops(stops, np.where(near, held, direction), near, asked)
    return Sliding(velocity, direction)


def _smooth(motion: JointMotion, values: Array) -> Array:
    """Through the filter of the positions."""
    return low_passed(values, rate=motion.rate, cutoff=motion.band.motion)


def _mobility(truth: Truth, motion: JointMotion) -> Array:
    """Acceleration of every joint by a torque at each, shape (N, n, n); a free base gives way."""
    model = drive_model(truth.robot)
    joints = motion.position, motion.velocity, motion.acceleration
    base, inner = model.reconstruct_passive(motion.time, *joints, inertial=truth.inertial)
    masses = model.mass_matrix(motion.position, base=base, inner=inner, inertial=truth.inertial)
    start, count = model.tree.offset, len(model.joints)
    return np.asarray(np.linalg.inv(masses)[:, start : start + count, start : start + count])
