"""Fits of the true hypothesis to drawn arms, by the code and the starting values of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.yardstick.likelihood.arms import Arm, arm_of
from benchmarks.yardstick.likelihood.measures import Octave, held_out_deviates, held_out_ratios
from benchmarks.yardstick.likelihood.recorded import fitted_octaves, torque_data
from missing_physics.answer.findings import QUANTILE, answer_of
from missing_physics.hypotheses import TIMING, Candidate, Hypothesis
from missing_physics.inference import Fit, Posterior, fitted
from missing_physics.inference.data import Data
from missing_physics.inference.fit import residuals
from missing_physics.inference.score import independent_shares
from missing_physics.inference.screening import Screen
from missing_physics.inference.search import standard_search
from missing_physics.inference.torques.data import TorqueData

__all__ = ["DRIFT", "FitMeasures", "Interval", "drifting_fit_of", "fit_of"]

#: Time constant of the drift in `drifting_fit_of` [s]: longer than a block of these arms, which is 0.75 s, as
#: the correlation of the residual is at half of the real joints.
DRIFT = 1.0


@dataclass(frozen=True)
class Interval:
    """An estimated parameter and its true value.

    Attributes:
        name: of the parameter, without the joint.
        truth, low, high: true value and 95 % interval.
        error: estimate minus truth, in standard deviations.
    """

    name: str
    truth: float
    low: float
    high: float
    error: float

    @property
    def contains(self) -> bool:
        """Whether the truth is in the interval."""
        return self.low <= self.truth <= self.high


@dataclass(frozen=True)
class FitMeasures:
    """One fit of the true hypothesis.

    Attributes:
        number: of the arm.
        effect: of the arm, "" for none.
        of_effect, of_standard: intervals of the effect's parameters; of friction, offsets and the delay.
        octaves: of the residual of each joint in fitted rows.
        shares: independent samples per row of each joint.
        white: independent samples per row of white noise in the band.
        chi_square, foreseen: of held-out rows of each joint, see `JointMeasures`.
        over_noise: rms residual relative to the noise in the band, of each joint.
        deviates: of the held-out blocks of all joints.
        quiet: whether the noise in the band is below the error of any model at the effect's joint.
        refused: reason for which the fit counts as impossible; "" else.
    """

    number: int
    effect: str
    of_effect: tuple[Interval, ...]
    of_standard: tuple[Interval, ...]
    octaves: tuple[tuple[Octave, ...], ...]
    shares: tuple[float, ...]
    white: float
    chi_square: tuple[float, ...]
    foreseen: tuple[float, ...]
    over_noise: tuple[float, ...]
    deviates: tuple[float, ...]
    quiet: bool
    refused: str


def fit_of(number: int) -> FitMeasures:
    """Fit the true hypothesis to the arm of a number."""
    return _measured(arm_of(number))


def drifting_fit_of(number: int) -> FitMeasures:
    """The same with torques that drift, which the likelihood does not expect."""
    return _measured(arm_of(number, drift=DRIFT))


@threadpool_limits.wrap(limits=1, user_api="blas")
def _measured(arm: Arm) -> FitMeasures:
    state = standard_search(torque_data(arm.robot, [arm.fit], [arm.held_out]))
    start = state.standard
    data = state.about(start)
    hypothesis = Hypothesis().taking_from_file(*data.delays)
    if arm.effect:
        hypothesis = _candidate(arm, data, start).added_to(hypothesis)
    fit = state.settled(fitted(data, hypothesis, start))
    data = state.about(fit)
    shares = independent_shares(data, fit)
    chi_square, foreseen = held_out_ratios(data, fit)
    k = data.joints.index(arm.at)
    return FitMeasures(
        arm.number,
        arm.effect,
        tuple(_of_effect(arm, data, fit)),
        tuple(_of_standard(arm, data, fit)),
        tuple(tuple(fitted_octaves(data, fit, j)) for j in range(len(data.joints))),
        tuple(map(float, shares)),
        data.independent,
        tuple(map(float, chi_square)),
        tuple(map(float, foreseen)),
        tuple(map(float, fit.sigma / data.noise)),
        tuple(float(one) for own in held_out_deviates(data, fit, shares) for one in own),
        bool(data.noise[k] < data.error[k]),
        "; ".join(fit.impossible.values()),
    )


def _candidate(arm: Arm, data: TorqueData, start: Fit) -> Candidate:
    """The true effect at its joint, with the starting values that a search would choose."""
    shares = independent_shares(data, start)
    residual = [
        np.where(data.fitted_rows(i)[:, None], residuals(data, start, i), 0.0) for i in range(data.fitted)
    ]
    every = data.candidates(start.hypothesis, start.parameters, residual)
    own = [one for one in every if one.term.key == (arm.effect, arm.at)]
    if own[0].term.effect.is_event:
        own = [one for one in own if one.term.run == 0]
    return Screen(data, start, shares).best(own)[0].candidate


def _of_effect(arm: Arm, data: TorqueData, fit: Fit) -> list[Interval]:
    """Intervals that the diagnosis states for the parameters of the effect."""
    if not arm.effect:
        return []
    answer = answer_of(data, Posterior((fit,), np.ones(1)), fit)
    stated = [one for one in answer.findings if (one.effect, one.location) == (arm.effect, arm.at)]
    found = []
    for name, estimate in stated[0].parameters.items():
        deviation = fit.deviation(f"{arm.effect}@{arm.at}.{name}")
        error = (estimate.value - arm.truth[name]) / max(deviation, 1e-300)
        found.append(Interval(name, arm.truth[name], *estimate.ci95, error))
    return found


def _of_standard(arm: Arm, data: Data, fit: Fit) -> list[Interval]:
    """Intervals of friction, offsets and the delay as a diagnosis would state them."""
    found = []
    for name, truth in {**arm.friction, TIMING: arm.delay}.items():
        place = fit.layout.names.index(name)
        if not fit.layout.free[place]:
            continue
        value, deviation = fit.parameter(name), float(fit.deviations[place])
        low, high = value - QUANTILE * deviation, value + QUANTILE * deviation
        if place in data.layout.positive:
            low = max(low, 0.0)
        found.append(Interval(name.rpartition(".")[2], truth, low, high, (value - truth) / deviation))
    return found
