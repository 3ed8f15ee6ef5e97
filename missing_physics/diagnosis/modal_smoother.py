"""How flexible links really vibrated: corrections of their modal motion by what positions and torques say.

Modal coordinates that follow from the joints' smoothed motion alone collect its noise: a lightly damped mode
is driven at resonance by the noise of a joint's acceleration. How joints and modes really moved is what the
recorded torques make of them. With (dq, dx) what must be added to the smoothed joint motion and to the modal
motion that follows from it, base accelerations eliminated,

    [Zmm Zmx] [dq'']   [        0        ]   [r - d]
    [Zxm Zxx] [dx''] + [ C dx' + K dx    ] = [  0  ],      recorded - smoothed position = dq + v,

r the recorded torque minus what the nominal robot with its effects needs for the smoothed motion, v the
encoder's white noise and d a latent torque of each joint, a random walk that stands for whatever the model
leaves out; r holds the white noise of the torque, which acts between samples as the torque does and is part
of the state too. All the noise of the smoothed motion is in r as well, but there it is known and does no
harm. The fixed-interval smoother of Bryson and Frazier finds (dq, dx) and their covariance (Bierman,
Automatica 9 (1973) 503-511); the speed of the random walk is that of greatest likelihood, and noise of the
encoders that nobody stated is what makes the innovations as large as they should be. Only dx is used: d and
dq together hold what the regression is to explain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.modal_response import ModalResponse

__all__ = ["Corrections", "Sight", "VibrationSmoother"]

Array = NDArray[np.float64]

#: Rates of the latent torque that are tried, as a part of the recorded torque's rms per second^(1/2).
WALKS = (0.0003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
#: The one that is tried first.
FIRST_WALK = 0.01
#: Standard deviation of a first latent torque, as a multiple of that rms.
START = 0.1
#: First errors of the smoothed joint motion, as multiples of its noise: it was made of the same samples that
#: correct it, so that beside them it must say next to nothing.
OPEN = 10.0
#: Keeps covariances positive where a channel is said to be free of noise: part of the channel's rms.
LEAST_NOISE = 1e-6
#: Between which parts of its variance an estimated noise is put right by the innovations.
CREDIBLE = (0.25, 4.0)


@dataclass(frozen=True)
class Sight:
    """Further channels that see the correction beside the encoders.

    Attributes:
        rows: derivative of each channel by [dq; dx; dq'; dx'] at every pose, shape (P, p, 2 (n + s)).
        gap: recorded minus predicted without the correction, shape (N, p); NaN where nothing was recorded.
        noise: standard deviation per sample, shape (p,).
    """

    rows: Array
    gap: Array
    noise: Array


@dataclass(frozen=True)
class Corrections:
    """What the smoother says, with its uncertainty.

    Attributes:
        mean: [dq; dx; dq'; dx'] at the K samples asked for, shape (K, 2 (n + s)).
        covariance: of its errors, shape (K, 2 (n + s), 2 (n + s)).
        innovations: of every sample and channel, scaled and turned so that they should be white and of unit
            variance, shape (N, m); NaN where nothing was recorded.
    """

    mean: Array
    covariance: Array
    innovations: Array


class VibrationSmoother:
    """The smoother of one recording.

    Args:
        response: dynamics of the correction.
        residual: r of the module's equations, shape (N, n).
        gap: recorded minus smoothed position, shape (N, n).
        position_noise, torque_noise: standard deviations per sample, shape (n,).
        rate_noise: standard deviation of the smoothed velocity, shape (n,).
        level: rms of the recorded position and torque, shape (n,) each.
        guessed: whose position's noise was only estimated, shape (n,); the innovations put it right.

    Attributes:
        torque: what the correction of the modal motion adds to the predicted torque, shape (N, n).
        walk: speed of the latent torque, one of `WALKS`.
    """

    def __init__(
        self,
        response: ModalResponse,
        residual: Array,
        gap: Array,
        *,
        position_noise: Array,
        torque_noise: Array,
        rate_noise: Array,
        level: tuple[Array, Array],
        guessed: NDArray[np.bool_] | None = None,
    ) -> None:
        self.response = response
        self._noise = np.maximum(position_noise, LEAST_NOISE * np.maximum(level[0], LEAST_NOISE)) ** 2
        self._torque_noise, self._size = torque_noise, np.maximum(level[1], 1e-12)
        self._rate_noise = np.maximum(rate_noise, np.sqrt(self._noise))
        self._moves, self._before, self._after = _with_white_noise(*response.transitions())
        self._data = residual[:, :, None], gap[:, :, None]
        self.walk, best = self._likeliest(*self._data)
        if guessed is not None and guessed.any():
            power = np.clip(np.mean(_whitened(best) ** 2, axis=0), *CREDIBLE)
            self._noise = np.where(guessed, power, 1.0) * self._noise
            best = self._filter(self.walk, *self._data)
        self.torque = self._smoothed(best)[:, :, 0]

    def torque_of(self, residual: Array, gap: Array) -> Array:
        """The same for other data of the same noise, such as drawn noise alone, shape (N, n, D)."""
        return self._smoothed(self._filter(self.walk, residual, gap))

    def corrections(self, samples: NDArray[np.int_]) -> Corrections:
        """The corrections at `samples`, shape (K,), with their uncertainty, and every innovation."""
        filtered = self._filter(self.walk, *self._data)
        n, size = self.response.joints, 2 * self.response.inertia.shape[1]
        wanted = {int(k): place for place, k in enumerate(samples)}
        means, spreads = np.zeros((len(samples), size)), np.zeros((len(samples), size, size))
        adjoint = np.zeros((len(filtered.kept[-1].mean), 1))
        weight = np.zeros((len(adjoint), len(adjoint)))  # covariance of the adjoint
        for k in range(len(filtered.kept) - 1, -1, -1):
            step = filtered.kept[k]
            adjoint[:n] -= step.surprise + step.gain.T @ adjoint
            weight[:n] -= step.gain.T @ weight
            weight[:, :n] -= weight @ step.gain
            weight[:n, :n] += step.seen
            if k in wanted:
                place = wanted[k]
                means[place] = (step.mean - step.spread @ adjoint)[:size, 0]
                spreads[place] = (step.spread - step.spread @ weight @ step.spread)[:size, :size]
            move = self._moves[self.response.pose[k - 1]]
            adjoint, weight = move.T @ adjoint, move.T @ weight @ move
        return Corrections(means, spreads, _whitened(filtered))

    def _likeliest(self, residual: Array, gap: Array) -> tuple[float, _Filtered]:
        """The walk of greatest likelihood, uphill from the first, and what the filter finds with it."""
        place = WALKS.index(FIRST_WALK)
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
        n = self.response.joints
        pushed = -self._after * self._torque_noise
        pushed[:, -n:] = np.diag(self._torque_noise)
        noise = pushed @ pushed.transpose(0, 2, 1)
        latent = np.arange(-2 * n, -n)
        noise[:, latent, latent] += (walk * self._size) ** 2 * self.response.step
        return np.asarray(noise)

    def _start(self, size: int) -> Array:
        """Covariance of the first state; links begin at rest, as their reconstructed motion does."""
        n, g = self.response.joints, self.response.inertia.shape[1]
        spread = np.zeros(size)
        spread[:n] = OPEN**2 * self._noise
        spread[g : g + n] = (OPEN * self._rate_noise) ** 2
        spread[-2 * n : -n] = (START * self._size) ** 2
        spread[-n:] = self._torque_noise**2
        return np.diag(spread)

    def _filter(self, walk: float, residual: Array, gap: Array) -> _Filtered:
        response, noise = self.response, self._process(walk)
        n, size = response.joints, noise.shape[1]
        mean, spread = np.zeros((size, residual.shape[2])), self._start(size)
        measured, likelihood = np.diag(self._noise), 0.0
        kept: list[_Step] = []
        for k, pose in enumerate(response.pose):
            seen = np.asarray(np.linalg.inv(spread[:n, :n] + measured), dtype=float)
            wrong = gap[k] - mean[:n]
            surprise = seen @ wrong
            likelihood -= 0.5 * float(wrong[:, 0] @ surprise[:, 0] - np.linalg.slogdet(seen)[1])
            gain = spread[:, :n] @ seen
            kept.append(_Step(mean, spread, gain, seen, surprise))
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
        adjoint = np.zeros_like(kept[-1].mean)  # of the state after the measurement
        states = []
        for k in range(len(kept) - 1, -1, -1):
            step = kept[k]
            adjoint[:n] -= step.surprise + step.gain.T @ adjoint
            states.append(step.mean - step.spread @ adjoint)
            adjoint = self._moves[response.pose[k - 1]].T @ adjoint
        whole = np.array(states[::-1])
        modal = np.concatenate([whole[:, n : n + s], whole[:, 2 * n + s : 2 * (n + s)]], axis=1)
        return response.torque(modal)


def _with_white_noise(move: Array, before: Array, after: Array) -> tuple[Array, Array, Array]:
    """The white noise of the sample's torque as further states, shapes (P, L, L), (P, L, n), (P, L, n).

    It acts between samples as the torque does, so that it pushes before and after its own sample.
    """
    poses, size, n = before.shape
    none = np.zeros((poses, n, size + n))
    whole = np.concatenate([np.concatenate([move, -before], axis=2), none], axis=1)
    return (
        whole,
        np.concatenate([before, none[:, :, :n]], axis=1),
        np.concatenate([after, none[:, :, :n]], axis=1),
    )


def _whitened(filtered: _Filtered) -> Array:
    """Innovations turned and scaled to unit covariance, of the first set of data, shape (N, m)."""
    # the inverse covariance S^-1 = C C^T, so that C^T e = C^-1 S^-1 e has unit covariance
    roots = np.linalg.cholesky(np.array([step.seen for step in filtered.kept]))
    surprise = np.array([step.surprise[:, :1] for step in filtered.kept])
    return np.asarray(np.linalg.solve(roots, surprise)[:, :, 0])


@dataclass(frozen=True)
class _Step:
    """Predicted state and covariance, gain, inverse covariance S^-1 of the innovation e, S^-1 e."""

    mean: Array
    spread: Array
    gain: Array
    seen: Array
    surprise: Array


@dataclass(frozen=True)
class _Filtered:
    """Every sample's step, and the log-likelihood."""

    kept: list[_Step]
    likelihood: float
