"""Response of a free base to small changes of momentum or forces relative to the nominal robot.

Momentum of base, links and modes of flexible links is M_bb t + M_bm qd + M_bs xd, with the base's twist t.
Without external forces the twist changes by M_bb^-1 (P - M_bs xd) if a momentum P is added and the modal
rates change by xd. P is constant in inertial axes; its components along the base's axes follow from the
rotation measured by the gyros. The modes' equation, integrated by the trapezoidal rule, is

    (M_ss - M_sb M_bb^-1 M_bs) a + C v + K x = f_s - M_sb M_bb^-1 f_b.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.vibration.newmark import vibrating

__all__ = ["Floating"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Floating:
    """Base and modes along one motion; G instants, n joints, s modes.

    Attributes:
        time: uniform [s], shape (G,).
        rotation: base to inertial axes, shape (G, 3, 3).
        mass: matrix along the motion, rows [base, joints, modes], shape (G, 6 + n + s, 6 + n + s).
        stiffness, damping: of the modes, shape (s, s), or (G, s, s) where it changes.
    """

    time: Array
    rotation: Array
    mass: Array
    stiffness: Array
    damping: Array

    @property
    def step(self) -> float:
        """Time between instants [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def modes(self) -> slice:
        """Rows of the modes."""
        return slice(self.mass.shape[1] - len(self.stiffness), self.mass.shape[1])

    @property
    def centre(self) -> Array:
        """Centre of mass in the base's frame [m], shape (G, 3), from the coupling of rotation and force."""
        weight = self.mass[:, 0, 0]
        lever = self.mass[:, :3, 3:6] / weight[:, None, None]  # -m [c x]
        return np.stack([lever[:, 1, 2], lever[:, 2, 0], lever[:, 0, 1]], axis=1)

    def turned(self, momentum: Array) -> Array:
        """Angular rates due to a momentum, in base axes.

        Args:
            momentum: [linear; angular] about the base's origin [N s, N m s], shape (G, 6, C).

        Returns:
            [rad/s], shape (G, 3, C).
        """
        return np.asarray(np.linalg.solve(self.mass[:, :6, :6], momentum)[:, 3:])

    def kept(self, momentum: Array) -> Array:
        """A constant angular momentum in base axes about the base's origin, shape (G, 6, C).

        Args:
            momentum: angular momentum about the centre of mass, in inertial axes [N m s], shape (3, C).
        """
        along = self.rotation.transpose(0, 2, 1) @ momentum
        return np.concatenate([np.zeros_like(along), along], axis=1)

    def gathered(self, force: Array) -> Array:
        """Total momentum due to a force since the first instant, shape (G, 6, C).

        Args:
            force: [force; moment] about the base's origin in base axes [N, N m], shape (G, 6, C).
        """
        centre = self.centre[:, :, None]
        linear = self.rotation @ force[:, :3]
        moment = self.rotation @ (force[:, 3:] - np.cross(centre, force[:, :3], axis=1))
        back = self.rotation.transpose(0, 2, 1)
        linear, moment = (back @ _sum(part, self.step) for part in (linear, moment))
        return np.concatenate([linear, moment + np.cross(centre, linear, axis=1)], axis=1)

    def under(self, force: Array, forces_on_modes: Array | None = None) -> Array:
        """Angular rates due to forces on base and modes, starting from rest [rad/s], shape (G, 3, C).

        Args:
            force: on the base as in `gathered`.
            forces_on_modes: shape (G, s, C); zero when None.
        """
        momentum = self.gathered(force)
        if self.stiffness.size:
            on_modes = np.zeros((len(force), len(self.stiffness), force.shape[2]))
            on_modes = on_modes if forces_on_modes is None else forces_on_modes
            moving = self.vibration(on_modes - self.lever @ force)
            momentum = momentum - self.mass[:, :6, self.modes] @ moving
        return self.turned(momentum)

    def shaken(self, forces_on_modes: Array) -> Array:
        """Angular rates due to internal forces on the modes [rad/s], shape (G, 3, C)."""
        return self.turned(-self.mass[:, :6, self.modes] @ self.vibration(forces_on_modes))

    @property
    def lever(self) -> Array:
        """M_sb M_bb^-1, shape (G, s, 6)."""
        coupled = self.mass[:, :6, self.modes]
        return np.asarray(np.linalg.solve(self.mass[:, :6, :6], coupled).transpose(0, 2, 1))

    @property
    def inertia(self) -> Array:
        """Inertia of the modes with the base free, shape (G, s, s)."""
        rows = self.modes
        return np.asarray(self.mass[:, rows, rows] - self.lever @ self.mass[:, :6, rows])

    def vibration(self, force: Array) -> Array:
        """Rates of the modes due to forces with the base free, starting from rest, shape (G, s, C)."""
        return vibrating(self.inertia, self.stiffness, self.damping, force, self.step)[1]

    def free_vibration(self) -> Array:
        """Angular rates due to free vibration of initially deflected or moving modes, shape (G, 3, 2 s).

        Initial deflections are one, initial rates the mode's frequency.
        """
        count = len(self.stiffness)
        inertia = self.inertia
        frequency = np.sqrt(np.diag(self.stiffness) / np.diag(inertia[len(inertia) // 2]))
        begin = np.hstack([np.eye(count), np.zeros((count, count))])
        moving = np.hstack([np.zeros((count, count)), np.diag(frequency)])
        still = np.zeros((len(inertia), count, 2 * count))
        swing = vibrating(inertia, self.stiffness, self.damping, still, self.step, (begin, moving))
        return self.turned(-self.mass[:, :6, self.modes] @ swing[1])


def _sum(values: Array, step: float) -> Array:
    """Integral over time from the first instant by the trapezoidal rule, shape as `values`."""
    found = np.zeros_like(values)
    np.cumsum(step / 2 * (values[1:] + values[:-1]), axis=0, out=found[1:])
    return found
