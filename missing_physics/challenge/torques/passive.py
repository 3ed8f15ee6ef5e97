"""Change of the joint torques by a change of the generalised forces, for unchanged joint motion.

No force acts on a free base, so its accelerations are eliminated. Flexible links vibrate: with M
the remaining mass matrix, K and C the links' stiffness and damping, and f the change of the
inverse dynamics,

    M_xx x'' + C x' + K x = -f_x,    torque = f_j + M_jx x'',

from rest, exactly for matrices that hold for a while and forces that are linear between samples. Changes of
gyroscopic forces of x are neglected: relative to those of the modes they are (slew rate / frequency)^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm

from reference_model.evaluation.model import RobotModel
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion

__all__ = ["PassiveRows"]

Array = NDArray[np.float64]

#: Number of poses along a motion at which the matrices of the modes are evaluated.
POSES = 64


@dataclass(frozen=True)
class PassiveRows:
    """Equations of base, joints and modes of a robot along a motion, with rows in that order.

    Attributes:
        matrix: mass matrix of joints and modes without the base's accelerations, shape (N, n + s, n + s).
        reduction: Z_jb Z_bb^-1 of a free base, shape (N, n + s, 6); None for a fixed one.
        stiffness, damping: matrices of the modes, shape (s, s).
        joints: number n of joints.
        step: sample time [s].
    """

    matrix: Array
    reduction: Array | None
    stiffness: Array
    damping: Array
    joints: int
    step: float

    @classmethod
    def of(
        cls,
        model: RobotModel,
        time: Array,
        position: Array,
        base: BaseMotion | None,
        inner: InnerMotion | None,
    ) -> PassiveRows:
        """For a model without spherical joints, with the motion of its base and its flexible links."""
        z = np.asarray(model.mass_matrix(position, base=base, inner=inner))
        reduction: Array | None = None
        if base is not None:
            reduction = np.asarray(np.linalg.solve(z[:, :6, :6], z[:, :6, 6:]).transpose(0, 2, 1))
            z = z[:, 6:, 6:] - reduction @ z[:, :6, 6:]
        bodies = [body.flexible for body in model.tree.bodies if body.flexible is not None]
        stiffness, damping = (
            block_diag(*(getattr(body, name) for body in bodies)) if bodies else np.zeros((0, 0))
            for name in ("stiffness", "damping")
        )
        return cls(z, reduction, stiffness, damping, len(model.joints), float(time[1] - time[0]))

    def torque(self, rows: Array) -> Array:
        """Joint torques of a change of all rows, shape (N, rows, k) to (N, n, k)."""
        if self.reduction is not None:
            rows = rows[:, 6:] - self.reduction @ rows[:, :6]
        n = self.joints
        if not len(self.stiffness):
            return np.asarray(rows)
        moved = self._vibration(-rows[:, n:])
        return np.asarray(rows[:, :n] + self.matrix[:, :n, n:] @ moved)

    def stiff(self, rows: Array) -> Array:
        """The same at frequencies far above those of the modes, where their stiffness is negligible."""
        if self.reduction is not None:
            rows = rows[:, 6:] - self.reduction @ rows[:, :6]
        n = self.joints
        if not len(self.stiffness):
            return np.asarray(rows)
        return np.asarray(
            rows[:, :n] - self.matrix[:, :n, n:] @ np.linalg.solve(self.matrix[:, n:, n:], rows[:, n:])
        )

    def _vibration(self, force: Array) -> Array:
        """Accelerations of the modes under `force` from rest, linear between samples, shape (N, s, k)."""
        s, samples = len(self.stiffness), len(force)
        pose = np.minimum(np.arange(samples) * POSES // samples, POSES - 1)
        first = np.searchsorted(pose, np.arange(POSES))
        inverse = np.linalg.inv(self.matrix[np.minimum(first, samples - 1), self.joints :, self.joints :])
        pull = np.hstack([self.stiffness, self.damping])
        moves = [self._transition(one @ pull, one) for one in inverse]
        found, state = np.zeros_like(force), np.zeros((2 * s, force.shape[2]))
        for k in range(samples):
            if k:
                move, before, after = moves[pose[k]]
                state = move @ state + before @ force[k - 1] + after @ force[k]
            found[k] = inverse[pose[k]] @ (force[k] - pull @ state)
        return found

    def _transition(self, pull: Array, push: Array) -> tuple[Array, Array, Array]:
        """Transition of [x; x'] over one sample, and its response to the force before and after it."""
        s = len(pull)
        rate = np.zeros((4 * s, 4 * s))
        rate[:s, s : 2 * s] = np.eye(s)
        rate[s : 2 * s, : 2 * s] = -pull
        rate[s : 2 * s, 2 * s : 3 * s] = push
        rate *= self.step
        rate[2 * s : 3 * s, 3 * s :] = np.eye(s)
        moved = expm(rate)
        after = moved[: 2 * s, 3 * s :]
        return moved[: 2 * s, : 2 * s], moved[: 2 * s, 2 * s : 3 * s] - after, after
