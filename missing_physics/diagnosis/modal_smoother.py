"""How flexible links really vibrated: corrections of their modal motion by what positions and torques say.

Modal coordinates that follow from the joints' smoothed motion alone collect its noise: a lightly damped mode
is driven at resonance by the noise of a joint's acceleration. How joints and modes really moved is what the
recorded torques make of them. With (dq, dx) what must be added to the smoothed joint motion and to the modal
motion that follows from it, base accelerations eliminated,

    [Zmm Zmx] [dq'']   [        0        ]   [r - d]
    [Zxm Zxx] [dx''] + [ C dx' + K dx    ] = [  0  ],      recorded - smoothed position = dq + v,

r the recorded torque minus what the nominal robot with its effects needs for the smoothed motion, v the
encoder's white noise and d a latent torque of each joint, a random walk that stands for whatever the model
leaves out; r holds the white noise of the torque. All the noise of the smoothed motion is in r as well, but
there it is known and does no harm. The fixed-interval smoother of Bryson and Frazier finds (dq, dx) (Bierman,
Automatica 9 (1973) 503-511); the speed of the random walk is that of greatest likelihood. Only dx is used: d
and dq together hold what the regression is to explain.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

__all__ = ["POSES", "ModalResponse", "VibrationSmoother"]

Array = NDArray[np.float64]

#: Rates of the latent torque that are tried, as a part of the recorded torque's rms per second^(1/2).
WALKS = (0.003, 0.01, 0.03, 0.1, 0.3)
#: Standard deviation of a first latent torque, as a multiple of that rms.
START = 0.1
#: The pose may change by one part in this many of the recording before the matrices are taken anew.
POSES = 64
#: Keeps covariances positive where a channel is said to be free of noise: part of the channel's rms.
LEAST_NOISE = 1e-6


@dataclass(frozen=True)
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
    def coupling(self) -> Array:
        """Zmx Zxx^-1, shape (P, n, s)."""
        n = self.joints
        pushed = np.linalg.solve(self.inertia[:, n:, n:], self.inertia[:, n:, :n])
        return np.asarray(pushed.transpose(0, 2, 1))

    @cached_property
    def elastic(self) -> Array:
        """Stiffness and damping side by side, shape (s, 2 s)."""
        return np.hstack([self.stiffness, self.damping])

    def torque(self, modal: Array) -> Array:
        """Torque of the joints that [dx; dx'], shape (N, 2 s, ...), makes, shape (N, n, ...)."""
        pull = np.einsum("ij,tj...->ti...", self.elastic, modal)
        return np.asarray(-np.einsum("tij,tj...->ti...", self.coupling[self.pose], pull))

    def transitions(self) -> tuple[Array, Array, Array]:
        """Of [dq; dx; dq'; dx'; d] over one sample, and by r before and after it, at every pose.

        Shapes (P, L, L), (P, L, n), (P, L, n) with L = 2 (n + s) + n; r is linear in between.
        """
        g, n = self.inertia.shape[1], self.joints
        size = 2 * g + n
        found = []
        for z in self.inertia:
            inverse = np.linalg.inv(z)
            rate = np.zeros((size + 2 * n, size + 2 * n))
            rate[:g, g : 2 * g] = np.eye(g)
            rate[g : 2 * g, n:g] = -inverse[:, n:] @ self.stiffness
            rate[g : 2 * g, g + n : 2 * g] = -inverse[:, n:] @ self.damping
            rate[g : 2 * g, 2 * g : size] = -inverse[:, :n]
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
        s, n = self.modes, self.joints
        moves = []
        for z, coupling in zip(self.inertia, self.coupling):
            rate = np.zeros((2 * s + 2 * n, 2 * s + 2 * n))
            rate[:s, s : 2 * s] = np.eye(s)
            rate[s : 2 * s, : 2 * s] = -np.linalg.solve(z[n:, n:], self.elastic)
            rate[s : 2 * s, 2 * s : 2 * s + n] = -coupling.T
            whole = rate * self.step
            whole[2 * s : 2 * s + n, 2 * s + n :] = np.eye(n)
            moves.append(expm(whole)[: 2 * s])
        states = np.zeros((len(acceleration), 2 * s))
        change = np.diff(acceleration, axis=0)
        for k in range(len(acceleration) - 1):
            states[k + 1] = moves[self.pose[k]] @ np.concatenate([states[k], acceleration[k], change[k]])
        coupled = self.coupling @ self.inertia[:, n:, :n]
        return np.asarray(self.torque(states) - np.einsum("tij,tj->ti", coupled[self.pose], acceleration))


class VibrationSmoother:
    """The smoother of one recording.

    Args:
        response: dynamics of the correction.
        residual: r of the module's equations, shape (N, n).
        gap: recorded minus smoothed position, shape (N, n).
        position_noise, torque_noise: standard deviations per sample, shape (n,).
        level: rms of the recorded position and torque, shape (n,) each.

    Attributes:
        torque: what the correction of the modal motion adds to the predicted torque, shape (N, n).
    """

    def __init__(
        self,
        response: ModalResponse,
        residual: Array,
        gap: Array,
        *,
        position_noise: Array,
        torque_noise: Array,
        level: tuple[Array, Array],
    ) -> None:
        self.response = response
        self._noise = np.maximum(position_noise, LEAST_NOISE * np.maximum(level[0], LEAST_NOISE)) ** 2
        self._torque_noise, self._size = torque_noise, np.maximum(level[1], 1e-12)
        self._moves, self._before, self._after = response.transitions()
        self.walk, best = self._likeliest(residual[:, :, None], gap[:, :, None])
        self.torque = self._smoothed(best)[:, :, 0]

    def torque_of(self, residual: Array, gap: Array) -> Array:
        """The same for other data of the same noise, such as drawn noise alone, shape (N, n, D)."""
        return self._smoothed(self._filter(self.walk, residual, gap))

    def _likeliest(self, residual: Array, gap: Array) -> tuple[float, _Filtered]:
        """The walk of greatest likelihood, uphill from the middle, and what the filter finds with it."""
        place = len(WALKS) // 2
        best = self._filter(WALKS[place], residual, gap)
        for way in (1, -1):
            start = place
            while 0 <= place + way < len(WALKS):
                trial = self._filter(WALKS[place + way], residual, gap)
                if trial.likelihood <= best.likelihood:
                    break
                place, best = place + way, trial
            if place != start:
                break
        return WALKS[place], best

    def _process(self, walk: float) -> Array:
        """Covariance that one sample adds to the state at every pose, shape (P, L, L)."""
        pushed = (self._before + self._after) * self._torque_noise
        noise = pushed @ pushed.transpose(0, 2, 1)
        latent = np.arange(noise.shape[1] - self.response.joints, noise.shape[1])
        noise[:, latent, latent] += (walk * self._size) ** 2 * self.response.step
        return np.asarray(noise)

    def _filter(self, walk: float, residual: Array, gap: Array) -> _Filtered:
        response, noise = self.response, self._process(walk)
        n, size = response.joints, noise.shape[1]
        mean, spread = np.zeros((size, residual.shape[2])), np.zeros((size, size))
        spread[:n, :n] = np.diag(self._noise)
        spread[-n:, -n:] = np.diag((START * self._size) ** 2)
        measured, likelihood = np.diag(self._noise), 0.0
        kept: list[tuple[Array, Array, Array, Array]] = []
        for k, pose in enumerate(response.pose):
            seen = np.linalg.inv(spread[:n, :n] + measured)
            wrong = gap[k] - mean[:n]
            surprise = seen @ wrong
            likelihood -= 0.5 * float(wrong[:, 0] @ surprise[:, 0] - np.linalg.slogdet(seen)[1])
            gain = spread[:, :n] @ seen
            kept.append((mean, spread, gain, surprise))
            move, last = self._moves[pose], min(k + 1, len(residual) - 1)
            mean = move @ (mean + gain @ wrong)
            mean += self._before[pose] @ residual[k] + self._after[pose] @ residual[last]
            spread = move @ (spread - gain @ spread[:n]) @ move.T + noise[pose]
            spread = 0.5 * (spread + spread.T)
        return _Filtered(kept, likelihood)

    def _smoothed(self, filtered: _Filtered) -> Array:
        """Backward pass of the adjoint, then the torque of the modal part of the state, (N, n, D)."""
        response, kept = self.response, filtered.kept
        n, s = response.joints, response.modes
        adjoint = np.zeros_like(kept[-1][0])  # of the state after the measurement
        states = []
        for k in range(len(kept) - 1, -1, -1):
            mean, spread, gain, surprise = kept[k]
            adjoint[:n] -= surprise + gain.T @ adjoint
            states.append(mean - spread @ adjoint)
            adjoint = self._moves[response.pose[k - 1]].T @ adjoint
        whole = np.array(states[::-1])
        modal = np.concatenate([whole[:, n : n + s], whole[:, 2 * n + s : 2 * (n + s)]], axis=1)
        return response.torque(modal)


@dataclass(frozen=True)
class _Filtered:
    """Per sample predicted state and covariance, gain, innovation over its covariance; log-likelihood."""

    kept: list[tuple[Array, Array, Array, Array]]
    likelihood: float
