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

Further channels (`Sight`) are more measurements of the same state. Each has a gain and an offset of its own,
the offset a constant where that is enough, and otherwise a random walk, by one factor for all channels of a
kind. A channel whose gain comes out far from one, such as a gauge in other units, with another sign or on
another link, is not looked at. Where a load
bends the links otherwise than the robot's numbers say, a latent force on every mode, a random walk too, is
part of what moves the modes, so that a load that bends a link slowly makes no vibration. Every factor is
that of greatest likelihood, zero among them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.modal_response import ModalResponse
from missing_physics.diagnosis.modal_state import Sight, StateSpace

__all__ = ["Corrections", "Sight", "VibrationSmoother"]

Array = NDArray[np.float64]

#: What walks beside the offsets of further channels.
TORQUE, LOAD = "torque", "load"
#: Rates of the latent torque that are tried, as a part of the recorded torque's rms per second^(1/2).
WALKS = (0.0003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
#: The one that is tried first.
FIRST_WALK = 0.01
#: The same of forces on the modes, as a part of the rms of the elastic forces, from the first on.
LOADS = (0.0, *WALKS[:5])
#: The same of offsets, as a part of the channel's rms; the last leaves nothing of what the channel says.
DRIFTS = (0.0, 1e-5, 1e-4, 0.001, 0.01, 0.1, 1.0, 10.0, 100.0)
#: Standard deviation of the gains of sensors, as calibrated.
GAINS = 0.05
#: A gain is this far from one only where the channel is not what its name says.
FAR = 0.25
#: Samples at the start of a recording by whose likelihood these are chosen.
SEARCHED = 20000
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
        sight: further channels that see the correction.

    Attributes:
        torque: what the correction of the modal motion adds to the predicted torque, shape (N, n).
        walks: how fast each walks: `TORQUE` the latent torques, one of `WALKS`, `LOAD` the forces on the
            modes, one of `LOADS`, and every kind of further channels its offsets, one of `DRIFTS`.
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
        sight: Sight | None = None,
    ) -> None:
        self.response = response
        self.sight: Sight | None = None
        noise = np.maximum(position_noise, LEAST_NOISE * np.maximum(level[0], LEAST_NOISE)) ** 2
        self._noise = self._first_noise = noise
        self._torque_noise, self._size = torque_noise, np.maximum(level[1], 1e-12)
        self._rate_noise = np.maximum(rate_noise, np.sqrt(noise))
        self._there = np.ones(gap.shape, dtype=bool)
        self._data = residual[:, :, None], gap[:, :, None]
        self.walks = {TORQUE: FIRST_WALK, LOAD: 0.0}
        self._spaces: dict[bool, StateSpace] = {}
        self._found: dict[tuple[float, ...], float] = {}  # likelihoods by walks
        self._choose(TORQUE, WALKS)
        doubtful = np.zeros(len(noise), dtype=bool) if guessed is None else guessed
        if sight is not None:
            self._see(sight)
        if self.sight is not None:
            doubtful = np.concatenate([doubtful, self.sight.guessed])
        best = self._filter(*self._data)
        if doubtful.any():
            power = np.clip(np.nanmean(self._white(best) ** 2, axis=0), *CREDIBLE)
            self._noise = np.where(doubtful, power, 1.0) * self._noise
            best = self._filter(*self._data)
        self.torque = self._smoothed(best)[:, :, 0]

    def torque_of(self, residual: Array, gap: Array) -> Array:
        """The same for other data of the same noise, such as drawn noise alone, shape (N, n, D).

        Args:
            residual: shape (N, n, D).
            gap: of the encoders and the further channels, shape (N, n + p, D).
        """
        return self._smoothed(self._filter(residual, gap))

    def corrections(self, samples: NDArray[np.int_]) -> Corrections:
        """The corrections at `samples`, shape (K,), with their uncertainty, and every innovation."""
        filtered, space = self._filter(*self._data), self._space
        size = 2 * self.response.inertia.shape[1]
        wanted = {int(k): place for place, k in enumerate(samples)}
        means, spreads = np.zeros((len(samples), size)), np.zeros((len(samples), size, size))
        adjoint = np.zeros((len(filtered.kept[-1].mean), 1))
        weight = np.zeros((len(adjoint), len(adjoint)))  # covariance of the adjoint
        for k in range(len(filtered.kept) - 1, -1, -1):
            step, look = filtered.kept[k], space.looks[k]
            adjoint -= look.T @ (step.surprise + step.gain.T @ adjoint)
            weight -= look.T @ (step.gain.T @ weight)
            weight -= (weight @ step.gain) @ look
            weight += look.T @ step.seen @ look
            if k in wanted:
                place = wanted[k]
                means[place] = (step.mean[:size] - step.spread[:size] @ adjoint)[:, 0]
                spread = step.spread[:size]
                spreads[place] = spread[:, :size] - spread @ weight @ spread.T
            move = space.moves[self.response.pose[k - 1]]
            adjoint, weight = move.T @ adjoint, move.T @ weight @ move
        return Corrections(means, spreads, self._white(filtered))

    def _see(self, sight: Sight) -> None:
        """Take further channels in, and choose how their offsets and the forces on the modes walk."""
        blind = self._data, self._noise, self._there
        self._add(sight)
        first = self._filter(*self._data, search=True)
        self._found[tuple(self.walks.values())] = first.likelihood
        last = first.kept[-1]
        near = np.abs(last.mean[self._space.gains, 0]) < FAR
        if not near.all():
            self._data, self._noise, self._there = blind
            self.sight, self.walks = None, {TORQUE: self.walks[TORQUE], LOAD: 0.0}
            self._spaces.clear()
            self._found.clear()
            if not near.any():
                return
            self._add(sight.of(np.flatnonzero(near)))
        for kind in list(self.walks)[2:]:
            self._choose(kind, DRIFTS)
        if self.response.modes:
            self._choose(LOAD, LOADS)

    def _add(self, sight: Sight) -> None:
        self.sight = sight
        there = np.isfinite(sight.gap)
        self._there = np.hstack([self._there, there])
        floor = np.maximum(sight.noise, LEAST_NOISE * np.maximum(sight.level, LEAST_NOISE))
        self._noise = np.concatenate([self._noise, floor**2])
        residual, gap = self._data
        self._data = residual, np.concatenate([gap, np.where(there, sight.gap, 0.0)[:, :, None]], axis=1)
        self._spaces.clear()
        self._found.clear()
        self.walks |= dict.fromkeys(sight.kinds, 0.0)

    def _choose(self, what: str, values: Sequence[float]) -> None:
        """Set one of the walks to the value of greatest likelihood, uphill from where it is.

        One that need not be there is one number more, and must pay for it (Bayesian information criterion).
        """

        def likelihood(place: int) -> float:
            self.walks[what] = values[place]
            every = tuple(self.walks.values())
            if every not in self._found:
                self._found[every] = self._filter(*self._data, search=True).likelihood
            return self._found[every]

        place = values.index(self.walks[what])
        best = first = likelihood(place)
        for way in (1, -1):
            start = place
            while 0 <= place + way < len(values):
                trial = likelihood(place + way)
                if trial <= best:
                    break
                place, best = place + way, trial
            if place != start:
                break
        needless = values[0] == 0.0 and best - first < 0.5 * np.log(min(len(self._there), SEARCHED))
        self.walks[what] = 0.0 if needless else values[place]

    @property
    def _space(self) -> StateSpace:
        forces = self.walks[LOAD] > 0.0
        if forces not in self._spaces:
            self._spaces[forces] = StateSpace.of(self.response, len(self._there), self.sight, forces=forces)
        return self._spaces[forces]

    def _white(self, filtered: _Filtered) -> Array:
        """Innovations turned and scaled to unit covariance, of the first set of data, shape (N, m)."""
        # the inverse covariance S^-1 = C C^T, so that C^T e = C^-1 S^-1 e has unit covariance
        roots = np.linalg.cholesky(np.array([step.seen for step in filtered.kept]))
        surprise = np.array([step.surprise[:, :1] for step in filtered.kept])
        white = np.linalg.solve(roots, surprise)[:, :, 0]
        return np.where(self._there, white, np.nan)

    def _process(self) -> Array:
        """Covariance that one sample adds to the state at every pose, shape (P, L, L)."""
        n, first, space = self.response.joints, 2 * self.response.inertia.shape[1], self._space
        pushed = -space.after * self._torque_noise
        pushed[:, -n:] = np.diag(self._torque_noise)
        noise = pushed @ pushed.transpose(0, 2, 1)
        walks = np.zeros(noise.shape[1])
        walks[first : first + n] = self.walks[TORQUE] * self._size
        if self.sight is not None:
            walks[space.forces] = self.walks[LOAD] * self.sight.load[: len(walks[space.forces])]
            walks[space.offsets] = self.sight.level * [self.walks[kind] for kind in self.sight.kinds]
        return np.asarray(noise + np.diag(walks**2) * self.response.step)

    def _start(self) -> Array:
        """Covariance of the first state; links begin at rest, as their reconstructed motion does."""
        n, g = self.response.joints, self.response.inertia.shape[1]
        spread = np.zeros(self._space.moves.shape[1])
        spread[:n] = OPEN**2 * self._first_noise
        spread[g : g + n] = (OPEN * self._rate_noise) ** 2
        spread[2 * g : 2 * g + n] = (START * self._size) ** 2
        if self.sight is not None:
            spread[self._space.offsets] = self.sight.level**2  # any zero; no load at rest
            spread[self._space.gains] = GAINS**2
        spread[-n:] = self._torque_noise**2
        return np.diag(spread)

    def _filter(self, residual: Array, gap: Array, *, search: bool = False) -> _Filtered:
        """All samples; in a search the first of them, of which nothing is kept but the last."""
        response, space, noise = self.response, self._space, self._process()
        if space.through is not None:
            gap = gap - space.through @ residual
        spread = self._start()
        mean = np.zeros((len(spread), residual.shape[2]))
        measured, likelihood = np.diag(self._noise), 0.0
        kept: list[_Step] = []
        for k, pose in enumerate(response.pose[: SEARCHED if search else None]):
            look = space.looks[k]
            shown = look @ spread
            seen = np.asarray(np.linalg.inv(shown @ look.T + measured), dtype=float)
            wrong = gap[k] - look @ mean
            surprise = seen @ wrong
            likelihood -= 0.5 * float(wrong[:, 0] @ surprise[:, 0] - np.linalg.slogdet(seen)[1])
            gain = shown.T @ seen
            if search:
                kept.clear()
            kept.append(_Step(mean, spread[: space.forces.stop].copy(), gain, seen, surprise))
            move, last = space.moves[pose], min(k + 1, len(residual) - 1)
            mean = move @ (mean + gain @ wrong)
            mean += space.before[pose] @ residual[k] + space.after[pose] @ residual[last]
            spread = move @ (spread - gain @ shown) @ move.T + noise[pose]
            spread = 0.5 * (spread + spread.T)
        return _Filtered(kept, likelihood)

    def _smoothed(self, filtered: _Filtered) -> Array:
        """Backward pass of the adjoint, then the torque of the modal part of the state, (N, n, D)."""
        response, kept, space = self.response, filtered.kept, self._space
        n, s = response.joints, response.modes
        adjoint = np.zeros_like(kept[-1].mean)  # of the state after the measurement
        told, states = space.forces.stop, []
        for k in range(len(kept) - 1, -1, -1):
            step = kept[k]
            adjoint -= space.looks[k].T @ (step.surprise + step.gain.T @ adjoint)
            states.append(step.mean[:told] - step.spread @ adjoint)
            adjoint = space.moves[response.pose[k - 1]].T @ adjoint
        whole = np.array(states[::-1])
        modal = np.concatenate([whole[:, n : n + s], whole[:, 2 * n + s : 2 * (n + s)]], axis=1)
        return response.torque(modal, whole[:, space.forces] if self.walks[LOAD] > 0.0 else 0.0)


@dataclass(frozen=True)
class _Step:
    """What is kept of one sample.

    Attributes:
        mean: predicted state.
        spread: rows of its covariance: of joints and modes and the forces on both.
        gain, seen, surprise: gain, inverse covariance S^-1 of the innovation e, S^-1 e.
    """

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
