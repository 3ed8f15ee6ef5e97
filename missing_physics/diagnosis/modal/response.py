"""Linear dynamics of what must be added to a robot's smoothed joint motion and to its links' modal motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from missing_physics.diagnosis.modal.courses import march, transitions

__all__ = ["POSES", "ModalResponse"]

Array = NDArray[np.float64]

#: The pose may change by one part in this many of the recording before the matrices are taken anew.
POSES = 64


@dataclass(frozen=True, eq=False)
class ModalResponse:
    """The linear dynamics of the correction at several poses along the motion, n joints and s modes.

    Attributes:
        inertia: mass matrix of joints and modes, the base's accelerations eliminated, (P, n + s, n + s).
        stiffness, damping: of the modes, shape (s, s).
        pose: of each sample, shape (N,).
        step: sample time [s].
    """

    inertia: Array
    stiffness: Array
    damping: Array
    pose: NDArray[np.int_]
    step: float

    @classmethod
    def of(
        cls, matrices: Array, stiffness: Array, damping: Array, *, base: int, samples: int, step: float
    ) -> ModalResponse:
        """From mass matrices (P, rows, rows) at poses evenly spread over `samples`; base rows first."""
        z = np.asarray(matrices, dtype=float)
        if base:
            pushed = np.linalg.solve(z[:, :base, :base], z[:, :base, base:])
            z = z[:, base:, base:] - z[:, base:, :base] @ pushed
        pose = np.minimum(np.arange(samples) * len(z) // samples, len(z) - 1)
        return cls(z, stiffness, damping, pose, step)

    @property
    def modes(self) -> int:
        """Number s of modes."""
        return len(self.stiffness)

    @property
    def joints(self) -> int:
        """Number n of joints."""
        return self.inertia.shape[1] - self.modes

    @cached_property
    def highest_frequency(self) -> float:
        """Of the modes with the joints free to move, undamped, at any pose [Hz]; zero without modes."""
        if not self.modes:
            return 0.0
        whole = np.zeros(self.inertia.shape[1:])
        whole[self.joints :, self.joints :] = self.stiffness
        squares = np.linalg.eigvals(np.linalg.solve(self.inertia, whole)).real
        return float(np.sqrt(max(squares.max(), 0.0)) / (2 * np.pi))

    @cached_property
    def coupling(self) -> Array:
        """Zmx Zxx^-1, shape (P, n, s)."""
        n = self.joints
        pushed = np.linalg.solve(self.inertia[:, n:, n:], self.inertia[:, n:, :n])
        return np.asarray(pushed.transpose(0, 2, 1))

    @cached_property
    def elastic(self) -> Array:
        """Stiffness and damping side by side, shape (s, 2 s)."""
        return np.hstack([self.stiffness, self.damping])

    def torque(self, modal: Array, force: Array | float = 0.0) -> Array:
        """Torque of the joints that [dx; dx'], shape (N, 2 s, ...), makes, shape (N, n, ...).

        Args:
            modal: the modes' motion.
            force: on the modes beside their stiffness and damping, shape (N, s, ...).
        """
        pull = np.einsum("ij,tj...->ti...", self.elastic, modal) + force
        return np.asarray(-np.einsum("tij,tj...->ti...", self.coupling[self.pose], pull))

    def transitions(self, *, forces: bool = False) -> tuple[Array, Array, Array]:
        """Of [dq; dx; dq'; dx'; d] over one sample, and by r before and after it, at every pose.

        Shapes (P, L, L), (P, L, n), (P, L, n) with L = 2 (n + s) + n; r is linear in between. With `forces`,
        constant forces on the s modes follow d in the state.
        """
        g, n = self.inertia.shape[1], self.joints
        size = 2 * g + (g if forces else n)
        found = []
        for z in self.inertia:
            inverse = np.linalg.inv(z)
            rate = np.zeros((size + 2 * n, size + 2 * n))
            rate[:g, g : 2 * g] = np.eye(g)
            rate[g : 2 * g, n:g] = -inverse[:, n:] @ self.stiffness
            rate[g : 2 * g, g + n : 2 * g] = -inverse[:, n:] @ self.damping
            rate[g : 2 * g, 2 * g : size] = -inverse[:, : size - 2 * g]
            rate[g : 2 * g, size : size + n] = inverse[:, :n]
            whole = rate * self.step
            whole[size : size + n, size + n :] = np.eye(n)
            moved = expm(whole)
            after = moved[:size, size + n :]
            found.append((moved[:size, :size], moved[:size, size : size + n] - after, after))
        moves, before, behind = zip(*found)
        return np.array(moves), np.array(before), np.array(behind)

    def driven(self, acceleration: Array) -> Array:
        """Torque Zmx x'' of modes that start at rest and are driven by the joints, shape (N, n).

        Args:
            acceleration: of the joints, linear between samples, shape (N, n).
        """
        coupled = self.coupling @ self.inertia[:, self.joints :, : self.joints]
        own = np.einsum("tij,tj->ti", coupled[self.pose], acceleration)
        return np.asarray(self.torque(self.ringing(acceleration)) - own)

    def ringing(self, acceleration: Array) -> Array:
        """[x; x'] of such modes, shape (N, 2 s).

        Args:
            acceleration: of the joints, linear between samples, shape (N, n).
        """
        s, poses = self.modes, len(self.inertia)
        a, b = np.zeros((poses, 2 * s, 2 * s)), np.zeros((poses, 2 * s, self.joints))
        a[:, :s, s:] = np.eye(s)
        a[:, s:] = -np.linalg.solve(self.inertia[:, self.joints :, self.joints :], self.elastic[None])
        b[:, s:] = -self.coupling.transpose(0, 2, 1)
        moves = transitions(a, b, self.step)
        return march(moves, self.pose, acceleration[:, :, None], np.zeros((2 * s, 1)))[:, :, 0]
