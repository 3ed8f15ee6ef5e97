"""Effects at joints moved by motors of a transmission, along a motion, in the coordinates of the motors.

A force on joint j loads motor k with T[j, k] times that force; the joint's motion is row j of T times that
of the motors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference_model.effects.along import EffectAlong
from reference_model.effects.base import JointEffect, JointSignals
from reference_model.effects.catalogue import UsedEffect
from reference_model.evaluation.drive_model import DriveModel
from reference_model.plant.acting import AMBIENT_TEMPERATURE

__all__ = ["CoupledMotion", "coupled_joints"]

Array = NDArray[np.float64]

FRICTION = JointSignals.CHANNELS.index("friction")


def coupled_joints(model: DriveModel) -> tuple[str, ...]:
    """Joints that motors of transmissions move."""
    return tuple(name for one in model.robot.transmissions for name in one.joints)


@dataclass(frozen=True)
class CoupledMotion:
    """A motion of n drives.

    Attributes:
        model: of the robot.
        time: [s], shape (N,).
        position, velocity, acceleration: of the drives [rad or m, and per s, s^2], shape (N, n).
        needed: torque of the drives [N m or N], shape (N, n).
        transition: speed of each below which its direction is not known, shape (n,).
    """

    model: DriveModel
    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    needed: Array
    transition: Array

    def row(self, joint: str) -> Array:
        """Row of T: the joint's motion per motion of each drive, shape (n,)."""
        return np.asarray(self.model.forward[self._place(joint)])

    def signals(self, joint: str) -> Array:
        """Signals of one joint in the order of `JointSignals.CHANNELS`, friction zero, shape (N, 11)."""
        place, row = self._place(joint), self.row(joint)
        moved = [part @ row for part in (self.position, self.velocity, self.acceleration)]
        loads = self.model.joint_loads(self.position, self.velocity, self.acceleration)[:, place]
        torque, rest = self.needed @ self.model.robot.coupling[:, place], np.zeros(self.time.size)
        warm = np.full(rest.size, AMBIENT_TEMPERATURE)
        return np.column_stack([self.time, *moved, torque, rest, *loads.T, warm])

    def along(self, effect: JointEffect, joint: str) -> EffectAlong:
        """An effect at a joint."""
        bearing = self.model.robot.moving_joints[self._place(joint)].bearing
        return EffectAlong(
            effect,
            bearing_arms=(bearing.radial_arm, bearing.axial_arm) if bearing else (0.0, 0.0),
            transition=float(np.sqrt(self.row(joint) ** 2 @ self.transition**2)),
        )

    def forces(self, effects: Sequence[UsedEffect]) -> Array:
        """Forces of effects at joints of transmissions, reflected to the motors, shape (N, n) [N m or N]."""
        total = np.zeros_like(self.velocity)
        for joint in coupled_joints(self.model):
            own = [one for one in effects if one.at == joint and isinstance(one.effect, JointEffect)]
            if not own:
                continue
            signals, force = self.signals(joint), np.zeros(self.time.size)
            for one in sorted(own, key=lambda used: not _is_law(used)):
                assert isinstance(one.effect, JointEffect)
                seen = self.along(one.effect, joint).torque(signals, dict(one.parameters))
                signals[:, FRICTION] += seen if _is_law(one) else 0.0
                force += seen
            total += np.outer(force, self.row(joint))
        return total

    def _place(self, joint: str) -> int:
        return [one.name for one in self.model.robot.moving_joints].index(joint)


def _is_law(used: UsedEffect) -> bool:
    return isinstance(used.effect, JointEffect) and used.effect.is_friction_law
