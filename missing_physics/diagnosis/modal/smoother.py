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

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import DTypeLike, NDArray

from missing_physics.diagnosis.modal.filter import Data, Filtered, filtered, filtered_again, smoothed, spreads
from missing_physics.diagnosis.modal.response import ModalResponse
from missing_physics.diagnosis.modal.state import Sight, StateSpace

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
#: Samples at the start of a recording by whose likelihood these are chosen,
SEARCHED = 20000
#: so many of them per period of the fastest mode, where more of them than so many are left.
LOOKS, LEAST_LOOKS = 4.0, 5000
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
        unchanged: dynamics of the correction as the robot is described.
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
        self.response = self.unchanged = response
        self.sight: Sight | None = None
        noise = np.maximum(position_noise, LEAST_NOISE * np.maximum(level[0], LEAST_NOISE)) ** 2
        self._noise = self._first_noise = noise
        self._torque_noise, self._size = torque_noise, np.maximum(level[1], 1e-12)
        self._rate_noise = np.maximum(rate_noise, np.sqrt(noise))
        self._there = np.ones(gap.shape, dtype=bool)
        self._data = residual[:, :, None], gap[:, :, None]
        self.walks = {TORQUE: FIRST_WALK, LOAD: 0.0}
        self._spaces: dict[tuple[bool, bool], StateSpace] = {}
        self._found: dict[tuple[float, ...], float] = {}  # likelihoods by walks
        self._choose(TORQUE, WALKS)
        doubtful = np.zeros(len(noise), dtype=bool) if guessed is None else guessed
        if sight is not None:
            self._see(sight)
        if self.sight is not None:
            doubtful = np.concatenate([doubtful, self.sight.guessed])
        self._spaces.clear()
        best = self._filter(self._torques())
        if doubtful.any():
            power = np.clip(np.nanmean(self._white(best) ** 2, axis=0), *CREDIBLE)
            self._noise = np.where(doubtful, power, 1.0) * self._noise
            best = self._filter(self._torques())
        self.torque = smoothed(self._space(), best)[:, :, 0]
        self._best: Filtered | None = best

    def torque_of(self, residual: Array, gap: Array) -> Array:
        """The same for other data of the same noise, such as drawn noise alone, shape (N, n, D).

        Args:
            residual: shape (N, n, D).
            gap: of the encoders and the further channels, shape (N, n + p, D).
        """
        space, asked = self._space(), self._torques()
        again = filtered_again(space, _data(space, residual, gap), self._settled(), asked)
        return smoothed(space, again)

    def otherwise(
        self,
        torques: Array | float,
        gaps: Array | float,
        *,
        walks: Mapping[str, float] | None = None,
        response: ModalResponse | None = None,
        like: VibrationSmoother | None = None,
    ) -> Self:
        """The same smoother of data less torques (N, n) and gaps (N, n + p), with these walks and dynamics.

        Where `like` has the same walks and dynamics, its gains are taken. `torque` is that of the first data.
        """
        other = copy(self)
        other.response = response or self.response
        residual, gap = self._data
        torques, gaps = (np.asarray(part, dtype=float)[..., None] for part in (torques, gaps))
        other._data = residual - torques, gap - gaps
        other.walks = dict(self.walks if walks is None else walks)
        other._spaces, other._found, other._best = {}, {}, None
        if like is not None and like.walks == other.walks and like.response is other.response:
            other._spaces, space = like._spaces, like._space()
            other._best = filtered_again(space, _data(space, *other._data), like._settled(), like._torques())
        return other

    def chosen(self) -> Self:
        """The same with all walks of greatest likelihood."""
        other = self.otherwise(0.0, 0.0)
        other._choose(TORQUE, WALKS)
        for kind in list(other.walks)[2:]:
            other._choose(kind, DRIFTS)
        if other.sight is not None and other.response.modes:
            other._choose(LOAD, LOADS)
        return other

    @property
    def data(self) -> tuple[Array, Array]:
        """Torques (N, n, 1) and gaps of encoders and further channels (N, n + p, 1) that it smooths."""
        return self._data

    @property
    def channels(self) -> int:
        """Number of encoders and further channels."""
        return len(self._noise)

    def likelihood(self) -> Array:
        """Logarithm of the likelihood of every sample, shape (N,)."""
        found = self._settled()
        scales = np.diagonal(found.roots, axis1=1, axis2=2)
        return np.asarray(np.log(scales).sum(axis=1) - 0.5 * (self.white**2).sum(axis=1), dtype=float)

    def whitened(self, residual: Array, gap: Array) -> Array:
        """Innovations of other data, (N, n, D) and (N, n + p, D), made white, shape (N, n + p, D)."""
        space = self._space()
        again = filtered_again(space, _data(space, residual, gap), self._settled(), self._torques())
        return np.where(self._there[:, :, None], again.white[:, ::-1], 0.0)

    @property
    def white(self) -> Array:
        """The same of its own data, shape (N, n + p)."""
        return np.nan_to_num(self._white(self._settled()))

    def _settled(self) -> Filtered:
        """All samples of its own data."""
        if self._best is None:
            self._best = self._filter(self._torques())
        return self._best

    def corrections(self, samples: NDArray[np.int_]) -> Corrections:
        """The corrections at `samples`, shape (K,), with their uncertainty, and every innovation."""
        space, size = self._space(), 2 * self.response.inertia.shape[1]
        asked = np.broadcast_to(
            np.eye(size, space.moves.shape[1]), (len(space.moves), size, space.moves.shape[1])
        )
        found = self._filter(asked, kept=np.float64)
        covariance = spreads(space, found, samples, asked)
        return Corrections(smoothed(space, found)[samples, :, 0], covariance, self._white(found))

    def _see(self, sight: Sight) -> None:
        """Take further channels in, and choose how their offsets and the forces on the modes walk."""
        blind = self._data, self._noise, self._there
        self._add(sight)
        first = self._filter()
        self._found[tuple(self.walks.values())] = first.likelihood
        near = np.abs(first.last[self._space(search=True).gains, 0]) < FAR
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
                self._found[every] = self._filter().likelihood
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
        needless = values[0] == 0.0 and best - first < 0.5 * np.log(len(self._searched))
        self.walks[what] = 0.0 if needless else values[place]

    @property
    def _searched(self) -> NDArray[np.int_]:
        """Samples by whose likelihood walks are chosen."""
        span = min(len(self._there), SEARCHED)
        highest = self.response.highest_frequency * self.response.step
        most = span // LEAST_LOOKS if self._there.all() else 1  # a slower clock's samples might all be missed
        return np.arange(0, span, max(1, min(most, int(1.0 / (LOOKS * highest)) if highest > 0.0 else 1)))

    def _space(self, *, search: bool = False) -> StateSpace:
        """The system at all samples, or at those of a search."""
        forces = self.walks[LOAD] > 0.0
        if (forces, search) not in self._spaces:
            rows = self._searched if search else np.arange(len(self._there))
            self._spaces[forces, search] = StateSpace.of(self.response, rows, self.sight, forces=forces)
        return self._spaces[forces, search]

    def _torques(self) -> Array:
        """The torque of the modal part of the moving rows, at every pose, shape (P, n, d)."""
        space, response = self._space(), self.response
        n, s, g = response.joints, response.modes, response.inertia.shape[1]
        pull = np.zeros((s, space.moves.shape[1]))
        pull[:, n:g], pull[:, g + n : 2 * g] = response.stiffness, response.damping
        if self.walks[LOAD] > 0.0:
            pull[:, space.forces] = np.eye(s)
        return np.asarray(-response.coupling @ pull)

    def _white(self, found: Filtered) -> Array:
        """Innovations turned and scaled to unit covariance, of the first set of data, shape (N, m)."""
        return np.where(self._there, found.white[:, ::-1, 0], np.nan)

    def _filter(self, asked: Array | None = None, *, kept: DTypeLike = np.float32) -> Filtered:
        """All samples, of which `asked` is told; those of a search, of which nothing is kept, without."""
        space = self._space(search=asked is None)
        added, drift = self._process(space)
        return filtered(
            space,
            _data(space, *self._data),
            start=self._start(space),
            added=space.spread(added),
            drift=space.every * drift,
            noise=self._noise[::-1],
            asked=asked,
            kept=kept,
        )

    def _process(self, space: StateSpace) -> tuple[Array, Array]:
        """Covariance that a sample adds to the moving rows at every pose, (P, d, d); variances of others."""
        n, first = self.response.joints, 2 * self.response.inertia.shape[1]
        pushed = -space.after * self._torque_noise
        pushed[:, space.torques] = np.diag(self._torque_noise)
        walks, drift = np.zeros(space.moves.shape[1]), np.zeros(space.gains.stop - space.offsets.start)
        walks[first : first + n] = self.walks[TORQUE] * self._size
        if self.sight is not None:
            forces = space.forces.stop - space.forces.start
            walks[space.forces] = self.walks[LOAD] * self.sight.load[:forces]
            kinds = self.sight.kinds
            drift[: len(kinds)] = self.sight.level * [self.walks[kind] for kind in kinds]
        added = pushed @ pushed.transpose(0, 2, 1) + np.diag(walks**2) * self.response.step
        return added, drift**2 * self.response.step

    def _start(self, space: StateSpace) -> Array:
        """Variances of the first state; links begin at rest, as their reconstructed motion does."""
        n, g = self.response.joints, self.response.inertia.shape[1]
        spread = np.zeros(space.gains.stop)
        spread[:n] = OPEN**2 * self._first_noise
        spread[g : g + n] = (OPEN * self._rate_noise) ** 2
        spread[2 * g : 2 * g + n] = (START * self._size) ** 2
        spread[space.torques] = self._torque_noise**2
        if self.sight is not None:
            spread[space.offsets] = self.sight.level**2  # any zero; no load at rest
            spread[space.gains] = GAINS**2
        return spread


def _data(space: StateSpace, residual: Array, gap: Array) -> Data:
    return Data(space.pushed(residual), space.seen(residual, gap))
