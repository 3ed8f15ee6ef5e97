"""Changes of base and flexible links fitted to all channels of recordings at once, by their likelihood.

Nothing that acts at a joint moves base or links otherwise than the recorded joints tell. The filter of
`modal/smoother.py`, in which a random walk stands for whatever acts at the joints, therefore tells how likely
recorded torques and further channels are with a change of base and links: with what it adds taken from the
data, and with the modes answering as it makes them answer, innovations are white and of unit variance where
nothing else is missing. Numbers are those of greatest likelihood, by Gauss-Newton steps on the innovations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.modal.response import ModalResponse
from missing_physics.diagnosis.modal.smoother import VibrationSmoother
from missing_physics.diagnosis.statistics.blocks import blocks
from missing_physics.diagnosis.statistics.correlated_errors import BlockedRegression
from missing_physics.diagnosis.terms.term import Term

__all__ = ["PassiveFit", "added", "at_joints", "blind", "fit_passive", "masses", "seen", "smoother_of"]

Array = NDArray[np.float64]

#: Levenberg-Marquardt steps; their dampings (parts of the largest singular value's square), in the order in
#: which they are tried; what one has to keep of the gain that it promises, else the next is tried; and the
#: least singular value, as a part of the largest.
MOST_STEPS, DAMPINGS, KEPT, LEAST_SIZE = 30, (0.0, 1e-4, 1e-3, 1e-2, 0.1, 1.0), 0.25, 1e-8
#: A step that gains less than this of the logarithm of the likelihood is the last.
CONVERGED = 0.05
#: Fewest samples per period of the fastest mode: between samples torques are taken for linear. With three a
#: simulated link's damping of 0.03 came out as 0.053 +- 0.009.
SAMPLES_PER_PERIOD = 4.0
#: Step of a difference by a number on which the modes' answer depends, part of its value or typical size.
STEP = 1e-3


@dataclass(frozen=True)
class PassiveFit:
    """Terms fitted to some recordings.

    Attributes:
        segments: the recordings, each with a smoother of vibration.
        walks: of each.
        terms: with fitted values.
        like: smoothers of the same walks, whose gains will do where the modes answer alike.
    """

    segments: tuple[Segment, ...]
    walks: tuple[dict[str, float], ...]
    terms: tuple[Term, ...]
    like: tuple[VibrationSmoother | None, ...] = ()

    @cached_property
    def smoothers(self) -> tuple[VibrationSmoother, ...]:
        """Of the data less what the terms add."""
        like = self.like or (None,) * len(self.segments)
        each = zip(self.segments, self.walks, like)
        return tuple(_without(segment, self.terms, walks, like=known) for segment, walks, known in each)

    @cached_property
    def likelihoods(self) -> Array:
        """Logarithm of the likelihood of each sample of all recordings, shape (N,)."""
        return np.concatenate([smoother.likelihood() for smoother in self.smoothers])

    @property
    def likelihood(self) -> float:
        """Logarithm of the likelihood of all data."""
        return float(self.likelihoods.sum())

    @property
    def size(self) -> int:
        """Number of estimated parameters."""
        return sum(len(term.free) for term in self.terms)

    @property
    def blocks(self) -> NDArray[np.int_]:
        """Block of time of each sample."""
        return blocks([segment.motion.time for segment in self.segments])

    @property
    def rows(self) -> NDArray[np.int_]:
        """The same of each innovation, shape (R',)."""
        lengths = [segment.motion.time.size for segment in self.segments]
        return np.repeat(self.blocks, np.repeat([s.channels for s in self.smoothers], lengths))

    @cached_property
    def columns(self) -> Array:
        """Minus the derivatives of the innovations by the free numbers, shape (R', K)."""
        parts = []
        for segment, smoother, walks in zip(self.segments, self.smoothers, self.walks):
            own = [_derivatives(segment, smoother, self.terms, term, walks) for term in self.terms]
            parts.append(np.concatenate(own, axis=2))
        return np.concatenate([part.reshape(-1, part.shape[2]) for part in parts])

    @cached_property
    def errors(self) -> Array:
        """Innovations, shape (R',)."""
        return np.concatenate([smoother.white.ravel() for smoother in self.smoothers])

    @cached_property
    def regression(self) -> BlockedRegression:
        """Linearised at the fit."""
        values = np.concatenate([term.values for term in self.terms])
        target = self.errors + self.columns @ values
        return BlockedRegression.of(self.columns, target, self.rows, prior=np.zeros(values.size))

    def at(self, terms: Sequence[Term]) -> PassiveFit:
        """The same recordings with other terms."""
        return PassiveFit(self.segments, self.walks, tuple(terms), self.smoothers)

    def rewalked(self) -> PassiveFit:
        """The same terms, every walk at its greatest likelihood."""
        return self.walking(tuple(dict(smoother.chosen().walks) for smoother in self.smoothers))

    def walking(self, walks: Sequence[dict[str, float]]) -> PassiveFit:
        """The same terms with other walks."""
        return PassiveFit(self.segments, tuple(walks), self.terms)


def fit_passive(start: PassiveFit) -> PassiveFit:
    """The numbers of the terms of greatest likelihood, from their values in `start`."""
    current = start
    for _ in range(MOST_STEPS if start.size else 0):
        columns, errors = current.columns, current.errors
        scale = np.linalg.norm(columns, axis=0)
        scale[scale == 0] = 1.0
        left, sizes, right = np.linalg.svd(columns / scale, full_matrices=False)
        sizes, along = np.maximum(sizes, LEAST_SIZE * sizes[0]), left.T @ errors
        best = current
        for damping in DAMPINGS:
            weights = sizes / (sizes**2 + damping * sizes[0] ** 2)
            step = right.T @ (weights * along)
            promised = 0.5 * float(errors @ errors - np.sum((errors - columns / scale @ step) ** 2))
            trial = _moved(current, step / scale)
            best = max(best, trial, key=lambda fit: fit.likelihood)
            if trial.likelihood - current.likelihood > KEPT * promised:
                break
        gained, current = best.likelihood - current.likelihood, best
        if gained < CONVERGED:
            break
    return current


def _moved(current: PassiveFit, change: Array) -> PassiveFit:
    terms, first = [], 0
    for term in current.terms:
        last = first + len(term.free)
        terms.append(term.at_values(term.values + change[first:last]))
        first = last
    return current.at(terms)


def added(segment: Segment, terms: Sequence[Term]) -> Array:
    """What terms add to the predictions along a recording, shape (N, m)."""
    parts = [segment.passive.shown(replace(term, frozen=True))[0][:, :, 0] for term in terms]
    return np.asarray(np.sum(parts, axis=0))


def smoother_of(segment: Segment) -> VibrationSmoother | None:
    """The smoother of vibration where more than encoders sees it, often enough for every mode."""
    return None if blind(segment) else segment.vibration


def blind(segment: Segment) -> str:
    """What a recording of a robot with links that bend lacks for that; empty where nothing."""
    smoother = segment.vibration
    if smoother is None:
        return "torque and position of every joint"
    if smoother.sight is None:
        beside = (
            ", tip sensors or sensors of the base" if segment.robot.base.kind == "free" else " or tip sensors"
        )
        return f"strain gauges{beside}"
    fewest = SAMPLES_PER_PERIOD * smoother.unchanged.highest_frequency
    return (
        "" if segment.motion.low_pass.rate >= fewest else f"at least {np.ceil(fewest):.0f} samples per second"
    )


def seen(segment: Segment, term: Term) -> tuple[Array, Array]:
    """A term and its derivatives as torques (N, n, 1 + k) and gaps (N, n + p, 1 + k) of the smoother.

    Where encoders see it alone, p is zero.
    """
    return _for_smoother(segment, *segment.passive.shown(term, _channels(segment)))


def masses(segment: Segment, directions: Array) -> tuple[Array, Array]:
    """The same of combinations (P, B) of inertial numbers, (N, ..., B)."""
    return _for_smoother(segment, *segment.passive.of_masses(directions, _channels(segment)))


def at_joints(segment: Segment) -> tuple[Array, Array]:
    """The same of a spring, viscous and dry friction at each joint, (N, ..., 3 n)."""
    motion, n = segment.motion, len(segment.joints)
    slow = np.array([place.transition for place in segment.places])
    kinds = motion.position, motion.velocity, np.tanh(motion.velocity / slow)
    torques = np.zeros((motion.time.size, n, 3 * n))
    for k, column in enumerate(np.hstack(kinds).T):
        torques[:, k % n, k] = column
    channels = np.zeros((motion.time.size, len(_channels(segment)), 3 * n))
    return _for_smoother(segment, torques, channels)


def _vibration(segment: Segment) -> VibrationSmoother:
    assert segment.vibration is not None
    return segment.vibration


def _channels(segment: Segment) -> tuple[str, ...]:
    sight = _vibration(segment).sight
    return () if sight is None else sight.channels


def _for_smoother(segment: Segment, outputs: Array, channels: Array) -> tuple[Array, Array]:
    sight = _vibration(segment).sight
    torques = outputs[:, : len(segment.joints)]
    if sight is not None:
        channels = np.where(np.isfinite(sight.gap)[:, :, None], channels, 0.0)
    return torques, np.concatenate([np.zeros_like(torques), channels], axis=1)


def _without(
    segment: Segment,
    terms: Sequence[Term],
    walks: dict[str, float],
    response: ModalResponse | None = None,
    like: VibrationSmoother | None = None,
) -> VibrationSmoother:
    smoother = _vibration(segment)
    count = len(segment.motion.time)
    torques = np.zeros((count, smoother.response.joints))
    gaps = np.zeros((count, smoother.channels))
    for term in terms:
        own, others = seen(segment, replace(term, frozen=True))
        torques, gaps = torques + own[:, :, 0], gaps + others[:, :, 0]
    answer = response or _response(segment, smoother.response, terms)
    return smoother.otherwise(torques, gaps, walks=walks, response=answer, like=like)


def _response(segment: Segment, described: ModalResponse, terms: Sequence[Term]) -> ModalResponse:
    """How the modes answer with the terms."""
    for term in terms:
        change = segment.passive.change(*term.key)
        assert change is not None
        described = change.answering(described, term.parameters)
    return described


def _derivatives(
    segment: Segment,
    smoother: VibrationSmoother,
    terms: Sequence[Term],
    term: Term,
    walks: dict[str, float],
) -> Array:
    """Minus the derivatives of the innovations by the numbers of `term`, shape (N, m, k)."""
    torques, gaps = seen(segment, term)
    columns = smoother.whitened(torques[:, :, 1:], gaps[:, :, 1:])
    for k, parameter in enumerate(term.estimated):
        value = term.parameters[parameter.name]
        step = STEP * max(abs(value), parameter.typical)
        other = replace(term, parameters={**term.parameters, parameter.name: value + step})
        answer = _response(segment, smoother.unchanged, [other if t.key == term.key else t for t in terms])
        if not np.array_equal(answer.damping, smoother.response.damping):
            moved = _without(segment, terms, walks, response=answer)
            columns[:, :, k] -= (moved.white - smoother.white) / step
    return columns
