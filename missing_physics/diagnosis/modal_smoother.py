"""How flexible links really vibrated: corrections of their modal motion by what the torques say.

Modal coordinates that follow from the joints' recorded motion alone collect its noise: a lightly damped mode
is driven at resonance by the noise of a joint's acceleration, and what it then does shows in the joints'
torques. The torques tell it back. The correction (dx, dxd) obeys, with the base's accelerations eliminated,

    Zxx dx'' + C dx' + K dx = -Zxm w,      torque residual = Zmx dx'' + d + v,

w the noise of the joints' accelerations at the modes' frequencies, v the torque's noise and d a latent torque
of each joint, a random walk that stands for whatever the model leaves out. A Rauch-Tung-Striebel smoother
(AIAA Journal 3 (1965) 1445-1450) finds the correction; the speed of the random walk and the size of w, which
holds what smoothing took away from the motion besides its noise, are those of greatest likelihood, and the
latent torque itself is thrown away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

__all__ = ["POSES", "ModalResponse", "modal_torque"]

Array = NDArray[np.float64]

#: Rates of the latent torque that are tried, as a part of the residual's rms per second^(1/2).
WALKS = (0.03, 0.1, 0.3, 1.0, 3.0)
#: Sizes of w that are tried, as multiples of what the position's noise makes.
ROUGHNESS = (10.0, 100.0)
#: Standard deviation of a first latent torque, as a multiple of the residual's rms.
START = 3.0
#: The pose may change by one part in this many of the recording before the matrices are taken anew.
POSES = 64
#: Keeps covariances positive where a torque is said to be free of noise.
LEAST_NOISE = 1e-6


@dataclass(frozen=True)
class ModalResponse:
    """The linear dynamics of the correction at several poses along the motion.

    Attributes:
        coupling: Zmx Zxx^-1, shape (P, n, s).
        inertia: Zxx, shape (P, s, s).
        stiffness, damping: shape (s, s).
        pose: of each sample, shape (N,).
    """

    coupling: Array
    inertia: Array
    stiffness: Array
    damping: Array
    pose: NDArray[np.int_]

    @classmethod
    def of(
        cls, matrices: Array, stiffness: Array, damping: Array, *, base: int, samples: int
    ) -> ModalResponse:
        """From mass matrices (P, rows, rows) at poses evenly spread over `samples`; base rows first."""
        modes = len(stiffness)
        z = matrices
        if base:
            pushed = np.linalg.solve(z[:, :base, :base], z[:, :base, base:])
            z = z[:, base:, base:] - z[:, base:, :base] @ pushed
        joints = z.shape[1] - modes
        inertia = np.asarray(z[:, joints:, joints:], dtype=float)
        coupling = np.linalg.solve(inertia, z[:, joints:, :joints]).transpose(0, 2, 1)
        pose = np.minimum(np.arange(samples) * len(z) // samples, len(z) - 1)
        return cls(coupling, inertia, stiffness, damping, pose)

    def torque(self, pose: int) -> Array:
        """Torque of the joints per unit of [dx; dxd], shape (n, 2 s)."""
        return -self.coupling[pose] @ np.hstack([self.stiffness, self.damping])

    def transition(self, pose: int, step: float) -> Array:
        """Of [dx; dxd] over one sample, shape (2 s, 2 s)."""
        back = -np.linalg.solve(self.inertia[pose], np.hstack([self.stiffness, self.damping]))
        s = len(self.stiffness)
        return np.asarray(expm(np.vstack([np.hstack([np.zeros((s, s)), np.eye(s)]), back]) * step))

    def noise(self, pose: int, step: float, position_noise: Array) -> Array:
        """Covariance that the noise of the joints' accelerations adds over one sample, shape (2 s, 2 s)."""
        squares, shapes = np.linalg.eig(np.linalg.solve(self.inertia[pose], self.stiffness))
        pushed = np.linalg.solve(shapes.real, self.coupling[pose].T)  # of each coupled mode by each joint
        level = np.abs(squares.real)[:, None] * pushed * position_noise * step**0.5  # w^2 sigma sqrt(step)
        s = len(self.stiffness)
        root = np.vstack([np.zeros((s, pushed.shape[1])), shapes.real @ level * step**0.5])
        return np.asarray(root @ root.T)


def modal_torque(
    response: ModalResponse, residual: Array, step: float, *, position_noise: Array, torque_noise: Array
) -> Array:
    """The torque that the correction of the modal motion makes, shape (N, n).

    Args:
        response: dynamics of the correction.
        residual: measured minus predicted torque [N m or N], shape (N, n).
        step: sample time [s].
        position_noise, torque_noise: standard deviations per sample, shape (n,).
    """
    size = np.sqrt(np.mean(residual**2, axis=0))
    noise = np.maximum(torque_noise, LEAST_NOISE * np.maximum(size, 1e-12))

    def run(walk: float, rough: float) -> _Smoother:
        return _Smoother(response, residual, step, rough * position_noise, noise, walk * size)

    tried = {walk: run(walk, 1.0) for walk in WALKS}
    chosen = max(tried, key=lambda walk: tried[walk].likelihood)
    runs = [tried[chosen], *(run(chosen, rough) for rough in ROUGHNESS)]
    return max(runs, key=lambda one: one.likelihood).modal_torque()


class _Smoother:
    """Forward pass of the filter with one speed of the latent torque; the backward pass on demand."""

    def __init__(
        self,
        response: ModalResponse,
        residual: Array,
        step: float,
        position_noise: Array,
        torque_noise: Array,
        walk: Array,
    ) -> None:
        n, s2 = residual.shape[1], 2 * len(response.stiffness)
        self._response, self._modes = response, s2
        poses = range(len(response.inertia))
        self._observe = [np.hstack([response.torque(k), np.eye(n)]) for k in poses]
        self._move = [np.block([[response.transition(k, step), np.zeros((s2, n))],
                                [np.zeros((n, s2)), np.eye(n)]]) for k in poses]  # fmt: skip
        self._noise = []
        for k in poses:
            noise = np.zeros((s2 + n, s2 + n))
            noise[:s2, :s2] = response.noise(k, step, position_noise)
            noise[s2:, s2:] = np.diag(walk**2 * step)
            self._noise.append(noise)
        size = np.maximum(np.sqrt(np.mean(residual**2, axis=0)), 1e-12)
        self._forward(residual, np.diag(torque_noise**2), np.diag((START * size) ** 2))

    def _forward(self, residual: Array, measured: Array, start: Array) -> None:
        s2, n = self._modes, residual.shape[1]
        mean, spread = np.zeros(s2 + n), np.zeros((s2 + n, s2 + n))
        spread[s2:, s2:] = start
        self._means, self._spreads, self._ahead, self._wide = [], [], [], []
        likelihood = 0.0
        for row, pose in zip(residual, self._response.pose):
            self._ahead.append(mean)
            self._wide.append(spread)
            observe = self._observe[pose]
            gap, seen = row - observe @ mean, observe @ spread @ observe.T + measured
            solved = np.linalg.solve(seen, np.column_stack([gap, observe @ spread]))
            likelihood -= 0.5 * (gap @ solved[:, 0] + float(np.linalg.slogdet(seen)[1]))
            mean = mean + spread @ observe.T @ solved[:, 0]
            spread = spread - spread @ observe.T @ solved[:, 1:]
            self._means.append(mean)
            self._spreads.append(spread)
            move = self._move[pose]
            mean, spread = move @ mean, move @ spread @ move.T + self._noise[pose]
        self.likelihood = likelihood

    def modal_torque(self) -> Array:
        """Rauch-Tung-Striebel pass, and the torque of the modal part of the smoothed state, (N, n)."""
        poses, last = self._response.pose, len(self._means) - 1
        mean = self._means[last]
        found = [self._torque(poses[last], mean)]
        for k in range(last - 1, -1, -1):
            inverse = np.linalg.pinv(self._wide[k + 1], hermitian=True)  # fewer noises than coordinates
            gain = self._spreads[k] @ self._move[poses[k]].T @ inverse
            mean = self._means[k] + gain @ (mean - self._ahead[k + 1])
            found.append(self._torque(poses[k], mean))
        return np.array(found[::-1])

    def _torque(self, pose: int, mean: Array) -> Array:
        return np.asarray(self._observe[pose][:, : self._modes] @ mean[: self._modes])
